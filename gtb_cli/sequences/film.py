"""Meshes of the films that knots leave behind when they move to the boundary of Δ."""

from __future__ import annotations

import numpy as np

from gtb_cli.arrays import FloatArray, shifted
from gtb_cli.knots.domain import domain
from gtb_cli.knots.triangulation import triangulation
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.sequences.knot_limit import Film, KnotLimit
from gtb_cli.theory.patch import Patch

FILM_CELLS = {1: 1024, 2: 64}
"""Cells of a film along each of its sides."""


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
        return np.concatenate([_section_points(film.section(z), n) for z in levels.tolist()])
    first, second = np.meshgrid(levels, levels, indexing="ij")
    return film.points(np.column_stack([first.ravel(), second.ravel()]))


def _section_points(section: Patch, n: int) -> FloatArray:
    start, end = section.domain.vertices[:, 0]
    t = start + (end - start) * (np.arange(n + 1) / n)
    t[-1] = end
    return section.evaluate(t, "linear")
