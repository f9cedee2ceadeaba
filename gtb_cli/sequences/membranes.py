"""Meshes of the films that knots leave behind when they move to the boundary of Δ."""

import numpy as np

from gtb_cli.arrays import FloatArray, shifted
from gtb_cli.knots.domain import domain
from gtb_cli.knots.triangulation import triangulation
from gtb_cli.limits.knot_limit import Film, KnotLimit
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.moment.solve import LogSum, solve
from gtb_cli.moment.torus import shares


def film_mesh(limit: KnotLimit) -> Mesh:
    """Mesh the films of a knot limit that has some: segments for a curve, triangles for a surface."""
    film_cells = {1: 1024, 2: 64}  # cells of a film along each of its sides
    dimension = limit.patch.dimension
    n = film_cells[dimension]
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

    Those that are not found stay where the solver left them: on the film, too.
    """
    x = (along - along.min()) / np.ptp(along)
    t = np.tile(np.arange(1, n) / n, len(log_weights))
    weights = np.repeat(log_weights.T, n - 1, axis=1)
    s, _ = solve(LogSum(x[:, None] - 0.5, weights), t[None] - 0.5, np.log(t / (1 - t))[None])
    inner = shares((x[:, None] - 0.5) * s + weights).T.reshape(len(log_weights), n - 1, -1)
    ends = [shares(np.where(x == end, log_weights, -np.inf).T).T[:, None] for end in (0, 1)]
    return np.concatenate([ends[0], inner, ends[1]], axis=1).reshape(-1, len(x)) @ control_points
