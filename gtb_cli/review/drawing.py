"""Pictures of what changed, for comments and print: old, new, and one of them coloured by its distance."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.plots.look import Camera, Look, empty_figure, encoded, panels, settings
from gtb_cli.plots.palette import LINE_COLOURS
from gtb_cli.plots.scene import HIDDEN_STRENGTH, ShadedTriangles, plain, space_views
from gtb_cli.plots.shape_figures import with_normals
from gtb_cli.review.changes import Change
from gtb_cli.vocabulary import PATCH_COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOUR_MAP = "viridis"


@dataclass(frozen=True)
class Panel:
    """A mesh, in the frame of its side, and what colours it."""

    title: str
    mesh: Mesh
    number: int  # of its side: 0 is old, 1 is new
    is_whole: bool  # the mesh is neither simplified nor divided, so that its open sides are those of the file
    values: FloatArray | None = None  # (m,) at its vertices, from 0 to 1
    top: float = 0.0  # the distance of which 1 stands


def drawing(change: Change) -> bytes:
    """Return a PNG of a change that has frames, all of which is under one camera."""
    found = _panels(change)
    with settings():
        figure = empty_figure(Look(size=(3.6 * len(found), 3.7), dpi=100))
        axes = panels(figure, [panel.title for panel in found])
        for ax, panel in zip(axes, found, strict=True):
            x, y, width, height = ax.get_position().bounds
            ax.set_position((x, y + 0.1, width, height - 0.1))
            if panel.top:
                _draw_scale(figure.add_axes((x + 0.25 * width, y + 0.06, 0.5 * width, 0.03)), panel.top)
        surfaces = [None if panel.mesh.is_curve else _surface(panel) for panel in found]
        views = space_views(axes, Camera(), surfaces, [panel.mesh.vertices for panel in found])
        for view, panel in zip(views, found, strict=True):
            mesh = panel.mesh
            if not mesh.is_curve and panel.is_whole:
                view.lines(list(mesh.vertices[mesh.open_sides]), width=0.9, hidden=HIDDEN_STRENGTH)
            for segments, colour in _coloured_segments(panel) if mesh.is_curve else ():
                view.lines(segments, colour=colour, width=1.8)
        views[0].triad()
        return encoded(figure, "png")


def _panels(change: Change) -> list[Panel]:
    assert change.frames is not None
    plain_panels, coloured = [], []
    is_alone = change.frames[0] is not change.frames[1]
    for k, (side, frame) in enumerate(zip((change.old, change.new), change.frames, strict=True)):
        if side is None or side.mesh is None:
            continue
        vertices = frame.inside(side.mesh.vertices)
        if is_alone:
            vertices = vertices / (np.abs(vertices).max() or 1.0)
        mesh = replace(side.mesh, vertices=vertices)
        name, other = ("old", "new") if k == 0 else ("new", "old")
        panel = Panel(f"{name}, at its own scale" if is_alone else name, mesh, k, side.faces == len(mesh.cells))
        plain_panels.append(panel)
        if side.turned is not None:
            title, values, top = f"{name}, around faces that are turned over", side.turned.astype(np.float64), 0.0
        elif side.distances is not None and change.found is not None:
            title, top = f"{name}, by its distance from {other}", change.found.distance
            values = (side.distances / top).clip(0, 1)
        else:
            continue
        coloured.append(replace(panel, title=title, values=values, top=top))
    return plain_panels + coloured


def _surface(panel: Panel) -> ShadedTriangles:
    attributes = {} if panel.values is None else {"value": panel.values}
    mesh = with_normals(replace(panel.mesh, attributes=attributes)).split
    colours = plain(len(mesh.faces), PATCH_COLOURS[panel.number])
    return ShadedTriangles(mesh.vertices, mesh.faces, mesh.normals, colours, mesh.attributes.get("value"), COLOUR_MAP)


def _coloured_segments(panel: Panel) -> list[tuple[list[FloatArray], str]]:
    """Return the segments of a curve by their colours, which are 32 where they are coloured by values."""
    ends = panel.mesh.vertices[panel.mesh.cells]
    if panel.values is None:
        return [(list(ends), LINE_COLOURS[panel.number])]
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    steps = 31
    step = np.rint(panel.values[panel.mesh.cells].mean(axis=1) * steps)
    colours = colormaps[COLOUR_MAP]
    return [(list(ends[step == k]), to_hex(colours(k / steps))) for k in np.unique(step)]


def _draw_scale(ax: Axes, top: float) -> None:
    """Draw which distances the colours stand for."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    figure = ax.get_figure()
    assert figure is not None
    colours = ScalarMappable(Normalize(0, top), COLOUR_MAP)
    bar = figure.colorbar(colours, cax=ax, orientation="horizontal", ticks=[0, top])
    bar.ax.set_xticklabels(["0", f"{top:.3g}"])
    bar.outline.set_linewidth(0.5)
