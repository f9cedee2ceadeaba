"""Figures of `gtb plot`, one for each value of its --what, and `plot` in Python."""

import re
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from gtb_cli.errors import DomainError
from gtb_cli.knots.decomposition import regular_decomposition
from gtb_cli.language.spec_paths import SpecPath, loaded
from gtb_cli.limits.degeneration import heights_of
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.models.model import Model
from gtb_cli.plots.bases import draw_bases, draw_basis
from gtb_cli.plots.domains import draw_all_decompositions, draw_decomposition, draw_domain, draw_lifted
from gtb_cli.plots.look import Axes, AxesOf, Figure, Look, empty_figure, panels, settings, subscript, with_numbers
from gtb_cli.plots.net_lines import is_flat
from gtb_cli.plots.panels import Approach, Frames, default_values, figure_of_distances, figure_of_members
from gtb_cli.plots.shape_figures import draw_curves, draw_mesh, draw_surfaces
from gtb_cli.theory.patch import Patch
from gtb_cli.vocabulary import PLOT_KINDS, SHAPE_PICTURES


class Variation(NamedTuple):
    """A number of a patch that takes several values: ``getattr(patch, key)[knot]``, and the values as texts."""

    key: str
    knot: int
    values: tuple[float, ...]
    texts: tuple[str, ...]


class Picture(NamedTuple):
    """A request for a picture of a patch, a model or a mesh."""

    what: str
    look: Look
    approach: Approach
    vary: Variation | None = None


def plot(
    thing: Patch | Model | Mesh | SpecPath, ax: Axes | None = None, what: str | None = None, **options: Any
) -> Axes:
    """Draw a patch, a model or a mesh with matplotlib, as ``gtb plot`` does.

    Parameters
    ----------
    thing : Patch, Model or Mesh
    ax : matplotlib.axes.Axes, optional
        Where to draw. Default: axes of a new figure, ``ax.figure``, without a window. Axes of a surface get limits and
        an aspect that suit it, and show no numbers; they are not axes of `mpl_toolkits.mplot3d`.
    what : str, optional
        "curve", "surface", "stripes", "basis", "domain", "decomposition", "decompositions", "sequence" or "distance".
        Default: a curve or a surface, or with `x` or `merge` a "sequence". A sequence, the "distance" from its limit,
        all "decompositions", several functions of the "basis" of a surface and variants of a surface make a figure of
        their own, the first of whose axes are returned.
    **options
        Those of the command, by their names. ``size`` (width and height in inches), ``dpi``, ``camera`` (azimuth and
        elevation in degrees), ``stretch`` (three factors), ``labels`` and ``net`` (bool), ``curvature`` ("gaussian" or
        "mean"), ``colours`` (a map), ``index`` (of basis functions), ``unnormalised`` and ``lifted`` (bool),
        ``resolution``, ``vary`` (such as ``{"weights[2]": [1, 5, 25]}``). Of a sequence: ``x``,
        ``lifting`` ((n,) values, or the index of the knot whose weight grows), ``merge`` (``{3: 1}``: knot 3 moves to
        knot 1) and ``steps``.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    DomainError
        An option is unknown or for another picture, or `what` does not fit.
    ExportError
        matplotlib is not installed.
    """
    found: Patch | Model | Mesh = loaded(thing, Patch, Model, Mesh)
    picture = picture_of(found, what, options)
    if ax is None:
        return figure_of(found, picture).axes[0]
    if ax.name != "rectilinear":
        raise DomainError(f"ax: expected axes as of figure.add_subplot(), got {ax.name} axes")
    if makes_figure(found, picture):
        raise DomainError(f"ax: {picture.what!r} makes a figure of its own")
    with settings():
        _draw_on(lambda _: [ax], found, picture)
        return ax


def picture_of(thing: Patch | Model | Mesh, what: str | None, options: Mapping[str, Any]) -> Picture:
    """Return the request that options make; a `DomainError` says what is unknown, or does not fit."""
    rest = dict(options)
    approach = Approach(**{name: rest.pop(name) for name in Approach.__dataclass_fields__ if name in rest})
    vary = rest.pop("vary", None)
    known = [*Look.__dataclass_fields__, "stretch", "vary", *Approach.__dataclass_fields__]
    if unknown := sorted(rest.keys() - set(known)):
        raise DomainError(f"options: expected some of {', '.join(known)}, got {unknown[0]!r}")
    variation = vary if vary is None or isinstance(vary, Variation) else _variation_of(vary)
    what = what or ("sequence" if len(approach.x) or approach.merge else default_picture(thing))
    look = Look(**{name: value for name, value in rest.items() if name != "stretch"})
    camera = replace(look.camera, stretch=rest.get("stretch", look.camera.stretch))
    picture = Picture(what, replace(look, camera=camera), approach, variation)
    _check(thing, picture)
    return picture


def _variation_of(given: object) -> Variation:
    if isinstance(given, Mapping) and len(given) == 1:
        ((name, values),) = given.items()
        match = re.fullmatch(r"(knots|weights|coefficients)\[(\d+)\]", str(name))
        numbers = np.asarray(values, dtype=np.float64)
        if match and numbers.ndim == 1 and len(numbers):
            return Variation(match[1], int(match[2]), tuple(numbers.tolist()), tuple(f"{x:.6g}" for x in numbers))
    example = {"weights[2]": [1, 5, 25]}
    raise DomainError(f"`vary`: expected one number and its values, such as {example}, got {given!r}")


def _check(thing: Patch | Model | Mesh, picture: Picture) -> None:
    """Refuse options that are not for a picture, and pictures that a thing does not have."""
    what, look, approach, vary = picture
    kind = default_picture(thing)
    if what not in ((*PLOT_KINDS, "mesh") if isinstance(thing, Mesh) else PLOT_KINDS):
        raise DomainError(f"what: expected {', '.join(PLOT_KINDS[:-1])} or {PLOT_KINDS[-1]}, got {what!r}")
    if isinstance(thing, Mesh) and what != "mesh":
        raise DomainError(f"what: a mesh has one picture, and none is called {what!r}")
    for name, is_given in (("index", look.index), ("unnormalised", look.unnormalised)):
        if is_given and what != "basis":
            raise DomainError(f"`{name}` is for `what` basis, and this is {what}")
    for name in approach.given:
        if what not in ("sequence", "distance") and not (what == "decomposition" and name == "lifting"):
            cells_too = "decomposition, " if name == "lifting" else ""
            raise DomainError(f"`{name}` is for `what` {cells_too}sequence and distance")
    if what in SHAPE_PICTURES and (kind == "curve") != (what == "curve"):
        other = "surface" if kind == "curve" else "curve"
        raise DomainError(f"is a {kind}, and `what` {what} is for a {other}: expected `what` {kind}")
    if what not in SHAPE_PICTURES and isinstance(thing, Model):
        raise DomainError(f"is a model of {len(thing.patches)} patches, and `what` {what} is for one")
    if look.curvature is not None and what == "stripes":
        raise DomainError("`curvature` is for `what` surface, and this is stripes")
    if vary is not None and (what not in (*SHAPE_PICTURES, "basis") or not isinstance(thing, Patch)):
        raise DomainError("`vary` is for a single curve or surface, or its basis")


def makes_figure(thing: Patch | Model | Mesh, picture: Picture) -> bool:
    """Tell whether a picture has axes of its own."""
    if picture.what in ("decompositions", "sequence", "distance"):
        return True
    several = picture.what == "basis" and len(picture.look.index) != 1
    return default_picture(thing) == "surface" and (several or picture.vary is not None)


def figure_of(thing: Patch | Model | Mesh, picture: Picture) -> Figure:
    """Draw a spec or a mesh."""
    what, look = picture.what, picture.look
    if what in ("sequence", "distance"):
        frames = frames_of_picture(thing, picture)
        members = range(len(frames.meshes))
        return figure_of_distances(frames, look) if what == "distance" else figure_of_members(frames, members, look)
    with settings():
        figure = empty_figure(look)
        if what == "decompositions" and isinstance(thing, Patch):
            draw_all_decompositions(figure, thing)
        elif makes_figure(thing, picture):
            _draw_on(partial(panels, figure), thing, picture)
        else:
            in_space = what in ("mesh", "surface", "stripes")
            if what == "curve" and not isinstance(thing, Mesh):
                in_space = not is_flat([patch.control_points for patch in thing.patches])
            elif what == "basis" or (what == "decomposition" and look.lifted):
                in_space = default_picture(thing) == "surface"
            ax = figure.add_axes((0.0, 0.0, 1.0, 1.0)) if in_space else with_numbers(figure)
            _draw_on(lambda _: [ax], thing, picture)
        return figure


def frames_of_picture(thing: Patch | Model | Mesh, picture: Picture, kind: str | None = None) -> Frames:
    """Return the meshes of a sequence, its distances, or of the kind "animation"."""
    assert isinstance(thing, Patch)
    xs, steps = default_values(kind or picture.what)
    resolution = picture.look.resolution or (128 if thing.dimension == 1 else 24)  # segments of each edge of a cell
    return picture.approach.frames(thing, resolution, x=xs, steps=steps, distances=picture.what == "distance")


def _draw_on(axes_of: AxesOf, thing: Any, picture: Picture) -> None:
    """Draw a thing that has this picture, as `_check` has seen, on axes for some titles."""
    what, look, approach, vary = picture
    if isinstance(thing, Mesh):
        draw_mesh(axes_of([""])[0], thing, look)
        return
    variants, names = _variants(thing, vary) if vary else ([thing], [""])
    if vary and not look.index:
        look = replace(look, index=(vary.knot,))  # the function of the knot that varies
    if what in ("surface", "stripes"):
        draw_surfaces(axes_of(names), variants, look, stripes=what == "stripes")
    elif what == "curve":
        draw_curves(axes_of(names)[0], [curve for each in variants for curve in each.patches], look, names * bool(vary))
    elif what == "basis" and thing.dimension == 2:
        draw_bases(axes_of, variants, look, names)
    elif what == "basis":
        draw_basis(axes_of(names)[0], variants, look, names * bool(vary))
    elif what == "domain":
        draw_domain(axes_of(names)[0], thing, look)
    else:
        draw = draw_lifted if look.lifted and thing.dimension == 2 else draw_decomposition
        draw(axes_of(names)[0], regular_decomposition(thing.knots, heights_of(thing, approach.lifting)), look)


def _variants(patch: Patch, vary: Variation) -> tuple[list[Patch], list[str]]:
    """Return a patch with each value of a number, and names."""
    option = f"`vary` {vary.key}[{vary.knot}]"
    if vary.key == "knots" and patch.dimension == 2:
        raise DomainError(f"{option}: a knot of a surface is a point, and `merge` moves it")
    if vary.knot >= len(patch.knots):
        raise DomainError(f"{option}: expected an index below {len(patch.knots)}")
    numbers, varies = getattr(patch, vary.key).ravel(), np.arange(len(patch.knots)) == vary.knot
    variants = [patch.replace(**{vary.key: np.where(varies, value, numbers)}) for value in vary.values]
    symbol = subscript({"knots": "a", "weights": "ω", "coefficients": "c"}[vary.key], vary.knot)
    return variants, [re.sub(r"sqrt\((\d+)\)", r"√\1", f"{symbol} = {text}") for text in vary.texts]


def default_picture(thing: Patch | Model | Mesh) -> str:
    """Return what is drawn by default: a curve, a surface or a mesh."""
    return "mesh" if isinstance(thing, Mesh) else "curve" if thing.dimension == 1 else "surface"
