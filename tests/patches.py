"""Tiny named patches: numbers are exact rationals where they can be, and a few are at the edge of what is allowed."""

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
from hypothesis import assume, strategies as st

from gtb_cli.errors import DomainError
from gtb_cli.theory.patch import Patch

SHIFT = 1e7

Rows = Sequence[Sequence[Any]]


def numbers(rows: Sequence[Any]) -> np.ndarray:
    """Floats nearest to numbers, or strings such as "8/7"; nested as given."""
    return np.array([numbers(row) if isinstance(row, list | tuple) else float(Fraction(row)) for row in rows])


def bumps(knots: np.ndarray) -> np.ndarray:
    """(n, 3) control points over knots scaled to a box of size 2, with heights that follow no plane."""
    scaled = 2 * (knots - knots.min(axis=0)) / np.ptp(knots, axis=0).max()
    heights = [math.sin(3 * i + 1) for i in range(len(knots))]
    return np.column_stack([scaled, *[np.zeros(len(knots))] * (2 - knots.shape[1]), heights])


def cubic_curve() -> Patch:
    """Rational cubic Bézier curve."""
    return Patch([0, 1, 2, 3], numbers([[0, 0], [1, 2], [3, "5/2"], [4, 0]]), [1, 2, 0.5, 1], [1, 3, 3, 1])


def basis_curve() -> Patch:
    """Example 2.1: five real knots with coefficients."""
    c = numbers(["1/2", 1, "3/2", "7/10", "9/10"])
    return Patch([0, math.sqrt(2) / 4, 0.5, math.sqrt(2) / 2, 1], irrational_curve().control_points, coefficients=c)


def irrational_curve() -> Patch:
    """Example 3.1."""
    points = numbers([[0, 0], ["2/5", "13/10"], [2, 2], ["37/10", "3/2"], [4, 0]])
    return Patch([0, math.sqrt(2) / 4, 0.5, math.sqrt(2) / 2, 1], points, [1, 10, 20, 6, 5])


def repeated_curve() -> Patch:
    """Repeated knots at both ends and inside, in no order."""
    points = [[3, 0, 1], [0, 0, 0], [1, 2, 0], [4, 4, 4], [0, 1, 0], [2, 2, -1]]
    return Patch([2, 0, 1, 2, 0, 1], points, [1, 2, 3, 4, 5, 6])


def far_curve() -> Patch:
    """Real knots far from the origin, ends of different scale."""
    knots = SHIFT + np.array([0, 0.25, 0.75, 2])
    return Patch(knots, [[0, 0, 1], [1, 1, 1], [2, -1, 0], [3, 0, 0]], [1, 5, 2, 1], edge_scale=[2, 0.5])


def bezier_triangle() -> Patch:
    """Rational Bézier triangle of degree 3."""
    knots = [(i, j) for j in range(4) for i in range(4 - j)]
    c = [math.factorial(3) // math.factorial(i) // math.factorial(j) // math.factorial(3 - i - j) for i, j in knots]
    return Patch(knots, bumps(np.array(knots)), [1 + (i * j + i) / 2 for i, j in knots], c)


def bicubic() -> Patch:
    """Rational bicubic tensor-product patch."""
    knots = [(i, j) for j in range(4) for i in range(4)]
    c = [math.comb(3, i) * math.comb(3, j) for i, j in knots]
    return Patch(knots, bumps(np.array(knots)), [1 + (i + 2 * j) % 3 for i, j in knots], c)


PENTAGON_POINTS: Rows = [
    [0, 2, 0], [1, 2, 4], [0, "6/5", 2], ["8/7", "8/7", 5], [2, 1, 2], [0, 0, 0], ["6/5", 0, 2], [2, 0, 0],
]  # fmt: skip
PENTAGON_WEIGHTS = [2, 2, 5, 7, 2, 3, 5, 2]


def pentagon() -> Patch:
    """Example 4.1 with the real knots Ã."""
    points = numbers(PENTAGON_POINTS)
    return Patch(points[:, :2], points, PENTAGON_WEIGHTS)


def integer_pentagon() -> Patch:
    """Example 4.1 with the integer knots."""
    knots = [[0, 2], [1, 2], [0, 1], [1, 1], [2, 1], [0, 0], [1, 0], [2, 0]]
    return Patch(knots, numbers(PENTAGON_POINTS), PENTAGON_WEIGHTS)


def irrational_hexagon() -> Patch:
    """A regular hexagon, turned, with knots on its slanted edges and inside."""
    corners = regular(6, 0.2)
    on_edges = [corners[j] * (1 - t) + corners[(j + 1) % 6] * t for j, t in [(0, 1 / math.pi), (2, 0.5), (4, 0.3)]]
    knots = 2 * np.array([*corners, *on_edges, [0.1, 0.2], [-1 / math.e, 0.1]])
    return Patch(knots, bumps(knots), np.arange(1.0, 12.0))


def nonagon() -> Patch:
    """Nine edges, with a knot inside."""
    knots = np.vstack([regular(9, 0.0) * 3, [[0.5, math.sqrt(2) / 2]]])
    return Patch(knots, bumps(knots), edge_normals="unit")


def trapezoid() -> Patch:
    """Rows of 5, 4 and 3 knots."""
    knots = [(i, j) for j in range(3) for i in range(5 - j)]
    return Patch(knots, bumps(np.array(knots)), coefficients=[math.comb(4 - j, i) * math.comb(2, j) for i, j in knots])


def plain_triangle() -> Patch:
    """Nothing but three corners, slanted edges."""
    return Patch([[0, 0], [3, 1], [1, 4]], [[0, 0, 0], [1, 0, 0], [0, 1, 1]])


def repeated_knots() -> Patch:
    """Knots twice or three times at a corner, on an edge and inside."""
    knots = [[0, 0], [3, 0], [3, 2], [0, 2], [0, 0], [1, 0], [1, 0], [1.5, 1], [1.5, 1], [1.5, 1], [3, 2]]
    points = bumps(np.array(knots)) + np.arange(11)[:, None] / 8
    return Patch(knots, points, [1, 2, 1, 2, 3, 1, 4, 1, 2, 3, 5])


def sixty_knots() -> Patch:
    """Sixty knots without order, with weights from 1e-12 to 1e12."""
    golden = (1 + math.sqrt(5)) / 2
    knots = np.array(
        [[math.cos(i * golden * 6) * math.sqrt(i), math.sin(i * golden * 6) * math.sqrt(i)] for i in range(60)]
    )
    return Patch(knots / 4, bumps(knots), [10.0 ** (12 * math.sin(7 * i)) for i in range(60)])


def resized_pentagon(size: float) -> Patch:
    return pentagon().replace(knots=pentagon().knots * size, control_points=pentagon().control_points * size)


def collapsed_edge() -> Patch:
    """A bicubic patch with one edge, and one further knot pair, in a point."""
    patch = bicubic()
    points = patch.control_points.copy()
    points[:4] = [1, -1, 0]
    points[9] = points[10]
    return Patch(patch.knots, points, patch.weights, patch.coefficients)


def regular(sides: int, turn: float) -> np.ndarray:
    """(sides, 2) corners of a regular polygon on the unit circle."""
    angle = 2 * np.pi * np.arange(sides) / sides + turn
    return np.column_stack([np.cos(angle), np.sin(angle)])


CURVES = {make.__name__: make for make in (cubic_curve, basis_curve, irrational_curve, repeated_curve, far_curve)}
KNOWN = (bezier_triangle, bicubic, pentagon, integer_pentagon, irrational_hexagon, nonagon, trapezoid, plain_triangle)
SURFACES = {make.__name__: make for make in (*KNOWN, repeated_knots, sixty_knots)} | {
    # Weights of 1e-12 and 1e12 side by side, and x^λ with x = 1e300, which no float holds
    "extreme_weights": lambda: bicubic().replace(
        weights=[10.0 ** (12 if i % 3 else -12) for i in range(16)], coefficients=None
    ),
    "beyond_floats": lambda: pentagon().replace(log_weights=np.array([1, 0, 3, 2, 0, 1, 3, 1]) * math.log(1e300)),
    # Exponents in the hundreds, and of a thousandth
    "large_knots": lambda: irrational_hexagon().replace(knots=irrational_hexagon().knots * 500),
    "small_knots": lambda: irrational_hexagon().replace(knots=irrational_hexagon().knots / 1000),
    "far_pentagon": lambda: pentagon().replace(knots=pentagon().knots + np.array([SHIFT, -SHIFT]), edge_normals="unit"),
    "tiny_pentagon": lambda: resized_pentagon(1e-9),
    "huge_pentagon": lambda: resized_pentagon(1e9).replace(edge_normals="unit", edge_scale=1e-9),
    "scaled_edges": lambda: pentagon().replace(edge_scale=[1, 0.5, 3, 0.1, 2]),
    "collapsed_edge": collapsed_edge,
}
NAMES = [*CURVES, *SURFACES]


@cache
def named(name: str) -> Patch:
    """The patch of that name, made once."""
    return (CURVES | SURFACES)[name]()


@st.composite
def any_patch(draw: st.DrawFn, dimension: int | None = None) -> Patch:
    """A patch of 2 to 12 knots, with weights of any size, perhaps far away, large or small."""
    # Places of knots: on a lattice, so that many are repeated or collinear, or anywhere
    coordinates = st.one_of(
        st.integers(0, 4).map(float), st.floats(-3, 3, allow_subnormal=False).map(lambda x: round(x, 3))
    )
    d = draw(st.sampled_from([1, 2, 2])) if dimension is None else dimension
    n = draw(st.integers(d + 1, 12))
    knots = np.array(draw(st.lists(st.tuples(*[coordinates] * d), min_size=n, max_size=n)))
    knots = (knots + draw(st.sampled_from([0, 0, 0, 100]))) * draw(st.sampled_from([1, 1, 1e-9, 1e-3, 20, 1e9]))
    points = np.array(draw(st.lists(st.tuples(*[st.integers(-9, 9)] * 3), min_size=n, max_size=n)), dtype=float)
    exponents = st.lists(st.floats(-12, 12), min_size=n, max_size=n)
    weights = 10.0 ** np.array(draw(exponents)) if draw(st.booleans()) else None
    try:
        return Patch(knots, points, weights)
    except DomainError:
        assume(False)
        raise
