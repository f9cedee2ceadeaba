"""Toric degeneration and knot limits: the paper's examples, exact limits, and rates of convergence."""

from __future__ import annotations

import json
import math

import mpmath
import numpy as np
import pytest

from gtb_cli.errors import DomainError
from gtb_cli.lifting import regular_decomposition
from gtb_cli.limits import degenerate, merge_knots, move_knots, regular_control_surface
from gtb_cli.moment import linear_locations
from gtb_cli.spec import load
from tests.shell import SPECS, gtb

ROUNDINGS = 1e-12
"""Merged weights and points are sums of a few numbers."""

CURVE, SURFACE, LIFTED = (load(SPECS / f"example-{name}.toml") for name in ("3.1", "4.2", "4.4"))


def linear(patch, p):
    return patch.points_at(linear_locations(patch.domain, patch.log_products, p), len(p))


def test_example_3_3_merges_three_knots_into_one():
    merged = merge_knots(CURVE, {1: 2, 3: 2})
    assert merged.knots.ravel().tolist() == [0, 0.5, 1]
    assert merged.weights == pytest.approx([1, 36, 5], rel=ROUNDINGS)
    assert merged.control_points[1] == pytest.approx([66.2 / 36, 62 / 36, 0], rel=ROUNDINGS)


def test_example_3_2_and_chains():
    once = merge_knots(CURVE, {1: 2})
    assert once.weights == pytest.approx([1, 30, 6, 5], rel=ROUNDINGS)
    chain = merge_knots(CURVE, {1: 2, 2: 3})
    assert chain.weights == pytest.approx([1, 36, 5], rel=ROUNDINGS)
    with pytest.raises(DomainError):
        merge_knots(CURVE, {1: 2, 2: 1})


def test_example_4_2_is_the_paper_s_merged_data():
    merged = merge_knots(SURFACE, {3: 1})
    assert merged.weights == pytest.approx([2, 9, 5, 2, 3, 5, 2], rel=ROUNDINGS)
    assert merged.control_points[1] == pytest.approx([10 / 9, 12 / 9, 43 / 9], rel=ROUNDINGS)
    for step, place in ((0.4, (38 / 35, 52 / 35)), (0.8, (36 / 35, 64 / 35))):
        assert move_knots(SURFACE, {3: 1}, step).knots[3] == pytest.approx(place, rel=ROUNDINGS)


def test_merging_keeps_general_coefficients():
    """A patch with the knots at one place is the merged patch, whatever c is."""
    c = np.array([0.5, 2, 3, 0.7, 1.5])
    curve = type(CURVE)(CURVE.knots, CURVE.control_points, CURVE.weights, c)
    together = curve.knots.copy()
    together[3] = together[2]
    t = np.linspace(0, 1, 33)
    same = type(CURVE)(together, CURVE.control_points, CURVE.weights, c).evaluate(t)
    assert np.abs(merge_knots(curve, {3: 2}).evaluate(t) - same).max() < ROUNDINGS


def test_a_merge_that_changes_the_hull_is_refused():
    with pytest.raises(DomainError, match="hull"):
        merge_knots(SURFACE, {4: 3})


@pytest.mark.parametrize("x", [5.0, 100.0, 600.0, 1e6, 1e30])
def test_degenerations_are_their_definition(x):
    patch = degenerate(LIFTED, x)
    u = np.array([[0.5, 0.5], [1.0, 1.0], [1.3, 1.2], [0.1, 1.7]])
    with mpmath.workdps(50):
        for parameter, point in zip(u, patch.evaluate(u), strict=True):
            shape = LIFTED.domain
            terms = []
            for knot, weight, exponent in zip(LIFTED.knots, LIFTED.weights, LIFTED.lifting, strict=True):
                term = mpmath.mpf(float(weight)) * mpmath.mpf(x) ** mpmath.mpf(float(exponent))
                for normal, vertex in zip(shape.normals, shape.vertices, strict=True):
                    h, power = (
                        sum(
                            mpmath.mpf(float(normal[k])) * (mpmath.mpf(float(q[k])) - mpmath.mpf(float(vertex[k])))
                            for k in (0, 1)
                        )
                        for q in (parameter, knot)
                    )
                    term *= h**power
                terms.append(term)
            total = sum(terms)
            exact = [
                float(sum(t * float(b[k]) for t, b in zip(terms, LIFTED.control_points, strict=True)) / total)
                for k in range(3)
            ]
            assert point == pytest.approx(exact, abs=2e-11)


def test_degenerations_converge_at_the_rate_of_the_gaps():
    """Inside a cell the distance falls like x to the power of the smallest gap of the knots outside it."""
    decomposition = regular_decomposition(LIFTED.knots, LIFTED.lifting)
    limit = regular_control_surface(LIFTED)
    for index, (cell, patch) in enumerate(zip(decomposition.cells, limit.patches, strict=True)):
        gap = np.delete(decomposition.gaps(index), list(cell)).min()
        p = np.array([patch.domain.vertices.mean(axis=0)])
        target = linear(patch, p)
        xs = (1e4, 1e5)
        off = [np.linalg.norm(linear(degenerate(LIFTED, x), p) - target) for x in xs]
        assert math.log(off[0] / off[1]) / math.log(xs[1] / xs[0]) == pytest.approx(gap, rel=0.1)


def test_any_x_will_do():
    huge = degenerate(LIFTED, 1e300)
    p = np.array([[1.0, 1.0], [0.4, 0.6]])
    assert np.isfinite(linear(huge, p)).all()
    assert degenerate(LIFTED, 2.0).weights == pytest.approx(LIFTED.weights * 2.0**LIFTED.lifting, rel=1e-15)


def test_one_weight_to_infinity_is_the_polyline_of_property_g():
    limit = regular_control_surface(CURVE, [0, 1, 0, 0, 0])
    assert [patch.control_points.tolist() for patch in limit.patches] == [
        [[0, 0, 0], [0.4, 1.3, 0]],
        [[0.4, 1.3, 0], [4, 0, 0]],
    ]


def test_the_sequence_of_example_4_4(tmp_path):
    xs = ["5", "100", "600", "1e6", "1e30"]
    options = [option for x in xs for option in ("-x", x)]
    result = gtb("degenerate", SPECS / "example-4.4.toml", *options, "-n", 6, "-o", tmp_path / "out")
    assert result.status == 0, result.err
    meshes = json.loads((tmp_path / "out" / "sequence.json").read_text())["meshes"]
    assert [mesh["x"] for mesh in meshes] == [5, 100, 600, 1e6, 1e30, "inf"]
    distances = [mesh["distance_to_limit"] for mesh in meshes]
    assert distances == sorted(distances, reverse=True)
    assert distances[-2] < 1e-5
    assert distances[-1] == 0
    faces = {
        tuple(line for line in path.read_text().splitlines() if line[0] == "f")
        for path in (tmp_path / "out").glob("*.obj")
    }
    assert len(faces) == 1
    assert sorted(path.name for path in (tmp_path / "out").glob("*.obj")) == sorted(
        [f"example-4.4-x{x}.obj" for x in xs] + ["example-4.4-limit.obj"]
    )


def test_the_membrane_of_example_4_2(tmp_path):
    result = gtb(
        "knot-limit",
        SPECS / "example-4.2.toml",
        "--merge",
        "3:1",
        "--steps",
        "0,0.4,0.8",
        "-n",
        8,
        "-o",
        tmp_path / "k",
    )
    assert result.status == 0, result.err
    assert "pointwise only" in result.err
    meshes = json.loads((tmp_path / "k" / "sequence.json").read_text())["meshes"]
    assert [mesh["step"] for mesh in meshes] == [0, 0.4, 0.8, 1]
    assert meshes[2]["distance_to_limit"] == pytest.approx(0.559, abs=2e-3)
    assert meshes[2]["distance_to_limit_with_film"] < 0.4
