"""Edges of patches along open edges of a part: how far the points and planes of its faces are from the patch's.

Sides of a hole are Bézier curves near edges that are splines: a file's surfaces come nearer to these.
"""

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy.polynomial import chebyshev

from gtb_cli.arrays import FloatArray
from gtb_cli.cad.cad_seams import along_edge
from gtb_cli.importers.cad_files import edge_uses, face_forms, kernel
from gtb_cli.theory.patch import Patch

# (n, 6) differences of a part's points, 0 at the ends, and unit normals from a patch's, at (n,) fractions of an edge.
# Where curvature is to be met, nine more are the part's second fundamental form F: of v, times the patch's normal, it
# is v · F v.
Border: TypeAlias = Callable[[FloatArray], FloatArray]


def part_borders(patch: Patch, part: Any, *, curved: bool = False) -> list[Border | None]:
    """Return for each edge of a patch a border if it lies along an open edge of a part, a shape near the origin."""
    if part is None:
        return [None] * len(patch.domain.vertices)
    rows = list[FloatArray]()
    for (edge, face), *others in edge_uses(part).values():
        if not others and not kernel("BRep").BRep_Tool.Degenerated_s(edge):
            points, normals, _, at = along_edge(edge, face, np.linspace(0, 1, 1001))
            rows.append(np.hstack([points, normals, *([face_forms(face, at).reshape(-1, 9)] if curved else [])]))
    return [_border(patch, k, rows) for k in range(len(patch.domain.vertices))]


def _border(patch: Patch, edge: int, traced: list[FloatArray]) -> Border | None:
    from scipy.interpolate import make_interp_spline

    near, exact = 1e-3, 1e-8  # of the size of the edge: within them, it lies along the part's, and is the same
    degree, count, rounds = 40, 160, 6  # least squares, as points far from the origin are rounded
    x, shape = -np.cos(np.pi * (np.arange(count) + 0.5) / count), patch.domain
    start, end = shape.vertices[edge], shape.vertices[(edge + 1) % len(shape.vertices)]
    places, numbers = start + (x[:, None] + 1) / 2 * (end - start), np.full(count, shape.faces.edge(edge).number)
    locations = [*patch.rational_basis.locations(places, "linear", numbers)]
    points, normals = patch.points_at(locations, count), patch.normals_at(locations, count)
    size = float(np.ptp(points, axis=0).max())
    for rows in traced:
        distances = np.linalg.norm(points[:, None] - rows[:, :3], axis=2)
        if not np.isfinite(rows).all() or distances.min(axis=1).max() > 10 * near * size:
            continue
        curve = make_interp_spline(np.arange(len(rows)), rows, 5)
        t, rates = distances.argmin(axis=1).astype(float), curve.derivative()
        for _ in range(rounds):  # of Newton, towards the nearest points
            ways = rates(t)[:, :3]
            t = np.clip(t + ((points - curve(t)[:, :3]) * ways).sum(axis=1) / (ways**2).sum(axis=1), 0, len(rows) - 1)
        found, faced, forms = np.split(curve(t), [3, 6], axis=1)
        signs = np.sign((faced * normals).sum(axis=1, keepdims=True))
        away, turned = found - points, faced * signs - normals
        if np.isfinite(turned).all() and (most := float(np.linalg.norm(away, axis=1).max())) <= near * size:
            if most <= exact * size and not forms.size:
                return None
            series = chebyshev.chebfit(x, np.hstack([away, turned, forms * signs]), degree)
            first, last = chebyshev.chebval(np.array([-1.0, 1.0]), series[:, :3]).T
            series[:2, :3] -= (first + last) / 2, (last - first) / 2
            return lambda fractions: np.asarray(chebyshev.chebval(2 * fractions - 1, series).T)
    return None
