"""A CI job written from the README alone: its lines run as they stand there, pass, and fail when they should."""

import os
import re
import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from gtb_cli.formats.meshfiles import read_mesh
from tests.marks import long, mostly_long
from tests.shell import REPOSITORY, SPECS, Result, shell

SECTION = re.search(r"^## In CI\n(.*?)^## ", (REPOSITORY / "README.md").read_text(encoding="utf-8"), re.M | re.S)[1]

CHOSEN = ("pentagon", "example-3.1", "box-corner")  # a surface, a curve and a model
ACTION = REPOSITORY / ".github" / "actions" / "diff" / "action.yml"


ELSEWHERE = [
    {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
    {"OMP_NUM_THREADS": "4", "OPENBLAS_NUM_THREADS": "4", "PYTHONHASHSEED": "7", "LC_ALL": "C"},
    {"NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3 AVX512F AVX512_SKX X86_V3 X86_V4"},  # an older processor
]


@pytest.fixture(scope="module")
def repository(tmp_path_factory) -> Path:
    return team(tmp_path_factory.mktemp("team"), CHOSEN)


def team(folder: Path, names: Sequence[str]) -> Path:
    """A team's repository: some specs, and their golden meshes."""
    makefile = re.search(r"^```make\n(.*?)^```$", SECTION, re.MULTILINE | re.DOTALL)[1]
    (folder / "specs").mkdir()
    for name in names:
        shutil.copy(SPECS / f"{name}.toml", folder / "specs")
    (folder / "Makefile").write_text(makefile, encoding="utf-8")
    (folder / ".gitignore").write_text("out\n", encoding="utf-8")
    done = shell("make -s golden", folder)
    assert done.status == 0, done.err
    assert len(os.listdir(folder / "golden")) == len(names)
    return folder


@pytest.fixture
def checkout(repository, tmp_path) -> Path:
    return shutil.copytree(repository, tmp_path / "checkout", symlinks=True)


def job(folder: Path, **variables: str) -> Result:
    """Run the steps as GitHub does, each in a shell that stops at the first error; gtb is installed already."""
    steps = re.findall(r"^ +- run: (.*)$", SECTION, re.MULTILINE)
    assert steps[0].startswith("pip install")
    result = None
    shutil.rmtree(folder / "out", ignore_errors=True)  # a job begins with a fresh checkout
    for step in steps[1:]:
        result = shell(f"set -e; {step}", folder, **variables)
        if result.status:
            break
    return result


def nudge(folder: Path) -> None:
    """Move one control point of the pentagon by a millionth of its size."""
    diagonal = 5.744562646538029  # diagonal of the box of the pentagon's control points: √(2² + 2² + 5²)
    spec = folder / "specs" / "pentagon.toml"
    text = spec.read_text(encoding="utf-8")
    assert text.count('["8/7", "8/7", 5]') == 1
    spec.write_text(text.replace('["8/7", "8/7", 5]', f'["8/7", "8/7", {5 + 1e-6 * diagonal!r}]'), encoding="utf-8")


def assert_as_shown(text: str) -> None:
    """Compare with what the README shows; the last digits may differ here, too."""
    failure = re.search(r"^```\n(different.*?)^```$", SECTION, re.MULTILINE | re.DOTALL)[1]
    number = re.compile(r"\d[\d.]*(?:e-\d+)?")
    assert number.sub("#", text) == number.sub("#", failure)
    found, shown = (np.array(number.findall(each), dtype=float) for each in (text, failure))
    assert np.allclose(found, shown, rtol=0.02, atol=0)


def action(folder: Path, specs: str = "specs") -> Result:
    """Run what the action runs after it has installed gtb, as often as a job uses it."""
    line = re.findall(r"^    - run: (.*)$", ACTION.read_text(encoding="utf-8"), re.MULTILINE)[-1]
    (folder / "runner").mkdir(exist_ok=True)
    options = {"SPECS": specs, "GOLDEN": "golden", "OPTIONS": "-n 8", "TOLERANCE": ""}
    return shell(f"set -e; {line}", folder, RUNNER_TEMP=str(folder / "runner"), **options)


@pytest.mark.parametrize("names", [CHOSEN[:1], CHOSEN[:2]], ids=len)
def test_one_spec_and_several_pass_and_a_removed_or_moved_one_fails(names, tmp_path):
    folder = team(tmp_path, names)
    good = f"{len(names)} same, 0 different, 0 missing, 0 extra\n"
    assert (job(folder).text, action(folder).text, shell("make -s check", folder).text) == (good, good, good)
    assert action(folder, specs=f"specs/{names[0]}.toml specs").status == 2  # one of them twice
    nudge(folder)
    for result in (job(folder), action(folder)):
        assert (result.status, "1 different" in result.text) == (1, True)
    assert shell("make -s golden && make -s check", folder).status == 0
    shutil.copy(SPECS / "bicubic.toml", folder / "specs")
    (folder / "specs" / f"{names[0]}.toml").unlink()
    for result in (job(folder), action(folder)):
        assert result.status == 1
        assert f"missing: golden/{names[0]}.obj is not in " in result.text
    assert shell("make -s golden && make -s check", folder).text == good


@pytest.mark.parametrize("variables", mostly_long(ELSEWHERE), ids=lambda variables: next(iter(variables)))
def test_it_passes_where_nothing_changed(checkout, variables):
    result = job(checkout, **variables)
    assert result.status == 0, result.text + result.err
    assert result.text == f"{len(CHOSEN)} same, 0 different, 0 missing, 0 extra\n"
    assert (checkout / "out" / "manifest.json").exists()


def test_a_moved_control_point_fails_it_and_it_says_what_differs_where(checkout):
    nudge(checkout)
    result = job(checkout)
    assert result.status == 1
    golden, out = (read_mesh(checkout / folder / "pentagon.obj").vertices for folder in ("golden", "out"))
    distances = np.linalg.norm(golden - out, axis=1)
    where = re.search(r"most at vertex (\d+): \((.*?)\) and \((.*?)\)", result.text)
    assert distances[int(where[1])] == distances.max()
    assert np.allclose(np.array(where[2].split(), dtype=float), golden[int(where[1])], rtol=1e-8)
    assert np.allclose(np.array(where[3].split(), dtype=float), out[int(where[1])], rtol=1e-8)
    assert_as_shown(result.text)


@long
def test_a_broken_spec_fails_it(checkout):
    (checkout / "specs" / "pentagon.toml").write_text("knots = [\n", encoding="utf-8")
    result = job(checkout)
    assert result.status == 2
    assert "specs/pentagon.toml:" in result.err
