"""The kinds of file that readers are tried with, and what each of them must find there."""

import functools
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from gtb_cli.bezier.pieces import bezier_pieces
from gtb_cli.cad.vtu import encode_vtu
from gtb_cli.formats.export import standing
from gtb_cli.knots.lattice import lattice_of
from gtb_cli.language.loading import load
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.models.model import Model
from gtb_cli.shell.meshing import MeshOptions
from gtb_cli.tessellation.recipe import Recipe
from tests.shell import SPECS
from tests.tools.readers.libraries import SAMPLES

SINGLE = 2.0**-22  # relative error of 32-bit numbers, and of readers of text whose last bits are not the nearest ones

SIX_DIGITS = 1e-5  # relative error of what a program prints


@dataclass(frozen=True)
class Kind:
    """A kind of file: a spec of `specs/` and options of `gtb mesh`. The first word of its name is the format."""

    name: str
    spec: str
    options: MeshOptions

    @property
    def format(self) -> str:
        return self.name.split()[0].lower()

    @property
    def file(self) -> str:
        return f"{self.name.lower().replace(' ', '-')}.{self.format}"

    @functools.cached_property
    def made(self) -> Mesh:
        """The mesh that is written."""
        return self.options.recipe.mesh(load(SPECS / f"{self.spec}.toml"))[0]

    @functools.cached_property
    def mesh(self) -> Mesh:
        """What is in the file."""
        return standing(self.made, self.format)

    @functools.cached_property
    def groups(self) -> tuple[str, ...]:
        return tuple(name for name, _, _ in self.mesh.groups)

    def encoded(self) -> bytes:
        return b"".join(self.options.encoded(self.made, self.format))


class Cells(Kind):
    """Exact Bézier cells. Readers evaluate them; the mesh is of triangles (of curves, segments) at `SAMPLES`."""

    @functools.cached_property
    def mesh(self) -> Mesh:
        """Points of the patches themselves, or of their exact pieces."""
        spec = load(SPECS / f"{self.spec}.toml")
        patches = spec.patches if isinstance(spec, Model) else (spec,)
        points = []
        for patch in patches:
            for piece in (patch,) if lattice_of(patch.domain) else bezier_pieces(patch):
                v = piece.domain.vertices
                sides = v[[1, -1]] - v[0] if piece.dimension == 2 else v[1:] - v[0]
                points.append(piece.evaluate(v[0] + np.array(SAMPLES)[:, : len(sides)] @ sides))
        vertices, width = np.concatenate(points), patches[0].dimension + 1
        return Mesh(vertices, np.arange(len(vertices)).reshape(-1, width), name=spec.name)

    def encoded(self) -> bytes:
        return encode_vtu(load(SPECS / f"{self.spec}.toml"))[0]


KINDS = (
    Kind("OBJ", "pentagon", MeshOptions(Recipe(6))),
    Kind("OBJ normals uv", "pentagon", MeshOptions(Recipe(6, normals=True), uv=True)),
    Kind("OBJ model", "box-corner", MeshOptions(Recipe(4, normals=True))),
    Kind("OBJ curve", "example-3.1", MeshOptions(Recipe(16))),
    Kind("PLY", "pentagon", MeshOptions(Recipe(6))),
    Kind("PLY ascii", "pentagon", MeshOptions(Recipe(6), ascii=True)),
    Kind("PLY normals uv", "pentagon", MeshOptions(Recipe(6, normals=True), uv=True)),
    Kind("PLY attributes", "bicubic", MeshOptions(Recipe(6, normals=True, attributes=("mean_curvature", "u", "v")))),
    Kind(
        "PLY attributes ascii",
        "bicubic",
        MeshOptions(Recipe(6, normals=True, attributes=("gaussian_curvature", "mean_curvature")), ascii=True, uv=True),
    ),
    Kind("PLY uv and u", "bicubic", MeshOptions(Recipe(6, attributes=("u",)), uv=True)),
    Kind("PLY model", "box-corner", MeshOptions(Recipe(4, normals=True, attributes=("mean_curvature",)))),
    Kind("PLY curve", "example-3.1", MeshOptions(Recipe(16))),
    Kind("PLY curve ascii", "example-3.1", MeshOptions(Recipe(16), ascii=True)),
    Kind("STL", "pentagon", MeshOptions(Recipe(6))),
    Kind("STL ascii", "pentagon", MeshOptions(Recipe(6), ascii=True)),
    Kind("STL tube", "example-3.1", MeshOptions(Recipe(16, radius=0.05))),
    Kind("STL solid", "bicubic", MeshOptions(Recipe(6, thickness=-0.1))),
    Kind("STL 2 facets", "bicubic", MeshOptions(Recipe(1))),
    Kind("GLB", "pentagon", MeshOptions(Recipe(6))),
    Kind("GLB normals uv", "pentagon", MeshOptions(Recipe(6, normals=True), uv=True)),
    Kind("GLB model", "box-corner", MeshOptions(Recipe(4, normals=True))),
    Kind("GLB curve", "example-3.1", MeshOptions(Recipe(16))),
    Cells("VTU", "example-4.1-integer", MeshOptions(Recipe())),
    Cells("VTU triangle", "bezier-triangle", MeshOptions(Recipe())),
    Cells("VTU model", "teapot", MeshOptions(Recipe())),
    Cells("VTU curve", "cubic-bezier", MeshOptions(Recipe())),
)


class Different(Exception):
    """A reader finds something else than is in the file."""


def agreement(kind: Kind, found: dict[str, Any], tolerance: float = SINGLE) -> list[str]:
    """Return what else than vertices and cells a reader has found, and found right; raise `Different` with what is not.

    It has `points` and `cells` in any order, and where the reader gives them `normals`, `uv` and `attributes` (by name)
    of each point, `names` of groups or nodes. A reader that only counts gives `vertices`, `cells` and `bounds`, each of
    which may be None. The tolerance is relative to the largest coordinate.
    """
    unit = 1e-3  # error of a normal: Blender keeps them in 32 bits
    if "points" not in found:
        _compare_counts(kind.mesh, found, tolerance)
        return _parts_kept(kind, found)
    mesh = kind.mesh
    limit = tolerance * float(np.abs(mesh.vertices).max())
    tree = cKDTree(mesh.vertices)
    # Equal vertices count as one: readers of STL merge them, others do where files have them twice.
    label = np.array([min(near) for near in tree.query_ball_point(mesh.vertices, limit)])
    points = np.asarray(found["points"], dtype=float).reshape(-1, 3)
    if len(points) == 0:
        raise Different("no vertices")
    if not np.isfinite(points).all():
        raise Different("a vertex is not finite")
    if not all(0 <= corner < len(points) for cell in found["cells"] for corner in cell):
        raise Different("a cell has a corner that is not a vertex")
    distance, nearest = tree.query(points)
    if not distance.max() <= limit:
        raise Different(f"a vertex is {distance.max():.2g} away")
    places = label[nearest]
    if len(set(places)) != len(set(label)):
        raise Different(f"{len(set(places))} of {len(set(label))} vertices")
    expected, read = _cells(label[mesh.cells]), _cells([[places[corner] for corner in cell] for cell in found["cells"]])
    if expected != read:
        raise Different(f"{len(found['cells'])} of {len(mesh.cells)} cells, {sum((expected & read).values())} the same")
    kept = []
    normals, their_vertices = _normals(kind)
    for name, values, error, at in (
        ("normals", normals, unit, label[their_vertices]),
        ("uv", _uv(kind), tolerance, label),
    ):
        if values is not None and found.get(name):
            _compare_values(name, values, np.asarray(found[name], dtype=float), at, places, error)
            kept.append(name)
    theirs = found.get("attributes", {})
    known = [name for name in mesh.attributes if name in theirs] if kind.format == "ply" else []
    for name in known:
        expected_values, values = mesh.attributes[name], np.asarray(theirs[name], dtype=float)
        error = tolerance * max(1.0, float(np.abs(expected_values).max()))
        _compare_values(name, expected_values[:, None], values.reshape(-1, 1), label, places, error)
    if known:
        kept.append(f"{len(known)} of {len(mesh.attributes)} attributes")
    return kept + _parts_kept(kind, found)


def _normals(kind: Kind) -> tuple[np.ndarray | None, np.ndarray]:
    """Return the normals in a file, and the vertex of each."""
    if not kind.options.recipe.normals or kind.format == "stl" or kind.mesh.is_curve:
        return None, np.arange(0)
    if kind.format == "ply":
        return kind.mesh.vertex_normals, np.arange(len(kind.mesh.vertices))
    return kind.mesh.normals, kind.mesh.vertex_of_normal


def _uv(kind: Kind) -> np.ndarray | None:
    return kind.mesh.parameters if kind.options.uv else None


def _cells(corners: Sequence[Sequence[int]] | np.ndarray) -> Counter[tuple[int, ...]]:
    """Count cells, whichever corner is the first; segments have no direction."""
    counted: Counter[tuple[int, ...]] = Counter()
    for cell in corners:
        row = [int(corner) for corner in cell]
        if len(row) == 2:
            row.sort()
        first = row.index(min(row))
        counted[tuple(row[first:] + row[:first])] += 1
    return counted


def _compare_values(
    name: str, expected: np.ndarray, found: np.ndarray, label: np.ndarray, places: np.ndarray, error: float
) -> None:
    if len(found) != len(places):
        raise Different(f"{name}: {len(found)} of {len(places)}")
    for place, value in zip(places, found, strict=True):
        nearest = np.abs(expected[label == place] - value).max(axis=1).min()  # equal vertices may differ in these
        if not nearest <= error:
            raise Different(f"{name}: one is {nearest:.2g} away")


def _compare_counts(mesh: Mesh, found: dict[str, Any], tolerance: float) -> None:
    corners = mesh.cells.size
    parts = sum(len(np.unique(mesh.cells[start:stop])) for _, start, stop in mesh.groups)
    merged = len(np.unique(mesh.vertices.round(9), axis=0))
    for name, expected in (("cells", [len(mesh.cells)]), ("vertices", [len(mesh.vertices), merged, parts, corners])):
        if found.get(name) is not None and found[name] not in expected:
            raise Different(f"{found[name]} of {expected[0]} {name}")
    if found.get("bounds") is not None:
        moved = np.abs(np.asarray(found["bounds"], dtype=float) - mesh.bounds).max()
        if not moved <= tolerance * np.abs(mesh.vertices).max():
            raise Different(f"bounds are {moved:.2g} away")


def _parts_kept(kind: Kind, found: dict[str, Any]) -> list[str]:
    kept = []
    if kind.format in ("obj", "glb") and kind.groups and set(kind.groups) <= set(found.get("names") or ()):
        kept.append(f"{len(kind.groups)} parts")
    return kept
