"""Hulls, edges and edge functions: what is on an edge, how it is measured, and what is refused."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from gtb_cli.domain import convex_hull, domain
from gtb_cli.errors import DomainError

PENTAGON = np.array([[0, 2], [1, 2], [0, 6 / 5], [8 / 7, 8 / 7], [2, 1], [0, 0], [6 / 5, 0], [2, 0]])

EXACT = 4e-16
"""Two roundings."""


def test_the_pentagon_of_example_2_2():
    shape = domain(PENTAGON)
    assert shape.vertices.tolist() == [[0, 0], [2, 0], [2, 1], [1, 2], [0, 2]]
    # The paper's v, 2 − u, 3 − u − v, 2 − v, u.
    assert shape.normals.tolist() == [[0, 1], [-1, 0], [-1, -1], [0, -1], [1, 0]]
    assert [shape.edge_knots(j).tolist() for j in range(5)] == [[5, 6, 7], [7, 4], [4, 1], [1, 0], [0, 2, 5]]
    u, v = 0.7, 1.1
    assert shape.edge_functions([[u, v]])[0] == pytest.approx([v, 2 - u, 3 - u - v, 2 - v, u], rel=EXACT)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("shift", [0.0, 1e7])
def test_collinear_knots_stay_on_their_edges_at_any_scale_and_place(scale, shift):
    shape = domain(PENTAGON * scale + shift * scale)
    assert len(shape.vertices) == 5
    assert shape.incidence.sum(axis=0).tolist() == [3, 2, 2, 2, 3]
    assert (shape.heights[shape.incidence] == 0).all()


@pytest.mark.parametrize(("depth", "on_edge"), [(1e-11, False), (1e-14, True), (-1e-14, True), (-1e-10, None)])
def test_the_tolerance_of_collinear_knots(depth, on_edge):
    """1e-12 of the size: a knot at 1e-11 is inside, one at 1e-14 is on the edge, on either side of it."""
    shape = domain([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, depth]])
    if on_edge is None:
        assert len(shape.vertices) == 5
    else:
        assert len(shape.vertices) == 4
        assert shape.incidence[4, 0] == on_edge


@given(st.integers(0, 10**6), st.integers(4, 40))
def test_hulls_are_scipys(seed, n):
    points = np.random.default_rng(seed).normal(size=(n, 2))
    ours, theirs = convex_hull(points), ConvexHull(points).vertices
    start = ours.tolist().index(theirs[0])
    assert np.roll(ours, -start).tolist() == theirs.tolist()
    assert points[ours[0], 1] == points[:, 1].min()


def test_repeated_knots_and_the_lowest_leftmost_corner():
    shape = domain([[2, 2], [0, 0], [2, 0], [0, 0], [2, 0], [1, 1]])
    assert shape.vertices.tolist() == [[0, 0], [2, 0], [2, 2]]
    assert shape.faces[4:].tolist() == [
        [False, True, False, True, False, False],
        [False, False, True, False, True, False],
        [True, False, False, False, False, False],
    ]


@pytest.mark.parametrize(
    "knots", [[[0, 0], [1, 1], [2, 2]], [[0, 0], [0, 0], [0, 0]], [[0, 0], [1, 1e-14], [2, 0]], [[3.0, 1], [3, 2]]]
)
def test_flat_knots_are_refused(knots):
    with pytest.raises(DomainError, match="on one line"):
        domain(knots)


def test_a_curve_needs_two_places():
    with pytest.raises(DomainError, match="two different knots"):
        domain([1.0, 1.0, 1.0])
    assert domain([2.0, 0.0, 1.0]).vertices.ravel().tolist() == [0, 2]


def test_lengths_of_normals():
    triangle = np.array([[0, 0], [4, 0], [0, 2.0]])
    assert domain(triangle, "primitive").normals.tolist() == [[0, 1], [-1, -2], [1, 0]]
    assert domain(triangle, "auto").normals.tolist() == [[0, 1], [-1, -2], [1, 0]]
    assert domain(triangle, "unit").normals[1] == pytest.approx([-1 / math.sqrt(5), -2 / math.sqrt(5)], rel=EXACT)
    assert np.linalg.norm(domain(triangle + 0.5, "auto").normals, axis=1) == pytest.approx([1, 1, 1], rel=EXACT)
    with pytest.raises(DomainError, match=r"primitive needs integer corners of the hull, got \(0\.5, 0\.5\)"):
        domain(triangle + 0.5, "primitive")
    with pytest.raises(DomainError, match="expected auto, unit or primitive, got 'long'"):
        domain(triangle, "long")


def test_edge_scales():
    triangle = [[0, 0], [1, 0], [0, 1]]
    assert domain(triangle, edge_scale=[2, 3, 5]).normals.tolist() == [[0, 2], [-3, -3], [5, 0]]
    with pytest.raises(DomainError, match="expected one number or 3, one per edge"):
        domain(triangle, edge_scale=[1, 2])
    with pytest.raises(DomainError, match="edge_scale"):
        domain(triangle, edge_scale=-1)
    curve = domain([0, 1, 3], edge_scale=[2, 5])
    assert curve.edge_functions([1.0]).tolist() == [[2, 10]]


@given(st.integers(0, 10**6))
def test_edge_functions_keep_their_digits_up_to_the_edge(seed):
    """Against exact fractions, for slanted edges and points down to 1e-12 of the size from them."""
    rng = np.random.default_rng(seed)
    knots = rng.normal(size=(6, 2))
    shape = domain(knots, "unit")
    v, r = shape.vertices, len(shape.vertices)
    j = int(rng.integers(r))
    t = rng.random()
    u = (1 - t) * v[j] + t * v[(j + 1) % r]
    u = u + (v.mean(axis=0) - u) * 10.0 ** rng.uniform(-12, -1)
    got = shape.edge_functions(u[None])[0, j]
    (ax, ay), (bx, by), (x, y) = ([Fraction(float(c)) for c in p] for p in (v[j], v[(j + 1) % r], u))
    cross = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
    assert got == pytest.approx(float(cross) / math.hypot(float(bx - ax), float(by - ay)), rel=1e-14)


def test_parameters_are_snapped_within_four_roundings_and_no_more():
    shape = domain([[0, 0], [1, 0], [1, 1], [0, 1]])
    assert shape.edge_functions([[0.5, -5e-16]])[0, 0] == 0
    assert shape.edge_functions([[0.5, 5e-16]])[0, 0] == 0
    assert shape.edge_functions([[0.5, 1e-12]])[0, 0] == 1e-12
    with pytest.raises(DomainError, match=r"parameters\[1\]: \(0\.5, -1e-12\) is outside the domain, by up to 1e-12"):
        shape.edge_functions([[0.5, 0.5], [0.5, -1e-12]])


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
def test_parameters_must_be_finite(wrong):
    with pytest.raises(DomainError, match=r"parameters\[2\]: must be finite"):
        domain(PENTAGON).edge_functions([[0.5, 0.5], [1, 1], [wrong, 1]])


@pytest.mark.parametrize("wrong", [[0.5], [[1, 2, 3]], 0.5])
def test_parameters_must_have_the_right_shape(wrong):
    with pytest.raises(DomainError, match=r"parameters: expected shape \(m, 2\)"):
        domain(PENTAGON).edge_functions(wrong)


def test_faces_of_points():
    shape = domain(PENTAGON)
    u = np.array([[1, 1], [1, 0], [2, 0.5], [1.5, 1.5], [0.5, 2], [0, 1], *shape.vertices])
    assert shape.face_of(shape.heights_of_columns(u)).tolist() == list(range(11))


def test_points_known_to_lie_on_an_edge_are_taken_to():
    shape = domain(PENTAGON)
    off = np.array([[1.5 + 3e-15, 1.5 + 2e-15]])
    with pytest.raises(DomainError, match="outside"):
        shape.heights_of_columns(off)
    assert shape.heights_of_columns(off, 0, np.array([3]))[2, 0] == 0
