"""Meshes of the films of a knot limit; `gtb_cli.limits.knot_limit` says where there are films."""

import numpy as np

from gtb_cli.arrays import FloatArray, shifted
from gtb_cli.knots.domain import domain
from gtb_cli.knots.triangulation import triangulation
from gtb_cli.limits.knot_limit import KnotLimit
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.moment.solve import LogSum, solve
from gtb_cli.moment.torus import shares


def film_mesh(limit: KnotLimit) -> Mesh:
    """Mesh the films of a knot limit that has some: segments for a curve, triangles for a surface."""
    segment, square = [0, 1], [[0, 0], [1, 0], [1, 1], [0, 1]]
    levels, n = (segment, 1024) if limit.patch.dimension == 1 else (square, 64)  # and cells along each side of a film
    part = triangulation(domain(levels), n)
    points, cells, count = [], [], 0
    for film in limit.films:
        if film.along is None:
            points.append(film.points(part.parameters[:, ::-1]))
        else:
            log_weights = film.log_weights((np.arange(n + 1) / n)[:, None])
            points.append(_section_points(film.along, log_weights, film.control_points, n))
        cells.append(shifted(part.cells, count))
        count += len(points[-1])
    vertices, triangles = np.concatenate(points), np.concatenate(cells)
    # Sections share the corners that no knot reaches, so there is no cell there.
    distinct = (vertices[triangles] != vertices[np.roll(triangles, 1, axis=1)]).any(axis=2)
    return Mesh(vertices, triangles[distinct.all(axis=1)], name="film")


def _section_points(along: FloatArray, log_weights: FloatArray, control_points: FloatArray, n: int) -> FloatArray:
    """Sample curves with (l, k) logarithms of weights at n + 1 evenly spaced linear parameters: (l (n + 1), 3)."""
    x = (along - along.min()) / np.ptp(along)
    t = np.tile(np.arange(1, n) / n, len(log_weights))
    weights = np.repeat(log_weights.T, n - 1, axis=1)
    # Points that are not found stay where the solver left them: on the film, too.
    s, _ = solve(LogSum(x[:, None] - 0.5, weights), t[None] - 0.5, np.log(t / (1 - t))[None])
    inner = shares((x[:, None] - 0.5) * s + weights).T.reshape(len(log_weights), n - 1, -1)
    ends = [shares(np.where(x == end, log_weights, -np.inf).T).T[:, None] for end in (0, 1)]
    return np.concatenate([ends[0], inner, ends[1]], axis=1).reshape(-1, len(x)) @ control_points
