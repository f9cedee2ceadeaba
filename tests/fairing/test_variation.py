"""Curvature and its variation: integrals of surfaces that are known, and quadratic forms that agree with them."""

import math

import numpy as np
import pytest

from gtb_cli.fairing.energy import energy_samples, samples
from gtb_cli.fairing.metric import Block, blocks, forms
from gtb_cli.fairing.variation import bendings, linearisation
from gtb_cli.knots.domain import domain
from gtb_cli.moment.moment_map import MomentMap
from gtb_cli.moment.solve import LogSum
from gtb_cli.theory.patch import Patch


def sampled(patch: Patch, resolution: int = 24) -> tuple[list[Block], np.ndarray]:
    p, areas, _ = energy_samples(patch.domain, resolution)
    return list(blocks(patch.knots, patch.log_products, MomentMap(patch.knots, patch.log_products).inverse(p))), areas


def bicubic(f) -> Patch:
    i, j = (index.ravel() / 3 for index in np.mgrid[:4, :4])
    return Patch(np.column_stack([i, j]), f(i, j), coefficients="binomial")


def graph(a: float) -> Patch:
    """z = a (x³ + 3 x²y + x y²) + x²: of a = 0 a parabolic cylinder, with curvature 2 / (1 + 4 x²)^1.5."""
    lattice = bicubic(lambda x, y: np.column_stack([x, y, x]))
    u = np.random.default_rng(0).random((80, 2))
    z = a * (u[:, 0] ** 3 + 3 * u[:, 0] ** 2 * u[:, 1] + u[:, 0] * u[:, 1] ** 2) + u[:, 0] ** 2
    heights = np.linalg.lstsq(lattice.basis(u, "linear"), z, rcond=None)[0]
    return lattice.replace(control_points=np.column_stack([lattice.knots, heights]))


def test_a_cylinder_over_a_parabola():
    """Arc length s has ds = w dx with w² = 1 + 4 x²; κ = 2 / w³ and H = κ / 2."""
    patch = graph(0.0)
    ((found,),) = bendings(*sampled(patch, 40), [patch.control_points])
    nodes, weights = np.polynomial.legendre.leggauss(40)
    x, dx = 0.5 + 0.4995 * nodes, 0.4995 * weights
    w = np.sqrt(1 + 4 * x * x)
    assert found.area == pytest.approx(0.999 * (w @ dx), rel=1e-6)
    assert found.energy == pytest.approx(0.999 * ((2 / w**3) ** 2 * w @ dx), rel=1e-6)
    slope = -12 * x / w**5 / w  # dH/ds
    assert found.variation == pytest.approx(found.area * 0.999 * (slope**2 * w @ dx), rel=1e-6)
    assert found.curvature == pytest.approx(2, rel=1e-2)


@pytest.mark.parametrize(("scale", "shift"), [(1e-9, 0.0), (1e9, 0.0), (1.0, 1e3)])
def test_integrals_have_no_unit(scale, shift):
    patch = graph(0.5)
    ((one, other),) = bendings(*sampled(patch), [patch.control_points, patch.control_points * scale + shift])
    assert other.energy == pytest.approx(one.energy, rel=1e-6)
    assert other.variation == pytest.approx(one.variation, rel=1e-6)
    assert other.curvature * scale == pytest.approx(one.curvature, rel=1e-6)


def test_several_zones_are_measured_at_once():
    patch = graph(0.5)
    where, areas = sampled(patch, 10)
    zones = areas * np.stack([np.linspace(0, 1, len(areas)), np.ones(len(areas))])
    found = bendings(where, zones, [patch.control_points, -2 * patch.control_points])
    for zone, expected in zip(zones, found, strict=True):
        (alone,) = bendings(where, zone, [patch.control_points])
        assert alone[0].energy == pytest.approx(expected[0].energy, rel=1e-12)
        assert alone[0].area == pytest.approx(expected[1].area / 4, rel=1e-12)


def test_digits_are_kept_near_edges_and_corners():
    """Curvature there follows from differences of sums that are 1e10 times larger in coordinates from elsewhere."""
    bent = bicubic(lambda x, y: np.column_stack([x, y, x * x + np.sin(3 * x * y)]))
    turn = np.array([[0.8, 0.6], [-0.6, 0.8]])
    patch = Patch(bent.knots @ turn, bent.control_points, coefficients="binomial")
    places = np.array([[0.5, 1e-5], [1e-5, 0.3], [2e-5, 1e-5], [1 - 1e-5, 1 - 2e-5]]) @ turn
    s = MomentMap(patch.knots, patch.log_products).inverse(places)
    found = bendings(blocks(patch.knots, patch.log_products, s), np.eye(4), [patch.control_points])
    curvature = patch.curvature(places, "linear")
    squares = [each.energy / each.area for (each,) in found]
    np.testing.assert_allclose(squares, 4 * curvature.mean**2 - 2 * curvature.gaussian, rtol=2e-8)


def test_samples_start_from_coarser_ones(monkeypatch):
    """A place takes few evaluations of the moments: 11 from the layers alone, on loops of many knots 25."""
    columns, moments = [], LogSum.moments
    monkeypatch.setattr(LogSum, "moments", lambda total, s: (columns.append(s.shape[1]), moments(total, s))[1])
    lattice = domain(np.stack(np.mgrid[:12, :12], axis=-1).reshape(-1, 2))
    found = samples(lattice, np.random.default_rng(0).normal(size=144), 32)
    assert sum(columns) < 8 * len(found.areas)
    np.testing.assert_allclose(found.areas @ MomentMap(*found[:2])(found.s), 0, atol=1e-9)


def test_forms_are_the_integrals_of_the_surface_whose_metric_they_have():
    """Of P itself the forms are ∫ |II|² and ∫ |∇II|², however it is parametrised: here with weights that are uneven."""
    patch = graph(0.5)
    uneven = Patch(patch.knots, points := patch.control_points, np.geomspace(1, 3, 16), "binomial")
    where = sampled(uneven)
    second, third = forms(*where, points, (2, 3))
    ((found,),) = bendings(*where, [points])
    assert np.einsum("ik,ij,jk->", points, second, points) == pytest.approx(found.energy, rel=1e-9)
    # The part of a symmetric tensor of third order that its trace determines has 3/4 of the square of the trace, 2 ∇H
    assert np.einsum("ik,ij,jk->", points, third, points) >= 3 * found.variation / found.area
    *at, areas = samples(uneven.domain, uneven.log_products, 10)
    parts = slice(None), *np.arange(400).reshape(40, 10)  # beside corners, shares of far knots are nothing
    whole, *halves = (forms(blocks(*at, part), areas, points, (3,))[0] for part in parts)
    np.testing.assert_allclose(sum(halves), whole, rtol=1e-9, atol=1e-12 * np.abs(whole).max())
    for matrix in (second, third):
        np.testing.assert_allclose(matrix @ np.ones(16), 0, atol=1e-9 * np.abs(matrix).max())


def test_the_third_form_vanishes_on_paraboloids_seen_from_afar():
    """z = ε (x² + y²): third derivatives are of order ε³, and ∫ |∇II|² of order ε⁶."""
    energies = []
    for size in (1e-2, 2e-2):
        patch = bicubic(lambda x, y, a=1.5 * size: np.column_stack([x, y, a * (x * (x - 1 / 3) + y * (y - 1 / 3))]))
        (third,) = forms(*sampled(patch), patch.control_points, (3,))
        energies.append(np.einsum("ik,ij,jk->", patch.control_points, third, patch.control_points))
    assert math.log2(energies[1] / energies[0]) == pytest.approx(6, abs=0.1)


def test_the_linearisation_is_that_of_differences():
    """At a bent surface with uneven weights, or near a corner, where the last knot counts for nothing."""
    patch = graph(0.5)
    uneven = Patch(patch.knots, patch.control_points, np.geomspace(1, 3, 16), "binomial")
    near = list(blocks(uneven.knots, uneven.log_products, -np.array([[30.0, 31], [30, 30]]))), np.ones(2)
    members, h = np.array([5, 15, 10]), 1e-5
    for where in (sampled(uneven, 10), near):
        values, slopes, squares, matrices = linearisation(*where, uneven.control_points, members)
        steps, moved = h * np.eye(9).reshape(9, 3, 3), np.tile(uneven.control_points, (18, 1, 1))
        moved[:, members] += [*steps, *-steps]
        found = bendings(*where, [uneven.control_points, *moved])[0]
        found = [(b.area, b.energy, b.variation / b.area) for b in found]
        np.testing.assert_allclose(values, found[0], rtol=1e-12)
        differences = (np.array(found[1:10]) - found[10:]).T / (2 * h)
        for slope, expected in zip(slopes, differences, strict=True):
            np.testing.assert_allclose(2 * slope, expected, rtol=1e-5, atol=1e-6 * np.abs(expected).max())
        assert all(np.linalg.eigvalsh(square).min() > -1e-9 * np.abs(square).max() for square in squares)
        whole = forms(*where, uneven.control_points, (2, 3))
        np.testing.assert_allclose(matrices, whole[:, members[:, None], members], rtol=1e-9)
