"""What others install: the source archive has all that tests need, a wheel made of it all that commands need."""

import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

from gtb_cli import __version__
from tests.marks import long
from tests.shell import REPOSITORY, SPECS, environment

pytestmark = long


def python(*arguments: object, folder: Path, path: Path | str = REPOSITORY) -> str:
    """What a process of Python prints that works in a folder and imports from another one."""
    command = [sys.executable, *map(str, arguments)]
    done = subprocess.run(command, cwd=folder, env=environment(PYTHONPATH=str(path)), capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def built(kind: str, source: Path, folder: Path) -> Path:
    """A wheel or a source archive (sdist), by the hooks that pip calls; what has them is among what tests need."""
    hook = f"from flit_core import buildapi; print(buildapi.build_{kind}({str(folder)!r}))"
    return folder / python("-c", hook, folder=source).strip()


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory) -> Path:
    """The source archive, unpacked."""
    folder = tmp_path_factory.mktemp("source")
    with tarfile.open(built("sdist", REPOSITORY, folder)) as archive:
        archive.extractall(folder, filter="data")
    return folder / f"gtb_cli-{__version__}"


@pytest.fixture(scope="module")
def installed(unpacked, tmp_path_factory) -> Path:
    """A folder of packages with nothing in it but what the wheel holds."""
    folder = tmp_path_factory.mktemp("installed")
    path = built("wheel", unpacked, tmp_path_factory.mktemp("wheel"))
    options = ("--quiet", "--no-deps", "--no-index", "--disable-pip-version-check", "--target", folder)
    python("-m", "pip", "install", *options, path, folder=unpacked)
    return folder


def files(root: Path) -> set[Path]:
    packed = ("gtb_cli", "tests", "specs")  # folders of the source archive
    return {
        path.relative_to(root)
        for name in packed
        for path in (root / name).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }


def test_the_source_archive_has_every_file(unpacked):
    assert files(unpacked) == files(REPOSITORY)
    for name in ("LICENSE", "Makefile", "README.md", "pyproject.toml"):
        assert (unpacked / name).read_bytes() == (REPOSITORY / name).read_bytes()


def test_tests_run_in_the_source_archive(unpacked):
    places = "import gtb_cli, tests; print(gtb_cli.__file__, tests.__file__)"
    found = python("-c", places, folder=unpacked, path=unpacked).split()
    assert found == [str(unpacked / name / "__init__.py") for name in ("gtb_cli", "tests")]
    some = ("--assert=plain", "tests/test_golden.py", "tests/theory/test_examples.py")
    assert "[100%]" in python("-m", "pytest", "-m", "not long", *some, folder=unpacked, path=unpacked)


def test_the_wheel_of_the_checkout_is_that_of_the_archive(unpacked, tmp_path_factory):
    one, other = (built("wheel", source, tmp_path_factory.mktemp("wheel")) for source in (REPOSITORY, unpacked))
    with zipfile.ZipFile(one) as first, zipfile.ZipFile(other) as second:
        assert sorted(first.namelist()) == sorted(second.namelist())
        held = {Path(name) for name in first.namelist() if ".dist-info/" not in name}
    assert held == {path for path in files(REPOSITORY) if path.parts[0] == "gtb_cli"}


def test_it_says_its_version_elsewhere(installed, tmp_path):
    place = python("-c", "import gtb_cli; print(gtb_cli.__path__[0])", folder=tmp_path, path=installed).strip()
    assert place == str(installed / "gtb_cli")
    version = python(installed / "bin" / "gtb", "--version", folder=tmp_path, path=installed)
    assert version.strip().endswith(__version__)


def test_commands_work_elsewhere(installed, tmp_path):
    """The examples in the help of those that need files of the package run, in folders with specs and nothing else."""
    commands = ("mesh", "view", "schema", "help", "completion")
    for name in commands:
        (tmp_path / name).mkdir()
        shutil.copytree(SPECS, tmp_path / name / "specs", ignore=shutil.ignore_patterns("pictures"))
    found = python("-c", EXAMPLES, installed, *commands, folder=tmp_path, path=f"{installed}:{REPOSITORY}")
    assert found.strip() == str(installed / "gtb_cli" / "__init__.py")


EXAMPLES = """
import sys
from pathlib import Path
import gtb_cli, tests.shell
tests.shell.REPOSITORY, *names = sys.argv[1:]  # what a shell runs is what is installed, too
for name in names:
    done = tests.shell.script(tests.shell.example_of(name), Path(name).absolute())
    assert done.status == 0 and "error" not in done.err, (name, done)
print(gtb_cli.__file__)
"""
