"""What moment maps of the same knots share: nothing that they find depends on who asked before."""

import numpy as np
import pytest

from gtb_cli.knots import decomposition
from gtb_cli.moment import hulls
from gtb_cli.moment.moment_map import MomentMap

KNOTS = np.random.default_rng(3).random((12, 2)) * [1.0, 0.5]
BENT = np.random.default_rng(4).normal(size=12)
TILT = KNOTS @ [70.0, -30.0] + 5.0


def cells(weights):
    moments = MomentMap(KNOTS, weights)
    knots = moments._unit_knots
    return hulls.cells_with_gradients(hulls.hull_of(knots), knots, weights)


def asked(monkeypatch):
    """Count the decompositions that are made."""
    made = []
    whole = decomposition.regular_decomposition
    monkeypatch.setattr(decomposition, "regular_decomposition", lambda knots, w: made.append(1) or whole(knots, w))
    hulls._hull.cache_clear()
    return made


def test_weights_with_the_same_cells_have_them_decided_once(monkeypatch):
    made = asked(monkeypatch)
    for size in (10, 20, 1000, 1e6):
        cells(size * BENT)
        cells(size * BENT + TILT)
    assert len(made) == 1


def test_weights_with_other_cells_have_their_own(monkeypatch):
    made = asked(monkeypatch)
    one = cells(10 * BENT)
    other = cells(-10 * BENT)
    assert len(made) == 2
    assert [cell.knots.tolist() for cell, _ in one] != [cell.knots.tolist() for cell, _ in other]


def test_a_knot_that_is_nearly_on_the_plane_of_a_cell_is_decided_anew(monkeypatch):
    made = asked(monkeypatch)
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    for bend in (0.0, 1e-3, 1e-10, -1e-3):
        w = np.array([0.0, 1.0, 1.0 + bend, 0.0])
        found = hulls.cells_with_gradients(hulls.hull_of(square), square, w)
        assert len(found) == (1 if bend == 0 else 2) or abs(bend) == 1e-10
    assert len(made) == 4


@pytest.mark.parametrize("before", [BENT, -BENT, BENT + 3 * np.cos(np.arange(12.0))])
def test_what_was_solved_before_changes_no_digit(before):
    p = 0.6 * KNOTS + 0.4 * KNOTS.mean(axis=0)
    hulls._hull.cache_clear()
    alone = MomentMap(KNOTS, 30 * BENT).inverse(p)
    hulls._hull.cache_clear()
    MomentMap(KNOTS, 30 * before).inverse(p)
    assert np.array_equal(MomentMap(KNOTS, 30 * BENT).inverse(p), alone)


def test_gradients_are_those_of_the_lifted_cells():
    w = 10 * BENT + TILT
    for cell, gradient in cells(w):
        knots = MomentMap(KNOTS, w)._unit_knots
        rows = [int(np.flatnonzero((knots == knot).all(axis=1))[0]) for knot in cell.knots]
        rise = w - knots @ gradient
        assert np.ptp(rise[rows]) < 1e-11 * np.abs(w).max()
        assert rise.max() < rise[rows].max() + 1e-11 * np.abs(w).max()
