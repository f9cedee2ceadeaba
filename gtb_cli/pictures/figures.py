"""Figures of `gtb plot`, one for each value of its --what, and `plot` in Python."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from gtb_cli.errors import DomainError
from gtb_cli.knots.decomposition import regular_decomposition
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.pictures.bases import draw_bases, draw_basis
from gtb_cli.pictures.domains import draw_decomposition, draw_domain, draw_lifted
from gtb_cli.pictures.look import Look, empty_figure, settings, whole, with_numbers
from gtb_cli.pictures.nets import is_flat
from gtb_cli.pictures.plates import draw_all_decompositions
from gtb_cli.pictures.sequences import default_resolution, default_values, figure_of_frames, frames_of_degeneration
from gtb_cli.pictures.shapes import draw_curves, draw_mesh, draw_surface
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
    what : {"curve", "surface", "basis", "domain", "decomposition", "decompositions", "sequence", "distance"}, optional
        Default: a curve or a surface. A "sequence" is the degeneration by the patch's lifting, "distance" that from its
        limit, and "decompositions" are all regular ones. They, and the "basis" of a surface, make a figure, the first
        of whose axes are returned.
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
    look, what = Look(**options), what or default_picture(thing)
    if ax is None:
        return figure_of(thing, what, look).axes[0]
    if what in ("decompositions", "sequence", "distance") or (what == "basis" and _is_surface(thing)):
        raise DomainError(f"ax: {what!r} makes a figure of its own")
    with settings():
        _draw_on(ax, thing, what, look)
        return ax


def figure_of(thing: Patch | Model | Mesh, what: str, look: Look, *, lifting: ArrayLike | None = None) -> Figure:
    """Draw a spec or a mesh; `lifting` is (n,) for a decomposition, instead of the patch's own.

    Raises a `DomainError` if the picture does not fit the shape, such as a surface picture of a curve.
    """
    if what in ("sequence", "distance") and isinstance(thing, Patch):
        resolution = look.resolution or default_resolution(thing.dimension)
        xs = default_values(what)[0]
        frames = frames_of_degeneration(thing, xs, lifting, resolution, distances=what == "distance")
        return figure_of_frames(frames, what, look)
    with settings():
        figure = empty_figure(look)
        if what == "basis" and isinstance(thing, Patch) and thing.dimension == 2:
            draw_bases(figure, thing, look)
            return figure
        if what == "decompositions" and isinstance(thing, Patch):
            draw_all_decompositions(figure, thing)
            return figure
        in_space = what in ("mesh", "surface") or (what == "curve" and not _is_plane(thing))
        in_space |= what == "decomposition" and look.lifted and _is_surface(thing)
        _draw_on(whole(figure) if in_space else with_numbers(figure), thing, what, look, lifting)
        return figure


def _draw_on(ax: Axes, thing: Patch | Model | Mesh, what: str, look: Look, lifting: ArrayLike | None = None) -> None:
    """Draw a spec or a mesh on axes; what makes a figure of its own is drawn by `figure_of`."""
    kind, kinds = default_picture(thing), ("curve", "surface", "basis", "domain", "decomposition", "decompositions")
    if look.indices and what != "basis":
        raise DomainError(f"indices: are of basis functions, and this is a picture of a {what}")
    if isinstance(thing, Mesh):
        if what != "mesh":
            raise DomainError(f"what: a mesh has one picture, and none is called {what!r}")
        draw_mesh(ax, thing, look)
        return
    if what not in (*kinds, "sequence", "distance"):
        raise DomainError(f"what: expected {', '.join(kinds)}, sequence or distance, got {what!r}")
    if what in ("curve", "surface"):
        if kind != what:
            raise DomainError(f"is a {kind}, and has no picture as a {what}: expected `what` {kind}")
        if kind == "curve":
            draw_curves(ax, thing.patches, look)
        else:
            draw_surface(ax, thing, look)
    elif isinstance(thing, Model):
        raise DomainError(f"is a model of {len(thing.patches)} patches, and `what` {what} is for one")
    elif what == "domain":
        draw_domain(ax, thing, look)
    elif what == "basis":
        draw_basis(ax, [thing], look)
    else:
        draw = draw_lifted if look.lifted and thing.dimension == 2 else draw_decomposition
        draw(ax, regular_decomposition(thing.knots, lifting_of(thing, lifting)), look)


def figure_of_variants(variants: Sequence[Patch], names: Sequence[str], what: str, look: Look) -> Figure:
    """Draw variants of a curve, or their basis functions, in one picture."""
    if variants[0].dimension == 2:
        raise DomainError("variants are drawn of a curve, or of its basis; this is a surface")
    with settings():
        figure = empty_figure(look)
        ax = with_numbers(figure)
        if what == "basis":
            draw_basis(ax, variants, look, names)
        else:
            draw_curves(ax, variants, look, names)
        return figure


def default_picture(thing: Patch | Model | Mesh) -> str:
    """Return what is drawn by default: a curve, a surface or a mesh."""
    return "mesh" if isinstance(thing, Mesh) else "curve" if thing.dimension == 1 else "surface"


def _is_surface(thing: Patch | Model | Mesh) -> bool:
    return not isinstance(thing, Mesh) and thing.dimension == 2


def _is_plane(thing: Patch | Model | Mesh) -> bool:
    """Tell whether it is a curve in a plane of constant height, or several."""
    curve = not isinstance(thing, Mesh) and thing.dimension == 1
    return curve and is_flat([patch.control_points for patch in thing.patches])
