"""What the README shows runs, and what there is stands in it."""

import re
import shutil

import pytest

from gtb_cli.commands.cli import COMMANDS
from gtb_cli.commands.plot import plot
from tests.marks import long
from tests.shell import REPOSITORY, SPECS, script, shell

README = (REPOSITORY / "README.md").read_text(encoding="utf-8")
COMMANDS_PAGE = (REPOSITORY / "specs" / "COMMANDS.md").read_text(encoding="utf-8")


def blocks(language: str, *pages: str) -> list[str]:
    found = re.findall(rf"^```{language}\n(.*?)^```$", "".join(pages or (README, COMMANDS_PAGE)), re.M | re.S)
    return list(dict.fromkeys(found))


def words(line: str) -> str:
    """A command line without the note beside it."""
    return re.sub(r"\s+# .*$", "", line)


def shell_blocks() -> list[object]:
    """Those of the README, and then what the page of commands adds, which repeats at length the examples of help."""
    sequences = re.compile("gtb (degenerate|knot-limit) ")  # commands that measure distances for many seconds
    shown = {words(line) for block in blocks("sh", README) for line in block.splitlines()}
    added = [
        "\n".join(line for line in block.splitlines() if words(line) not in shown)
        for block in blocks("sh", COMMANDS_PAGE)
    ]
    return [
        *(pytest.param(block, marks=long if sequences.search(block) else ()) for block in blocks("sh", README)),
        *(pytest.param(block, marks=long) for block in added if block.strip()),
    ]


@pytest.fixture
def workplace(tmp_path):
    """A folder with `specs/` and the README's own spec."""
    (tmp_path / "specs").symlink_to(SPECS)
    for text in blocks("toml"):
        name = re.match(r"# (\S+\.toml)\n", text)[1]
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_a_row_and_a_section(name):
    row = re.search(rf"^\| `gtb {name}` \|.*\| `gtb {name}\b", README, re.MULTILINE)
    assert row, f"README.md has no row for {name}"
    section = re.search(rf"^## gtb {name}\n(.*?)^## ", COMMANDS_PAGE, re.MULTILINE | re.DOTALL)
    assert section, f"specs/COMMANDS.md has no section '## gtb {name}'"
    assert f"gtb {name} " in section[1]


def test_it_is_short():
    lines = 250  # the README is read in ten minutes
    assert len(README.splitlines()) <= lines


@pytest.mark.usefixtures("measured_roughly")
@pytest.mark.parametrize("block", shell_blocks())
def test_its_commands_run(block, workplace, monkeypatch):
    monkeypatch.setattr(next(option for option in plot.params if option.name == "dpi"), "default", 30)
    (workplace / "specs").unlink()
    for path in {path for name in re.findall(r"specs/([\w.*-]+)", block) for path in SPECS.glob(name)}:
        (workplace / "specs").mkdir(exist_ok=True)  # has what is named only, which `gtb info specs` measures, too
        (workplace / "specs" / path.name).symlink_to(path)
    result = script(block, workplace)
    assert result.status == 0, result.err
    assert "error" not in result.err


@long
def test_its_ways_to_share_work_without_a_scheduler_do(workplace):
    names = ["bicubic", "hexagon"]
    lines = re.findall(r"^    (printf .*xargs.*|gtb .*SLURM.*)", COMMANDS_PAGE, re.MULTILINE)
    lines = ["make -s -j8", lines[0], f"for SLURM_ARRAY_TASK_ID in $(seq {len(names)}); do {lines[1]}; done"]
    (workplace / "parts").mkdir()
    for name in names:
        shutil.copy(SPECS / f"{name}.toml", workplace / "parts")
    (workplace / "list").write_text("".join(f"parts/{name}.toml\n" for name in names))
    (workplace / "Makefile").write_text("\n".join(blocks("make", COMMANDS_PAGE)))
    made = []
    for line in lines:
        shutil.rmtree(workplace / "out", ignore_errors=True)
        result = shell(line, workplace)
        assert (result.status, result.err) == (0, "")
        made.append([(workplace / "out" / f"{name}.obj").read_bytes() for name in names])
    assert made[0] == made[1] == made[2]
    assert len(set(made[0])) == len(names)


@pytest.mark.parametrize("block", blocks("python"))
def test_its_python_runs(block, workplace, monkeypatch):
    monkeypatch.chdir(workplace)
    exec(compile(block, "README.md", "exec"), {})


def test_its_links_lead_somewhere():
    for folder, text in ((REPOSITORY, README), (SPECS, COMMANDS_PAGE)):
        for target in re.findall(r"\]\(([^)#]+)", text):
            assert (folder / target).exists()


def test_its_targets_of_make_are_there():
    makefile = (REPOSITORY / "Makefile").read_text(encoding="utf-8")
    targets = re.findall(r"^    make ([a-z][a-z-]*)", README, re.MULTILINE)
    assert {"mesh", "test"} <= set(targets)
    for target in targets:
        assert re.search(rf"^{target}:.*## ", makefile, re.MULTILINE), target
