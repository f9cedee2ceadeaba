"""Meshes of the films that knots leave behind when they move to the boundary of Δ."""

from __future__ import annotations

import numpy as np

from gtb_cli.arrays import FloatArray, shifted
from gtb_cli.knots.domain import domain
from gtb_cli.knots.triangulation import triangulation
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.theory.knot_limit import Film, KnotLimit

FILM_CELLS = {1: 1024, 2: 64}
"""Cells of a film along each of its sides."""

EVENNESS = 1e-9
"""Error of log(t / (1 − t)) at a vertex of a section, whose parameter should be t."""

MAX_STEPS = 100
"""Steps of Newton's method for the vertices; vertices lie on the film whatever their parameters are."""


def film_mesh(limit: KnotLimit) -> Mesh:
    """Mesh the films of a knot limit that has some: segments for a curve, triangles for a surface."""
    dimension = limit.patch.dimension
    n = FILM_CELLS[dimension]
    points, cells, count = [], [], 0
    for film in limit.films:
        if dimension == 1:
            points.append(film.points((np.arange(n + 1) / n)[:, None]))
            cells.append(count + np.stack([np.arange(n), np.arange(1, n + 1)], axis=1))
        else:
            points.append(_film_points(film, n))
            cells.append(shifted(triangulation(_SQUARE, n).cells, count))
        count += len(points[-1])
    vertices, triangles = np.concatenate(points), np.concatenate(cells)
    # Sections share the corners that no knot reaches, so there is no cell there.
    distinct = (vertices[triangles] != vertices[np.roll(triangles, 1, axis=1)]).any(axis=2)
    return Mesh(vertices, triangles[distinct.all(axis=1)], name="film")


_SQUARE = domain([[0, 0], [1, 0], [1, 1], [0, 1]])


def _film_points(film: Film, n: int) -> FloatArray:
    """Return ((n + 1)², 3) points of the film of a surface, row by row."""
    levels = np.arange(n + 1) / n
    if film.along is not None:
        return _section_points(film.along, film.log_weights(levels[:, None]), film.control_points, n)
    first, second = np.meshgrid(levels, levels, indexing="ij")
    return film.points(np.column_stack([first.ravel(), second.ravel()]))


def _section_points(along: FloatArray, log_weights: FloatArray, control_points: FloatArray, n: int) -> FloatArray:
    """(l (n + 1), 3) points of curves with (l, k) logarithms of weights, even in their linear parametrisations.

    Newton's method solves log(μ / (1 − μ)) = log(t / (1 − t)), which is almost linear in s, between bounds that shrink.
    """
    x = (along - along.min()) / np.ptp(along)
    t = np.arange(1, n) / n
    s = np.zeros((len(log_weights), n - 1))
    low, high = np.full_like(s, -np.inf), np.full_like(s, np.inf)
    for _ in range(MAX_STEPS):
        shares = _shares(log_weights[:, None] + s[..., None] * x)
        mean, rest = shares @ x, shares @ (1 - x)
        with np.errstate(divide="ignore", invalid="ignore"):
            error = np.log(mean / rest) - np.log(t / (1 - t))
            slope = (shares * (x - mean[..., None]) ** 2).sum(axis=-1) / (mean * rest)
            step = s - error / slope
        if (np.abs(error) <= EVENNESS).all():
            break
        low, high = np.where(error < 0, s, low), np.where(error > 0, s, high)
        further = 1 + np.abs(s)
        up = np.where(np.isfinite(high), (s + high) / 2, s + further)
        down = np.where(np.isfinite(low), (s + low) / 2, s - further)
        s = np.where((step > low) & (step < high), step, np.where(error < 0, up, down))
    ends = [_shares(np.where(x == end, log_weights, -np.inf))[:, None] for end in (0, 1)]
    return np.concatenate([ends[0], shares, ends[1]], axis=1).reshape(-1, len(x)) @ control_points


def _shares(exponents: FloatArray) -> FloatArray:
    """Exponentials along the last axis, divided by their sums."""
    e = np.exp(exponents - exponents.max(axis=-1, keepdims=True))
    return np.asarray(e / e.sum(axis=-1, keepdims=True))
