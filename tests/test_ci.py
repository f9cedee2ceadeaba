"""A CI job written from the README alone, the action and the hooks: they pass, and fail when they should."""

import os
import re
import shlex
import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from gtb_cli.formats.meshfiles import read_mesh
from tests.marks import long, mostly_long
from tests.shell import CURVE, PENTAGON, REPOSITORY, SPECS, Result, gtb, shell

SECTION = re.search(r"^## In CI\n(.*?)^## ", (REPOSITORY / "README.md").read_text(encoding="utf-8"), re.M | re.S)[1]

CHOSEN = ("pentagon", "example-3.1", "box-corner")  # a surface, a curve and a model
ACTION = REPOSITORY / ".github" / "actions" / "diff" / "action.yml"


ELSEWHERE = [
    {"OMP_NUM_THREADS": "4", "OPENBLAS_NUM_THREADS": "4", "PYTHONHASHSEED": "7", "LC_ALL": "C"},
    {"NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3 AVX512F AVX512_SKX X86_V3 X86_V4"},  # an older processor
]


@pytest.fixture(scope="module")
def repository(tmp_path_factory) -> Path:
    return team(tmp_path_factory.mktemp("team"), CHOSEN)


def team(folder: Path, names: Sequence[str]) -> Path:
    """A team's repository: some specs, and their golden meshes."""
    (folder / "specs").mkdir()
    for name in names:
        shutil.copy(SPECS / f"{name}.toml", folder / "specs")
    renew(folder)
    assert len(os.listdir(folder / "golden")) == len(names)
    return folder


def renew(folder: Path) -> None:
    """Take all meshes over as golden ones."""
    shutil.rmtree(folder / "out", ignore_errors=True)
    done = shell("gtb mesh specs/*.toml -n 8 -o out/ && gtb approve golden out --prune", folder)
    assert done.status == 0, done.err


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


def action(folder: Path, **variables: str) -> Result:
    """Run what the action runs after it has installed gtb, as often as a job uses it, in a runner's environment."""
    text = ACTION.read_text(encoding="utf-8")
    install, line = re.findall(r"^    - run: (.*)$", text, re.MULTILINE)
    assert "$GITHUB_ACTION_PATH/../../.." in install
    assert "${{" not in install + line
    assert (ACTION.parent / "../../../pyproject.toml").resolve() == REPOSITORY / "pyproject.toml"
    given = dict(re.findall(r"^        ([A-Z]+): \$\{\{ inputs\.(\w+) \}\}$", text, re.MULTILINE))
    defaults = dict(re.findall(r"^  (\w+):\n    description: .*\n    default: (.*)$", text, re.MULTILINE))
    assert set(given.values()) == set(defaults)
    runner = folder / "runner"
    runner.mkdir(exist_ok=True)
    for name in ("output", "summary"):
        (runner / name).write_bytes(b"")
    places = {
        "GITHUB_ACTION_PATH": ACTION.parent,
        "GITHUB_OUTPUT": runner / "output",
        "GITHUB_STEP_SUMMARY": runner / "summary",
        "RUNNER_TEMP": runner,
    }
    values = {name: defaults[key].strip('"') for name, key in given.items()} | variables
    return shell(f"set -e; {line}", folder, **{name: str(path) for name, path in places.items()}, **values)


def outputs(folder: Path) -> dict[str, str]:
    """What the action said to later steps."""
    return dict(line.split("=", 1) for line in (folder / "runner" / "output").read_text("utf-8").splitlines())


@long
def test_the_action_tells_what_changed_in_a_summary_and_beside_files(checkout):
    assert action(checkout).status == 0
    assert outputs(checkout) == {"status": "same", "report": str(*(checkout / "runner").glob("gtb-report-*"))}
    nudge(checkout)
    (checkout / "golden" / "100%,a:b.obj").write_bytes((checkout / "golden" / "pentagon.obj").read_bytes())
    result = action(checkout, REPORT="a report", TOLERANCE="1e-7", LIMITS="--max-seconds 50 --max-memory 2G")
    assert (result.status, outputs(checkout)) == (1, {"status": "different", "report": "a report"}), result.err
    assert {path.name for path in (checkout / "a report").iterdir()} == {"changes.html", "changes.md", "changes.txt"}
    summary = (checkout / "runner" / "summary").read_text("utf-8")
    assert summary == (checkout / "a report" / "changes.md").read_text("utf-8")
    assert "| `pentagon.obj` | different |" in summary
    annotations = [line for line in result.text.splitlines() if line.startswith("::")]
    assert [line.split("::")[1] for line in annotations] == [
        "warning file=specs/pentagon.toml,title=gtb diff",
        "warning file=golden/100%25%2Ca%3Ab.obj,title=gtb diff",
    ]
    assert annotations[1].endswith("::missing: golden/100%25,a:b.obj is not in new")


def test_the_action_names_a_missing_folder_in_one_line_whatever_its_name(tmp_path):
    (tmp_path / "report").mkdir()
    (tmp_path / "report" / "changes.txt").symlink_to("secret")  # through which nothing may be written
    wrong = {"GOLDEN": "a,b:c%", "OPTIONS": "-n 8\n--no-such", "REPORT": "report"}
    result = action(tmp_path, SPECS="a.toml\n::warning::b.toml", **wrong)
    assert (result.status, [*(tmp_path / "report").iterdir()]) == (2, [])
    (said,) = [line for line in result.text.splitlines() if line.startswith("::")]
    assert said.startswith("::error file=a%2Cb%3Ac%25,title=gtb diff::a,b:c%25 is not a folder: gtb mesh ")
    assert "a.toml ::warning::b.toml" in said
    assert "--no-such" in result.err  # lines of options count, too


@long
def test_the_action_names_an_unreadable_golden_mesh_where_it_is(tmp_path):
    shutil.copy(CURVE, tmp_path / "x.toml")
    (tmp_path / "a,b").mkdir()
    (tmp_path / "a,b" / "x.obj").write_text("v 1\n", encoding="utf-8")
    result = action(tmp_path, SPECS="x.toml", GOLDEN="a,b/", OPTIONS="-n 8")
    assert result.status == 2
    assert "::error file=a%2Cb/x.obj," in result.err


@long
def test_a_broken_spec_and_one_without_a_golden_mesh_hide_no_other(checkout):
    nudge(checkout)
    shutil.copy(SPECS / "bicubic.toml", checkout / "specs")
    (checkout / "specs" / "box-corner.toml").write_text("knots = [", encoding="utf-8")
    result = action(checkout)
    assert (result.status, outputs(checkout)["status"]) == (2, "error")
    lines = [line for line in (result.text + result.err).splitlines() if line[:2] == "::"]
    assert sorted(line.split(",title")[0].split(",line")[0] for line in lines) == [
        *("::error file=specs/box-corner.toml", "::warning file=specs/bicubic.toml"),
        *("::warning file=specs/box-corner.toml", "::warning file=specs/pentagon.toml"),
    ]
    assert str(checkout) not in Path(outputs(checkout)["report"], "changes.html").read_text("utf-8")


@long
def test_the_job_of_gitlab_makes_a_page(checkout):
    page = (SPECS / "COMMANDS.md").read_text(encoding="utf-8")
    lines = re.search(r"^## In GitLab\n.*?^```yaml\n(.*?)^```", page, re.M | re.S)[1]
    install, *steps = re.findall(r"^    - (.*)$", lines, re.M)
    assert install == "pip install ./gtb-cli"
    nudge(checkout)
    assert [shell(step, checkout).status for step in steps] == [0, 1]
    assert (checkout / re.search(r"paths: \[(.*?)\]", lines)[1]).exists()


@long
def test_the_action_names_the_line_of_an_error_and_runs_nothing_that_an_input_says(checkout):
    (checkout / "specs" / "pentagon.toml").write_text('knots = [\n  [0, "zero"]]\n', encoding="utf-8")
    result = action(checkout)
    assert (result.status, outputs(checkout)["status"]) == (2, "error")
    assert "::error file=specs/pentagon.toml,line=1," in result.err
    for name in ("SPECS", "GOLDEN", "OPTIONS", "TOLERANCE", "LIMITS", "REPORT"):
        value = {"SPECS": "specs/bicubic.toml", name: "x$(touch hit)`touch hit`;touch hit"}
        assert action(checkout, **{"SPECS": f"specs/{CHOSEN[1]}.toml"} | value).status
        assert not (checkout / "hit").exists()


def test_hooks_are_commands_that_take_files():
    text = (REPOSITORY / ".pre-commit-hooks.yaml").read_text(encoding="utf-8")
    entries = re.findall(r"^  entry: (.*)$", text, re.MULTILINE)
    assert len(entries) == len(re.findall(r"^- id: ", text, re.MULTILINE)) == 2
    for entry in entries:
        name, *words = shlex.split(entry)
        assert name == "gtb"
        assert gtb(*words, CURVE, PENTAGON).status == 0


@long
def test_one_spec_and_several_pass_and_a_removed_or_moved_one_fails(tmp_path):
    names = CHOSEN[:2]
    folder = team(tmp_path, names)
    good = "2 same, 0 different, 0 missing, 0 extra\n"
    assert (job(folder).text, action(folder).text) == (good, good)
    assert action(folder, SPECS=f"specs/{names[0]}.toml specs").status == 2  # one of them twice
    nudge(folder)
    for result in (job(folder), action(folder)):
        assert (result.status, "1 different" in result.text) == (1, True)
    renew(folder)
    shutil.copy(SPECS / "bicubic.toml", folder / "specs")
    (folder / "specs" / f"{names[0]}.toml").unlink()
    for result in (job(folder), action(folder)):
        assert result.status == 1
        assert f"missing: golden/{names[0]}.obj is not in " in result.text
    (folder / "specs" / "bicubic.toml").unlink()
    renew(folder)
    assert job(folder).text == action(folder).text == good.replace("2", "1")


@pytest.mark.parametrize("variables", mostly_long(ELSEWHERE, 0), ids=lambda variables: next(iter(variables)))
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
    assert "::error file=specs/pentagon.toml,line=" in result.err
