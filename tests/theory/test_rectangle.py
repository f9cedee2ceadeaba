"""Grids of parameters of a rectangle, evaluated by tables in both directions."""

import numpy as np
import pytest

from gtb_cli.errors import DomainError
from gtb_cli.knots.triangulation import triangulation
from gtb_cli.theory.patch import Patch
from tests.laws import error_of_linear_points, error_of_points
from tests.patches import SHIFT, bumps

COLUMNS, ROWS = [0.0, 0.4, 1.5, 2.0], [0.0, 0.9, 1.0]


def rectangle(scale=1.0, shift=0.0, products=True):
    """A patch on a grid of uneven knots in a random order."""
    factors = [1.0, 3.0, 0.2, 5.0], [2.0, 0.7, 1.0]
    knots = np.stack(np.meshgrid(COLUMNS, ROWS), axis=-1).reshape(-1, 2)
    weights = np.outer(factors[1], factors[0]).ravel()
    if not products:
        weights[4] *= 1.5
    order = np.random.default_rng(0).permutation(len(knots))
    return Patch((knots * scale + shift)[order], bumps(knots)[order], weights[order])


def pairs(patch, count=8, indexing="xy"):
    """(count, count + 3, 2) parameters, with both ends of each side, and others 1e-9 of it from them."""
    low, high = patch.domain.vertices[[0, 2]]
    lines = [
        a + (b - a) * np.r_[0, 1e-9, np.linspace(0, 1, n)[1:], 1 - 1e-9]
        for a, b, n in zip(low, high, (count, count + 3), strict=True)
    ]
    lines = [np.append(line[:-2], [line[-1], end]) for line, end in zip(lines, high, strict=True)]
    return np.stack(np.meshgrid(*lines, indexing=indexing), axis=-1)


@pytest.mark.parametrize("products", [True, False])
@pytest.mark.parametrize("indexing", ["xy", "ij"])
@pytest.mark.parametrize(("scale", "shift"), [(1.0, 0.0), (1e-9, 0.0), (1e9, 0.0), (1.0, SHIFT)])
def test_a_grid_has_the_points_of_its_parameters(scale, shift, indexing, products):
    patch = rectangle(scale, shift, products)
    u = pairs(patch, indexing=indexing)
    mixed = np.random.default_rng(1).permutation(u.shape[0] * u.shape[1])
    for kind, error in (("toric", error_of_points(patch)), ("linear", error_of_linear_points(patch))):
        alone = patch.evaluate(u.reshape(-1, 2)[mixed], kind)
        assert np.abs(patch.evaluate(u, kind).reshape(-1, 3)[mixed] - alone).max() <= error


@pytest.mark.parametrize("kind", ["toric", "linear"])
def test_a_parameter_outside_is_named_by_its_place(kind):
    patch = rectangle()
    u = pairs(patch)
    u[5:, :, 1] += 3.0
    with pytest.raises(DomainError, match=rf"parameters\[{5 * u.shape[1]}\].* outside the domain"):
        patch.evaluate(u, kind)


def test_derivatives_and_normals_of_a_grid_are_those_of_its_parameters():
    patch = rectangle()
    u = pairs(patch)[2:-2, 2:-2]
    flat = u.reshape(-1, 2)
    mixed = np.random.default_rng(1).permutation(len(flat))
    for method in (patch.derivatives, patch.normals):
        np.testing.assert_allclose(
            method(u).reshape(-1, *method(flat[:1]).shape[1:])[mixed], method(flat[mixed]), atol=1e-11
        )
    with pytest.raises(DomainError, match="on its boundary"):
        patch.derivatives(pairs(patch))


def test_meshes_of_rectangles_are_exactly_grids():
    shape = rectangle(1 / 3, 0.1).domain
    part = triangulation(shape, 7)
    grid = part.parameters.reshape(8, 8, 2)
    assert (grid[:, :, 0] == grid[0, :, 0]).all()
    assert (grid[:, :, 1] == grid[:, :1, 1]).all()
    assert (part.parameters[part.boundary[:, 0]] == shape.vertices).all()
