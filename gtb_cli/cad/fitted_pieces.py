"""Patches without exact surfaces as B-spline pieces that keep their tangent planes along all edges and seams."""

import numpy as np

from gtb_cli.cad import spline_pieces
from gtb_cli.cad.spline_pieces import (
    EDGES,
    Borders,
    FittedPieces,
    Halves,
    Splines,
    fit_inside,
    grid,
    largest_angle,
    normals_along,
    normals_at,
)
from gtb_cli.theory.patch import Patch

DEGREE = 6


def fitted_pieces(patch: Patch, name: str, spans: int, halves: Halves, borders: Borders) -> FittedPieces:
    """Fit a patch by as many pieces as it has corners, in the linear parametrisation.

    Edges interpolate the patch's, or are their exact halves, or borders of a part; seams are shared. The rest is least
    squares of positions, and of n · ∂S = 0 across edges and seams with the normals n there.
    """
    splines = Splines(DEGREE, np.linspace(0.0, 1.0, spans + 1) ** 2)  # denser at edges: derivatives may have no bound
    quarters, _ = spline_pieces.corner_pieces(patch, halves, borders, is_polar=False)
    low, high = patch.control_points.min(axis=0), patch.control_points.max(axis=0)
    origin, size = (low + high) / 2, float((high - low).max())
    zero, one = np.zeros(1), np.ones(1)
    lines = [grid(splines.greville, zero), grid(zero, splines.greville), grid(one, splines.greville)]
    grids = [grid(splines.fitted, splines.fitted), grid(splines.between, splines.between)]
    *rims, fitted, between = spline_pieces.points_at(patch, quarters, [*lines, *grids])
    near = zero + 1 / splines.slopes[0], one - 1 / splines.slopes[1]
    rows = [
        grid(*((splines.fitted, x) if axis else (x, splines.fitted)))
        for axis, last in EDGES
        for x in (near[last], (zero, one)[last])
    ]
    measured = [grid(splines.along, zero), grid(zero, splines.along)]
    *planes, first, second, ways = normals_at(patch, quarters, [*rows, *measured, np.array([[1.0, 0.0], [1.0, 1.0]])])
    edges, before, seams = ((rim - origin) / size for rim in rims)
    rows_of = zip(quarters, edges, before, strict=True)
    nets = [spline_pieces.framed(quarter, (splines, splines), enumerate(pair)) for quarter, *pair in rows_of]
    for k, net in enumerate(nets):  # seams begin and end in tangent planes
        seam = splines.curve(np.hstack([seams[k], np.ones((len(net), 1))]))
        seam[0] = net[-1, 0]
        seam[-1, :3] = seams[0, -1]
        for pole, end, normal in ((1, 0, ways[k, 0]), (-2, -1, ways[k, 1])):
            if np.isfinite(normal).all():
                seam[pole, :3] -= normal * (normal @ (seam[pole, :3] - seam[end, :3]))
        net[-1] = nets[(k + 1) % len(nets)][:, -1] = seam
    least = np.cos(np.radians(10))  # if normals turn farther within the first pole, B-splines cannot follow their limit
    followed = [(near * last).sum(axis=2) > least for near, last in zip(planes[::2], planes[1::2], strict=True)]
    given = [np.where(kept[..., None], last, np.nan) for kept, last in zip(followed, planes[1::2], strict=True)]
    for k, net in enumerate(nets):
        fit_inside(net, (splines, splines), (fitted[k] - origin) / size, [normals[k] for normals in given], 3.0, one)
    normals = [[normals_along(net, axis, last, splines) for axis, last in EDGES] for net in nets]
    trios = zip(normals, first, second, strict=True)
    angle = max(largest_angle(*pair) for own, *wanted in trios for pair in zip(own, wanted, strict=False))
    bend = max(largest_angle(own[3], after[2]) for own, after in zip(normals, normals[1:] + normals[:1], strict=True))
    made = [(piece, net, (splines, splines)) for piece, net in zip(quarters, nets, strict=True)]
    surfaces, away, gap = spline_pieces.measured_surfaces(name, made, between, origin, size)
    error = max(float(np.sqrt((each**2).sum(axis=1)).max()) for each in away)
    return FittedPieces(surfaces, error, gap, bend, angle, 1 - float(np.mean(followed)))
