"""Pages are looked at where there is a browser; `make browser` asks for one."""

from tests.pictures.browser import THERE

collect_ignore = [] if THERE else ["test_browser.py"]
