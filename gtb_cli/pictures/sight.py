"""What a page shows: triangles or segments, with the points and lines that belong to them, in model units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, cross, dot, shifted
from gtb_cli.errors import DomainError
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.topology import adjacent
from gtb_cli.pictures.look import subscript
from gtb_cli.pictures.nets import net_of
from gtb_cli.pictures.sequences import Frames, with_normals
from gtb_cli.tessellation.attributes import with_attributes
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.model import Model
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen

PATCH_SEGMENTS, MODEL_SEGMENTS, CURVE_SEGMENTS = 40, 14, 256
"""Segments of each edge of a patch, of each of many patches of a model, and of a curve."""

FULL_DETAIL_PATCHES = 4
"""Largest number of patches of a model that are drawn as finely as a single one."""

NO_PAIRS = np.empty((0, 2), dtype=np.int64)
NO_POINTS = np.empty((0, 3))


@frozen
class Moment:
    """One state of a moving shape: positions, normals (none for curves) and control points."""

    label: str
    vertices: FloatArray
    normals: FloatArray
    net_points: FloatArray


@frozen
class Sight:
    """What a page shows.

    Attributes
    ----------
    name : str
    moments : tuple of Moment
        One moment, or the moments of a sequence.
    cells : (k, 3) or (k, 2) int
    groups : tuple of (name, start, stop)
        Ranges of `cells` with names of their own.
    border, open, folds : (m, 2) int
        Sides between patches, sides without a neighbour, and sides within a patch at which the surface turns back:
        where the normals of both triangles are more than 90 degrees apart.
    net : (m, 2) int
        Pairs of control points between which lines are drawn.
    net_names, knot_names : tuple of str
    knots : (n, 3) float
        Points of the surface at the knots.
    scalars : dict of name to (m,) float
        "mean" and "gaussian" curvature.
    exact : bool
        Whether the normals are the surface's own at the vertices, not means of the triangles'.
    """

    name: str
    moments: tuple[Moment, ...]
    cells: IntArray
    groups: tuple[tuple[str, int, int], ...]
    border: IntArray = field(default_factory=lambda: NO_PAIRS)
    open: IntArray = field(default_factory=lambda: NO_PAIRS)
    folds: IntArray = field(default_factory=lambda: NO_PAIRS)
    net: IntArray = field(default_factory=lambda: NO_PAIRS)
    net_names: tuple[str, ...] = ()
    knots: FloatArray = field(default_factory=lambda: NO_POINTS)
    knot_names: tuple[str, ...] = ()
    scalars: dict[str, FloatArray] = field(default_factory=dict)
    exact: bool = True

    @property
    def is_curve(self) -> bool:
        """Whether the cells are segments."""
        return bool(self.cells.shape[1] == 2)


def sight_of(shape: Patch | Model, resolution: int | None = None, name: str | None = None) -> Sight:
    """See a spec: its mesh with exact normals, control net, knots and curvature."""
    patches = shape.patches
    surface = patches[0].dimension == 2
    fine = (PATCH_SEGMENTS if len(patches) <= FULL_DETAIL_PATCHES else MODEL_SEGMENTS) if surface else CURVE_SEGMENTS
    mesh = tessellate(shape, resolution or fine, parametrization="linear")
    scalars = {}
    if surface:
        kinds = ("mean", "gaussian")
        found = with_attributes(shape, mesh, [f"{kind}_curvature" for kind in kinds], "linear")[0].attributes
        scalars = {kind: found[f"{kind}_curvature"] for kind in kinds}
    firsts = np.cumsum([0, *(len(patch.knots) for patch in patches)]).tolist()
    names = [patch.name or f"patch{k}" for k, patch in enumerate(patches)]
    before = [f"{text} " if len(patches) > 1 else "" for text in names]
    knots = [
        f"{start}{subscript('a', i)} = ({', '.join(f'{x:.6g}' for x in knot)}), ω = {patch.weights[i]:.6g}"
        for start, patch in zip(before, patches, strict=True)
        for i, knot in enumerate(patch.knots.tolist())
    ]
    points = np.concatenate([patch.control_points for patch in patches])
    called = name or shape.name or names[0]
    groups = mesh.groups or ((called, 0, len(mesh.cells)),)
    border, free, folds = (NO_PAIRS,) * 3 if mesh.is_curve else sides(mesh, groups)
    if isinstance(shape, Patch):
        border, free = free, NO_PAIRS
    return Sight(
        called,
        (Moment("", mesh.vertices, _normals(mesh), points),),
        mesh.cells,
        groups,
        border,
        free,
        folds,
        np.concatenate([np.array(net_of(patch)) + first for patch, first in zip(patches, firsts, strict=False)]),
        tuple(
            f"{start}{subscript('b', i)} = ({', '.join(f'{x:.6g}' for x in point)})"
            for start, patch in zip(before, patches, strict=True)
            for i, point in enumerate(patch.control_points.tolist())
        ),
        np.concatenate([patch.evaluate(patch.knots) for patch in patches]),
        tuple(knots),
        scalars,
    )


def sight_of_mesh(mesh: Mesh, name: str) -> Sight:
    """See a mesh; if it has no normals, with the means of the triangles' normals."""
    groups = mesh.groups or ((name, 0, len(mesh.cells)),)
    border, free, folds = (NO_PAIRS,) * 3 if mesh.is_curve else sides(mesh, groups)
    moment = Moment("", mesh.vertices, _normals(with_normals(mesh)), NO_POINTS)
    return Sight(name, (moment,), mesh.cells, groups, border, free, folds, exact=mesh.normals is not None)


def sight_of_frames(frames: Frames, name: str) -> Sight:
    """See a sequence."""
    first = frames.meshes[0]
    if any(mesh.cells.shape != first.cells.shape or (mesh.cells != first.cells).any() for mesh in frames.meshes):
        raise DomainError("the meshes of a sequence have the same faces, and these do not: it cannot be played")
    net = NO_POINTS if frames.net_points is None else frames.net_points
    moments = tuple(
        Moment(label, mesh.vertices, _normals(with_normals(mesh)), net)
        for label, mesh in zip(frames.titles, frames.meshes, strict=True)
    )
    border = NO_PAIRS if first.is_curve else first.open_sides
    pairs = np.array(frames.net, dtype=np.int64).reshape(-1, 2)
    names = tuple(subscript("b", i) for i in range(len(net)))
    groups = ((name, 0, len(first.cells)),)
    exact = first.normals is not None
    return Sight(name, moments, first.cells, groups, border, net=pairs, net_names=names, exact=exact)


def joined(sights: Sequence[Sight]) -> Sight:
    """See several things together."""
    if len(sights) == 1:
        return sights[0]
    if len({sight.is_curve for sight in sights}) > 1:
        raise DomainError("curves and surfaces are not shown on one page")
    if any(len(sight.moments) > 1 for sight in sights):
        raise DomainError("a sequence is shown on a page of its own")
    moments = [sight.moments[0] for sight in sights]
    vertices = np.cumsum([0, *(len(moment.vertices) for moment in moments)]).tolist()
    points = np.cumsum([0, *(len(moment.net_points) for moment in moments)]).tolist()
    cells = np.cumsum([0, *(len(sight.cells) for sight in sights)]).tolist()

    def moved(name: str, by: Sequence[int]) -> IntArray:
        return np.concatenate([shifted(getattr(sight, name), start) for sight, start in zip(sights, by, strict=False)])

    shown = [set(sight.scalars) for sight in sights]
    return Sight(
        ", ".join(sight.name for sight in sights),
        (
            Moment(
                "",
                np.concatenate([moment.vertices for moment in moments]),
                np.concatenate([moment.normals for moment in moments]),
                np.concatenate([moment.net_points for moment in moments]),
            ),
        ),
        moved("cells", vertices),
        tuple(
            (name if len(sight.groups) == 1 else f"{sight.name}: {name}", start + first, stop + first)
            for sight, first in zip(sights, cells, strict=False)
            for name, start, stop in sight.groups
        ),
        moved("border", vertices),
        moved("open", vertices),
        moved("folds", vertices),
        moved("net", points),
        tuple(name for sight in sights for name in sight.net_names or ("",) * len(sight.moments[0].net_points)),
        np.concatenate([sight.knots for sight in sights]),
        tuple(name for sight in sights for name in sight.knot_names),
        {key: np.concatenate([sight.scalars[key] for sight in sights]) for key in sorted(set.intersection(*shown))},
        all(sight.exact for sight in sights),
    )


def sides(mesh: Mesh, groups: Sequence[tuple[str, int, int]]) -> tuple[IntArray, IntArray, IntArray]:
    """Return the sides of triangles between groups, open sides, and folds within a group, each once."""
    group = np.repeat(np.arange(len(groups)), [stop - start for _, start, stop in groups])
    pairs, ends = adjacent(mesh.faces)
    first, second = pairs.T
    between = group[first] != group[second]
    size = float(np.abs(mesh.vertices - mesh.vertices.mean(axis=0)).max()) or 1.0
    corners = mesh.vertices[mesh.faces] / size
    normals = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    back = dot(normals[first], normals[second]) < 0
    return ends[between], mesh.open_sides, ends[back & ~between]


def _normals(mesh: Mesh) -> FloatArray:
    return NO_POINTS if mesh.normals is None else mesh.normals
