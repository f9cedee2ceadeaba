"""The rate of a degeneration, from its definition, by linear programs for all sets of knots."""

from itertools import combinations

import numpy as np
import pytest
from scipy.optimize import linprog

from gtb_cli import convergence_rate, regular_decomposition
from gtb_cli.errors import ToleranceError
from gtb_cli.knots import convergence


def least_gap(knots, lifting, apart):
    """The least of all g of the largest gap of some knots below the highest of λ − ⟨g, a⟩."""
    rows = [(*(knots[i] - a), -1.0) for a in knots for i in apart]
    bounds = [lifting[i] - height for height in lifting for i in apart]
    return linprog([*(0 * knots[0]), 1.0], A_ub=rows, b_ub=bounds, bounds=(None, None)).fun


def by_definition(knots, lifting):
    cells = [set(cell) for cell in regular_decomposition(knots, lifting).cells]
    sets = [set(apart) for size in range(1, 5) for apart in combinations(range(len(knots)), size)]
    without_cell = [apart for apart in sets if not any(apart <= cell for cell in cells)]
    least = [apart for apart in without_cell if not any(other < apart for other in without_cell)]
    return min((least_gap(knots, lifting, apart) for apart in least), default=np.inf)


@pytest.mark.parametrize("seed", range(12))
def test_the_rate_is_the_least_gap_of_knots_with_no_cell_in_common(seed):
    rng = np.random.default_rng(seed)
    shape = (6, 1 + seed % 3 // 2)
    knots = rng.integers(0, 4, shape).astype(float) if seed % 2 else rng.random(shape)
    lifting = rng.integers(0, 4, len(knots)) if seed % 4 < 2 else rng.random(len(knots))
    rate = convergence_rate(regular_decomposition(knots, lifting))
    assert rate == pytest.approx(by_definition(knots, lifting), rel=1e-9)
    for scale, shift in ((1e-9, 0.0), (1e9, 0.0), (1.0, 1e7)):
        moved = regular_decomposition(scale * knots + shift, lifting)
        assert convergence_rate(moved) == pytest.approx(rate, rel=1e-6)


def test_three_knots_around_another_may_decide():
    knots = np.array([[0, 0], [3, 0], [0, 3], [1, 1]])
    assert convergence_rate(regular_decomposition(knots, [0, 0, 0, 2])) == pytest.approx(2)


def test_the_roof_above_a_segment_is_highest_where_two_planes_cross():
    start, ends, share = *np.random.default_rng(0).random((2, 9, 50)), np.linspace(0, 1, 2001)
    start[0], ends[1] = 0, 0
    roofs = (start[:, 0, None, None] + share[:, None] * (ends - start[:, :1])[:, None]).min(axis=0).max(axis=0)
    np.testing.assert_allclose(convergence._highest_above_segments(start[:, 0], ends), roofs, atol=1e-3)


def test_a_single_cell_is_its_own_limit():
    assert convergence_rate(regular_decomposition([0.0, 1.0, 4.0], [1.0, 2.0, 5.0])) == np.inf


def test_too_many_knots_are_refused(monkeypatch):
    monkeypatch.setattr(convergence, "MAX_GAPS", 17)
    with pytest.raises(ToleranceError, match="3 knots and 2 cells"):
        convergence_rate(regular_decomposition([0.0, 1.0, 2.0], [0.0, 1.0, 0.0]))
