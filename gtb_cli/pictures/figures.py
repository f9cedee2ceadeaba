"""Figures of `gtb plot`, one for each value of its --what, and `plot` in Python."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from gtb_cli.errors import DomainError
from gtb_cli.knots.decomposition import regular_decomposition
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.pictures.look import Look, empty_figure, settings, whole, with_numbers
from gtb_cli.pictures.nets import is_flat
from gtb_cli.pictures.planar import draw_basis, draw_curves, draw_decomposition, draw_domain
from gtb_cli.pictures.sequences import (
    default_resolution,
    default_values,
    figure_of_frames,
    frames_of_degeneration,
)
from gtb_cli.pictures.solid import draw_bases, draw_lifted, draw_mesh, draw_space_curves, draw_surface
from gtb_cli.theory.degeneration import lifting_of
from gtb_cli.theory.model import Model
from gtb_cli.theory.patch import Patch

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


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
        ``size`` (width and height in inches), ``dpi``, ``camera`` (azimuth and elevation in degrees), ``labels`` and
        ``net`` (bool), ``curvature`` ("gaussian" or "mean"), ``colour_map``, ``isolines`` (their number),
        ``indices`` (of basis functions), ``unnormalised``, ``lifted`` (bool), ``resolution``.

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
        ax = _axes_for(empty_figure(look), thing, what, look) if ax is None else ax
        _draw_on(ax, thing, what, look)
        return ax


def _limit(thing: Patch | Model, ax: Axes | None, what: str, look: Look) -> Axes:
    """Draw the degeneration of a patch by its lifting, or the distances from the limit, in a figure of its own."""
    if not isinstance(thing, Patch):
        raise DomainError(f"what: a {what} is of one patch, and this is a model of {len(thing.patches)}")
    if ax is not None:
        raise DomainError(f"ax: a {what} makes a figure of its own")
    resolution = look.resolution or default_resolution(thing.dimension)
    xs = default_values(what)[0]
    frames = frames_of_degeneration(thing, xs, None, resolution, distances=what == "distance")
    return figure_of_frames(frames, what, look).axes[0]


def figure_of(shape: Patch | Model, what: str, look: Look, *, lifting: ArrayLike | None = None) -> Figure:
    """Draw a spec; `lifting` is (n,) for a decomposition, instead of the patch's own.

    Raises a `DomainError` if the picture does not fit the shape, such as a surface picture of a curve.
    """
    with settings():
        figure = empty_figure(look)
        if what == "basis" and isinstance(shape, Patch) and shape.dimension == 2:
            draw_bases(figure, shape, look)
        else:
            _draw_on(_axes_for(figure, shape, what, look), shape, what, look, lifting=lifting)
        return figure


def _axes_for(figure: Figure, thing: Patch | Model | Mesh, what: str, look: Look) -> Axes:
    """Return axes that suit a picture: with room for numbers, or over the whole figure."""
    in_space = what in ("mesh", "surface") or (what == "curve" and not _is_plane(thing))
    in_space |= what == "decomposition" and look.lifted and isinstance(thing, Patch) and thing.dimension == 2
    return whole(figure) if in_space else with_numbers(figure)


def _draw_on(ax: Axes, thing: Patch | Model | Mesh, what: str, look: Look, *, lifting: ArrayLike | None = None) -> None:
    """Draw a spec on axes, as `figure_of` does, or a mesh; the basis of a surface needs a figure."""
    if look.indices and what != "basis":
        raise DomainError(f"indices: are of basis functions, and this is a picture of a {what}")
    if isinstance(thing, Mesh):
        if what != "mesh":
            raise DomainError(f"what: a mesh has one picture, and none is called {what!r}")
        draw_mesh(ax, thing, look)
    elif what in ("curve", "surface"):
        kind = default_picture(thing)
        if kind != what:
            raise DomainError(f"is a {kind}, and has no picture as a {what}: expected `what` {kind}")
        if _is_plane(thing):
            draw_curves(ax, thing.patches, look)
        elif kind == "curve":
            draw_space_curves(ax, thing.patches, look)
        else:
            draw_surface(ax, thing, look)
    elif what not in ("domain", "basis", "decomposition"):
        raise DomainError(
            f"what: expected curve, surface, basis, domain, decomposition, sequence or distance, got {what!r}"
        )
    elif isinstance(thing, Model):
        raise DomainError(f"is a model of {len(thing.patches)} patches, and `what` {what} is for one")
    elif what == "domain":
        draw_domain(ax, thing, look)
    elif what == "basis":
        if thing.dimension == 2:
            raise DomainError("a basis of a surface is several pictures, and needs a figure, not axes")
        draw_basis(ax, [thing], look)
    else:
        found = regular_decomposition(thing.knots, lifting_of(thing, lifting))
        if look.lifted and thing.dimension == 2:
            draw_lifted(ax, found, look)
        else:
            draw_decomposition(ax, found, look)


def figure_of_variants(variants: Sequence[Patch], names: Sequence[str], what: str, look: Look) -> Figure:
    """Draw variants of a curve, or their basis functions, in one picture."""
    if variants[0].dimension == 2:
        raise DomainError("variants are drawn of a curve, or of its basis; this is a surface")
    with settings():
        figure = empty_figure(look)
        ax = with_numbers(figure)
        if what == "basis":
            draw_basis(ax, variants, look, names)
        elif what == "curve" and is_flat([variant.control_points for variant in variants]):
            draw_curves(ax, variants, look, names)
        else:
            raise DomainError("variants are drawn of a curve in the plane, or of its basis")
        return figure


def default_picture(thing: Patch | Model | Mesh) -> str:
    """Return what is drawn by default: a curve, a surface or a mesh."""
    return "mesh" if isinstance(thing, Mesh) else "curve" if thing.dimension == 1 else "surface"


def _is_plane(thing: Patch | Model | Mesh) -> bool:
    """Tell whether it is a curve in a plane of constant height, or several."""
    if isinstance(thing, Mesh) or thing.dimension == 2:
        return False
    return is_flat([patch.control_points for patch in thing.patches])
