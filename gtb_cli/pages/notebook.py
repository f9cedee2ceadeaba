"""Pictures of themselves that patches, models, meshes, decompositions and domains show in a notebook."""

import html

import numpy as np

from gtb_cli.arrays import FloatArray, bounds_of
from gtb_cli.knots.decomposition import RegularDecomposition
from gtb_cli.knots.domain import Domain
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.models.model import Model
from gtb_cli.pages.page import page
from gtb_cli.plots.palette import INK, patch_colour
from gtb_cli.theory.patch import Patch

SIDE, MARGIN = 220, 16  # of a picture in pixels


def notebook_html(thing: Patch | Model | Mesh | RegularDecomposition | Domain) -> str:
    """Return HTML for a notebook."""
    if isinstance(thing, Domain):
        clouds = thing.vertices, thing.knots
        corners, places = (rows if thing.dimension == 2 else rows[:, [0, 0]] * [1, 0] for rows in clouds)
        return _picture(places, [corners], range(len(places)))
    if not isinstance(thing, RegularDecomposition):
        # A block as wide as its place, border included: no scroll bar appears around it.
        style = "display:block;box-sizing:border-box;width:100%;height:420px;border:1px solid #8884;border-radius:6px"
        return f'<iframe srcdoc="{html.escape(page(thing), quote=True)}" style="{style}"></iframe>'
    # Cells, coloured in turn, and knots, hollow in none; of a curve, the lifted knots and their upper hull.
    places = thing.knots
    if thing.dimension == 1:
        span = float(np.ptp(thing.knots[:, 0]))
        heights = (thing.lifting - thing.lifting.min()) * (span / 2 / (np.ptp(thing.lifting) or 1.0))
        places = np.column_stack([thing.knots[:, 0], heights])
    present = {i for cell in thing.cells for i in cell}
    return _picture(places, [places[list(polygon)] for polygon in thing.polygons], present)


def _picture(places: FloatArray, cells: list[FloatArray], present: object) -> str:
    """SVG of polygons, or segments, and numbered points, which are filled if they are `present`."""
    low, high = bounds_of(places)
    scale = SIDE / float((high - low).max())
    width, height = (high - low) * scale + 2 * MARGIN

    def seen(points: FloatArray) -> list[list[float]]:
        flipped = np.column_stack([points[:, 0] - low[0], high[1] - points[:, 1]])
        return (flipped * scale + MARGIN).round(1).tolist()  # type: ignore[no-any-return]

    parts = []
    for number, cell in enumerate(cells):
        corners = " ".join(f"{x},{y}" for x, y in seen(cell))
        parts.append(f'<polygon points="{corners}" fill="{patch_colour(number)}" stroke="{INK}"/>')
    for number, (x, y) in enumerate(seen(places)):
        fill = INK if number in present else "white"  # type: ignore[operator]
        parts.append(f'<circle cx="{x}" cy="{y}" r="3.5" fill="{fill}" stroke="{INK}"/>')
        parts.append(f'<text x="{x + 5}" y="{y - 5}" font-size="11" font-family="sans-serif">{number}</text>')
    size = f'width="{width:.0f}" height="{height:.0f}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size} style="background:white">{"".join(parts)}</svg>'
