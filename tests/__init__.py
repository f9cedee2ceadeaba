"""The tests: folders and modules are those of `gtb_cli`; the modules beside this one hold what they share."""

import os

from gtb_cli.__main__ import THREADS

# As every process of gtb, before numpy is loaded: two threads, which wait for each other, take several times as long.
os.environ.update(dict.fromkeys(THREADS, "1"))
