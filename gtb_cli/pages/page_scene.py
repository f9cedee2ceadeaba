"""The contents of a page: triangles or segments, with the points and lines that belong to them, in model units."""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import field, replace
from functools import reduce
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import FloatArray, IntArray, cross, dot, joined as rows_joined, shifted, unit
from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.meshes.coincident import numbered_places
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.topology import adjacent, sides_of
from gtb_cli.models.model import Model, with_weld
from gtb_cli.plots.look import subscript
from gtb_cli.plots.net_lines import net_of
from gtb_cli.plots.panels import Frames
from gtb_cli.plots.shape_figures import free_edges, with_normals
from gtb_cli.solids.wall_depth import MAX_WALL_FACES, wall_of_vertices
from gtb_cli.tessellation.attributes import with_attributes
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.edges import edge_points_at
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen
from gtb_cli.vocabulary import thickness_of

NO_POINTS = np.empty((0, 3))
MAX_PAGE_FACES = 1_000_000  # of a page; each takes about 40 bytes
PAGE_TOLERANCE = 4e-4  # of the size: less than half a pixel where a model fills a screen
PAGE_FACES = 60_000  # of an even mesh, if nothing else is asked for


class Keyframe(NamedTuple):
    """One state of a moving shape: (m, 3) positions and unit normals (none for curves), and control points."""

    vertices: FloatArray
    normals: FloatArray
    net_points: FloatArray


@frozen
class Content:
    """The contents of a page: one keyframe, or those of a sequence, with the same (k, 3) or (k, 2) cells.

    `groups` are named ranges of cells: (name, start, stop). `lines` are those of `sides`, (m, 4) pairs of vertices and
    the groups on both sides, and (m, 2) pairs of control points: ``net``. `knots` are the (n, 3) points of the surface
    at the knots, `edges` the middles of open edges, or of all of a single patch, and `scalars` its "mean" and
    "gaussian" curvature, or the "wall" of a solid, None if there are too many triangles. A vertex with several normals
    is several rows of a keyframe.
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
    edges: FloatArray = field(default_factory=lambda: NO_POINTS)
    edge_names: tuple[str, ...] = ()
    scalars: Mapping[str, FloatArray | None] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()  # what is unusual about the shape
    thickness: float | None = None  # for which a solid was made
    unit: str | None = None  # of its lengths
    quick: str = ""  # what is shown in place of what is asked for

    @property
    def is_curve(self) -> bool:
        """True if the cells are segments."""
        return bool(self.cells.shape[1] == 2)


def content_of(
    shape: Patch | Model, recipe: Recipe | None = None, name: str | None = None, *, quick: bool = False
) -> Content:
    """Return the contents for a spec: its mesh with exact normals, control net, knots, and curvature or wall.

    Without a recipe, the mesh is fine enough for a screen. A quick one, in a tenth of the time, is coarse, and has
    neither curvature nor wall, nor remarks on a solid.
    """
    patches = shape.patches
    quick = quick and shape.dimension == 2
    solid = recipe is not None and (recipe.radius is not None or recipe.thickness is not None)
    if quick:
        recipe = replace(recipe or Recipe(), resolution=8 if solid else 16, tolerance=None)
    mesh, remarks, tolerance = _made(shape, recipe)
    surface = shape.dimension == 2 and not solid and not quick
    if surface:
        mesh = with_attributes(shape, mesh, ["mean_curvature", "gaussian_curvature"], "linear")[0]
    net, net_names, knot_names = list[IntArray](), list[str](), list[str]()
    for k, patch in enumerate(patches):
        net.append(np.array(net_of(patch)) + len(net_names))
        before = f"{patch.name or f'patch{k}'} " if len(patches) > 1 else ""
        for i, (knot, weight, point) in enumerate(zip(patch.knots, patch.weights, patch.control_points, strict=True)):
            net_names.append(f"{before}{subscript('b', i)} = {_tuple(point)}")
            knot_names.append(f"{before}{subscript('a', i)} = {_tuple(knot)}, ω = {weight:.6g}")
    title = name or shape.name or patches[0].name or "patch0"
    groups = mesh.groups or ((title, 0, len(mesh.cells)),)
    lines = sides(mesh, groups, tolerance)
    if isinstance(shape, Patch):  # its edges are not left open by mistake
        lines |= {"border": np.concatenate([lines["border"], lines["open"]]), "open": lines["open"][:0]}
    free = free_edges(with_weld(shape, None if recipe is None else recipe.weld)) if shape.dimension == 2 else []
    shown = mesh.split
    scalars = {kind: shown.attributes[f"{kind}_curvature"] for kind in ("mean", "gaussian") if surface}
    return Content(
        title,
        (_keyframe(shown, np.concatenate([patch.control_points for patch in patches])),),
        shown.cells,
        groups,
        lines | {"net": np.concatenate(net)},
        net_names=tuple(net_names),
        knots=np.concatenate([patch.evaluate(patch.knots) for patch in patches]),
        knot_names=tuple(knot_names),
        edges=np.concatenate([NO_POINTS, *(edge_points_at(patch, edge, np.array([0.5])) for _, patch, edge in free)]),
        edge_names=tuple(name for name, *_ in free),
        scalars=scalars if quick else scalars | _wall(shown),
        remarks=() if quick and solid else tuple(remarks),
        thickness=abs(thickness_of(recipe.thickness)[1]) if recipe and recipe.thickness else None,
        quick=f"a quick picture, {recipe.resolution} segments an edge" if quick and recipe else "",
    )


def _made(shape: Patch | Model, recipe: Recipe | None) -> tuple[Mesh, list[str], float]:
    """Return a mesh, what is unusual about it, and its tolerance, if it has one: without a recipe, that of a screen."""
    if recipe is None:
        with suppress(ToleranceError):
            return _made(shape, _fine(shape))
        recipe = Recipe(14)
    return *replace(recipe, normals=True).mesh(shape), recipe.tolerance_for(shape) or 0.0


def _fine(shape: Patch | Model) -> Recipe:
    """Return the recipe of a mesh whose outline looks smooth on a screen.

    Even meshes show curvature and stripes best, and are taken where twice the resolution that a page has room for is
    enough. It follows from one of 8: the surface is about l α / 8 from edges of length l between normals at an angle α.
    """
    if shape.dimension == 1:
        return Recipe(256)
    coarse = tessellate(shape, 8).split
    size = float(np.linalg.norm(np.subtract(*coarse.bounds)))
    ends = coarse.vertices[coarse.edges]
    between = ends[:, 1] - ends[:, 0]
    turns = np.zeros_like(between) if coarse.normals is None else np.diff(coarse.normals[coarse.edges], axis=1)[:, 0]
    chord_error = float(np.sqrt(dot(between, between) * dot(turns, turns)).max()) / 8
    tolerance = PAGE_TOLERANCE * size
    if not (math.isfinite(chord_error) and tolerance > 0):
        return Recipe(14)
    needed = max(math.ceil(8 * math.sqrt(chord_error / tolerance)), 8)
    most = max(math.isqrt(PAGE_FACES // Recipe(1).faces(shape)), 1)
    return Recipe(min(needed, most)) if needed <= 2 * most else Recipe(tolerance=tolerance, max_faces=MAX_PAGE_FACES)


def content_of_mesh(mesh: Mesh, name: str) -> Content:
    """Return the contents for a mesh; if it has no normals, with the means of the triangles' normals.

    Vertices at the same place, as in files that hold each patch or triangle by itself, then count as one.
    """
    groups = mesh.groups or ((name, 0, len(mesh.cells)),)
    if mesh.normals is None and not mesh.is_curve:
        first, labels = numbered_places(mesh.vertices)
        mesh = with_normals(Mesh(mesh.vertices[first], labels[mesh.cells]))
    shown = mesh.split
    return Content(name, (_keyframe(shown),), shown.cells, groups, sides(mesh, groups), scalars=_wall(shown))


def content_of_frames(frames: Frames, name: str) -> Content:
    """Return the contents for a sequence."""
    first = frames.meshes[0]
    if not all(np.array_equal(mesh.cells, first.cells) for mesh in frames.meshes):
        raise DomainError("the meshes of a sequence have the same faces, and these do not: it cannot be played")
    groups = ((name, 0, len(first.cells)),)
    lines, none = sides(first, groups), np.empty((0, 4), dtype=np.int64)
    return Content(
        name,
        tuple(_keyframe(with_normals(mesh, smooth=True), frames.net_points) for mesh in frames.meshes),
        first.cells,
        groups,
        {"border": lines["open"], "open": none, "folds": none, "net": np.array(frames.net, dtype=int).reshape(-1, 2)},
        labels=tuple(frames.titles),
        net_names=tuple(subscript("b", i) for i in range(len(frames.net_points))),
    )


def joined(contents: Sequence[Content]) -> Content:
    """Return the contents of one page for several things together."""
    if len({content.is_curve for content in contents}) > 1:
        raise DomainError("curves and surfaces are not shown on one page")
    if len(contents) > 1 and any(len(content.keyframes) > 1 for content in contents):
        raise DomainError("a sequence is shown on a page of its own")
    named = []
    for content in contents:
        before = f"{content.name}: " if len(contents) > 1 and len(content.groups) > 1 else ""
        groups = tuple((before + name, start, stop) for name, start, stop in content.groups)
        named.append(replace(content, groups=groups))
    return reduce(_beside, named)


def _beside(one: Content, other: Content) -> Content:
    (frame,), (further,) = one.keyframes, other.keyframes
    vertices, cells = len(frame.vertices), len(one.cells)
    points, groups = len(frame.net_points), len(one.groups)
    behind = {key: [vertices, vertices, groups, groups] for key in one.lines} | {"net": [points] * 2}
    return Content(
        f"{one.name}, {other.name}",
        (rows_joined([frame, further]),),
        np.concatenate([one.cells, shifted(other.cells, vertices)]),
        (*one.groups, *((name, start + cells, stop + cells) for name, start, stop in other.groups)),
        {name: np.concatenate([rows, other.lines[name] + behind[name]]) for name, rows in one.lines.items()},
        net_names=one.net_names + other.net_names,
        knots=np.concatenate([one.knots, other.knots]),
        knot_names=one.knot_names + other.knot_names,
        edges=np.concatenate([one.edges, other.edges]),
        edge_names=one.edge_names + other.edge_names,
        scalars={
            name: None if mine is None or theirs is None else np.concatenate([mine, theirs])
            for name in sorted(one.scalars.keys() & other.scalars.keys())
            for mine, theirs in [(one.scalars[name], other.scalars[name])]
        },
        remarks=tuple(dict.fromkeys(one.remarks + other.remarks)),
        thickness=one.thickness,
        quick=one.quick or other.quick,
    )


def sides(mesh: Mesh, groups: Sequence[tuple[str, int, int]], chord_error: float = 0.0) -> dict[str, IntArray]:
    """Return the lines of a mesh, each side once: borders and sharp edges, open sides, and folds within a group.

    At a fold it turns by more than 90 degrees where its normals say that it is smooth, by more than 150 at an edge. A
    triangle that is lower than the mesh is exact may stand upright, and is not a fold.
    """
    none = np.empty((0, 4), dtype=np.int64)
    if mesh.is_curve:
        return dict.fromkeys(("border", "open", "folds"), none) | {"net": none[:, :2]}
    group = np.repeat(np.arange(len(groups)), [stop - start for _, start, stop in groups])
    pairs, ends = adjacent(mesh.faces)
    first, second = pairs.T
    between = group[first] != group[second]
    size = float(np.abs(mesh.vertices - mesh.vertices.mean(axis=0)).max()) or 1.0
    one, two, three = ((mesh.vertices[mesh.faces[:, k]] - mesh.vertices[mesh.faces[:, k - 1]]) / size for k in range(3))
    areas = cross(two, three)
    longest = np.sqrt(np.maximum(dot(one, one), np.maximum(dot(two, two), dot(three, three))))
    flat = np.sqrt(dot(areas, areas)) <= chord_error / size * longest
    facing = unit(areas)
    # Both triangles have the normals of the edge's ends, so that the surface is smooth there: it turns back from 90°.
    smooth = np.ones(len(pairs), dtype=bool)
    for end in ends.T:
        rows = [mesh.normal_of[pair, (mesh.faces[pair] == end[:, None]).argmax(axis=1)] for pair in (first, second)]
        smooth &= rows[0] == rows[1]
    least = np.where(smooth, 0.0, math.cos(math.radians(150)))
    back = ~between & ~flat[pairs].any(axis=1) & (dot(facing[first], facing[second]) < least)
    lines = np.concatenate([ends, group[pairs]], axis=1)
    found = sides_of(mesh.faces)
    owner = group[found.open // 3]
    return {
        "border": lines[(between | ~smooth) & ~back],
        "open": np.column_stack([found.directed[found.open], owner, owner]),
        "folds": lines[back],
        "net": none[:, :2],
    }


def _wall(mesh: Mesh) -> dict[str, FloatArray | None]:
    """Return the thickness of the wall behind each vertex of a mesh, if it is closed; None if that takes too long."""
    if not mesh.is_curve and len(mesh.cells) > MAX_WALL_FACES:
        return {"wall": None}
    return {} if mesh.is_curve or (wall := wall_of_vertices(mesh)) is None else {"wall": wall}


def _keyframe(mesh: Mesh, points: FloatArray = NO_POINTS) -> Keyframe:
    return Keyframe(mesh.vertices, NO_POINTS if mesh.normals is None else mesh.normals, points)


def _tuple(numbers: ArrayLike) -> str:
    return f"({', '.join(f'{x:.6g}' for x in np.asarray(numbers).tolist())})"
