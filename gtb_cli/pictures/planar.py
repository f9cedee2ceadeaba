"""Pictures in the plane: curves, bases of curves, domains and decompositions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import DomainError
from gtb_cli.knots.domain import domain
from gtb_cli.pictures.colours import FAINT, INK, LINE_COLOURS, NET, line_style, patch_colour
from gtb_cli.pictures.look import Look, subscript
from gtb_cli.pictures.nets import curve_path, net_of
from gtb_cli.theory.basis import gt_bernstein
from gtb_cli.theory.patch import Patch

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from gtb_cli.knots.decomposition import RegularDecomposition


# Box behind a label, so that lines do not run through it
HALO = {"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.75}


def draw_curves(ax: Axes, curves: Sequence[Patch], look: Look, names: Sequence[str] = ()) -> None:
    """Draw curves that lie in the plane, with control polygons and numbered points."""
    paths = [curve_path(curve)[:, :2] for curve in curves]
    for k, path in enumerate(paths):
        colour, dashes = line_style(k)
        ax.plot(*path.T, dashes, color=colour, lw=1.8, zorder=3, label=names[k] if names else None)
    if look.draws_net(len(curves)):
        for curve in curves:  # the control polygon, or the net that the lifting induces
            for pair in net_of(curve):
                ax.plot(*curve.control_points[list(pair), :2].T, "-", color=NET, lw=0.9, alpha=0.75, zorder=2)
        paths = [curve.control_points[:, :2] for curve in curves]
        unique = dict.fromkeys((i, *place) for places in paths for i, place in enumerate(places.tolist()))
        spots = np.array(list(unique))[:, 1:]
        ax.plot(*spots.T, "o", ms=4.5, color="white", mec=NET, mew=0.9, zorder=4)
        if look.numbers(len(spots)):
            label_all(ax, spots, [subscript("b", key[0]) for key in unique])
    level(ax, np.concatenate(paths))
    if names:
        ax.legend(frameon=False, fontsize=8, loc="best")


def level(ax: Axes, places: FloatArray) -> None:
    """Give axes of a plane picture the same scale in both directions, and room around the points."""
    low, high = places.min(axis=0), places.max(axis=0)
    spans = np.maximum(high - low, 0.02 * float((high - low).max()) or 1.0)
    spans += 0.18 * spans.max()
    box = ax.get_window_extent()
    spans = np.maximum(spans, np.array([spans[1] * box.width / box.height, spans[0] * box.height / box.width]))
    middle = (low + high) / 2
    ax.set_xlim(middle[0] - spans[0] / 2, middle[0] + spans[0] / 2)
    ax.set_ylim(middle[1] - spans[1] / 2, middle[1] + spans[1] / 2)
    ax.set_aspect("equal", adjustable="box")
    ax.grid(True, color="#E6E6E6", lw=0.6)
    ax.set_axisbelow(True)


def basis_values(patch: Patch, u: FloatArray, unnormalised: bool) -> FloatArray:
    """Return (m, n) values of T_i, or β_i, at parameters."""
    return gt_bernstein(patch.domain, patch.coefficients, u) if unnormalised else patch.basis(u)


def chosen(look: Look, patch: Patch) -> tuple[int, ...]:
    """Return the indices of the basis functions to draw."""
    count = len(patch.knots)
    for index in look.indices:
        if not 0 <= index < count:
            raise DomainError(f"index: expected 0 … {count - 1}, got {index}")
    return look.indices or tuple(range(count))


def draw_basis(ax: Axes, curves: Sequence[Patch], look: Look, names: Sequence[str] = ()) -> None:
    """Draw basis functions of curves over t; several curves are variants of one curve, each with a name."""
    basis_points = 480  # number of points at which a basis is evaluated; knots and their neighbours are among them
    indices = chosen(look, curves[0])
    symbol = "β" if look.unnormalised else "T"
    number = 0
    for variant, curve in enumerate(curves):
        low, high = (float(x) for x in curve.domain.vertices[:, 0])
        even = (1 - np.cos(np.linspace(0, np.pi, basis_points + 1))) / 2
        t = np.union1d(low + (high - low) * even, curve.knots[:, 0]).clip(low, high)
        values = basis_values(curve, t, look.unnormalised)
        for index in indices:
            colour, dashes = line_style(number)
            number += 1
            ax.plot(t, values[:, index], dashes, color=colour, lw=1.6, zorder=3, clip_on=False)
            top = int(np.argmax(values[:, index]))
            text = names[variant] if names else subscript(symbol, index)
            edge = {0: "left", len(t) - 1: "right"}.get(top, "center")
            place, offset = (float(t[top]), float(values[top, index])), {"left": 5, "right": -3}.get(edge, 0)
            note(ax, text, place, (offset, 3), ha=edge, va="bottom", color=colour, fontsize=9, bbox=HALO)
    low, high = (float(x) for x in curves[0].domain.vertices[:, 0])
    ax.set_xlim(low, high)
    ax.set_ylim(bottom=0)
    ax.margins(y=0.08)
    ax.set_xlabel("t")
    ax.set_ylabel(f"{symbol}(t)" if len(indices) != 1 else f"{subscript(symbol, indices[0])}(t)")
    ax.grid(True, color="#EEEEEE", lw=0.6)
    shown = np.concatenate([curve.knots[:, 0] for curve in curves])
    ax.plot(
        shown, np.zeros(len(shown)), "o", ms=5, color="white", mec=INK, mew=0.9, zorder=6, clip_on=False,
        transform=ax.get_xaxis_transform(),
    )  # fmt: skip
    if look.numbers(len(curves[0].knots)) and not names:
        heights: dict[float, int] = {}
        for i, place in enumerate(curves[0].knots[:, 0].tolist()):
            again = heights[place] = heights.get(place, -1) + 1
            beside = (9 * ((place == low) - (place == high)), 8 + 9 * again)
            note(ax, subscript("a", i), (place, 0.0), beside, xycoords=ax.get_xaxis_transform(), color="#555555")


def draw_domain(ax: Axes, patch: Patch, look: Look) -> None:
    """Draw Δ with numbered knots and edges, and weights."""
    knots, shape = patch.knots, patch.domain
    numbered = look.numbers(len(knots))
    if shape.dimension == 1:
        flat = np.column_stack([knots[:, 0], np.zeros(len(knots))])
        ax.plot(shape.vertices[:, 0], [0, 0], "-", color=LINE_COLOURS[0], lw=2, zorder=2, solid_capstyle="butt")
        ax.set_yticks([])
        ax.spines["left"].set_visible(False)
        ax.set_xlabel("t")
        ax.set_ylim(-1, 1)
    else:
        flat = knots
        ax.fill(*shape.vertices.T, facecolor="#EAF2F8", edgecolor=LINE_COLOURS[0], lw=1.6, zorder=1)
        level(ax, shape.vertices)
        ax.set_xlabel("u")
        ax.set_ylabel("v")
        if numbered:
            _number_edges(ax, shape.vertices)
    draw_knots(ax, flat)
    if numbered:
        texts = [f"{subscript('a', i)}\nω={weight:.4g}" for i, weight in enumerate(patch.weights)]
        _label_knots(ax, flat, texts, shape.vertices)


def _label_knots(ax: Axes, places: FloatArray, texts: Sequence[str], corners: FloatArray) -> None:
    """Write texts beside knots, towards the inside of Δ, where no edge runs; above those of a curve, in two rows."""
    lines: dict[tuple[float, float], list[str]] = {}
    for (x, y), text in zip(places.tolist(), texts, strict=True):
        lines.setdefault((x, y), []).append(text)
    # Width of a label of a curve's knot, as a fraction of Δ: one that is nearer to the last stands in another row
    label_width = 0.13
    last = [-np.inf, -np.inf]
    for place, text in sorted((place, "\n".join(several)) for place, several in lines.items()):
        if corners.shape[1] == 1:
            near = label_width * float(np.ptp(corners))
            row = 0 if place[0] - last[0] >= near or last[0] < last[1] else 1
            last[row] = place[0]
            note(ax, text, place, (0, 7 + 24 * row), va="bottom")
            continue
        x, y = _inward(np.array(place), corners)
        across = 0.0 if abs(x) < 0.3 else float(np.sign(x))
        sharp = bool((corners == place).all(axis=1).any())  # edges run above and below
        up = float(not sharp) if abs(y) < 0.3 else float(np.sign(y))
        ha, va = ("center", "left", "right")[int(across)], ("center", "bottom", "top")[int(up)]
        note(ax, text, place, (5 * across, 6 * up), ha=ha, va=va, bbox=HALO)


def _inward(place: FloatArray, corners: FloatArray) -> FloatArray:
    """Direction into a polygon from a place on its boundary; from one inside, to its middle."""
    along = np.roll(corners, -1, axis=0) - corners
    normals = np.column_stack([-along[:, 1], along[:, 0]]) / np.hypot(*along.T)[:, None]
    depths = ((place - corners) * normals).sum(axis=1)
    low, high = corners.min(axis=0), corners.max(axis=0)
    size = float((high - low).max())
    here = depths < 1e-6 * size
    if not here.any():
        return np.asarray(((low + high) / 2 - place) / (size / 2))
    direction = normals[here].sum(axis=0)
    return np.asarray(direction / np.hypot(*direction))


def _number_edges(ax: Axes, corners: FloatArray) -> None:
    for edge, (a, b) in enumerate(zip(corners, np.roll(corners, -1, axis=0), strict=True)):
        along = (b - a) / np.hypot(*(b - a))
        upright = 90 - (90 - np.degrees(np.arctan2(along[1], along[0]))) % 180  # so that it is not upside down
        style = {"va": "center", "fontsize": 7.5, "color": LINE_COLOURS[0], "rotation": upright, "zorder": 6}
        note(ax, f"edge {edge}", (a + b) / 2, (9 * along[1], -9 * along[0]), **style)


def draw_knots(ax: Axes, places: FloatArray, absent: Sequence[int] = ()) -> None:
    """Draw knots as dots, those in no cell hollow."""
    filled = np.setdiff1d(np.arange(len(places)), absent)
    ax.plot(*places[filled].T, "o", ms=5.5, color=INK, mec="white", mew=0.6, zorder=5, clip_on=False)
    if len(absent):
        ax.plot(*places[list(absent)].T, "o", ms=6.5, color="white", mec=INK, mew=1.3, zorder=5, clip_on=False)


def draw_decomposition(ax: Axes, found: RegularDecomposition, look: Look) -> None:
    """Draw the cells of a decomposition filled, knots outside all cells hollow, and λ at the knots."""
    numbered = look.numbers(len(found.knots))
    if found.dimension == 1:
        _draw_lifted_line(ax, found, numbered)
        return
    for cell, polygon in enumerate(found.polygons):
        corners = found.knots[list(polygon)]
        ax.fill(*corners.T, facecolor=patch_colour(cell), edgecolor=INK, lw=1.3, joinstyle="round", zorder=1)
    draw_knots(ax, found.knots, found.absent)
    if numbered:
        texts = [f"{subscript('a', i)}\nλ={height:.4g}" for i, height in enumerate(found.lifting)]
        _label_knots(ax, found.knots, texts, domain(found.knots).vertices)
    level(ax, found.knots)
    ax.set_xlabel("u")
    ax.set_ylabel("v")


def _draw_lifted_line(ax: Axes, found: RegularDecomposition, numbered: bool) -> None:
    """Draw lifted knots of a curve, their upper hull, and its projection."""
    t, heights = found.knots[:, 0], found.lifting
    floor = float(heights.min()) - 0.28 * (float(np.ptp(heights)) or 1.0)
    for cell, (a, b) in enumerate(found.polygons):
        ax.fill_between(t[[a, b]], heights[[a, b]], floor, color=patch_colour(cell), alpha=0.35, lw=0, zorder=1)
        ax.plot(t[[a, b]], heights[[a, b]], "-", color=INK, lw=1.5, zorder=3)
        ax.plot(t[[a, b]], [floor, floor], "-", color=patch_colour(cell), lw=5, zorder=2, solid_capstyle="butt")
    for x, height in zip(t.tolist(), heights.tolist(), strict=True):
        ax.plot([x, x], [floor, height], ":", color=FAINT, lw=0.9, zorder=2)
    draw_knots(ax, np.column_stack([t, heights]), found.absent)
    draw_knots(ax, np.column_stack([t, np.full(len(t), floor)]), found.absent)
    if numbered:
        for i, (x, height) in enumerate(zip(t.tolist(), heights.tolist(), strict=True)):
            rising = i not in found.absent and any(
                t[a] <= x < t[b] and heights[b] > heights[a] for a, b in found.polygons
            )
            note(ax, f"{height:.4g}", (x, height), (-5 if rising else 5, 4), ha="right" if rising else "left")
            note(ax, subscript("a", i), (x, floor), (0, -15), annotation_clip=False)
    ax.margins(x=0.07)
    ax.set_ylim(floor, float(heights.max()) + 0.14 * (float(np.ptp(heights)) or 1.0))
    ax.set_xticks([])
    ax.spines["bottom"].set_visible(False)
    ax.set_ylabel("λ")


def label_all(ax: Axes, places: FloatArray, labels: Sequence[str]) -> None:
    """Write labels beside points in the plane, on the side away from their common middle."""
    middle = places.mean(axis=0) if len(places) else np.zeros(2)
    for place, text in zip(places, labels, strict=False):
        direction = place - middle
        length = float(np.hypot(*direction))
        x, y = (direction / length if length else np.array([0.7, 0.7])) * 9
        note(ax, text, place, (x, y), va="center", color=INK, bbox=HALO)


def note(ax: Axes, text: str, place: ArrayLike, offset: tuple[float, float], **style: Any) -> None:
    """Write a text beside a place, by an offset in points to the right and upwards."""
    defaults = {"textcoords": "offset points", "ha": "center", "fontsize": 8, "zorder": 7}
    ax.annotate(text, place, offset, **{**defaults, **style})  # type: ignore[arg-type]
