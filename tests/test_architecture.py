"""The floors of the house: what may import what, and what must not be imported early."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

import gtb_cli
from gtb_cli.commands.cli import COMMANDS

PACKAGE = Path(gtb_cli.__file__).parent
REPOSITORY = PACKAGE.parent

GROUND = "ground"
WINGS = [
    *(GROUND, "knots", "theory", "bezier", "meshes", "spec", "imports", "formats", "assembly", "certificates"),
    *("tessellation", "sequences", "fairing", "design", "pictures", "checks", "shell", "commands"),
]
"""The floors, from the ground up: each imports only those before it. Modules beside the folders are the ground."""

APART = {"knots": {"meshes"}, "theory": {"meshes"}, "bezier": {"meshes"}, "meshes": {"knots", "theory", "bezier"}}
"""Floors that do not know each other."""

DOORS = {"__init__", "__main__"}
"""The public names and the process, which know every floor."""

READS_MESHES = {"meshes.mesh", "formats.glb", "formats.ply", "formats.stl"}
"""Modules that may import trimesh, inside functions."""

RECIPE = "tessellation.recipe"
"""What the options of commands become: all that they import of the library."""

LONGEST, LARGEST = 400, 3300
"""Lines of a module, and of a wing."""


def modules() -> dict[str, ast.Module]:
    return {
        ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__"): ast.parse(
            path.read_text(encoding="utf-8")
        )
        for path in sorted(PACKAGE.rglob("*.py"))
    }


MODULES = modules()


def imported(tree: ast.AST) -> set[str]:
    """Full names of what is imported anywhere in a tree."""
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            names |= {str(node.module), *(f"{node.module}.{alias.name}" for alias in node.names)}
    return names


def imported_at_top(tree: ast.Module) -> set[str]:
    """The same for what is imported with the module."""
    return {name for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom) for name in imported(node)}


def own(names: set[str]) -> set[str]:
    """Modules of this package among imported names, without its name."""
    short = {name.removeprefix("gtb_cli.") for name in names if name.startswith("gtb_cli.")}
    return short & MODULES.keys()


def packages(names: set[str]) -> set[str]:
    return {name.partition(".")[0] for name in names}


def wing_of(name: str) -> str:
    """Floor of a module: its folder."""
    wing, _, room = name.partition(".")
    return wing if room or wing in WINGS else GROUND


def rooms() -> list[str]:
    return [name for name in MODULES if wing_of(name) not in ("shell", "commands") and name not in DOORS]


def circle(graph: dict[str, set[str]]) -> list[str]:
    """Names that are left when those which need none of the others are taken away, again and again."""
    graph = dict(graph)
    while free := [name for name, below in graph.items() if not below & graph.keys()]:
        for name in free:
            del graph[name]
    return sorted(graph)


def test_every_folder_is_a_floor():
    assert {path.parent.name for path in PACKAGE.glob("*/__init__.py")} <= set(WINGS)


@pytest.mark.parametrize("name", sorted(MODULES.keys() - DOORS))
def test_a_module_imports_only_its_floor_and_those_below(name):
    wing = wing_of(name)
    below = set(WINGS[: WINGS.index(wing) + 1]) - APART.get(wing, set())
    assert {other: wing_of(other) for other in own(imported(MODULES[name])) if wing_of(other) not in below} == {}


@pytest.mark.parametrize("wing", WINGS)
def test_a_floor_has_no_circles(wing):
    graph = {
        name: {other for other in own(imported(tree)) if wing_of(other) == wing} - {name, wing, "__init__"}
        for name, tree in MODULES.items()
        if wing_of(name) == wing and name not in DOORS
    }
    assert circle(graph) == []


def test_a_circle_is_found():
    assert circle({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": set()}) == ["a", "b", "c"]


@pytest.mark.parametrize("wing", WINGS)
def test_a_floor_is_not_too_large(wing):
    lines = [max(getattr(node, "end_lineno", 0) for node in MODULES[n].body) for n in MODULES if wing_of(n) == wing]
    assert sum(lines) <= LARGEST


@pytest.mark.parametrize("name", rooms())
def test_a_room_knows_no_shell(name):
    tree = MODULES[name]
    assert "click" not in packages(imported(tree))
    calls = [node.func for node in ast.walk(tree) if isinstance(node, ast.Call)]
    assert not [call for call in calls if isinstance(call, ast.Name) and call.id in ("print", "exit", "input")]
    exits = [call for call in calls if ast.unparse(call) in ("sys.exit", "os._exit")]
    assert not exits or name == "forks"  # it ends copies, and not the process


@pytest.mark.parametrize("name", sorted(MODULES))
def test_slow_packages_are_imported_when_they_are_used(name):
    early = packages(imported_at_top(MODULES[name]))
    assert not early & {"scipy", "trimesh", "matplotlib"}
    if name not in READS_MESHES:
        assert "trimesh" not in packages(imported(MODULES[name]))


@pytest.mark.parametrize("name", [name for name in MODULES if wing_of(name) in ("shell", "commands")])
def test_a_command_is_imported_alone_and_without_numpy(name):
    early = imported_at_top(MODULES[name])
    assert "numpy" not in packages(early)
    shell = {other for other in MODULES if wing_of(other) == "shell"}
    assert own(early) <= {"__init__", "errors", "forks", "threads", "vocabulary", RECIPE} | shell


def test_options_are_read_without_numpy():
    early = imported_at_top(MODULES[RECIPE])
    assert "numpy" not in packages(early)
    assert own(early) <= {"__init__", "errors", "vocabulary"}


@pytest.mark.parametrize("name", sorted(MODULES))
def test_a_module_is_short_and_says_what_it_is(name):
    assert max(getattr(node, "end_lineno", 0) for node in MODULES[name].body) <= LONGEST
    assert ast.get_docstring(MODULES[name])


def test_there_are_no_drawers():
    assert not {"utils", "util", "helpers", "common", "misc", "manager"} & {name.split(".")[-1] for name in MODULES}


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


SLOW = {"scipy", "trimesh", "fractions", "tempfile", "concurrent.futures", "multiprocessing", "numpy.ma"}
SLOW |= {"importlib.metadata", "decimal", "asyncio", "logging", "subprocess", "urllib.request", "unittest", "http"}


def test_a_small_mesh_imports_little(tmp_path):
    floor = loaded_by("import numpy, click", tmp_path)
    spec = REPOSITORY / "specs" / "pentagon.toml"
    arguments = ["mesh", "-q", "-n", "8", str(spec), "-o", "x.obj"]
    loaded = loaded_by(f"from gtb_cli.commands.cli import run; run({arguments!r})", tmp_path)
    assert (tmp_path / "x.obj").stat().st_size > 1000
    assert not (loaded - floor) & SLOW
