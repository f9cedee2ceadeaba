"""The contents of a page: triangles or segments, with the points and lines that belong to them, in model units."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from functools import reduce
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import FloatArray, IntArray, cross, dot, shifted, unit
from gtb_cli.arrays import joined as rows_joined
from gtb_cli.errors import DomainError
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.topology import adjacent
from gtb_cli.meshes.welding import weld
from gtb_cli.pictures.look import subscript
from gtb_cli.pictures.nets import net_of
from gtb_cli.pictures.sequences import Frames
from gtb_cli.pictures.shapes import with_normals
from gtb_cli.tessellation.attributes import with_attributes
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.model import Model
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen

NO_POINTS = np.empty((0, 3))

EXACT, NOT_ALL_EXACT = "exact at vertices", "not all exact"  # what a page says of normals


class Keyframe(NamedTuple):
    """One state of a moving shape: (m, 3) positions and unit normals (none for curves), and control points."""

    vertices: FloatArray
    normals: FloatArray
    net_points: FloatArray


@frozen
class Content:
    """The contents of a page: one keyframe, or those of a sequence, with the same (k, 3) or (k, 2) cells.

    `groups` are named ranges of cells: (name, start, stop). `lines` are (m, 2) pairs of vertices: ``border`` between
    groups, ``open`` without a neighbour, and ``folds`` within a group, where the surface turns back: by more than 90
    degrees where its normals say that it is smooth, by more than 150 at an edge; and pairs of control points: ``net``.
    `knots` are the (n, 3) points of the surface at the knots, and `scalars` its "mean" and "gaussian" curvature. A
    vertex with several normals is several rows of a keyframe: `vertices` is how many there are. `normals` is a word
    about the normals.
    """

    name: str
    keyframes: tuple[Keyframe, ...]
    cells: IntArray
    groups: tuple[tuple[str, int, int], ...]
    lines: Mapping[str, IntArray]
    labels: tuple[str, ...] = ("",)
    net_names: tuple[str, ...] = ()
    knots: FloatArray = field(default_factory=lambda: NO_POINTS)
    knot_names: tuple[str, ...] = ()
    scalars: Mapping[str, FloatArray] = field(default_factory=dict)
    vertices: int = 0
    normals: str = ""
    limits: Mapping[str, Any] | None = None  # see `gtb_cli.pictures.limits`

    @property
    def is_curve(self) -> bool:
        """True if the cells are segments."""
        return bool(self.cells.shape[1] == 2)


def content_of(shape: Patch | Model, resolution: int | None = None, name: str | None = None) -> Content:
    """Return the contents for a spec: its mesh with exact normals, control net, knots and curvature."""
    patches = shape.patches
    surface = shape.dimension == 2
    fine = 256 if not surface else 40 if len(patches) <= 4 else 14  # looks smooth; many patches are small
    mesh = tessellate(shape, resolution or fine, parametrization="linear")
    if surface:
        mesh = with_attributes(shape, mesh, ["mean_curvature", "gaussian_curvature"], "linear")[0]
    net: list[IntArray] = []
    net_names: list[str] = []
    knot_names: list[str] = []
    for k, patch in enumerate(patches):
        net.append(np.array(net_of(patch)) + len(net_names))
        before = f"{patch.name or f'patch{k}'} " if len(patches) > 1 else ""
        for i, (knot, weight, point) in enumerate(zip(patch.knots, patch.weights, patch.control_points, strict=True)):
            net_names.append(f"{before}{subscript('b', i)} = {_tuple(point)}")
            knot_names.append(f"{before}{subscript('a', i)} = {_tuple(knot)}, ω = {weight:.6g}")
    title = name or shape.name or patches[0].name or "patch0"
    groups = mesh.groups or ((title, 0, len(mesh.cells)),)
    lines = sides(mesh, groups)
    if isinstance(shape, Patch):  # its edges are not left open by mistake
        lines |= {"border": lines["open"], "open": lines["border"]}
    shown = mesh.split
    return Content(
        title,
        (_keyframe(shown, np.concatenate([patch.control_points for patch in patches])),),
        shown.cells,
        groups,
        lines | {"net": np.concatenate(net)},
        net_names=tuple(net_names),
        knots=np.concatenate([patch.evaluate(patch.knots) for patch in patches]),
        knot_names=tuple(knot_names),
        scalars={kind: shown.attributes[f"{kind}_curvature"] for kind in ("mean", "gaussian") if surface},
        vertices=len(mesh.vertices),
        normals=_word(mesh),
    )


def content_of_mesh(mesh: Mesh, name: str) -> Content:
    """Return the contents for a mesh; if it has no normals, with the means of the triangles' normals.

    Vertices at the same place, as in files that hold each patch or triangle by itself, then count as one.
    """
    groups = mesh.groups or ((name, 0, len(mesh.cells)),)
    word, count = _word(mesh), len(mesh.vertices)
    if mesh.normals is None and not mesh.is_curve:
        first, labels = weld(mesh.vertices)
        mesh = with_normals(Mesh(mesh.vertices[first], labels[mesh.cells]))
    shown = mesh.split
    return Content(name, (_keyframe(shown),), shown.cells, groups, sides(mesh, groups), vertices=count, normals=word)


def content_of_frames(frames: Frames, name: str) -> Content:
    """Return the contents for a sequence."""
    first = frames.meshes[0]
    if not all(np.array_equal(mesh.cells, first.cells) for mesh in frames.meshes):
        raise DomainError("the meshes of a sequence have the same faces, and these do not: it cannot be played")
    none = np.empty((0, 2), dtype=np.int64)
    return Content(
        name,
        tuple(_keyframe(with_normals(mesh, smooth=True), frames.net_points) for mesh in frames.meshes),
        first.cells,
        ((name, 0, len(first.cells)),),
        {
            "border": none if first.is_curve else first.open_sides,
            "open": none,
            "folds": none,
            "net": np.array(frames.net, dtype=np.int64).reshape(-1, 2),
        },
        labels=tuple(frames.titles),
        net_names=tuple(subscript("b", i) for i in range(len(frames.net_points))),
        vertices=len(first.vertices),
        normals="means of the triangles'" if first.normals is None else _word(first),
    )


def joined(contents: Sequence[Content]) -> Content:
    """Return the contents of one page for several things together."""
    if len({content.is_curve for content in contents}) > 1:
        raise DomainError("curves and surfaces are not shown on one page")
    if len(contents) > 1 and any(len(content.keyframes) > 1 for content in contents):
        raise DomainError("a sequence is shown on a page of its own")
    return reduce(_beside, map(_with_names, contents) if len(contents) > 1 else contents)


def _with_names(content: Content) -> Content:
    """Return contents whose groups, where there are several, have names that begin with the content's own."""
    if len(content.groups) == 1:
        return content
    named = tuple((f"{content.name}: {name}", start, stop) for name, start, stop in content.groups)
    return replace(content, groups=named)


def _beside(one: Content, other: Content) -> Content:
    """Return the contents of a page for one thing and another."""
    (frame,), (further,) = one.keyframes, other.keyframes
    vertices, cells = len(frame.vertices), len(one.cells)
    behind = {"net": len(frame.net_points)}
    return Content(
        f"{one.name}, {other.name}",
        (rows_joined([frame, further]),),
        np.concatenate([one.cells, shifted(other.cells, vertices)]),
        (*one.groups, *((name, start + cells, stop + cells) for name, start, stop in other.groups)),
        {
            name: np.concatenate([rows, shifted(other.lines[name], behind.get(name, vertices))])
            for name, rows in one.lines.items()
        },
        net_names=one.net_names + other.net_names,
        knots=np.concatenate([one.knots, other.knots]),
        knot_names=one.knot_names + other.knot_names,
        scalars={
            name: np.concatenate([one.scalars[name], other.scalars[name]])
            for name in sorted(one.scalars.keys() & other.scalars.keys())
        },
        vertices=one.vertices + other.vertices,
        normals=_together(one.normals, other.normals),
    )


def sides(mesh: Mesh, groups: Sequence[tuple[str, int, int]]) -> dict[str, IntArray]:
    """Return the lines of a mesh, each side once: the borders between groups, open sides, and folds within a group."""
    if mesh.is_curve:
        return dict.fromkeys(("border", "open", "folds", "net"), np.empty((0, 2), dtype=np.int64))
    group = np.repeat(np.arange(len(groups)), [stop - start for _, start, stop in groups])
    pairs, ends = adjacent(mesh.faces)
    first, second = pairs.T
    between = group[first] != group[second]
    size = float(np.abs(mesh.vertices - mesh.vertices.mean(axis=0)).max()) or 1.0
    corners = mesh.vertices[mesh.faces] / size
    facing = unit(cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    # Both triangles have the normals of the edge's ends, so that the surface is smooth there: it turns back from 90°.
    smooth = np.ones(len(pairs), dtype=bool)
    for end in ends.T:
        rows = [mesh.normal_of[pair, (mesh.faces[pair] == end[:, None]).argmax(axis=1)] for pair in (first, second)]
        smooth &= rows[0] == rows[1]
    back = dot(facing[first], facing[second]) < np.where(smooth, 0.0, math.cos(math.radians(150)))
    return {"border": ends[between], "open": mesh.open_sides, "folds": ends[back & ~between], "net": ends[:0]}


def _word(mesh: Mesh) -> str:
    """Say whose the normals at the vertices of a mesh are."""
    if mesh.normals is None:
        return "means of the triangles', which part at edges sharper than 35°"
    return EXACT if mesh.exact_normals else NOT_ALL_EXACT


def _together(one: str, other: str) -> str:
    """Say whose the normals of two contents are."""
    if {one, other} == {EXACT, NOT_ALL_EXACT}:
        return NOT_ALL_EXACT
    return one if other in one else f"{one} and {other}"


def _keyframe(mesh: Mesh, points: FloatArray = NO_POINTS) -> Keyframe:
    return Keyframe(mesh.vertices, NO_POINTS if mesh.normals is None else mesh.normals, points)


def _tuple(numbers: ArrayLike) -> str:
    return f"({', '.join(f'{x:.6g}' for x in np.asarray(numbers).tolist())})"
