"""Grids of knots, and exponentials on them."""

import math

import numpy as np
import pytest

from gtb_cli.moment.grid import grid_of

ROUNDING = 1e-13
"""Error of exponentials of numbers up to 60: a few dozen roundings of these."""

COLUMNS = {"equal": [-1.5, -0.5, 0.5, 1.5], "thirds": [0, 1 / 3, 2 / 3, 1], "irrational": [0, math.sqrt(2), 2, 3]}


def product(columns, rows):
    return np.array([[x, y] for x in columns for y in rows], dtype=np.float64)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("name", COLUMNS)
def test_exponentials_of_a_grid_are_those_of_its_knots(name, scale):
    rng = np.random.default_rng(0)
    knots = scale * rng.permutation(product(COLUMNS[name], [7, 7.5, 8, 8.5, 9, 9.5]))
    s = rng.uniform(-10, 10, (2, 50)) / scale
    grid = grid_of(knots)
    expected = [[math.exp((a - grid.first) @ t) for t in s.T] for a in knots[grid.order]]
    np.testing.assert_allclose(grid.exponentials(s), expected, rtol=ROUNDING)
    assert sorted(grid.order.tolist()) == list(range(len(knots)))


def test_high_degrees_keep_their_digits():
    knots = product(np.arange(33), [0, 1])
    s = np.array([[0.7, -0.3], [0.1, 0.2]])
    grid = grid_of(knots)
    exact = [[math.exp(math.fsum([a * x, b * y])) for x, y in s.T] for a, b in knots[grid.order]]
    np.testing.assert_allclose(grid.exponentials(s), exact, rtol=ROUNDING)


def test_other_knots_are_not_a_grid():
    square = product(range(4), range(4))
    assert grid_of(square) is not None
    assert grid_of(square[:-1]) is None
    assert grid_of(np.concatenate([square[:-1], square[:1]])) is None
    assert grid_of(square @ [[1, 1], [-1, 1]]) is None
    assert grid_of(np.arange(4.0)[:, None]) is None
    assert grid_of(np.random.default_rng(1).random((30, 2))) is None


def test_products_are_worth_it_if_they_save_exponentials():
    assert grid_of(product(range(4), range(4))).is_worth_it
    assert not grid_of(product([0, 1, 3], [0, 1, 5])).is_worth_it
