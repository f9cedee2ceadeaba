"""The rational basis that copies of a patch share, and the choice of a parametrisation."""

import dataclasses
import pickle

import numpy as np
import pytest

from gtb_cli.errors import DomainError
from tests.patches import pentagon

WEIGHTS = np.arange(1.0, 9)


def test_a_copy_shares_the_basis():
    patch = pentagon()
    moved = patch.replace(control_points=patch.control_points + 1, name="moved", lifting=None)
    assert moved.rational_basis is patch.rational_basis
    assert patch.replace(weights=WEIGHTS).domain is patch.domain
    assert patch.replace(edge_normals="unit").domain is not patch.domain
    assert patch.replace(edge_scale=2.0).domain.normals[0, 1] == 2 * patch.domain.normals[0, 1]
    assert patch.replace(knots=patch.knots * 2).domain.size == 2 * patch.domain.size
    assert patch.replace(weights=WEIGHTS).rational_basis is not patch.rational_basis


def test_a_copy_has_no_stale_weights():
    far = pentagon().replace(log_weights=1000 * WEIGHTS)
    assert far.weights.tolist() == [np.inf] * 8
    assert far.log_products.tolist() == (1000 * WEIGHTS).tolist()
    back = far.replace(weights=WEIGHTS)
    assert back.weights.tolist() == WEIGHTS.tolist()
    assert (back.log_weights == np.log(WEIGHTS)).all()
    assert (far.replace(name="other").log_weights == far.log_weights).all()
    both = far.replace(weights=WEIGHTS, log_weights=np.log(WEIGHTS) * (1 + 1e-12))
    assert (both.weights == WEIGHTS).all()
    assert (both.log_weights != back.log_weights)[1:].all()
    with pytest.raises(DomainError, match="weights: disagree with log_weights"):
        dataclasses.replace(far, weights=2 * WEIGHTS)
    assert (pickle.loads(pickle.dumps(back)).replace(weights=2 * WEIGHTS).log_weights == np.log(2 * WEIGHTS)).all()


def test_a_part_has_what_belongs_to_its_knots():
    patch = pentagon().replace(lifting=WEIGHTS)
    members = np.array([0, 3, 5, 7])
    part = patch.part(members, name="part")
    for name in ("knots", "control_points", "weights", "log_weights", "coefficients", "lifting"):
        assert (getattr(part, name) == getattr(patch, name)[members]).all()


def test_calls_do_not_learn_from_each_other():
    patch = pentagon()
    shares = np.random.default_rng(1).dirichlet(np.ones(5), 500)
    u = patch.domain.center + 0.9 * (shares @ patch.domain.vertices - patch.domain.center)
    first = patch.evaluate(u, "linear")
    patch.evaluate(u[::3], "linear")
    assert (patch.evaluate(u, "linear") == first).all()
