"""The floors of the house: what may import what, and what must not be imported early."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

import gtb_cli
from gtb_cli.cli import COMMANDS

PACKAGE = Path(gtb_cli.__file__).parent
REPOSITORY = PACKAGE.parent

GROUND = "__init__ errors arrays domain basis upper_hull upper_faces lifting normals patch starts moment linear"
MESHES = (
    "limits mesh triangulation film joints complex distance nearest overlay lattice flatness splitting subdivision"
    " refinement tessellation"
)
SHAPES = "welding measures tangents curvature tube solid"
REPORTS = "binomial description elevation fitting checks compare"
FILES = "expression syntax reader schema spec templates meshfiles difference"
WRITING = "obj formats files export manifest family morph sequence plot"
ROOMS = " ".join([GROUND, MESHES, SHAPES, REPORTS, FILES, WRITING]).split()
"""From the ground up: each imports only those before it. A new room is put where it belongs;
of a folder the name of the folder."""

READS_MESHES = {"mesh", "export", "compare"}
"""Rooms that may import trimesh, inside functions."""

SHELL = {"console", "processes", "meshing", "manifests", "options", "sequences"}
"""Modules of `commands` that commands may import."""


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


def room_of(name: str) -> str:
    """Room of a module: a room may be a folder."""
    return name.partition(".")[0]


def rooms() -> list[str]:
    return [name for name in MODULES if room_of(name) not in ("commands", "cli", "__main__")]


@pytest.mark.parametrize("name", rooms())
def test_a_room_imports_only_rooms_below_it(name):
    room = room_of(name)
    assert room in ROOMS, f"{room} has no place in ROOMS yet"
    found = {room_of(other) for other in own(imported(MODULES[name]))} - {room}
    if name != "__init__":  # the public names, imported when used
        assert found <= set(ROOMS[: ROOMS.index(room)])


def test_folders_have_no_circles():
    """Within a folder, too, there is an order."""
    for folder in {room_of(name) for name in MODULES if "." in name}:
        graph = {
            name: {other for other in own(imported_at_top(MODULES[name])) if room_of(other) == folder} - {name}
            for name in MODULES
            if room_of(name) == folder
        }
        while graph:
            free = [name for name, below in graph.items() if not below & graph.keys()]
            assert free, f"circle of imports in {folder}: {sorted(graph)}"
            for name in free:
                del graph[name]


@pytest.mark.parametrize("name", rooms())
def test_a_room_knows_no_shell(name):
    tree = MODULES[name]
    assert "click" not in packages(imported(tree))
    calls = [node.func for node in ast.walk(tree) if isinstance(node, ast.Call)]
    assert not [call for call in calls if isinstance(call, ast.Name) and call.id in ("print", "exit", "input")]
    assert not [call for call in calls if ast.unparse(call) in ("sys.exit", "os._exit")]


@pytest.mark.parametrize("name", sorted(MODULES))
def test_slow_packages_are_imported_when_they_are_used(name):
    early = packages(imported_at_top(MODULES[name]))
    assert not early & {"scipy", "trimesh", "matplotlib"}
    if name not in READS_MESHES:
        assert "trimesh" not in packages(imported(MODULES[name]))


@pytest.mark.parametrize("name", [name for name in MODULES if name == "cli" or name.startswith("commands")])
def test_a_command_is_imported_alone_and_without_numpy(name):
    early = imported_at_top(MODULES[name])
    assert "numpy" not in packages(early)
    assert own(early) <= {"__init__", "errors", *(f"commands.{part}" for part in SHELL)}


@pytest.mark.parametrize("name", sorted(MODULES))
def test_a_module_is_short_and_says_what_it_is(name):
    assert max(getattr(node, "end_lineno", 0) for node in MODULES[name].body) <= 500
    assert ast.get_docstring(MODULES[name])


def test_there_are_no_drawers():
    assert not {"utils", "util", "helpers", "common", "misc", "manager"} & {name.split(".")[-1] for name in MODULES}


def test_every_command_is_where_the_table_says():
    from gtb_cli.cli import gtb

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
    loaded = loaded_by(f"from gtb_cli.cli import run; run({arguments!r})", tmp_path)
    assert "click" in loaded
    assert not loaded & {"numpy", "scipy", "trimesh", "gtb_cli.patch"}


def test_import_gtb_cli_imports_nothing(tmp_path):
    assert "numpy" not in loaded_by("import gtb_cli", tmp_path)


SLOW = {"scipy", "trimesh", "fractions", "tempfile", "concurrent.futures", "multiprocessing"}
SLOW |= {"importlib.metadata", "decimal", "asyncio", "logging", "subprocess", "urllib.request", "unittest", "http"}


def test_a_small_mesh_imports_little(tmp_path):
    floor = loaded_by("import numpy, click", tmp_path)
    spec = REPOSITORY / "specs" / "pentagon.toml"
    arguments = ["mesh", "-q", "-n", "8", str(spec), "-o", "x.obj"]
    loaded = loaded_by(f"from gtb_cli.cli import run; run({arguments!r})", tmp_path)
    assert (tmp_path / "x.obj").stat().st_size > 1000
    assert not (loaded - floor) & SLOW
