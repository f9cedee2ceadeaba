"""Pictures of curves, surfaces and meshes, and of control nets with them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.shading import facet_normals, filled_normals
from gtb_cli.models.model import Model
from gtb_cli.plots.look import Axes, Look, subscript
from gtb_cli.plots.net_lines import curve_path, is_flat, net_of
from gtb_cli.plots.palette import INK, LINE_COLOURS, NET, OPEN, line_style, patch_colour, rgb, scale_of
from gtb_cli.plots.scene import HIDDEN_STRENGTH, ShadedTriangles, View, plain, plane_view, space_views
from gtb_cli.tessellation.attributes import with_attributes
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.edges import edge_name, edge_points_at
from gtb_cli.theory.patch import Patch


def draw_curves(ax: Axes, curves: Sequence[Patch], look: Look, names: Sequence[str] = ()) -> None:
    """Draw curves, in the plane or in space, with control polygons and numbered points."""
    paths = [curve_path(curve) for curve in curves]
    controls = [curve.control_points for curve in curves]
    with_net = look.draws_net(len(curves))
    clouds = [*paths, *(controls if with_net else [])]
    if is_flat(controls):
        view = plane_view(ax, np.concatenate(clouds))
    else:
        (view,) = space_views([ax], look.camera, [None], clouds)
    if with_net:
        draw_net(view, curves, look)
    for k, path in enumerate(paths):
        colour, dashes = line_style(k)
        view.lines([path], colour=colour, width=1.8, dashes=dashes, order=4, label=names[k] if names else None)
    if names:
        ax.legend(frameon=False, fontsize=8, loc="best")
    view.triad()


def draw_surfaces(axes: Sequence[Axes], shapes: Sequence[Patch | Model], look: Look, *, stripes: bool = False) -> None:
    """Draw surfaces, or the patches of models, shaded by their exact normals, each on axes of its own.

    With `stripes` they reflect lamps, and only their open edges are drawn: a line would hide what a seam does to them.
    """
    surfaces = []
    for ax, shape in zip(axes, shapes, strict=True):
        fine = look.resolution or (16 if len(shape.patches) > 4 else 64) * (2 if stripes else 1)  # segments of an edge
        mesh = tessellate(shape, fine, parametrization="linear").split
        surface = replace(triangles_of(mesh, len(shape.patches)), stripes=stripes)
        surfaces.append(surface if look.curvature is None else _by_curvature(ax, shape, mesh, surface, look))
    with_net = bool(look.net) if stripes else look.draws_net(len(shapes[0].patches))
    points = [patch.control_points for shape in shapes for patch in shape.patches] if with_net else []
    for view, shape in zip(space_views(axes, look.camera, surfaces, points), shapes, strict=True):
        shared, free = borders(shape)
        if not stripes:
            view.lines(shared, width=0.9)
        if isinstance(shape, Model) and not stripes:
            view.lines(free, colour=OPEN, width=2.0, hidden=HIDDEN_STRENGTH, order=4)
        else:
            view.lines(free, width=1.2, hidden=HIDDEN_STRENGTH)
        if with_net:
            draw_net(view, shape.patches, look)
        if look.labels and not stripes:
            view.names([name for name, *_ in free_edges(shape)], [view.seen(path)[len(path) // 2, :2] for path in free])
        view.triad()


def draw_mesh(ax: Axes, mesh: Mesh, look: Look) -> None:
    """Draw a mesh: its segments, or its triangles and open sides."""
    surface = None if mesh.is_curve else triangles_of(with_normals(mesh).split, max(len(mesh.groups), 1))
    (view,) = space_views([ax], look.camera, [surface], [mesh.vertices])
    pairs = mesh.cells if mesh.is_curve else mesh.open_sides
    view.lines(list(mesh.vertices[pairs]), colour=LINE_COLOURS[0] if mesh.is_curve else INK, width=1.4)
    view.triad()


def triangles_of(mesh: Mesh, patches: int = 1) -> ShadedTriangles:
    """Return the surface of a mesh, with a colour for each patch."""
    colours = plain(len(mesh.cells))
    if patches > 1:
        for index, (_, start, stop) in enumerate(mesh.groups):
            colours[start:stop] = rgb(patch_colour(index))
    return ShadedTriangles(mesh.vertices, mesh.faces, mesh.normals, colours)


def with_normals(mesh: Mesh, *, smooth: bool = False) -> Mesh:
    """Return a mesh with normals or, without any, the means of its faces' normals; over sharp edges if `smooth`."""
    if mesh.normals is not None or mesh.is_curve:
        return mesh
    if not smooth:
        return replace(mesh, normals=lambda: facet_normals(mesh.vertices, mesh.faces))  # type: ignore[arg-type]
    return replace(mesh, normals=filled_normals(np.full_like(mesh.vertices, np.nan), mesh.vertices, mesh.faces))


def borders(shape: Patch | Model) -> tuple[list[FloatArray], list[FloatArray]]:
    """Return paths along edges that patches share, and along open edges, which are all edges of a single patch."""
    joints = shape.joints.shared if isinstance(shape, Model) else ()
    even = np.linspace(0, 1, 97)
    shared = [edge_points_at(shape.patches[k], edge, even) for k, edge in (joint.first for joint in joints)]
    return shared, [edge_points_at(patch, edge, even) for _, patch, edge in free_edges(shape)]


def free_edges(shape: Patch | Model) -> list[tuple[str, Patch, int]]:
    """Return the open edges, or all edges of a single patch, each with its name and patch."""
    if isinstance(shape, Patch):
        return [(f"edge {edge}", shape, edge) for edge in range(len(shape.domain.vertices))]
    return [(edge_name(shape.patches, ref), shape.patches[ref[0]], ref[1]) for ref in shape.joints.open]


def draw_net(view: View, patches: Sequence[Patch], look: Look) -> None:
    """Draw control points, numbered, and the net of the lifting or of a lattice."""
    net = [patch.control_points[list(pair)] for patch in patches for pair in net_of(patch)]
    view.lines(net, colour=NET, width=0.9, hidden=HIDDEN_STRENGTH, order=4)
    # Patches may share points, which are numbered once.
    numbered = dict.fromkeys((i, *place) for patch in patches for i, place in enumerate(patch.control_points.tolist()))
    spots = np.array(list(numbered))[:, 1:]
    few = look.numbers(len(spots)) and (look.labels or len(patches) == 1 or patches[0].dimension == 1)
    texts = [subscript("b", i) for i, *_ in numbered]
    view.points(spots, texts if few else (), edge=NET, size=4.5 if len(spots) < 100 else 2.5)


def _by_curvature(ax: Axes, shape: Patch | Model, mesh: Mesh, surface: ShadedTriangles, look: Look) -> ShadedTriangles:
    """Return a surface coloured by its curvature, clipped to a scale, which is drawn beside it."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    name = f"{look.curvature}_curvature"
    values = with_attributes(shape, mesh, [name], "linear")[0].attributes[name]
    colour_map = look.colours or "PuOr"
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
