"""Pictures of domains, of one decomposition or all, and of lifted knots with their upper hull."""

from collections.abc import Sequence
from itertools import islice, pairwise

import numpy as np

from gtb_cli.arrays import FloatArray, bounds_of
from gtb_cli.knots.all_decompositions import LiftingCone, regular_decompositions
from gtb_cli.knots.decomposition import RegularDecomposition, regular_decomposition
from gtb_cli.knots.domain import Domain, domain
from gtb_cli.plots import scene
from gtb_cli.plots.look import Axes, Figure, Look, subscript
from gtb_cli.plots.palette import FAINT, INK, LINE_COLOURS, patch_colour, rgb
from gtb_cli.theory.patch import Patch
from gtb_cli.values import grouped


def draw_domain(ax: Axes, patch: Patch, look: Look) -> None:
    """Draw Δ with numbered knots and edges, and weights."""
    knots, corners = patch.knots, patch.domain.vertices
    numbered = look.numbers(len(knots))
    texts = [f"{subscript('a', i)}\nω={weight:.4g}" for i, weight in enumerate(patch.weights)] if numbered else []
    if patch.dimension == 1:
        ax.plot(corners[:, 0], [0, 0], "-", color=LINE_COLOURS[0], lw=2, zorder=2, solid_capstyle="butt")
        ax.set(yticks=[], xlabel="t", ylim=(-1, 1))
        ax.spines["left"].set_visible(False)
        _draw_knots(scene.View(ax), np.column_stack([knots, np.zeros(len(knots))]))
        near, last = 0.13 * float(np.ptp(knots)), [-np.inf, -np.inf]
        for (place,), text in sorted(_gathered(knots, texts)):  # nearer to the last than a label is wide: one row up
            row = 0 if place - last[0] >= near or last[0] < last[1] else 1
            last[row] = place
            scene.note(ax, text, (place, 0), (0, 7 + 24 * row), va="bottom")
        return
    ax.fill(*corners.T, facecolor="#EAF2F8", edgecolor=LINE_COLOURS[0], lw=1.6, zorder=1)
    _draw_plane(ax, patch.domain, texts)
    for edge, (a, b) in enumerate(zip(corners, np.roll(corners, -1, axis=0), strict=True)) if numbered else ():
        along = (b - a) / np.hypot(*(b - a))
        upright = 90 - (90 - np.degrees(np.arctan2(along[1], along[0]))) % 180  # so that it is not upside down
        style = {"va": "center", "fontsize": 7.5, "color": LINE_COLOURS[0], "rotation": upright, "zorder": 6}
        scene.note(ax, f"edge {edge}", (a + b) / 2, (9 * along[1], -9 * along[0]), **style)


def draw_decomposition(ax: Axes, found: RegularDecomposition, look: Look) -> None:
    """Draw the cells of a decomposition filled, knots outside all cells hollow, and λ at the knots."""
    numbered = look.numbers(len(found.knots))
    if found.dimension == 1:
        _draw_lifted_line(ax, found, numbered)
        return
    for cell, polygon in enumerate(found.polygons):
        corners = found.knots[list(polygon)]
        ax.fill(*corners.T, facecolor=patch_colour(cell), edgecolor=INK, lw=1.3, joinstyle="round", zorder=1)
    texts = [f"{subscript('a', i)}\nλ={height:.4g}" for i, height in enumerate(found.lifting)] if numbered else []
    _draw_plane(ax, domain(found.knots), texts, found.absent)


def _draw_plane(ax: Axes, shape: Domain, texts: Sequence[str], absent: Sequence[int] = ()) -> None:
    """Draw knots over Δ with texts on the inside, as edges have their numbers outside."""
    _draw_knots(scene.plane_view(ax, shape.vertices), shape.knots, absent)
    ax.set(xlabel="u", ylabel="v")
    for place, text in _gathered(shape.knots, texts):
        x, y = _inward(np.array(place), shape)
        across = 0 if abs(x) < 0.3 else int(np.sign(x))
        sharp = bool((shape.vertices == place).all(axis=1).any())  # edges run above and below
        up = int(not sharp) if abs(y) < 0.3 else int(np.sign(y))
        ha, va = ("center", "left", "right")[across], ("center", "bottom", "top")[up]
        scene.note(ax, text, place, (5 * across, 6 * up), ha=ha, va=va, bbox=scene.HALO)


def _inward(place: FloatArray, shape: Domain) -> FloatArray:
    """Return the direction into Δ from a place on its boundary; from one inside, to its middle."""
    normals = shape.normals / shape.normal_lengths[:, None]
    here = ((place - shape.vertices) * normals).sum(axis=1) < 1e-6 * shape.size
    if not here.any():
        return np.asarray((shape.center - place) / (shape.size / 2))
    direction = normals[here].sum(axis=0)
    return np.asarray(direction / np.hypot(*direction))


def _gathered(knots: FloatArray, texts: Sequence[str]) -> list[tuple[tuple[float, ...], str]]:
    """Return the place of each knot, and the texts of all that are there."""
    lines = grouped(zip(map(tuple, knots.tolist()), texts, strict=False))
    return [(place, "\n".join(several)) for place, several in lines.items()]


def _draw_knots(view: scene.View, places: FloatArray, absent: Sequence[int] = ()) -> None:
    """Draw knots as dots, those in no cell hollow."""
    view.points(np.delete(places, list(absent), axis=0), colour=INK, edge="white", size=5.5)
    view.points(places[list(absent)], size=6)


def _draw_lifted_line(ax: Axes, found: RegularDecomposition, numbered: bool) -> None:
    """Draw lifted knots of a curve, their upper hull, and its projection."""
    t, heights = found.knots[:, 0], found.lifting
    floor = float(heights.min()) - 0.28 * (float(np.ptp(heights)) or 1.0)
    for cell, (a, b) in enumerate(found.polygons):
        ax.fill_between(t[[a, b]], heights[[a, b]], floor, color=patch_colour(cell), alpha=0.35, lw=0, zorder=1)
        ax.plot(t[[a, b]], heights[[a, b]], "-", color=INK, lw=1.5, zorder=3)
        ax.plot(t[[a, b]], [floor, floor], "-", color=patch_colour(cell), lw=5, zorder=2, solid_capstyle="butt")
    for level in (heights, np.full(len(t), floor)):
        _draw_knots(scene.View(ax), np.column_stack([t, level]), found.absent)
    for i, (x, height) in enumerate(zip(t.tolist(), heights.tolist(), strict=True)):
        ax.plot([x, x], [floor, height], ":", color=FAINT, lw=0.9, zorder=2)
        if numbered:
            climbs = any(t[a] <= x < t[b] and heights[b] > heights[a] for a, b in found.polygons)
            rising = climbs and i not in found.absent
            scene.note(ax, f"{height:.4g}", (x, height), (-5 if rising else 5, 4), ha="right" if rising else "left")
            scene.note(ax, subscript("a", i), (x, floor), (0, -15), annotation_clip=False)
    ax.margins(x=0.07)
    ax.set(ylim=(floor, float(heights.max()) + 0.14 * (float(np.ptp(heights)) or 1.0)), xticks=[], ylabel="λ")
    ax.spines["bottom"].set_visible(False)


def draw_lifted(ax: Axes, found: RegularDecomposition, look: Look) -> None:
    """Draw the upper hull of the lifted knots above the cells, which are its projection."""
    low, high = bounds_of(found.knots)
    flat = (found.knots - (low + high) / 2) / float((high - low).max())
    rise = float(np.ptp(found.lifting)) or 1.0
    domain_gap = 0.4  # distance of Δ below the lowest lifted knot, relative to the width of Δ
    heights = domain_gap + scene.GRAPH_HEIGHT * (found.lifting - found.lifting.min()) / rise
    lifted, ground = np.column_stack([flat, heights]), np.column_stack([flat, np.zeros(len(flat))])
    fans = [(k, (p[0], *pair)) for k, p in enumerate(found.polygons) for pair in pairwise(p[1:])]
    upper = np.array([face for _, face in fans])
    colours = np.array([rgb(patch_colour(cell)) for cell, _ in fans])
    vertices = np.concatenate([lifted, ground])
    faces = np.concatenate([upper, upper + len(lifted)])
    surface = scene.ShadedTriangles(vertices, faces, None, np.concatenate([colours, colours]))
    (view,) = scene.space_views([ax], look.camera, [surface])
    for level, width, texts, up, colour in (
        (lifted, 1.2, [f"λ={value:.4g}" for value in found.lifting], 6, INK),
        (ground, 0.9, [subscript("a", i) for i in range(len(flat))], -6, LINE_COLOURS[0]),
    ):
        closed = [level[[*polygon, polygon[0]]] for polygon in found.polygons]
        view.lines(closed, width=width, hidden=scene.HIDDEN_STRENGTH)
        _draw_knots(view, level, found.absent)
        for place, text in zip(view.seen(level)[:, :2], texts if look.numbers(len(flat)) else (), strict=False):
            scene.note(ax, text, place, (0, up), bbox=scene.HALO, va="bottom" if up > 0 else "top", color=colour)
    view.lines(list(np.stack([ground, lifted], axis=1)), colour=FAINT, width=0.8, hidden=0.7)


def draw_all_decompositions(figure: Figure, patch: Patch) -> None:
    """Draw regular decompositions in lexicographic order of their cells: all, or the first, and how many there are."""
    most_shown, most_found = 100, 20_000  # so that a picture takes seconds, whatever the number of knots
    found = list(islice(regular_decompositions(patch.knots), most_found + 1))
    count = f"{len(found)}" if len(found) <= most_found else f"more than {most_found}"
    shown = sorted(found[:most_found], key=lambda cone: cone.cells)[:most_shown]
    title = f"{count} regular decompositions" if len(found) > 1 else "1 regular decomposition"
    if len(shown) < len(found):
        title = f"{len(shown)} of {title}" if len(found) > most_found else f"The first {len(shown)} of {title}"

    width, height = figure.get_size_inches()
    head = 0.3 / height
    figure.text(0.5, 1 - head / 2, title, ha="center", va="center", fontsize=9.5)
    span = np.ptp(bounds_of(patch.knots), axis=0)
    shape = span[0] / span[1] if patch.dimension == 2 else 1.5
    free, n = height * (1 - head), len(shown)
    columns = max(range(1, n + 1), key=lambda columns: min(width / columns / shape, free / -(-n // columns)))
    across, down = 1 / columns, (1 - head) / -(-n // columns)
    font = min(8.0, 72 * 0.16 * min(width * across, height * down))
    for number, cone in enumerate(shown):
        row, column = divmod(number, columns)
        corner = (column * across, 1 - head - (row + 1) * down)
        ax = figure.add_axes((corner[0] + 0.12 * across, corner[1] + 0.04 * down, 0.84 * across, 0.84 * down))
        ax.axis("off")
        place = (corner[0] + 0.03 * across, corner[1] + 0.97 * down)
        figure.text(*place, str(number), ha="left", va="top", fontsize=font, color=FAINT)
        _draw_cells(ax, patch, cone, dot=font / 2)


def _draw_cells(ax: Axes, patch: Patch, cone: LiftingCone, dot: float) -> None:
    """Draw the cells, and knots, hollow in none; of a curve, the lifted knots and their upper hull."""
    places = patch.knots
    if patch.dimension == 1:
        places = np.column_stack([patch.knots[:, 0], cone.lifting / (np.ptp(cone.lifting) or 1.0)])
        ax.set_ylim(-1.15, 1.15)
    else:
        ax.set_aspect("equal", anchor="NW")
    for cell, polygon in enumerate(regular_decomposition(patch.knots, cone.lifting).polygons):
        outline = places[list(polygon)].T
        if patch.dimension == 1:
            ax.plot(*outline, "-", color=patch_colour(cell), lw=dot / 2)
        else:
            ax.fill(*outline, facecolor=patch_colour(cell), edgecolor=INK, lw=dot / 6, joinstyle="round")
    present = np.isin(np.arange(len(places)), cone.absent, invert=True)
    for which, colour, edge in ((present, INK, "white"), (~present, "white", INK)):
        dots = ax.plot(*places[which].T, "o", markersize=dot, markeredgewidth=dot / 6, zorder=3, clip_on=False)
        dots[0].set(markerfacecolor=colour, markeredgecolor=edge)
