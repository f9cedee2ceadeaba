"""The verdict whether two meshes are the same within a tolerance, and what differs where."""

import math
from collections.abc import Collection
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from operator import itemgetter
from typing import Literal, TypeAlias

import numpy as np

from gtb_cli.arrays import FloatArray, bounds_of
from gtb_cli.errors import DomainError
from gtb_cli.meshes.corner_values import unlike_values
from gtb_cli.meshes.correspondence import Lone, lone_faces, matching, unlike
from gtb_cli.meshes.hausdorff import Distance, Farthest, mesh_distance
from gtb_cli.meshes.measures import Measures, measure
from gtb_cli.meshes.mesh import FACETS, NORMALS, KnownMesh, Mesh, vertices_to_measure
from gtb_cli.meshes.motions import told_motion
from gtb_cli.vocabulary import Aspect, Comparison, percentage

# Fraction of the bounding box's diagonal. Other processors and libraries change meshes by about 1e-13 of it; moving a
# control point by 1e-6 moves the surface by more than this wherever its basis function exceeds a thousandth.
DEFAULT_TOLERANCE = 1e-9

Method: TypeAlias = Literal["vertices", "surface", "patches"]
Point: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True, repr=False)
class Difference:
    """How two meshes differ. Made by `difference`.

    Compared are vertices one by one, if the meshes have the same cells; the surfaces (or curves) that the meshes are;
    or those of the patches from which they would be made. Distances are in model units.
    """

    method: Method
    distance: float  # the largest found, or what is proved of patches: at most this
    bound: float  # of the true one, from above; for vertices, the distance
    tolerance: float  # the largest distance allowed
    asked: float | None  # the tolerance asked for; None for the default
    resolution: float  # by which rounding in the files may separate equal points; no tolerance is smaller
    diagonal: float  # of the bounding box of the smaller mesh
    forward: Farthest  # from the first mesh to the second
    backward: Farthest
    mean: float | None = None  # distance of vertices
    vertex: int | None = None  # of the first mesh, at the largest distance
    other_vertex: int | None = None
    group: str = ""  # of the first mesh that has the farthest vertex; empty without groups
    meshes: tuple[Mesh, Mesh] | None = None  # None if not surfaces of meshes were compared
    same_kind: bool = True  # a curve and a surface are never the same
    spaces: tuple[str, str] | None = None  # units and vertical axes, where two files of one format say others
    is_searched: bool = False  # whether the distance was found by a search that may miss nearest points
    turned: int = 0  # faces, or patches, that look to the other side, where everything is in the same place
    remarks: tuple[str, ...] = ()  # how else cells in the same place differ
    ignored: tuple[Aspect, ...] = ()  # which of these are not differences
    words: tuple[str, ...] = ()  # what was done to the first mesh, if that explains the difference
    values: tuple[str, ...] = ()  # how normals, texture coordinates and attributes differ
    is_curve: bool = False  # whether both are curves
    kind: Comparison = "auto"  # as what they were to be compared
    uncompared: tuple[str, ...] = ()  # sentences on such values that were not compared, or not everywhere
    stray: float | None = None  # the diagonal without few far vertices that make it more than a hundred times as long

    def __repr__(self) -> str:
        what, (distance, tolerance) = "same" if self.same else "different", self.amounts
        return f"<Difference: {what}, {self.method} {distance} apart, tolerance {tolerance}>"

    @property
    def amounts(self) -> tuple[str, str]:
        """The distance and the tolerance, in three digits, or in as many as tell them apart."""
        told = [(f"{self.distance:.{digits}g}", f"{self.tolerance:.{digits}g}") for digits in (3, 9, 17)]
        return next((pair for pair in told if pair[0] != pair[1]), told[0])

    @property
    def same(self) -> bool:
        """Whether the meshes are the same within the tolerance, in all aspects that are not ignored."""
        return self.same_kind and self.distance <= self.tolerance and not self.faults

    @property
    def faults(self) -> tuple[str, ...]:
        """What makes meshes in the same place different."""
        connectivity = () if "connectivity" in self.ignored else self.remarks
        sides = () if "orientation" in self.ignored else self.sides
        return (*self.units, *sides, *connectivity, *self.values)

    @property
    def units(self) -> tuple[str, ...]:
        """A remark on other units or vertical axes, if there are any."""
        return (f"the numbers are meant otherwise: {' against '.join(self.spaces)}",) if self.spaces else ()

    @property
    def sides(self) -> tuple[str, ...]:
        """A remark on faces or patches that are turned over, if there are any."""
        what = ("patch", "patches") if self.method == "patches" else ("face", "faces")
        return (f"{are(self.turned, *what)} turned over",) if self.turned else ()

    @cached_property
    def measures(self) -> tuple[Measures, ...]:
        """Of the meshes whose surfaces were compared."""
        return tuple(map(measure, self.meshes or ()))

    @property
    def is_proved(self) -> bool:
        """Whether the answer is proved: a distance of meshes that there is, or that none can exceed the tolerance."""
        return not self.is_searched and not self.is_loose

    @property
    def is_loose(self) -> bool:
        """Whether they are called the same, though the distance could be more than the tolerance."""
        return self.same and self.bound > self.tolerance

    @property
    def limits(self) -> tuple[str, ...]:
        """Sentences on where the answer does not quite fit the question."""
        result = [f"{remark}, which is ignored" for remark in (*self.sides, *self.remarks) if remark not in self.faults]
        result += self.uncompared
        finest = "the numbers in the files are no finer"
        if self.asked and self.asked < self.tolerance:
            result.append(f"tolerance {self.tolerance:.3g} instead of {self.asked:.3g}: {finest} at this size")
        if self.same and self.asked is None and self.tolerance > 1e-6 * self.diagonal:
            result.append(f"tolerance {self.tolerance:.3g}, as {finest}: smaller differences are not seen")
        if self.stray is not None:
            size = f"the size is {self.stray:.3g} instead of {self.diagonal:.3g}, which makes the tolerance"
            result.append(f"without a few vertices far from all others, {size} {self.tolerance:.3g}")
        if self.is_loose:
            where = "" if self.method == "patches" else "between samples "
            what = f"nothing farther apart than {self.distance:.3g} was found, but it is not proved"
            result.append(f"{what}: {where}it could be {self.bound:.3g}")
        return tuple(result)


def difference(
    a: KnownMesh,
    b: KnownMesh,
    tolerance: float | str | None = None,
    kind: Comparison = "auto",
    ignore: Collection[Aspect] = (),
) -> Difference:
    """Compare two meshes; the tolerance, `kind` and `ignore` are those of `diff`.

    Raises `DomainError` if the tolerance is none, a mesh has no cells or vertices that are not finite, or vertices are
    to be compared of meshes with other cells.

    No tolerance is less than the resolution, the largest distance between equal points after rounding to the numbers in
    the files: for each coordinate, half a unit in the last place in either file, at the size of the largest coordinate.
    `matching` says when two meshes have the same cells. Surfaces with other cells may be the same: an edge that is cut
    on both its sides, or the other diagonal of a flat quadrilateral, is not a difference; all that `unlike` finds is.
    """
    for each in (a, b):
        vertices_to_measure(each.mesh, "nothing can be compared")
    diagonal, smaller = min(((_diagonal(each.mesh.used), each.mesh) for each in (a, b)), key=itemgetter(0))
    resolution = math.hypot(*(a.half_steps + b.half_steps).tolist())
    asked, allowed = allowed_for(tolerance, diagonal, resolution)
    matched = None if kind == "surface" else matching(a, b, allowed)
    if matched is None and kind == "vertices":
        raise DomainError("the meshes have different faces, so that vertices cannot be compared one by one")
    fans, why = a.fans + b.fans, "cross themselves, or are too large to tell"
    overlaps = (f"triangles of {fans} polygons may overlap, as they {why}",) * bool(fans)
    spaces = (a.space, b.space) if a.format == b.format and a.space != b.space else None
    made = partial(
        Difference,
        tolerance=allowed,
        asked=asked,
        resolution=resolution,
        diagonal=diagonal,
        is_curve=a.mesh.is_curve and b.mesh.is_curve,
        kind=kind,
        ignored=tuple(sorted(ignore)),
        spaces=spaces,
        stray=None if isinstance(tolerance, float | int) and tolerance >= resolution else _stray(smaller, diagonal),
    )
    if matched is not None:
        place = int(matched.distances.argmax())
        distance, vertex, other = (each[place].item() for each in (matched.distances, matched.vertices, matched.others))
        points, others = a.mesh.vertices[matched.vertices], b.mesh.vertices[matched.others]
        steps, finest = a.half_steps + b.half_steps, allowed_for(tolerance, diagonal, 0.0)[1]
        most = np.abs(points - others).max(axis=0)
        axes = [
            f"{axis}: up to {apart:.3g} apart, and numbers in the files are right to {step:.2g}"
            for axis, apart, step in zip("xyz", most.tolist(), steps.tolist(), strict=True)
            if distance <= allowed and apart > max(step, finest)
        ]
        words = told_motion(points, others, allowed, spaces is None) if distance > allowed else ()
        turned = matched.turned
        if words and words[0].startswith("mirrored") and turned != (in_mirror := matched.turned_in_mirror):
            turns = told_motion(points, others, allowed, spaces is None, may_mirror=False) if not turned else ()
            words, turned = (turns, turned) if turns else (words, in_mirror)
        is_turned = "attributes" not in ignore and any(word.startswith(("turned", "mirrored")) for word in words)
        left_out = {NORMALS} & a.values().keys() & b.values().keys() if is_turned else set[str]()
        values = () if "attributes" in ignore else unlike_values(a, b, matched.slots, left_out)[0]
        return made(
            method="vertices",
            distance=distance,
            bound=distance,
            forward=Farthest(distance, tuple(a.mesh.vertices[vertex].tolist())),
            backward=Farthest(distance, tuple(b.mesh.vertices[other].tolist())),
            mean=float(matched.distances.mean()),
            vertex=vertex,
            other_vertex=other,
            group=_group(a.mesh, vertex),
            turned=turned,
            remarks=matched.remarks,
            words=words,
            values=(*axes, *values),
            uncompared=("normals are not compared, as they turn with what is turned",) * bool(left_out) + overlaps,
        )
    lone, found = lone_faces(a.mesh, b.mesh, allowed), _decided(a.mesh, b.mesh, allowed)
    moved, words = a, tuple[str, ...]()
    if lone is None and a.mesh.vertices.shape == b.mesh.vertices.shape:  # cells may be missing, beside a motion
        words = told_motion(a.mesh.vertices, b.mesh.vertices, allowed, spaces is None, may_mirror=False)
        is_turned = any(word.startswith("turned") for word in words)  # and normals with it
        doubtful = (*a.doubtful, *[NORMALS] * is_turned)
        moved = replace(a, mesh=replace(a.mesh, vertices=b.mesh.vertices), doubtful=doubtful) if words else a
        lone = lone_faces(moved.mesh, b.mesh, allowed) if words else None
    same_kind = a.mesh.is_curve == b.mesh.is_curve
    turned, remarks, are_all = 0 if lone is None else lone.turned, tuple[str, ...](), True
    is_held = any(each.values().keys() - {FACETS} for each in (a, b))
    close = min(allowed, max(resolution, 1e-6 * diagonal))
    is_told = "attributes" not in ignore and (found.distance <= allowed or lone is not None)
    values, where = (), "no place"
    if "attributes" not in ignore and kind != "surface":
        met = "" if is_told else "at the same places, "
        values, where = unlike_values(moved if lone else a, b, close, place=met, one=found.distance <= allowed <= close)
    crowd = ("sides of faces that only one has are not compared, as too many long ones lie across each other",)
    limit = f"only compared at {where}, as the faces are others"
    limit = "not compared, as surfaces were asked for" if kind == "surface" else limit
    if same_kind and found.distance <= allowed:
        turned, remarks, are_all = unlike(a, b, allowed, close, lone is None)
    return made(
        method="surface",
        distance=found.distance,
        bound=found.bound,
        forward=found.forward,
        backward=found.backward,
        meshes=(a.mesh, b.mesh),
        same_kind=same_kind,
        turned=turned,
        remarks=remarks,
        words=() if lone is None else (*words, *_told(lone, (a if lone.is_first else b).mesh)),
        values=values,
        uncompared=(f"normals, texture coordinates, attributes and groups are {limit}",) * (is_told and is_held)
        + crowd * (not are_all)
        + overlaps,
    )


def _decided(a: Mesh, b: Mesh, allowed: float) -> Distance:
    """Measure a distance so finely that it is more than what is allowed, or proved not to be, if effort suffices."""
    for power in range(1, 5):
        error = allowed * 0.1**power  # a tenth of the tolerance at most, then a tenth of the one before
        found = mesh_distance(a, b, error)
        if not found.distance <= allowed < found.bound <= found.distance + 2 * error:
            break  # decided, or the effort was spent
    return found


def _told(lone: Lone, mesh: Mesh) -> tuple[str, ...]:
    words, count = [], len(lone.absent)
    cell = ("segment", "segments") if mesh.is_curve else ("face", "faces")
    if count:
        near = f"near ({' '.join(f'{x:.9g}' for x in mesh.vertices[mesh.cells[lone.absent[0]]].mean(axis=0))})"
        words.append(f"{are(count, *cell)} {'missing' if lone.is_first else 'new'}, {near}")
    if lone.doubled:
        words.append(f"{are(lone.doubled, *cell)} {'no longer ' if lone.is_first else ''}there twice")
    if lone.repeated:
        words.append(f"{are(lone.repeated, *cell)} there {'less' if lone.is_first else 'more'} often")
    return tuple(words)


def are(count: int, one: str, many: str) -> str:
    """Say how many there are, as the beginning of a sentence."""
    return f"{count} {one} is" if count == 1 else f"{count} {many} are"


def allowed_for(tolerance: float | str | None, diagonal: float, resolution: float) -> tuple[float | None, float]:
    """Return the tolerance asked for, in model units, and the one that holds; `DomainError` if it is none."""
    if tolerance is None:
        return None, max(DEFAULT_TOLERANCE * diagonal, resolution)
    asked = math.nan
    with suppress(DomainError, TypeError, ValueError):
        asked = percentage(tolerance) / 100 * diagonal if isinstance(tolerance, str) else float(tolerance)
    if not 0 <= asked < math.inf:
        raise DomainError(f"tolerance: expected a number from 0, or a percentage such as '1%', got {tolerance!r}")
    return asked, max(asked, resolution)


def _stray(mesh: Mesh, diagonal: float) -> float | None:
    """The diagonal without the vertices farthest from the median, a hundredth of all but at least four, if it is small.

    Four are the corners of a stray tetrahedron, or those of a far triangle and one more.
    """
    points = mesh.used
    kept = len(points) - max(4, len(points) // 100)
    if kept < 4:
        return None
    away = np.abs(points / 2 - np.median(points, axis=0) / 2).max(axis=1)
    rest = _diagonal(points[np.argpartition(away, kept - 1)[:kept]])
    return rest if rest < diagonal / 100 else None


def _diagonal(points: FloatArray) -> float:
    low, high = bounds_of(points)
    return 2 * math.hypot(*(high / 2 - low / 2))


def _group(mesh: Mesh, vertex: int) -> str:
    if len(mesh.groups) < 2:
        return ""
    cells = np.flatnonzero((mesh.cells == vertex).any(axis=1))
    return next((name for name, start, stop in mesh.groups if len(cells) and start <= cells[0] < stop), "")
