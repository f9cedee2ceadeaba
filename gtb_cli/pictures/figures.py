"""What `gtb plot` draws: a figure for each value of its --what."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from gtb_cli.errors import DomainError
from gtb_cli.pictures.look import Look, empty_figure, settings, whole, with_numbers
from gtb_cli.pictures.nets import is_flat
from gtb_cli.theory.model import Model
from gtb_cli.theory.patch import Patch

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def figure_of(shape: Patch | Model, what: str, look: Look, *, lifting: ArrayLike | None = None) -> Figure:
    """Draw a spec.

    Parameters
    ----------
    shape : Patch or Model
    what : {"curve", "surface", "basis", "domain", "decomposition"}
    look : Look
    lifting : (n,) float, optional
        Lifting for a decomposition, instead of the patch's own.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    DomainError
        The picture does not fit the shape, such as a surface picture of a curve.
    ExportError
        matplotlib is not installed.
    """
    with settings():
        figure = empty_figure(look)
        if what == "basis" and isinstance(shape, Patch) and shape.dimension == 2:
            from gtb_cli.pictures.solid import draw_bases

            draw_bases(figure, shape, look)
        else:
            draw_on(axes_for(figure, shape, what, look), shape, what, look, lifting=lifting)
        return figure


def axes_for(figure: Figure, shape: Patch | Model, what: str, look: Look) -> Axes:
    """Return axes that suit a picture: with room for numbers, or over the whole figure."""
    plane = (what == "curve" and _is_plane(shape)) or what in ("basis", "domain")
    plane |= what == "decomposition" and not (look.lifted and isinstance(shape, Patch) and shape.dimension == 2)
    return with_numbers(figure) if plane else whole(figure)


def draw_on(ax: Axes, shape: Patch | Model, what: str, look: Look, *, lifting: ArrayLike | None = None) -> None:
    """Draw a spec on axes, as `figure_of` does; the basis of a surface needs a figure."""
    if what in ("curve", "surface"):
        patches = _patches_of(shape, what)
        if what == "surface":
            from gtb_cli.pictures.solid import draw_surface

            draw_surface(ax, shape, look)
        elif _is_plane(shape):
            from gtb_cli.pictures.planar import draw_curves

            draw_curves(ax, patches, look)
        else:
            from gtb_cli.pictures.solid import draw_space_curves

            draw_space_curves(ax, patches, look)
        return
    patch = _single(shape, what)
    from gtb_cli.pictures.planar import draw_basis, draw_decomposition, draw_domain

    if what == "basis":
        if patch.dimension == 2:
            raise DomainError("a basis of a surface is several pictures, and needs a figure, not axes")
        draw_basis(ax, [patch], look)
    elif what == "domain":
        draw_domain(ax, patch, look)
    else:
        from gtb_cli.knots.decomposition import regular_decomposition
        from gtb_cli.theory.degeneration import lifting_of

        found = regular_decomposition(patch.knots, lifting_of(patch, lifting))
        if look.lifted and patch.dimension == 2:
            from gtb_cli.pictures.solid import draw_lifted

            draw_lifted(ax, found, look)
        else:
            draw_decomposition(ax, found, look)


def figure_of_variants(variants: Sequence[Patch], names: Sequence[str], what: str, look: Look) -> Figure:
    """Draw variants of a curve, or their basis functions, in one picture."""
    from gtb_cli.pictures.planar import draw_basis, draw_curves

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


def default_picture(shape: Patch | Model) -> str:
    """Return what is drawn by default: a curve or a surface."""
    return "curve" if shape.dimension == 1 else "surface"


def _patches_of(shape: Patch | Model, what: str) -> Sequence[Patch]:
    kind = default_picture(shape)
    if kind != what:
        raise DomainError(f"is a {kind}, and has no picture as a {what}: expected --what {kind}")
    return shape.patches


def _single(shape: Patch | Model, what: str) -> Patch:
    if isinstance(shape, Model):
        raise DomainError(f"is a model of {len(shape.patches)} patches, and --what {what} is for one")
    return shape


def _is_plane(shape: Patch | Model) -> bool:
    return shape.dimension == 1 and is_flat([patch.control_points for patch in shape.patches])
