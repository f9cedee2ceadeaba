"""The plate of all regular decompositions of the knots of a patch, each small and numbered."""

from __future__ import annotations

from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from gtb_cli.arrays import bounds_of
from gtb_cli.knots.all_decompositions import LiftingCone, regular_decompositions
from gtb_cli.knots.decomposition import regular_decomposition
from gtb_cli.plots.palette import FAINT, INK, patch_colour
from gtb_cli.theory.patch import Patch

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


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
        _draw(ax, patch, cone, dot=font / 2)


def _draw(ax: Axes, patch: Patch, cone: LiftingCone, dot: float) -> None:
    """Draw the cells, and knots, hollow in none; of a curve, the lifted knots and their upper hull."""
    decomposition = regular_decomposition(patch.knots, cone.lifting)
    places = patch.knots
    if patch.dimension == 1:
        places = np.column_stack([patch.knots[:, 0], cone.lifting / (np.ptp(cone.lifting) or 1.0)])
        ax.set_ylim(-1.15, 1.15)
    else:
        ax.set_aspect("equal", anchor="NW")
    for cell, polygon in enumerate(decomposition.polygons):
        outline = places[list(polygon)].T
        if patch.dimension == 1:
            ax.plot(*outline, "-", color=patch_colour(cell), lw=dot / 2)
        else:
            ax.fill(*outline, facecolor=patch_colour(cell), edgecolor=INK, lw=dot / 6, joinstyle="round")
    present = np.isin(np.arange(len(places)), cone.absent, invert=True)
    for which, colour, edge in ((present, INK, "white"), (~present, "white", INK)):
        dots = ax.plot(*places[which].T, "o", markersize=dot, markeredgewidth=dot / 6, zorder=3, clip_on=False)
        dots[0].set(markerfacecolor=colour, markeredgecolor=edge)
