"""Pictures in Python: on axes of matplotlib, and in notebooks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gtb_cli.errors import DomainError
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.pictures.look import Look, empty_figure, settings, whole
from gtb_cli.theory.model import Model
from gtb_cli.theory.patch import Patch

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from gtb_cli.pictures.content import Content


def plot(thing: Patch | Model | Mesh, ax: Axes | None = None, what: str | None = None, **options: Any) -> Axes:
    """Draw a patch, a model or a mesh with matplotlib.

    Parameters
    ----------
    thing : Patch, Model or Mesh
    ax : matplotlib.axes.Axes, optional
        Where to draw. Default: axes of a new figure, ``ax.figure``, without a window. Axes of a surface get limits and
        an aspect that suit it, and show no numbers; they are not axes of `mpl_toolkits.mplot3d`.
    what : {"curve", "surface", "basis", "domain", "decomposition"}, optional
        Default: a curve or a surface. The basis of a surface is several pictures, which only `gtb plot` draws.
    **options
        Attributes of `gtb_cli.pictures.look.Look`.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    DomainError
        An option is unknown, or `what` does not fit.
    ExportError
        matplotlib is not installed.
    """
    unknown = sorted(options.keys() - Look.__dataclass_fields__.keys())
    if unknown:
        raise DomainError(f"options: expected some of {', '.join(Look.__dataclass_fields__)}, got {unknown[0]!r}")
    look = Look(**options)
    with settings():
        if isinstance(thing, Mesh):
            if what is not None:
                raise DomainError(f"what: a mesh has one picture, and none is called {what!r}")
            return _plot_mesh(thing, ax, look)
        from gtb_cli.pictures.figures import axes_for, default_picture, draw_on

        what = what or default_picture(thing)
        ax = axes_for(empty_figure(look), thing, what, look) if ax is None else ax
        draw_on(ax, thing, what, look)
        return ax


def _plot_mesh(mesh: Mesh, ax: Axes | None, look: Look) -> Axes:
    from gtb_cli.pictures.colours import INK, LINE_COLOURS
    from gtb_cli.pictures.scene import draw, lines, scene_of, triad
    from gtb_cli.pictures.sequences import with_normals
    from gtb_cli.pictures.solid import surface_of

    ax = whole(empty_figure(look)) if ax is None else ax
    surface = None if mesh.is_curve else surface_of(with_normals(mesh), max(len(mesh.groups), 1))
    scene = scene_of(look.camera, surface, [mesh.vertices])
    raster = draw(ax, scene)
    pairs = mesh.cells if mesh.is_curve else mesh.open_sides
    lines(ax, scene, raster, list(mesh.vertices[pairs]), colour=LINE_COLOURS[0] if mesh.is_curve else INK, width=1.4)
    triad(ax, look.camera)
    return ax


def page(thing: Patch | Model | Mesh) -> str:
    """Return HTML of a page that shows a patch, a model or a mesh in a browser, without a network: see `gtb view`."""
    from gtb_cli.pictures.page import page_of

    return page_of(_content(thing))


def frame(thing: Patch | Model | Mesh) -> str:
    """Return HTML of a frame with such a page, for a notebook."""
    from gtb_cli.pictures.page import frame_of

    return frame_of(_content(thing))


def _content(thing: Patch | Model | Mesh) -> Content:
    from gtb_cli.pictures.content import content_of, content_of_mesh

    return content_of_mesh(thing, thing.name) if isinstance(thing, Mesh) else content_of(thing)
