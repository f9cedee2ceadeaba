"""Pictures in Python: on axes of matplotlib, and in notebooks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gtb_cli.errors import DomainError
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.pictures.content import Content, content_of, content_of_mesh
from gtb_cli.pictures.figures import axes_for, default_picture, draw_on
from gtb_cli.pictures.look import Look, empty_figure, settings
from gtb_cli.pictures.page import frame_of, page_of
from gtb_cli.pictures.sequences import (
    default_resolution,
    default_values,
    figure_of_distances,
    figure_of_frames,
    frames_of_degeneration,
)
from gtb_cli.theory.model import Model
from gtb_cli.theory.patch import Patch

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot(thing: Patch | Model | Mesh, ax: Axes | None = None, what: str | None = None, **options: Any) -> Axes:
    """Draw a patch, a model or a mesh with matplotlib.

    Parameters
    ----------
    thing : Patch, Model or Mesh
    ax : matplotlib.axes.Axes, optional
        Where to draw. Default: axes of a new figure, ``ax.figure``, without a window. Axes of a surface get limits and
        an aspect that suit it, and show no numbers; they are not axes of `mpl_toolkits.mplot3d`.
    what : {"curve", "surface", "basis", "domain", "decomposition", "sequence", "distance"}, optional
        Default: a curve or a surface. The basis of a surface is several pictures, which only `gtb plot` draws. A
        "sequence" is the degeneration by the patch's lifting, "distance" that from its limit: each makes a figure, and
        the first of its axes are returned.
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
    if what in ("sequence", "distance") and not isinstance(thing, Mesh):
        return _limit(thing, ax, what, look)
    with settings():
        what = what or default_picture(thing)
        ax = axes_for(empty_figure(look), thing, what, look) if ax is None else ax
        draw_on(ax, thing, what, look)
        return ax


def _limit(thing: Patch | Model, ax: Axes | None, what: str, look: Look) -> Axes:
    """Draw the degeneration of a patch by its lifting, or the distances from the limit, in a figure of its own."""
    if not isinstance(thing, Patch):
        raise DomainError(f"what: a {what} is of one patch, and this is a model of {len(thing.patches)}")
    if ax is not None:
        raise DomainError(f"ax: a {what} makes a figure of its own")
    resolution = look.resolution or default_resolution(thing.dimension)
    far = what == "distance"
    frames = frames_of_degeneration(thing, default_values(what)[0], None, resolution, distances=far)
    return (figure_of_distances if far else figure_of_frames)(frames, look).axes[0]


def page(thing: Patch | Model | Mesh) -> str:
    """Return HTML of a page that shows a patch, a model or a mesh in a browser, without a network: see `gtb view`."""
    return page_of(_content(thing))


def frame(thing: Patch | Model | Mesh) -> str:
    """Return HTML of a frame with such a page, for a notebook."""
    return frame_of(_content(thing))


def _content(thing: Patch | Model | Mesh) -> Content:
    return content_of_mesh(thing, thing.name) if isinstance(thing, Mesh) else content_of(thing)
