"""The contents of a page with all regular control surfaces of a patch, or curves of a curve: its limits."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import bounds_of
from gtb_cli.knots.all_decompositions import LiftingCone
from gtb_cli.knots.decomposition import border_net, regular_decomposition
from gtb_cli.limits.degeneration import cells_of
from gtb_cli.pages.page_scene import NO_POINTS, Content, content_of, joined
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.theory.patch import Patch


class Part(NamedTuple):
    """A cell that limits may have: its patch, the corners of its polygon, and its part of the control net."""

    patch: Patch
    polygon: tuple[int, ...]
    net: list[tuple[int, int]]


def parts_of(patch: Patch, cones: Sequence[LiftingCone]) -> dict[tuple[int, ...], Part]:
    """Return the cells of all limits, each once, by their knots."""
    found: dict[tuple[int, ...], Part] = {}
    for cone in cones:
        if all(cell in found for cell in cone.cells):
            continue
        decomposition = regular_decomposition(patch.knots, cone.lifting)
        cells = zip(decomposition.cells, cells_of(patch, decomposition), decomposition.polygons, strict=True)
        for number, (cell, part, polygon) in enumerate(cells):
            found.setdefault(cell, Part(part, polygon, border_net(decomposition, number)))
    return found


def content_of_limits(
    patch: Patch, cones: Sequence[LiftingCone], parts: Mapping[tuple[int, ...], Part], resolution: int
) -> Content:
    """Return the contents for the limits of liftings: each of their cells once, and which cells each limit has.

    Limits share their cells, and neighbours in a limit have the same vertices on their common edge. `Content.limits` is
    what the script of the page chooses by: {"knots", "cells", "list"}, the places of knots for small pictures of
    decompositions, the rows of each cell in the arrays of the page, and the cells and unused knots of each limit.
    """
    whole = content_of(patch, Recipe(1))
    contents, cells = [], []
    rows = dict.fromkeys(("cells", "border", "folds", "knots"), 0)
    for cell, part in parts.items():
        content = _without_net(content_of(part.patch, Recipe(resolution), " ".join(map(str, cell))))
        contents.append(replace(content, knot_names=tuple(whole.knot_names[i] for i in cell)))
        counts = {"cells": len(content.cells), "knots": len(cell)}
        counts |= {kind: len(content.lines[kind]) for kind in ("border", "folds")}
        ranges = {kind: [rows[kind], rows[kind] + count] for kind, count in counts.items()}
        cells.append({"polygon": part.polygon, "net": part.net, "rows": ranges})
        rows = {kind: end for kind, (_, end) in ranges.items()}
    numbers = {cell: number for number, cell in enumerate(parts)}
    together = joined(contents)
    (keyframe,) = together.keyframes
    return replace(
        together,
        name=patch.name or "patch",
        keyframes=(keyframe._replace(net_points=patch.control_points),),
        net_names=whole.net_names,
        remarks=(),  # on cells, which the patch itself does not have
        limits={
            "knots": _small(patch),
            "cells": cells,
            "list": [
                {
                    "cells": [numbers[cell] for cell in cone.cells],
                    "absent": cone.absent,
                    "dimension": cone.dimension,
                    "heights": _heights(cone) if patch.dimension == 1 else [],
                }
                for cone in cones
            ],
        },
    )


def _without_net(content: Content) -> Content:
    (keyframe,) = content.keyframes
    lines = {**content.lines, "net": content.lines["net"][:0]}
    return replace(content, keyframes=(keyframe._replace(net_points=NO_POINTS),), lines=lines, net_names=())


def _small(patch: Patch) -> list[list[float]]:
    """Knots in a square of side 1, to three digits; the second coordinate is 0 for a curve."""
    low, high = bounds_of(patch.knots)
    places = np.zeros((len(patch.knots), 2))
    places[:, : patch.dimension] = (patch.knots - low) / (high - low).max()
    return np.round(places, 3).tolist()  # type: ignore[no-any-return]


def _heights(cone: LiftingCone) -> list[float]:
    """Lifting values between 0 and 1/2, to three digits."""
    heights = cone.lifting - cone.lifting.min()
    return np.round(heights / (2 * heights.max() or 1.0), 3).tolist()  # type: ignore[no-any-return]
