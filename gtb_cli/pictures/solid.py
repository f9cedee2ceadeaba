"""Pictures in space: surfaces, bases of surfaces as graphs over Δ, and lifted knots with their upper hull."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from gtb_cli.arrays import FloatArray, bounds_of
from gtb_cli.knots.decomposition import RegularDecomposition
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.shading import facet_normals, filled_normals
from gtb_cli.pictures.colours import FAINT, INK, LINE_COLOURS, NET, OPEN, line_style, patch_colour, rgb, scale_of
from gtb_cli.pictures.look import Look, panels, subscript
from gtb_cli.pictures.nets import boundary_paths, curve_path, edge_path, isoparametric_paths, net_of
from gtb_cli.pictures.planar import HALO, basis_values, chosen, note
from gtb_cli.pictures.scene import Surface, View, plain, views
from gtb_cli.tessellation.attributes import with_attributes
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.model import Model
from gtb_cli.theory.patch import Patch

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

GRAPH_HEIGHT = 0.62  # height of a graph relative to the width of Δ
HIDDEN_STRENGTH = 0.3  # opacity of what is behind a surface


def draw_surface(ax: Axes, shape: Patch | Model, look: Look) -> None:
    """Draw a surface, or the patches of a model, shaded by its exact normals."""
    parameter_lines = "#1F3A52"
    patches = shape.patches
    fine = look.resolution or (16 if len(patches) > 4 else 64)  # segments of each edge
    mesh = tessellate(shape, fine, parametrization="linear").split
    surface = surface_of(mesh, len(patches))
    if look.curvature is not None:
        surface = _by_curvature(ax, shape, mesh, surface, look)
    with_net = look.draws_net(len(patches))
    points = [patch.control_points for patch in patches] if with_net else []
    (view,) = views([ax], look.camera, [surface], points)
    for patch in patches if look.isolines else ():
        paths = isoparametric_paths(patch, look.isolines)
        view.lines(paths, colour=parameter_lines, width=0.6)
    shared, free = borders(shape)
    view.lines(shared, width=0.9)
    if isinstance(shape, Model):
        view.lines(free, colour=OPEN, width=2.0, hidden=HIDDEN_STRENGTH, order=4)
    else:
        view.lines(free, width=1.2, hidden=HIDDEN_STRENGTH)
    if with_net:
        draw_net(view, patches, look)
    view.triad()


def draw_mesh(ax: Axes, mesh: Mesh, look: Look) -> None:
    """Draw a mesh: its segments, or its triangles and open sides."""
    surface = None if mesh.is_curve else surface_of(with_normals(mesh).split, max(len(mesh.groups), 1))
    (view,) = views([ax], look.camera, [surface], [mesh.vertices])
    pairs = mesh.cells if mesh.is_curve else mesh.open_sides
    view.lines(list(mesh.vertices[pairs]), colour=LINE_COLOURS[0] if mesh.is_curve else INK, width=1.4)
    view.triad()


def surface_of(mesh: Mesh, patches: int = 1) -> Surface:
    """Return the surface of a mesh, with a colour for each patch."""
    colours = plain(len(mesh.cells))
    if patches > 1:
        for index, (_, start, stop) in enumerate(mesh.groups):
            colours[start:stop] = rgb(patch_colour(index))
    return Surface(mesh.vertices, mesh.faces, mesh.normals, colours)


def with_normals(mesh: Mesh, *, smooth: bool = False) -> Mesh:
    """Return a mesh with normals: a mesh from a file has none, and gets the means of its faces' normals.

    Faces that meet at a sharp edge have different means, unless the mesh is of a `smooth` surface.
    """
    if mesh.normals is not None or mesh.is_curve:
        return mesh
    if not smooth:
        return replace(mesh, normals=lambda: facet_normals(mesh.vertices, mesh.faces))  # type: ignore[arg-type]
    return replace(mesh, normals=filled_normals(np.full_like(mesh.vertices, np.nan), mesh.vertices, mesh.faces))


def borders(shape: Patch | Model) -> tuple[list[FloatArray], list[FloatArray]]:
    """Return paths along edges that patches share, and along open edges, which are all edges of a single patch."""
    if isinstance(shape, Patch):
        return [], boundary_paths(shape)
    joints = shape.joints
    shared = [edge_path(shape.patches[k], edge) for k, edge in (joint.first for joint in joints.shared)]
    return shared, [edge_path(shape.patches[k], edge) for k, edge in joints.open]


def draw_net(view: View, patches: Sequence[Patch], look: Look) -> None:
    """Draw control points, numbered, and the lines between them."""
    for patch in patches:
        net = list(patch.control_points[net_of(patch)])
        view.lines(net, colour=NET, width=0.9, hidden=HIDDEN_STRENGTH, order=4)
    spots = np.concatenate([patch.control_points for patch in patches])
    texts = [subscript("b", i) for patch in patches for i in range(len(patch.knots))]
    few = len(patches) == 1 and look.numbers(len(spots))
    view.points(spots, texts if few or look.labels else (), edge=NET, size=4.5 if len(spots) < 100 else 2.5)


def _by_curvature(ax: Axes, shape: Patch | Model, mesh: Mesh, surface: Surface, look: Look) -> Surface:
    """Return a surface coloured by its curvature, and draw the scale beside it.

    Values beyond the ends of the scale have the colours of these.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    name = f"{look.curvature}_curvature"
    values = with_attributes(shape, mesh, [name], "linear")[0].attributes[name]
    colour_map = look.colour_map or "PuOr"
    low, high = scale_of(values, colour_map)
    figure = ax.get_figure()
    assert figure is not None
    x, y, width, height = ax.get_position().bounds
    room = min(0.9 * figure.dpi / figure.bbox.width, 0.5 * width)  # of 0.9 inches
    ax.set_position((x, y, width - room, height))
    place = figure.add_axes((x + width - 0.92 * room, y + 0.16 * height, 0.13 * room, 0.62 * height))
    bar = figure.colorbar(ScalarMappable(Normalize(low, high), colour_map), cax=place, extend="both")
    place.set_title(f"{look.curvature}\ncurvature", fontsize=8, loc="left", pad=8)
    bar.outline.set_linewidth(0.5)
    return replace(surface, scalars=((values - low) / (high - low)).clip(0, 1), colour_map=colour_map)


def draw_space_curves(ax: Axes, curves: Sequence[Patch], look: Look) -> None:
    """Draw curves in space, with control polygons and numbered points."""
    paths = [curve_path(curve) for curve in curves]
    with_net = look.draws_net(len(curves))
    points = [curve.control_points for curve in curves] if with_net else []
    (view,) = views([ax], look.camera, [None], [*paths, *points])
    for k, path in enumerate(paths):
        colour, dashes = line_style(k)
        view.lines([path], colour=colour, width=1.9, dashes=dashes, order=4)
    if with_net:
        draw_net(view, curves, look)
    view.triad()


def draw_bases(figure: Figure, patch: Patch, look: Look) -> None:
    """Draw basis functions of a surface as graphs over Δ, each with a scale of its own, from 0 to its maximum."""
    indices = chosen(look, patch)
    symbol = "β" if look.unnormalised else "T"
    flat = Patch(patch.knots, patch.knots, patch.weights, patch.coefficients, log_weights=patch.log_weights)
    fine = look.resolution or (64 if len(indices) <= 4 else 48)
    fine = min(fine, math.ceil(max(look.size) * look.dpi / math.sqrt(len(indices))))  # a pixel is enough for a segment
    mesh = tessellate(flat, fine, parametrization="toric", normals=False)
    assert mesh.parameters is not None
    rim = _rim(patch)
    places = (mesh.parameters, patch.domain.vertices, patch.knots, rim)
    plane, corners, knots, edge = ((place - patch.domain.center) / patch.domain.size for place in places)
    values = basis_values(patch, mesh.parameters, look.unnormalised)[:, list(indices)]
    colour_map = look.colour_map or "viridis"
    highest = np.where(values.max(axis=0) > 0, values.max(axis=0), 1.0)
    surfaces = []
    for column in (values / highest).T:
        graph = with_normals(Mesh(np.column_stack([plane, GRAPH_HEIGHT * column]), mesh.faces), smooth=True)
        surfaces.append(replace(surface_of(graph), scalars=column.clip(0, 1), colour_map=colour_map))
    floor = np.column_stack([corners, np.zeros(len(corners))])
    box = np.concatenate([floor, floor + np.array([0, 0, GRAPH_HEIGHT])])
    names = [f"{subscript(symbol, i)}, up to {top:.3g}" for i, top in zip(indices, values.max(axis=0), strict=True)]
    rim_heights = GRAPH_HEIGHT * basis_values(patch, rim, look.unnormalised)[:, list(indices)] / highest
    drawn = views(panels(figure, names), look.camera, surfaces, [box])
    for view, index, above in zip(drawn, indices, rim_heights.T, strict=True):
        view.lines([np.vstack([floor, floor[:1]])], colour=FAINT, width=0.7, hidden=0.6)
        view.lines([np.column_stack([edge, above])], width=0.8, hidden=HIDDEN_STRENGTH)
        spots = np.column_stack([knots, np.zeros(len(knots))])
        view.points(np.delete(spots, index, axis=0), edge=FAINT, size=2.6)
        view.points(spots[[index]], colour=INK, edge="white", size=4.2)


def _rim(patch: Patch) -> FloatArray:
    """(m, 2) parameters around Δ."""
    corners = patch.domain.vertices
    share = (1 - np.cos(np.linspace(0, np.pi, 65)[:-1, None])) / 2
    ends = zip(corners, np.roll(corners, -1, axis=0), strict=True)
    return np.concatenate([*(a + (b - a) * share for a, b in ends), corners[:1]])


def draw_lifted(ax: Axes, found: RegularDecomposition, look: Look) -> None:
    """Draw the upper hull of the lifted knots above the cells, which are its projection."""
    low, high = bounds_of(found.knots)
    flat = (found.knots - (low + high) / 2) / float((high - low).max())
    rise = float(np.ptp(found.lifting)) or 1.0
    domain_gap = 0.4  # distance of Δ below the lowest lifted knot, relative to the width of Δ
    heights = domain_gap + GRAPH_HEIGHT * (found.lifting - found.lifting.min()) / rise
    lifted, ground = np.column_stack([flat, heights]), np.column_stack([flat, np.zeros(len(flat))])
    fans = [[(p[0], p[k], p[k + 1]) for k in range(1, len(p) - 1)] for p in found.polygons]
    upper = np.array([face for fan in fans for face in fan])
    cell = np.repeat(np.arange(len(fans)), [len(fan) for fan in fans])
    colours = np.array([rgb(patch_colour(k)) for k in cell.tolist()])
    vertices = np.concatenate([lifted, ground])
    faces = np.concatenate([upper, upper + len(lifted)])
    (view,) = views([ax], look.camera, [Surface(vertices, faces, None, np.concatenate([colours, colours]))])
    absent = np.isin(np.arange(len(flat)), found.absent)
    heights_above = [f"λ={value:.4g}" for value in found.lifting]
    names_below = [subscript("a", i) for i in range(len(flat))]
    for level, strength, texts, side, colour in (
        (lifted, 1.2, heights_above, "bottom", INK),
        (ground, 0.9, names_below, "top", LINE_COLOURS[0]),
    ):
        loops = [level[[*polygon, polygon[0]]] for polygon in found.polygons]
        view.lines(loops, width=strength, hidden=HIDDEN_STRENGTH)
        view.points(level[~absent], colour=INK, edge="white", size=5)
        view.points(level[absent], edge=INK, size=5.5)
        for place, text in zip(view.seen(level)[:, :2], texts if look.numbers(len(flat)) else (), strict=False):
            up = 6 if side == "bottom" else -6
            note(ax, text, place, (0, up), bbox={**HALO, "alpha": 0.7}, va=side, color=colour)
    posts = [np.stack([below, above]) for below, above in zip(ground, lifted, strict=True)]
    view.lines(posts, colour=FAINT, width=0.8, hidden=0.7)
