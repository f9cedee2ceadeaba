"""Lattices of the inner vertices of triangulations."""

import numpy as np
import pytest

from gtb_cli.knots.domain import domain
from gtb_cli.knots.even_triangulation import triangulation
from gtb_cli.moment.coarse_to_fine import MIN_COARSE_STEPS, STRIDE, vertex_lattices

POLYGONS = {
    "triangle": [[0, 0], [3, 0], [1, 2]],
    "quadrilateral": [[0, 0], [3, 0.5], [2.5, 2], [-0.5, 3]],
    "pentagon": [[0, 0], [3, 0], [4, 2], [2, 4], [0, 3]],
}

SMALLEST = STRIDE * MIN_COARSE_STEPS + 3

ROUNDING = 1e-11  # error of polynomials of size 10 that are extrapolated by half a dozen nodes, twice


def inner(shape, resolution):
    """Inner vertices of the triangulation, in its order."""
    parts = triangulation(shape, resolution)
    return np.delete(parts.parameters, parts.boundary.ravel(), axis=0)


def polynomial(p):
    """A polynomial of degree 2 in each direction of a lattice, even of a quadrilateral's; fewer than are reproduced."""
    return np.stack([p[:, 0] * p[:, 1] - p[:, 1] ** 2, 1 + p[:, 0] - p[:, 0] ** 2])


@pytest.mark.parametrize("resolution", [SMALLEST, SMALLEST + 1, 4 * SMALLEST + 2])
@pytest.mark.parametrize("name", POLYGONS)
def test_polynomials_are_interpolated_to_the_vertices_in_order(name, resolution):
    shape = domain(POLYGONS[name])
    lattice = vertex_lattices(shape, resolution)
    asked = []

    def solve(points, start):
        asked.append(len(points))
        assert (shape.heights_of_columns(points) > 0).all()
        if start is not None:
            assert off(name, start, points, lattice.last // STRIDE) < ROUNDING
        return polynomial(points)

    lines = lattice.lines(solve)
    blocks = lattice.blocks(1000)
    found = np.concatenate([lattice.values(lines, rows) for rows, _ in blocks], axis=1)
    p = inner(shape, resolution)
    assert found.shape[1] == len(p) == lattice.counts.sum()
    assert [vertices.start for _, vertices in blocks] == [0, *(vertices.stop for _, vertices in blocks[:-1])]
    assert off(name, found, p, lattice.last) < ROUNDING
    assert sum(asked) < len(p) / 8


def off(name, values, p, last):
    """How far values are off the polynomial, at all points but those of lines that are too short for one."""
    error = np.abs(values - polynomial(p)).max(axis=0)
    short = 0.0 if name == "quadrilateral" else min(3 * (SHORT / last) ** 2, 1.0)
    return np.sort(error)[: len(error) - int(short * len(error))].max(initial=0.0)


SHORT = 10 * STRIDE  # steps from a corner of a triangle: lines of six nodes, and what is interpolated from shorter ones


def test_a_coarse_lattice_is_not_worth_it():
    assert not vertex_lattices(domain(POLYGONS["pentagon"]), 32).is_worth_it
    assert vertex_lattices(domain(POLYGONS["pentagon"]), SMALLEST).is_worth_it
