"""The solver alone: many vectors of weights at once, starts for steep weights, and 50 digits at extremes."""

import numpy as np
import pytest

from gtb_cli.moment.moment_map import MomentMap, layer_starts, tame_starts
from gtb_cli.moment.solve import ACCEPTED_RESIDUAL, TARGET_RESIDUAL, LogSum, solve
from gtb_cli.theory.patch import Patch
from tests import exact
from tests.laws import RESIDUAL
from tests.patches import pentagon

KNOTS = pentagon().knots / 2
WEIGHTS = np.random.default_rng(1).normal(size=(8, 40)) * np.geomspace(0.1, 300, 40)
POINTS = np.random.default_rng(2).dirichlet(np.ones(8), 40) @ KNOTS


@pytest.mark.parametrize("start", [np.zeros((2, 40)), np.full((2, 40), 1e4), layer_starts(KNOTS, POINTS.T)])
def test_each_column_may_have_its_own_weights(start):
    found, missing = solve(LogSum(KNOTS, WEIGHTS), POINTS.T, start, TARGET_RESIDUAL)
    means = LogSum(KNOTS, WEIGHTS).moments(found)[0]
    there = np.delete(np.arange(40), missing)
    assert np.abs(means - POINTS.T)[:, there].max() <= ACCEPTED_RESIDUAL
    for column in there[::7].tolist():
        alone = LogSum(KNOTS, WEIGHTS[:, column]).moments(found[:, [column]])[0]
        assert np.abs(alone[:, 0] - POINTS[column]).max() <= 2 * ACCEPTED_RESIDUAL
    assert not len(missing) or np.ptp(WEIGHTS[:, missing], axis=0).min() > 100


def test_several_vectors_of_weights_are_inverted_together():
    together = MomentMap(KNOTS, WEIGHTS.T).inverse(POINTS, numbers=np.arange(40))
    for column, (w, p) in enumerate(zip(WEIGHTS.T, POINTS, strict=True)):
        moments = MomentMap(KNOTS, w)
        assert np.abs(moments(together[:, [column]]) - p).max() <= RESIDUAL
        assert np.abs(moments(moments.inverse(p[None])) - p).max() <= RESIDUAL


@pytest.mark.parametrize("range_", [1.0, 100.0, 3000.0])
def test_starts_of_steep_weights_are_near_their_solutions(range_):
    total, p = LogSum(KNOTS, np.array([1, 0, 3, 2, 0, 1, 3, 1]) * (range_ / 3)), POINTS.T
    start = tame_starts(total, p, layer_starts(KNOTS, p))
    found, missing = solve(total, p, start, TARGET_RESIDUAL)
    assert not len(missing)
    assert np.abs(found - start).max() < 20  # of torus coordinates in thousands


KINDS = {
    "tame": (1.0, 0.0, 1.0, 1.0),
    "weights of 1e+-12": (1.0, 0.0, 1.0, 28.0),
    "weights of 1e+-300": (1.0, 0.0, 1.0, 690.0),
    "thin": (1.0, 0.0, 1e-6, 2.0),
    "shifted": (1.0, 1e7, 1.0, 1.0),
    "small": (1e-9, 0.0, 1.0, 2.0),
    "large": (1e9, 0.0, 1.0, 2.0),
}


@pytest.mark.parametrize("dimension", [1, 2])
@pytest.mark.parametrize("kind", KINDS)
def test_points_have_the_mean_of_their_knots_with_50_digits(kind, dimension):
    scale, shift, thickness, steepness = KINDS[kind]
    rng = np.random.default_rng(3)
    for _ in range(4):
        knots = (rng.normal(size=(int(rng.integers(4, 20)), 2)) * [1, thickness] * scale + shift)[:, :dimension]
        patch = Patch(knots, np.zeros((len(knots), 3)), log_weights=rng.uniform(-1, 1, len(knots)) * steepness)
        v, size = patch.domain.vertices, patch.domain.size
        p = rng.dirichlet(np.full(len(v), 0.3), 6) @ v  # many are near edges and corners
        for location in patch.rational_basis.locations(p, "linear"):
            for column, row in enumerate(np.arange(len(p))[location.rows].tolist()):
                mean = exact_mean(patch, location.face.knots, location.knots, location.s[:, column])
                rounding = 16 * np.finfo(float).eps * np.abs(v).max()
                assert max(abs(float(m - x)) for m, x in zip(mean, p[row].tolist(), strict=True)) <= (
                    RESIDUAL * size + rounding
                )


def exact_mean(patch, members, knots, s):
    """The mean of a patch's knots at torus coordinates dual to others of the members of a face."""
    number, exponential = exact.Number, exact.CONTEXT.exp
    exponents = [
        number(float(w)) + sum(number(float(x)) * number(float(y)) for x, y in zip(a, s, strict=True))
        for w, a in zip(patch.log_products[members], knots, strict=True)
    ]
    terms = [exponential(e - max(exponents)) for e in exponents]
    return [
        sum(t * number(float(a[axis])) for t, a in zip(terms, patch.knots[members], strict=True)) / sum(terms)
        for axis in range(patch.dimension)
    ]
