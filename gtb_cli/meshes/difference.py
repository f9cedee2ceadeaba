"""The verdict whether two meshes are the same within a tolerance, and what differs where."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Literal, TypeAlias

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.errors import DomainError
from gtb_cli.meshes.hausdorff import MAX_CUTS, Farthest, mesh_distance
from gtb_cli.meshes.known import KnownMesh
from gtb_cli.meshes.measures import Measures, measure
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.welding import weld

# Fraction of the bounding box's diagonal. Other processors and libraries change meshes by about 1e-13 of it; moving a
# control point by 1e-6 moves the surface by more than this wherever its basis function exceeds a thousandth.
DEFAULT_TOLERANCE = 1e-9

Method: TypeAlias = Literal["vertices", "surface", "patches"]
Kind: TypeAlias = Literal["auto", "vertices", "surface"]
Point: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True, repr=False)
class Difference:
    """How two meshes differ. Made by `difference`.

    Attributes
    ----------
    method : {"vertices", "surface", "patches"}
        What was compared: vertices one by one, if the meshes have the same cells; the surfaces (or curves) that the
        meshes are; or those of the patches from which they would be made.
    distance, bound : float
        Largest distance found, and an upper bound of the true one; both are equal for vertices.
    tolerance : float
        Largest distance allowed.
    asked : float or None
        The tolerance asked for; None for the default.
    resolution : float
        Distance by which rounding in the files may separate equal points; no tolerance is smaller.
    diagonal : float
        Diagonal of the bounding box of the smaller mesh.
    forward, backward : Farthest
        From the first mesh to the second, and the other way.
    mean : float or None
        Mean distance of vertices.
    vertex, other_vertex : int or None
        Indices of the vertices at the largest distance.
    group : str
        Name of the group of the first mesh that has the farthest vertex; empty without groups.
    first, second : Measures or None
        Measures of the meshes; None if vertices were compared.
    same_kind : bool
        False if one is a curve and the other a surface: these are never the same.
    turned : int
        Number of faces of the second mesh whose orientation is reversed, if vertices were compared. They are in the
        same place, so this alone is not a difference.
    """

    method: Method
    distance: float
    bound: float
    tolerance: float
    asked: float | None
    resolution: float
    diagonal: float
    forward: Farthest
    backward: Farthest
    mean: float | None = None
    vertex: int | None = None
    other_vertex: int | None = None
    group: str = ""
    first: Measures | None = None
    second: Measures | None = None
    same_kind: bool = True
    turned: int = 0

    def __repr__(self) -> str:
        what = "same" if self.same else "different"
        return f"<Difference: {what}, {self.method} {self.distance:.3g} apart, tolerance {self.tolerance:.3g}>"

    @property
    def same(self) -> bool:
        """Whether the meshes are the same within the tolerance."""
        return self.same_kind and self.distance <= self.tolerance

    @property
    def is_proved(self) -> bool:
        """Whether the answer is proved: a distance of meshes that there is, or that none can exceed the tolerance."""
        return self.method != "patches" and (not self.same or self.bound <= self.tolerance)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Differences between surfaces in the same place: overlapping parts, duplicate faces, holes."""
        if not self.same or self.first is None or self.second is None:
            return ()
        rows = [("parts", self.first.components, self.second.components)]
        if not self.first.is_curve:
            rows.append(("edges with more than two faces", self.first.crowded_edges, self.second.crowded_edges))
            if self.first.is_closed != self.second.is_closed:
                rows.append(("open edges", self.first.open_edges, self.second.open_edges))
        told = [f"{one} against {other} {what}" for what, one, other in rows if one != other]
        return (f"in the same place, but {', '.join(told)}",) if told else ()


def difference(
    a: KnownMesh,
    b: KnownMesh,
    tolerance: float | str | None = None,
    kind: Kind = "auto",
    *,
    effort: int = MAX_CUTS,
) -> Difference:
    """Compare two meshes.

    Parameters
    ----------
    a, b : KnownMesh
    tolerance : float or str, optional
        In model units, or as a percentage ``"1%"`` of the diagonal of the smaller mesh's bounding box. The default is
        `DEFAULT_TOLERANCE` times this diagonal. The tolerance is never less than the resolution.
    kind : {"auto", "vertices", "surface"}
        Whether vertices are compared if the meshes have the same cells, or nothing but vertices or surfaces are.
    effort : int
        See `mesh_distance`.

    Raises
    ------
    DomainError
        The tolerance is none; vertices are to be compared of meshes with other cells.

    Notes
    -----
    The resolution is the largest distance between equal points after rounding to the numbers in the files: for each
    coordinate, half a unit in the last place in either file, at the size of the largest coordinate. Two meshes have the
    same cells in one of two cases. Either their cells have the same corners in the same order, where vertices with
    equal coordinates, as in an STL file, count as one. Or, in any order, each vertex matches one other within the
    tolerance.
    """
    diagonal = min(_diagonal(a.mesh), _diagonal(b.mesh))
    resolution = math.hypot(*(a.half_steps + b.half_steps).tolist())
    asked, allowed = allowed_for(tolerance, diagonal, resolution)
    pairs = None
    if kind != "surface":
        pairs = _pairs(a.mesh, b.mesh, allowed) or _pairs_in_any_order(a.mesh, b.mesh, allowed)
        if pairs is None and kind == "vertices":
            raise DomainError("the meshes have different faces, so that vertices cannot be compared one by one")
    made = partial(Difference, tolerance=allowed, asked=asked, resolution=resolution, diagonal=diagonal)
    if pairs is not None:
        vertices, others, turned = pairs
        distances = _distances(a.mesh.vertices[vertices], b.mesh.vertices[others])
        place = int(distances.argmax())
        vertex, other = int(vertices[place]), int(others[place])
        distance = float(distances[place])
        return made(
            method="vertices",
            distance=distance,
            bound=distance,
            forward=Farthest(distance, _point(a.mesh, vertex)),
            backward=Farthest(distance, _point(b.mesh, other)),
            mean=float(distances.mean()),
            vertex=vertex,
            other_vertex=other,
            group=_group(a.mesh, vertex),
            turned=turned,
        )
    finer = 0.1  # largest error of a distance, as a fraction of the tolerance, and of the error before
    remeasurements = 3  # while the tolerance lies between a distance and its bound
    error = finer * allowed
    found = mesh_distance(a.mesh, b.mesh, error, effort=effort)
    for _ in range(remeasurements):
        if not found.distance <= allowed < found.bound <= found.distance + 2 * error:
            break  # decided, or the effort was spent
        error *= finer
        found = mesh_distance(a.mesh, b.mesh, error, effort=effort)
    return made(
        method="surface",
        distance=found.distance,
        bound=found.bound,
        forward=found.forward,
        backward=found.backward,
        first=measure(a.mesh),
        second=measure(b.mesh),
        same_kind=a.mesh.is_curve == b.mesh.is_curve,
    )


def allowed_for(tolerance: float | str | None, diagonal: float, resolution: float) -> tuple[float | None, float]:
    """Return the tolerance asked for, in model units, and the one that holds; see `difference`.

    Raises
    ------
    DomainError
        It is no number from 0, and no percentage.
    """
    if tolerance is None:
        return None, max(DEFAULT_TOLERANCE * diagonal, resolution)
    try:
        asked = float(tolerance.removesuffix("%")) / 100 * diagonal if isinstance(tolerance, str) else tolerance
    except ValueError:
        asked = math.nan
    if not asked >= 0:
        raise DomainError(f"tolerance: must be a number from 0, or a percentage, got {tolerance!r}")
    return asked, max(asked, resolution)


def _diagonal(mesh: Mesh) -> float:
    used = mesh.vertices[mesh.cells.ravel()] if len(mesh.cells) < len(mesh.vertices) else mesh.vertices
    half = used.max(axis=0) / 2 - used.min(axis=0) / 2
    exponent = int(np.frexp(half.max())[1])
    return float(np.ldexp(np.linalg.norm(np.ldexp(half, -exponent)), exponent + 1))


def _distances(a: FloatArray, b: FloatArray) -> FloatArray:
    """(m,) distances of points, computed in a unit in which squares neither overflow nor underflow."""
    apart = a - b
    exponent = int(np.frexp(np.abs(apart).max(initial=0.0))[1])
    apart = np.ldexp(apart, -exponent)
    return np.asarray(np.ldexp(np.sqrt(np.einsum("ij,ij->i", apart, apart)), exponent))


def _point(mesh: Mesh, vertex: int) -> Point:
    x, y, z = mesh.vertices[vertex].tolist()
    return x, y, z


def _group(mesh: Mesh, vertex: int) -> str:
    if len(mesh.groups) < 2:
        return ""
    cells = np.flatnonzero((mesh.cells == vertex).any(axis=1))
    return next((name for name, start, stop in mesh.groups if len(cells) and start <= cells[0] < stop), "")


# Indices of matching vertices of two meshes, and how many faces are reversed
_Pairs: TypeAlias = tuple[IntArray, IntArray, int]


def _pairs(a: Mesh, b: Mesh, allowed: float) -> _Pairs | None:
    """Matching vertices if both meshes have the same cells, otherwise None."""
    if a.cells.shape != b.cells.shape:
        return None
    if len(a.vertices) == len(b.vertices) and np.array_equal(a.cells, b.cells):
        every = np.arange(len(a.vertices))
        return every, every, 0
    corners, other_corners = a.cells.ravel(), b.cells.ravel()
    for kind in (np.float64, np.float32):  # 32-bit numbers of one file may coincide, those of the other not
        with np.errstate(over="ignore", under="ignore"):
            first, labels = weld(a.vertices.astype(kind).astype(np.float64)[corners])
            other_first, other_labels = weld(b.vertices.astype(kind).astype(np.float64)[other_corners])
        if not np.array_equal(labels, other_labels):
            continue
        if kind is np.float64:
            return corners[first], other_corners[first], 0
        # Points of one number may lie apart: each corner counts, and none may be far from those with its number.
        spread = max(
            float(_distances(mesh.vertices[used], mesh.vertices[used[start][labels]]).max())
            for mesh, used, start in ((a, corners, first), (b, other_corners, other_first))
        )
        if spread <= allowed:
            pairs = np.unique(np.stack([corners, other_corners], axis=1), axis=0)
            return pairs[:, 0], pairs[:, 1], 0
    return None


def _pairs_in_any_order(a: Mesh, b: Mesh, tolerance: float) -> _Pairs | None:
    """Vertices that match within the tolerance if the cells are the same in any order; otherwise None."""
    if a.cells.shape != b.cells.shape:
        return None
    (first, cells), (second, other_cells) = (_welded(mesh) for mesh in (a, b))
    if len(first) != len(second):
        return None
    from scipy.spatial import cKDTree

    exponent = -int(np.frexp(np.abs(a.vertices[first]).max())[1])  # squares neither overflow nor underflow
    points, others = (np.ldexp(part, exponent) for part in (a.vertices[first], b.vertices[second]))
    tree = cKDTree(points, balanced_tree=False, compact_nodes=False)
    place = np.asarray(tree.query(others, distance_upper_bound=float(np.ldexp(tolerance, exponent)))[1])
    # A vertex too far from all others has the index beyond the last: the indices are then not one to one.
    if (np.bincount(place, minlength=len(first)) != 1).any():
        return None
    # Rows of sorted corners: both meshes must have the same rows, equally often.
    rows = np.concatenate([cells, place[other_cells]])
    here, there = _counted(np.sort(rows, axis=1))
    if not np.array_equal(here, there):
        return None
    turned = 0
    if not a.is_curve:
        start = rows.argmin(axis=1)[:, None]
        here, there = _counted(np.take_along_axis(rows, (start + np.arange(3)) % 3, axis=1))
        turned = int(np.maximum(there - here, 0).sum())
    return first[place], second, turned


def _counted(rows: IntArray) -> tuple[IntArray, IntArray]:
    """How often each distinct row occurs in the first half of the rows, and in the second."""
    _, labels = weld(np.pad(rows, ((0, 0), (0, 3 - rows.shape[1]))).astype(np.float64))
    here, there = (np.bincount(part, minlength=len(rows)) for part in np.split(labels, 2))
    return here, there


def _welded(mesh: Mesh) -> tuple[IntArray, IntArray]:
    """The index of one vertex at each place in use, and the cells as indices of these places."""
    corners = mesh.cells.ravel()
    first, labels = weld(mesh.vertices[corners])
    return corners[first], labels.reshape(mesh.cells.shape)
