"""The floors of the house: what may import what, and what must not be imported early."""

import ast
import os
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Collection
from functools import cache
from pathlib import Path

import pytest

import gtb_cli
from gtb_cli.commands.cli import COMMANDS

PACKAGE = Path(gtb_cli.__file__).parent
REPOSITORY = PACKAGE.parent

GROUND = "ground"
WINGS = [
    *(GROUND, "knots", "moment", "theory", "models", "language", "limits", "bezier", "meshes", "solids", "importers"),
    *("formats", "cad", "fairing", "tessellation", "distances", "sequences", "filling", "plots", "pages"),
    *("checks", "process", "shell", "verdicts", "review", "commands"),
    *("__init__", "__main__", "pytest_plugin"),
]
"""The floors, from the ground up: each imports only those before it. Modules beside the folders are the ground, but for
the two through which users come in, which are the top."""

PATCHES = {"knots", "moment", "theory", "models", "language", "limits", "bezier"}
APART = {"meshes": PATCHES, "solids": PATCHES}
"""Floors that do not know each other."""

READS_MESHES = {"meshes.mesh"}
"""Modules that may import trimesh, inside functions."""

OPTIONS = {"tessellation.recipe", "language.reading"}
"""What the options of commands become: all that they import of the library."""

LONGEST, LARGEST = 400, 3300
"""Lines of a module, and of a wing."""


@cache
def modules() -> dict[str, ast.Module]:
    return {
        ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__"): ast.parse(
            path.read_text(encoding="utf-8")
        )
        for path in sorted(PACKAGE.rglob("*.py"))
    }


@cache
def nodes(tree: ast.AST) -> list[ast.AST]:
    return list(ast.walk(tree))


@cache
def imported(tree: ast.AST) -> frozenset[str]:
    """Full names of what is imported anywhere in a tree."""
    names = set()
    for node in nodes(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            names |= {str(node.module), *(f"{node.module}.{alias.name}" for alias in node.names)}
    return frozenset(names)


def imported_at_top(tree: ast.Module) -> set[str]:
    """The same for what is imported with the module."""
    return {name for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom) for name in imported(node)}


def own(names: Collection[str]) -> set[str]:
    """Modules of this package among imported names, without its name."""
    short = {name.removeprefix("gtb_cli.") for name in names if name.startswith("gtb_cli.")}
    return short & modules().keys()


def packages(names: Collection[str]) -> set[str]:
    return {name.partition(".")[0] for name in names}


def wing_of(name: str) -> str:
    """Floor of a module: its folder."""
    wing, _, room = name.partition(".")
    return wing if (room or wing in WINGS) else GROUND


def lines(tree: ast.Module) -> int:
    return max(getattr(node, "end_lineno", 0) for node in tree.body)


def circle(graph: dict[str, set[str]]) -> list[str]:
    """Names that are left when those which need none of the others are taken away, again and again."""
    graph = dict(graph)
    while free := [name for name, below in graph.items() if not below & graph.keys()]:
        for name in free:
            del graph[name]
    return sorted(graph)


def test_the_table_of_wings_is_what_they_say_themselves():
    readme = (REPOSITORY / "README.md").read_text(encoding="utf-8")
    folders = [wing for wing in WINGS if (PACKAGE / wing).is_dir()]
    said = [f"| `{wing}` | {ast.get_docstring(modules()[wing])} |" for wing in folders]
    assert re.search(r"^\| wing \|.*\n\|---\|---\|\n((?:\|.*\n)+)", readme, re.M)[1].splitlines() == said


def test_a_room_has_a_name_of_its_own():
    rooms = Counter(name.split(".")[1] for name in modules() if "." in name and wing_of(name) != "commands")
    assert [room for room, times in rooms.items() if times > 1] == []


def test_a_class_has_a_name_of_its_own():
    tops = [node for tree in modules().values() for node in tree.body if isinstance(node, ast.ClassDef)]
    assert [name for name, times in Counter(node.name for node in tops).items() if times > 1] == []


def test_every_folder_is_a_floor():
    assert {path.parent.name for path in PACKAGE.glob("*/__init__.py")} <= set(WINGS)


def test_a_module_imports_only_its_floor_and_those_below():
    below = {wing: set(WINGS[: floor + 1]) - APART.get(wing, set()) for floor, wing in enumerate(WINGS)}
    arrows = {(name, other) for name, tree in modules().items() for other in own(imported(tree))}
    assert {(name, other) for name, other in arrows if wing_of(other) not in below[wing_of(name)]} == set()


def test_nothing_inside_imports_the_whole():
    assert {name for name, tree in modules().items() if "gtb_cli" in imported(tree)} == set()


def test_a_floor_has_no_circles():
    graph = {
        name: {other for other in own(imported(tree)) if wing_of(other) == wing} - {name, wing, "__init__"}
        for name, tree in modules().items()
        if (wing := wing_of(name))
    }
    assert circle(graph) == []


def test_a_circle_is_found():
    assert circle({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": set()}) == ["a", "b", "c"]


def test_a_floor_is_not_too_large():
    sizes = Counter()
    for name, tree in modules().items():
        sizes[wing_of(name)] += lines(tree)
    assert {wing: size for wing, size in sizes.items() if size > LARGEST} == {}


def test_a_room_knows_no_shell():
    for name, tree in modules().items():
        if wing_of(name) in ("process", "shell", "verdicts", "commands", "__main__"):
            continue
        assert "click" not in packages(imported(tree)), name
        calls = [node.func for node in nodes(tree) if isinstance(node, ast.Call)]
        called = {call.id for call in calls if isinstance(call, ast.Name)}
        called |= {ast.unparse(call) for call in calls if getattr(call, "attr", "") in ("exit", "_exit")}
        assert not called & {"print", "exit", "input", "sys.exit", "os._exit"}, name


def test_a_text_of_a_room_names_no_option():
    option = re.compile(r"(?<![\w-])(--[a-z]|-[a-zA-Z]\b)")
    found = set()
    for name, tree in modules().items():
        if wing_of(name) not in ("process", "shell", "verdicts", "commands", "__main__", "pytest_plugin"):
            alone = {id(node.value) for node in nodes(tree) if isinstance(node, ast.Expr)}  # docstrings
            texts = [node for node in nodes(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)]
            found |= {name for text in texts if id(text) not in alone and option.search(text.value)}
    assert found == {"language.starter", "importers.cad_files"}  # a comment of a spec; Python's own, for a process


def test_slow_packages_are_imported_when_they_are_used():
    for name, tree in modules().items():
        assert not packages(imported_at_top(tree)) & {"scipy", "trimesh", "matplotlib"}, name
    assert {name for name, tree in modules().items() if "trimesh" in packages(imported(tree))} <= READS_MESHES


def test_a_command_is_imported_alone_and_without_numpy():
    shell = {name for name in modules() if wing_of(name) in ("process", "shell", "verdicts")}
    for name in [name for name in modules() if wing_of(name) in ("process", "shell", "verdicts", "commands")]:
        early = imported_at_top(modules()[name])
        assert "numpy" not in packages(early), name
        assert own(early) <= {"__init__", "errors", "files", "version", "values", "vocabulary"} | OPTIONS | shell, name


def test_options_are_read_without_numpy():
    for name in OPTIONS:
        early = imported_at_top(modules()[name])
        assert "numpy" not in packages(early)
        assert own(early) <= {"__init__", "errors", "values", "vocabulary"}


def test_a_module_is_short_and_says_what_it_is():
    assert {name: lines(tree) for name, tree in modules().items() if lines(tree) > LONGEST} == {}
    assert {name for name, tree in modules().items() if not ast.get_docstring(tree)} == set()


def test_there_are_no_drawers():
    assert not {"utils", "util", "helpers", "common", "misc", "manager"} & {name.split(".")[-1] for name in modules()}


def test_every_command_is_where_the_table_says():
    from gtb_cli.commands.cli import gtb

    for name in COMMANDS:
        command = gtb.get_command(None, name)
        assert command.name == name


def test_public_names_are_all_there():
    for name in gtb_cli.__all__:
        assert getattr(gtb_cli, name) is not None
        assert name in dir(gtb_cli)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        gtb_cli.nothing  # noqa: B018


def loaded_by(code: str, folder: Path) -> set[str]:
    """Names of all modules that a new process has after running some code."""
    report = "\nimport sys; print('\\n'.join(sys.modules), file=sys.__stderr__)"
    done = subprocess.run(
        [sys.executable, "-c", code + report],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
        capture_output=True,
        text=True,
        check=True,
    )
    return set(done.stderr.split())


@pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["mesh", "--help"], ["nothing"], ["mesh"]])
def test_help_imports_no_numpy(arguments, tmp_path):
    loaded = loaded_by(f"from gtb_cli.commands.cli import run; run({arguments!r})", tmp_path)
    assert "click" in loaded
    assert not loaded & {"numpy", "scipy", "trimesh", "gtb_cli.theory.patch"}


def test_import_gtb_cli_imports_nothing(tmp_path):
    assert "numpy" not in loaded_by("import gtb_cli", tmp_path)


def test_a_small_mesh_imports_little(tmp_path):
    ours = {"models.same_edges", "models.smoothness", "theory.normals", "knots.decomposition", "language.copies"}
    assert ours <= modules().keys()
    slow = {"scipy", "trimesh", "fractions", "tempfile", "concurrent.futures", "multiprocessing", "numpy.ma", "json"}
    slow |= {"importlib.metadata", "decimal", "asyncio", "logging", "subprocess", "urllib.request", "unittest", "http"}
    floor = loaded_by("import numpy, click", tmp_path)
    spec = REPOSITORY / "specs" / "pentagon.toml"
    arguments = ["mesh", "-q", "-n", "8", str(spec), "-o", "x.obj"]
    loaded = loaded_by(f"from gtb_cli.commands.cli import run; run({arguments!r})", tmp_path)
    assert (tmp_path / "x.obj").stat().st_size > 1000
    assert not (loaded - floor) & (slow | {f"gtb_cli.{name}" for name in ours})
