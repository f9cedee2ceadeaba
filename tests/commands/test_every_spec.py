"""What holds for the mesh of every spec, at any size, in any place, and however it collapses."""

import json
import re
from collections.abc import Callable

import numpy as np
import pytest

from gtb_cli.language.loading import parse
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.model import Model
from gtb_cli.theory.patch import Patch
from tests.marks import mostly_long
from tests.shell import SPECS, gtb
from tests.specs import load

TOLERANCE = 0.1
"""Fraction of the size of a patch."""

MOVES: dict[str, tuple[float, Callable[[Patch], Patch]]] = {
    "points 1e-9": (1e-9, lambda patch: patch.replace(control_points=patch.control_points * 1e-9)),
    "points 1e9": (1e9, lambda patch: patch.replace(control_points=patch.control_points * 1e9)),
    "points + 1e7": (1.0, lambda patch: patch.replace(control_points=patch.control_points + 1e7)),
    "knots 1e-9": (1.0, lambda patch: patch.replace(knots=patch.knots * 1e-9)),
    "knots 1e9": (1.0, lambda patch: patch.replace(knots=patch.knots * 1e9)),
    "knots + 1e7": (1.0, lambda patch: patch.replace(knots=patch.knots + 1e7)),
}
"""How much the points of a patch grow, and what becomes of it."""

OPTIONS = [
    {"resolution": 5},
    {"resolution": 5, "parametrization": "linear"},
    {"tolerance": TOLERANCE},
]


def topology(mesh: Mesh) -> tuple[int, int]:
    """Euler characteristic, and the number of loops of open edges (of a curve: of ends)."""
    used = len(np.unique(mesh.cells))
    if mesh.is_curve:
        return used - len(mesh.cells), int((np.bincount(mesh.cells.ravel()) == 1).sum())
    sides = np.sort(mesh.cells[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges, counts = np.unique(sides, axis=0, return_counts=True)
    assert counts.max() <= 2
    following: dict[int, int] = {}
    for a, b in edges[counts == 1]:
        following.setdefault(int(a), int(a))
        following.setdefault(int(b), int(b))
        first, second = root(following, int(a)), root(following, int(b))
        following[first] = second
    loops = len({root(following, vertex) for vertex in following})
    return used - len(edges) + len(mesh.cells), loops


def root(following: dict[int, int], vertex: int) -> int:
    while following[vertex] != vertex:
        vertex = following[vertex]
    return vertex


@pytest.mark.parametrize("options", mostly_long(OPTIONS, 2), ids=str)
@pytest.mark.parametrize("move", MOVES)
@pytest.mark.parametrize("name", mostly_long(["cubic-bezier", "pentagon", "bezier-triangle", "repeated-knot"], 2))
def test_patches_may_be_tiny_huge_or_far_away(name, move, options):
    patch = load(SPECS / f"{name}.toml")
    growth, moved = MOVES[move]
    size = float(np.ptp(patch.control_points, axis=0).max())
    mesh, theirs = (
        tessellate(one, **options | ({"tolerance": TOLERANCE * size * scale} if "tolerance" in options else {}))
        for one, scale in ((patch, 1.0), (moved(patch), growth))
    )
    assert topology(mesh) == topology(theirs) == ((1, 2) if mesh.is_curve else (1, 1))
    if "resolution" in options:
        assert np.array_equal(mesh.cells, theirs.cells)


SQUARE = "knots = [[0, 0], [1, 0], [0, 1], [1, 1]]\n"

COLLAPSED = {
    "an edge": f"{SQUARE}control_points = [[0, 0, 0], [0, 0, 0], [0, 1, 1], [1, 1, 0]]\n",
    "two edges": f"{SQUARE}control_points = [[0, 0, 0], [0, 0, 0], [1, 1, 1], [1, 1, 1]]\n",
    "to a line": f"{SQUARE}control_points = [[0, 0, 0], [1, 1, 1], [2, 2, 2], [3, 3, 3]]\n",
    "to a point": f"{SQUARE}control_points = [[1, 2, 3], [1, 2, 3], [1, 2, 3], [1, 2, 3]]\n",
    "a fold": "knots = [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1]]\n"
    "control_points = [[0, 0, 0], [1, 0, 0], [0, 0, 0], [0, 1, 0], [1, 1, 0], [0, 1, 0]]\n",
    "weights": f"{SQUARE}weights = [1e-300, 1e300, 1, 1e-10]\n"
    "control_points = [[0, 0, 0], [1, 0, 0], [0, 1, 1], [1, 1, 0]]\n",
    "tiny": f"{SQUARE}control_points = [[0, 0, 0], [1e-310, 0, 0], [0, 1e-310, 1e-310], [1e-310, 1e-310, 0]]\n",
    "huge": f"{SQUARE}control_points = [[0, 0, 0], [1e30, 0, 0], [0, 1e30, 1e30], [1e30, 1e30, 0]]\n",
    "a curve to a point": "knots = [0, 1, 2]\ncontrol_points = [[1, 1], [1, 1], [1, 1]]\n",
    "ends of a curve": "knots = [0, 1, 2, 3]\ncontrol_points = [[1, 1], [1, 1], [2, 2], [2, 2]]\n",
}


def numbers_of_glb(data: bytes) -> np.ndarray:
    """All numbers of a GLB file that its description does not declare whole."""
    length = int.from_bytes(data[12:16], "little")
    tree = json.loads(data[20 : 20 + length])
    assert not re.search(rb"NaN|Infinity", data[20 : 20 + length])
    found = []
    for accessor in tree["accessors"]:
        if accessor["componentType"] == 5126:
            view = tree["bufferViews"][accessor["bufferView"]]
            count = accessor["count"] * {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[accessor["type"]]
            start = 28 + length + view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
            found.append(np.frombuffer(data, "<f4", count, start))
    return np.concatenate(found)


CURVATURE = ["--attribute", "gaussian_curvature", "--attribute", "mean_curvature"]

SHAPES = (["-n", "4"], ["-n", "3", "--parametrization", "linear"], ["--tolerance", "0.2"])

TEXTS = COLLAPSED | {name: (SPECS / f"{name}.toml").read_text("utf-8") for name in ("teapot", "repeated-knot")}


@pytest.mark.parametrize("name", mostly_long(TEXTS, 4))
@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # as the command does: what overflows must not come out
def test_no_file_has_a_number_that_is_none(name):
    text = TEXTS[name].encode()
    spec = parse(text)
    model = isinstance(spec, Model)
    kinds = [
        ["obj", "--normals"],
        ["ply", "--ascii", "--normals", *CURVATURE],
        ["stl", "--ascii"],
        ["glb", "--normals"],
    ]
    if model:
        del kinds[1:3]  # no attributes; and STL has the vertices of OBJ
    elif spec.dimension == 1:
        kinds = [["obj"], ["ply", "--ascii"], ["glb"]]
    for shape in SHAPES[:1] if model else SHAPES:
        for kind in kinds:
            result = gtb("mesh", "-", "-f", *kind, *shape, stdin=text)
            if name == "huge" and "--tolerance" in shape:
                assert result.status == 2
                continue
            assert result.status == 0, result.err
            if kind[0] == "glb":
                assert np.isfinite(numbers_of_glb(result.out)).all()
            else:
                assert not re.search(rb"\b(?:nan|inf)\b", result.out, re.IGNORECASE)
