"""The inverse moment map: right to 1e-12 wherever a point may lie and whatever the weights."""

from __future__ import annotations

import numpy as np
import pytest

from gtb_cli.basis import blend
from gtb_cli.errors import DomainError
from gtb_cli.joints import edge_points
from gtb_cli.moment import LinearParametrization, MomentMap, linear_locations
from gtb_cli.patch import Patch

RESIDUAL = 1e-12
"""What is promised, as a part of the hull's size."""

PENTAGON = np.array([[0, 2], [1, 2], [0, 6 / 5], [8 / 7, 8 / 7], [2, 1], [0, 0], [6 / 5, 0], [2, 0]])
WEIGHTS = np.array([2, 2, 5, 7, 2, 3, 5, 2.0])
LIFTING = np.array([1, 0, 3, 2, 0, 1, 3, 1.0])


def random_patch(seed: int) -> Patch:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(4, 61))
    knots = rng.normal(size=(n, 2)) * 10.0 ** rng.integers(-9, 10)
    return Patch(knots, rng.normal(size=(n, 3)), 10 ** rng.uniform(-12, 12, n) if seed % 3 else None)


def points_of(patch: Patch, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Points inside, down to 1e-12 of the size from edges, on edges and at corners; and the faces they are on."""
    rng = np.random.default_rng(seed)
    shape = patch.domain
    v, r = shape.vertices, len(shape.vertices)
    inner = rng.dirichlet(np.full(r, rng.choice([0.3, 1, 5])), 60) @ v
    edge = rng.integers(0, r, 60)
    t = rng.random((60, 1))
    on_edge = v[edge] * (1 - t) + v[(edge + 1) % r] * t
    inward = v.mean(axis=0) - on_edge
    near = on_edge + inward * 10.0 ** rng.uniform(-12, -2, (60, 1))
    faces = np.concatenate([np.zeros(120, dtype=int), 1 + edge, 1 + r + np.arange(r)])
    return np.vstack([inner, near, on_edge, v]), faces


@pytest.mark.parametrize("seed", range(60))
def test_the_moment_map_of_its_inverse_is_the_point(seed):
    patch = random_patch(seed)
    p, faces = points_of(patch, seed)
    parametrization = LinearParametrization(patch.domain, patch.log_products)
    back = blend(patch.domain, patch.log_products, patch.knots, parametrization.locations(p, faces), len(p))
    assert np.abs(back - p).max() <= RESIDUAL * patch.domain.size


@pytest.mark.parametrize("x", [5.0, 100.0, 600.0, 1e6, 1e30, 1e300])
def test_degenerations_of_any_size_are_solved(x):
    patch = Patch(PENTAGON, PENTAGON, log_weights=np.log(WEIGHTS) + LIFTING * np.log(x))
    p = np.random.default_rng(1).random((500, 2)) * 2
    p = p[p.sum(axis=1) < 3]
    back = patch.points_at(linear_locations(patch.domain, patch.log_products, p), len(p))
    assert np.abs(back[:, :2] - p).max() <= RESIDUAL * 2


def test_curves_too():
    rng = np.random.default_rng(4)
    knots = np.sort(rng.random(12))
    patch = Patch(knots, np.column_stack([knots, knots]), 10 ** rng.uniform(-12, 12, 12))
    p = np.concatenate([knots[0] + np.ptp(knots) * np.array([0, 1e-12, 1e-6, 0.5, 1 - 1e-12, 1]), knots])[:, None]
    back = patch.points_at(linear_locations(patch.domain, patch.log_products, p), len(p))
    assert np.abs(back[:, 0] - p[:, 0]).max() <= RESIDUAL


def test_large_sets_are_solved_like_single_points():
    """Thousands of points share starts; the solutions must not know."""
    patch = Patch(PENTAGON, PENTAGON, WEIGHTS)
    p = np.random.default_rng(3).random((20000, 2)) * 2
    p = p[p.sum(axis=1) < 3]
    points = Patch(PENTAGON, np.column_stack([PENTAGON, np.arange(8.0)]), WEIGHTS)
    together = points.points_at(linear_locations(patch.domain, patch.log_products, p), len(p))
    alone = [points.points_at(linear_locations(patch.domain, patch.log_products, q[None]), 1)[0] for q in p[:200]]
    assert np.abs(together[:200] - alone).max() < 1e-11


def test_an_edge_depends_on_its_own_data_only():
    """Two patches that share an edge's knots, up to an affine map, weights and points have the same points on it."""
    one = Patch(PENTAGON, np.column_stack([PENTAGON, np.arange(8.0)]), WEIGHTS)
    members = one.domain.edge_knots(0)
    place = 1 - (one.knots[members] - one.knots[members[0]]) @ [1, 0] / 2
    knots = np.vstack([np.column_stack([3 + 5 * place, np.full(len(members), -1.0)]), [[4, 3], [8, 2]]])
    other = Patch(
        knots,
        np.vstack([one.control_points[members], [[9, 9, 9], [7, 7, 7]]]),
        np.append(one.weights[members] * 3 * np.exp(0.4 * place), [2.0, 5.0]),
    )
    assert np.abs(edge_points(one, 0, 50) - edge_points(other, 0, 50)[::-1]).max() < 1e-13


def test_few_steps_are_enough():
    """Two evaluations more than the quadratic end of Newton's method needs from a neighbour's start."""
    patch = Patch(PENTAGON, PENTAGON, WEIGHTS)
    p = np.random.default_rng(3).random((50000, 2)) * 2
    p = p[p.sum(axis=1) < 3]
    columns = 0
    original = MomentMap._evaluate

    def counted(self, s):
        nonlocal columns
        columns += s.shape[1]
        return original(self, s)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(MomentMap, "_evaluate", counted)
        list(linear_locations(patch.domain, patch.log_products, p))
    assert columns < 5 * len(p)


@pytest.mark.parametrize("wrong", [[[2.5, 0.5]], [[0.5, np.nan]]])
def test_points_outside_are_refused(wrong):
    patch = Patch(PENTAGON, PENTAGON, WEIGHTS)
    with pytest.raises(DomainError, match=r"parameters\[0\]"):
        list(linear_locations(patch.domain, patch.log_products, np.array(wrong)))
