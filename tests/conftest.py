"""Settings for every test: hypothesis gives the same examples on every machine and has no clock."""

import faulthandler
import gc
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from itertools import product
from multiprocessing import get_context
from types import SimpleNamespace

import pytest
from hypothesis import settings

from gtb_cli.importers import cad_files
from tests.shell import unseen

gc.set_threshold(100_000)  # as every process of gtb: to look for cycles while tests are collected takes a second
os.fsync = int  # to wait for the disk takes seconds, and what tests write need not outlive the machine
signal.signal(signal.SIGINT, signal.default_int_handler)  # where it is ignored, processes that are started ignore it

settings.register_profile("gtb", deadline=None, derandomize=True, max_examples=30)
settings.register_profile("quick", settings.get_profile("gtb"), max_examples=12)


def pytest_configure(config: pytest.Config) -> None:
    """Try fewer examples where `make test` leaves out what is long."""
    settings.load_profile("quick" if config.option.markexpr == "not long" else "gtb")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run the longest tests first: at the end, all workers but one would wait for them."""
    items.sort(key=lambda item: item.path.stem not in ("test_guide", "test_study", "test_cluster", "test_cad_files"))


def pytest_collection_finish() -> None:
    gc.freeze()  # what was collected stays: searches for cycles, five of them at the end, pass it by


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say how many tests of pages did not run."""
    skipped = [(report.nodeid, str(report.longrepr)) for report in terminalreporter.stats.get("skipped", ())]
    if without := sum("test_browser" in name or "needs node" in why for name, why in skipped):
        terminalreporter.write_line(f"{without} tests of pages did not run: they need a browser (make browser) or node")


@pytest.fixture(autouse=True)
def _failures_are_looked_at() -> Iterator[None]:
    """Fail a test in which a command failed and nobody asked for its status."""
    yield
    left, unseen[:] = unseen[:], []
    assert left == [], "these commands failed, and the test did not look at their status"


@pytest.fixture
def probed_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """CAD files are read by a fork first, which has the kernel; where that fails, by a process that loads it, too."""

    def run(words: list[str], **options: bool) -> object:
        probe = partial(cad_files.probe, *words[-2:])
        fork = get_context("fork").Process(target=lambda: (faulthandler.disable(), sys.exit(probe())))
        fork.start()
        fork.join()
        return subprocess.run(words, **options) if fork.exitcode else SimpleNamespace(returncode=0)

    monkeypatch.setattr(cad_files, "subprocess", SimpleNamespace(run=run))


@pytest.fixture
def measured_roughly(monkeypatch: pytest.MonkeyPatch) -> None:
    """Commands make their sequences with rough distances, whose accuracy is tested elsewhere."""
    from gtb_cli.plots import panels
    from gtb_cli.sequences import sequence

    rough = sequence.Accuracy(chord_error=0.02, cells=16, points_in_all=100)
    for name, room in product(("degeneration", "knot_sequence"), (sequence, panels)):
        monkeypatch.setattr(room, name, partial(getattr(room, name), accuracy=rough))
