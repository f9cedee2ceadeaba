"""`gtb mesh --cluster`: a scheduler and workers that the test starts, one of which it kills."""

import signal
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path

import pytest

from gtb_cli.errors import GtbError
from gtb_cli.process.cluster import _check_workers
from gtb_cli.process.versions import versions
from tests.marks import long
from tests.shell import CURVE, PENTAGON, command, environment, gtb, process, until

SPECS = 10
SECONDS = 90  # within which a process that was started does what is waited for, on a busy machine


def test_dask_is_an_extra(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "distributed", None)
    result = gtb("mesh", PENTAGON, "-o", tmp_path / "x.obj", "--cluster", "127.0.0.1:8786", status=2)
    assert "pip install distributed" in result.err
    assert not list(tmp_path.iterdir())


class Workers:
    """A client of Dask whose one worker answers from a table what it is asked."""

    def __init__(self, **answers: object) -> None:
        self.threads, self.answer = answers.pop("OPENBLAS_NUM_THREADS", "1"), answers.pop("answer", None)
        self.versions = versions() | answers

    def ncores(self) -> dict[str, int]:
        return {"tcp://there": 1}

    def run(self, function: object, *arguments: str, **options: object) -> dict[str, object]:
        return {"tcp://there": self.threads if arguments else self.answer or self.versions}


def refused(message: str) -> None:
    raise AssertionError(message)


@pytest.mark.parametrize(
    ("name", "answer", "words"),
    [
        *(
            (package, "0.1", f"tcp://there has {package} 0.1, and this process has ")
            for package in ("gtb", "sources", "numpy", "scipy", "trimesh")
        ),
        ("scipy", None, "tcp://there has no scipy, and this process has "),
        ("answer", OSError("gone"), "tcp://there does not answer: gone"),
        ("OPENBLAS_NUM_THREADS", None, "tcp://there was started without OPENBLAS_NUM_THREADS=1"),
        ("OPENBLAS_NUM_THREADS", "2", "tcp://there was started without OPENBLAS_NUM_THREADS=1"),
    ],
)
def test_workers_that_would_make_other_bytes_are_refused(name, answer, words):
    _check_workers(Workers(), "here", refused)
    with pytest.raises(GtbError, match=f"--cluster here: {words}"):
        _check_workers(Workers(**{name: answer}), "here", refused)


@pytest.mark.parametrize("name", ["python", "system", "processor"])
def test_workers_that_may_round_differently_are_named(name):
    said = []
    _check_workers(Workers(**{name: "z80"}), "here", said.append)
    ours = f"{name} z80, and this process has {versions()[name]}"
    assert said == [f"--cluster here: tcp://there has {ours}: last digits of their files may differ"]


@pytest.mark.parametrize("joins", [True, False])
def test_where_no_worker_joins_a_line_says_so(joins):
    class Empty(Workers):
        def ncores(self) -> dict[str, int]:
            return {}

        def wait_for_workers(self, count: int, timeout: float) -> None:
            if not joins:
                raise TimeoutError

    said = []
    with nullcontext() if joins else pytest.raises(GtbError, match="here: no workers within 60 seconds"):
        _check_workers(Empty(), "here", said.append)
    assert said == ["--cluster here: no workers yet; waiting for one up to 60 seconds"]


class Cluster:
    """Processes of Dask in a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.file, self.processes = folder, folder / "scheduler.json", []
        self.start("scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(self.file))
        until(self.file.exists)

    def start(self, kind: str, *options: str, **variables: str) -> subprocess.Popen:
        code = f"import sys; from distributed.cli.dask_{kind} import main; sys.exit(main())"
        with (self.folder / f"{len(self.processes)}.log").open("wb") as log:
            started = subprocess.Popen(
                [sys.executable, "-c", code, "--no-dashboard", *options],
                env=environment(**{"OPENBLAS_NUM_THREADS": "1", **variables}),
                stdout=log,
                stderr=log,
            )
        self.processes.append(started)
        return started

    def worker(self, **variables: str) -> subprocess.Popen:
        number = len(self.processes)
        options = f"--scheduler-file {self.file} --no-nanny --nthreads 1 --memory-limit 0"
        started = self.start("worker", *options.split(), **variables)
        until(lambda: b"Registered to" in (self.folder / f"{number}.log").read_bytes())
        return started


@pytest.fixture
def cluster(tmp_path):
    folder = tmp_path / "cluster"
    folder.mkdir()
    started = Cluster(folder)
    yield started
    for running in started.processes:
        running.kill()
        running.wait()


@pytest.fixture
def specs(tmp_path):
    folder = tmp_path / "specs"
    folder.mkdir()
    for number in range(SPECS):
        (folder / f"spec{number}.toml").write_bytes(Path(PENTAGON).read_bytes())
    (folder / "curve.toml").write_bytes(Path(CURVE).read_bytes())
    (folder / "broken.toml").write_text("knots = 1\n")
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@long
def test_the_work_of_a_worker_that_dies_is_done_by_another_and_so_is_one_mesh(cluster, specs, tmp_path):
    mesh = ["mesh", specs, "-n", 150, "-q", "--resume"]
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    there.mkdir()
    expected = process(*mesh, "-o", here / "out", "--manifest", here / "manifest.json")
    workers = [cluster.worker() for _ in range(2)]
    out = there / "out"
    line = command(*mesh, "-o", out, "--manifest", there / "manifest.json", "--cluster", cluster.file)
    with subprocess.Popen(line, env=environment(), stderr=subprocess.PIPE, text=True) as running:
        until(lambda: out.is_dir() and any(out.glob("spec*.obj")))
        assert running.poll() is None
        assert len(list(out.glob("spec*.obj"))) < SPECS
        workers[0].send_signal(signal.SIGKILL)
        errors = running.communicate(timeout=SECONDS)[1]
    assert (running.returncode, errors) == (expected.status, expected.err)
    assert expected.status == 2  # as of a broken spec
    assert contents(out) == contents(here / "out")
    assert (there / "manifest.json").read_bytes() == (here / "manifest.json").read_bytes()
    one = "mesh", PENTAGON, "-n", 4
    assert process(*one, "--cluster", cluster.file) == gtb(*one)
    refused = process(*one, "--require", "watertight", "--cluster", cluster.file)
    assert refused == gtb(*one, "--require", "watertight")
    assert refused.status == 1
