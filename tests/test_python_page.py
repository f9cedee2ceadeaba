"""The public names of the library: each in its lists, in `specs/PYTHON.md` with an example, and typed."""

import os
import re
import subprocess
import sys

import pytest

import gtb_cli
from tests.marks import long
from tests.shell import REPOSITORY, SPECS
from tests.test_readme import blocks
from tests.tools.python_page import PAGE, page, sections

TEXT = PAGE.read_text(encoding="utf-8")
NAMES = [name for names in sections().values() for name in names]

THEORY = ("Patches", "Limits", "Other patches")
"""Sections whose functions have a source: the paper, another, or that it is not in the paper."""

SOURCE = re.compile(r"Def\.|Thm|[Ee]q\.|Sec(tion|\.) \d|Remark|Ex\. |Not in the paper|Gelfand")


def test_the_page_is_made_of_the_docstrings() -> None:
    assert page(TEXT) == TEXT, "docstrings have changed: make reference"


def test_each_public_name_stands_in_each_list_once() -> None:
    assert sorted(NAMES) == sorted(set(gtb_cli.__all__) - {"__version__"})


def test_each_public_name_is_in_an_example() -> None:
    examples = "".join(blocks("python", TEXT))
    assert [name for name in NAMES if f"gtb_cli.{name}" not in examples] == []


@pytest.mark.parametrize("name", [name for section in THEORY for name in sections()[section]])
def test_what_is_theory_has_a_source(name: str) -> None:
    value = getattr(gtb_cli, name)
    assert not callable(value) or isinstance(value, type) or SOURCE.search(value.__doc__)


@long
def test_its_examples_run(tmp_path, monkeypatch) -> None:
    pytest.importorskip("matplotlib")
    (tmp_path / "specs").symlink_to(SPECS)
    monkeypatch.chdir(tmp_path)
    exec(compile("\n".join(blocks("python", TEXT)), "PYTHON.md", "exec"), {})


SCRIPT = '''
"""What a user writes, with types."""

import sys
from pathlib import Path

import gtb_cli


def closed_volume(path: Path) -> float:
    spec = gtb_cli.load(path)
    mesh, remarks = gtb_cli.Recipe(tolerance="1%").mesh(spec)
    for remark in remarks:
        print(remark, file=sys.stderr)
    patches: list[gtb_cli.Patch] = [spec] if isinstance(spec, gtb_cli.Patch) else list(spec)
    return float(sum(gtb_cli.quadrature(patch).weights.sum() for patch in patches)) + len(mesh.faces)


reveal_type(gtb_cli.check(gtb_cli.load_patch("a.toml")))
reveal_type(gtb_cli.check(gtb_cli.load_model("a.toml")))
reveal_type(gtb_cli.load_patch("a.toml").derivatives([[0, 0.5]], order=2))
gtb_cli.tesselate
'''


@long
def test_what_users_write_passes_mypy_strict(tmp_path) -> None:
    """The README's and the page's examples, and a script with one wrong name, outside the checkout; in one run."""
    pytest.importorskip("mypy")
    readme = (REPOSITORY / "README.md").read_text(encoding="utf-8")
    texts = {"page.py": "\n".join(blocks("python", TEXT)), "script.py": SCRIPT}
    for number, block in enumerate(blocks("python", readme)):
        texts[f"readme{number}.py"] = block
    for name, text in texts.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    assert (REPOSITORY / "gtb_cli" / "py.typed").is_file()
    strict = f"--config-file={REPOSITORY / 'pyproject.toml'}"  # as `make types`, so that what that has read is known
    done = subprocess.run(
        [sys.executable, "-m", "mypy", strict, f"--cache-dir={REPOSITORY / '.mypy_cache'}", *texts],
        cwd=tmp_path,
        env=os.environ | {"MYPYPATH": str(REPOSITORY)},
        capture_output=True,
        text=True,
    )
    said = done.stdout.splitlines()
    assert [re.sub(r"^\S+ (error|note): |builtins\.", "", line) for line in said[:4]] == [
        'Revealed type is "gtb_cli.checks.report.Report"',
        'Revealed type is "gtb_cli.checks.report.ModelReport"',
        'Revealed type is "numpy.ndarray[tuple[Any, ...], numpy.dtype[numpy.float64]]"',
        'Module has no attribute "tesselate"; maybe "tessellate"?  [attr-defined]',
    ]
    assert len(said) == 5, done.stdout
