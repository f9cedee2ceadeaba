"""Bézier pieces against the patch in exact fractions, and against 50 digits."""

import math
from fractions import Fraction

import numpy as np
import pytest

from gtb_cli.bezier.pieces import bezier_degree, bezier_pieces, split_curve
from gtb_cli.errors import DomainError
from gtb_cli.knots.lattice import lattice_of
from gtb_cli.models.model import Model
from gtb_cli.theory.basis import torus_coordinates
from gtb_cli.theory.patch import Patch
from tests import exact
from tests.laws import size
from tests.patches import bicubic, cubic_curve, integer_pentagon, irrational_curve, named
from tests.shell import SPECS
from tests.specs import load

AGREEMENT = 1e-13  # of the patch's size

COMMENSURABLE = ["bicubic", "bezier_triangle", "integer_pentagon", "trapezoid", "repeated_knots"]
COMMENSURABLE += ["collapsed_edge", "cubic_curve", "repeated_curve"]


def steps_of(patch: Patch, corner: int, piece: Patch) -> tuple[list[int], np.ndarray]:
    """The edges at a corner, and the values of their edge functions that raise the powers of s and t by one."""
    edges = [corner - 1, corner] if patch.dimension == 2 else [corner]
    return edges, patch.domain.heights.max(axis=0)[edges] / piece.knots.max(axis=0)


def at(piece: Patch, corner: int, coordinates: np.ndarray) -> np.ndarray:
    """The point of a piece with coordinates (s, t): its knots are 0 … D; a curve is split at s = v/(1 − v) = 1."""
    if piece.dimension == 1:
        fraction = 2 * coordinates / (1 + coordinates)
        coordinates = 1 - fraction if corner == 1 else fraction
    return piece.evaluate((piece.knots.max(axis=0) * coordinates)[None])[0]


@pytest.mark.parametrize("name", COMMENSURABLE)
def test_pieces_tile_the_patch(name: str) -> None:
    patch = named(name)
    pieces, v = bezier_pieces(patch), patch.domain.vertices
    assert len(pieces) == len(v)
    for u in np.random.default_rng(3).dirichlet(np.ones(len(v)), 40) @ v:
        s = torus_coordinates(patch.domain, patch.domain.heights_of_columns(u[None]))[:, 0]
        found = []
        for corner, piece in enumerate(pieces):
            edges, steps = steps_of(patch, corner, piece)
            logs = np.linalg.solve(patch.domain.normals[edges].T, s)
            if (logs <= 1e-12).all():
                found.append(at(piece, corner, np.exp(np.minimum(logs, 0.0) * steps)))
        assert found
        assert np.abs(np.array(found) - patch.evaluate(u[None])).max() <= 10 * AGREEMENT * size(patch)


def test_a_piece_is_the_patch_in_fractions() -> None:
    patch = integer_pentagon()
    products = [Fraction(x) for x in (patch.weights * patch.coefficients).tolist()]
    points = [[Fraction(x) for x in row] for row in patch.control_points.tolist()]
    for corner, piece in enumerate(bezier_pieces(patch)):
        edges, steps = steps_of(patch, corner, piece)
        powers = np.rint(patch.domain.heights[:, edges] / steps).astype(int)
        assert piece.knots.max(axis=0).tolist() == powers.max(axis=0).tolist()
        for s, t in ((Fraction(1, 3), Fraction(3, 4)), (Fraction(1), Fraction(2, 7)), (Fraction(0), Fraction(5, 9))):
            terms = [p * s**i * t**j for p, (i, j) in zip(products, powers.tolist(), strict=True)]
            expected = [
                float(sum(w * b[axis] for w, b in zip(terms, points, strict=True)) / sum(terms)) for axis in range(3)
            ]
            found = at(piece, corner, np.array([float(s), float(t)]))
            assert np.abs(found - expected).max() <= AGREEMENT * size(patch)


@pytest.mark.parametrize("name", COMMENSURABLE)
def test_pieces_are_bezier_patches_with_positive_weights(name: str) -> None:
    for piece in bezier_pieces(named(name)):
        assert lattice_of(piece.domain) is not None
        assert (piece.weights > 0).all()
        assert piece.coefficients[0] == 1.0


def test_pieces_share_their_edges_and_the_middle() -> None:
    pieces = bezier_pieces(integer_pentagon())
    assert len(pieces.joints.shared) == 5
    assert len(pieces.joints.open) == 10
    last = [piece.control_points[-1] for piece in pieces]
    assert np.abs(np.array(last) - last[0]).max() <= AGREEMENT * size(integer_pentagon())
    assert not any(pieces.joints.flipped)


def test_a_model_keeps_its_joints() -> None:
    teapot = load(SPECS / "teapot.toml")
    assert isinstance(teapot, Model)
    part = Model(teapot.patches[:8])
    pieces = bezier_pieces(part)
    assert len(pieces) == 32
    assert len(pieces.joints.open) == 2 * len(part.joints.open)
    assert len(pieces.joints.collapsed) == 2 * len(part.joints.collapsed)


@pytest.mark.parametrize("at", [0.25, 1.0, 1.5, 2.999])
def test_a_curve_is_split_where_it_is_asked_for(at: float) -> None:
    curve = cubic_curve()
    left, right = split_curve(curve, at)
    expected = np.array([float(x) for x in exact.point(curve, [at])])
    for found in (left.control_points[-1], right.control_points[0]):
        assert np.abs(found - expected).max() <= AGREEMENT * size(curve)
    for u in np.linspace(0, 3, 31):
        piece, v = (left, 3 * u / at) if u <= at else (right, 3 * (u - at) / (3 - at))
        assert np.abs(piece.evaluate(np.array([min(v, 3.0)])) - curve.evaluate(np.array([u]))).max() <= AGREEMENT * 5


def test_missing_knots_have_pieces_of_the_common_denominator() -> None:
    curve = Patch([0, 1 / 3, 1 / 2, 1], [[0, 0], [1, 2], [2, -1], [3, 0]], [1, 2, 3, 4])
    left, right = bezier_pieces(curve)
    assert len(left.knots) == len(right.knots) == 7
    assert np.abs(left.control_points[-1] - right.control_points[0]).max() == 0
    total = np.array([1, 2, 3, 4.0])
    np.testing.assert_allclose(left.control_points[-1], total @ curve.control_points / 10, atol=1e-15)


@pytest.mark.parametrize(("factor", "shift"), [(1e-9, 0.0), (1e9, 0.0), (1.0, 1e7), (math.pi, 0.0)])
def test_any_scale_and_place_of_knots_control_points_and_edges(factor: float, shift: float) -> None:
    patch = integer_pentagon()
    by_knots = patch.replace(knots=factor * patch.knots + shift)
    by_points = patch.replace(control_points=factor * patch.control_points + shift)
    by_edges = patch.replace(edge_scale=[1, 0.5, 3, 0.1, factor])
    error = AGREEMENT * size(by_points) + 4 * np.finfo(float).eps * shift
    for piece, *others in zip(*map(bezier_pieces, (patch, by_knots, by_points, by_edges)), strict=True):
        assert all(np.array_equal(piece.knots, other.knots) for other in others)
        for other in (others[0], others[2]):
            assert np.abs(piece.control_points - other.control_points).max() <= AGREEMENT * size(patch)
        assert np.abs(factor * piece.control_points + shift - others[1].control_points).max() <= error


def test_weights_beyond_the_range_of_floats_stay_logarithms() -> None:
    patch = bicubic()
    steep = patch.replace(log_weights=np.linspace(-900, 900, 16))
    for piece in bezier_pieces(steep):
        assert np.isfinite(piece.log_weights).all()
        assert np.isfinite(piece.control_points).all()


@pytest.mark.parametrize(
    ("patch", "most", "message"),
    [
        (irrational_curve(), 25, "no common step"),
        (Patch([0, 0.3, 1], [[0, 0], [1, 1], [2, 0]]), 9, "degree 10 only.*common denominator 10, and at most 9"),
        (named("pentagon"), 25, "from edge 0, as fractions of the largest, have the common denominator 70"),
        (named("irrational_hexagon"), 25, "from edge 0 have no common step"),
        (Patch([[0, 0], [101, 0], [101, 101], [0, 101], [1, 1]], np.eye(5)[:, :3]), 200, "10404 control points each"),
    ],
)
def test_the_reason_where_there_are_none(patch: Patch, most: int, message: str) -> None:
    with pytest.raises(DomainError, match=message):
        bezier_pieces(patch, most)


def test_a_model_names_the_patch_without_pieces() -> None:
    flat = [[0, 0], [1, 1], [2, 0]]
    model = Model((Patch([0, 1, 2], flat), Patch([0, math.sqrt(2), 2], flat, name="bow")))
    with pytest.raises(DomainError, match=r"^bow: has no Bézier pieces"):
        bezier_pieces(model)


@pytest.mark.parametrize("at", [0.0, 3.0, -1.0, 4.0, math.nan, 1e-320])
def test_a_split_is_between_the_ends(at: float) -> None:
    with pytest.raises(DomainError, match="split: "):
        split_curve(cubic_curve(), at)
    with pytest.raises(DomainError, match="split: is for curves"):
        split_curve(bicubic(), 0.5)


def test_a_split_that_rounding_would_move_is_refused() -> None:
    """Exponents of 4e9 moved the point by 7e-8 of the size, which was called exact."""
    curve = cubic_curve()
    for scale in (1e6, 1e9):
        with pytest.raises(DomainError, match="split: rounding may move the point"):
            split_curve(curve.replace(knots=curve.knots * scale), scale)
    split_curve(curve.replace(knots=curve.knots * 1e4), 1e4)


def test_degrees() -> None:
    assert bezier_degree(np.array([0, 2.0, 4.0]), 0.0) == 2
    assert bezier_degree(np.array([0, 1 / 3, 1 / 7, 1.0]), 0.0) == 21
    assert bezier_degree(np.array([0, math.sqrt(2), 2.0]), 0.0) is None


def test_powers_that_no_knot_has_cost_nothing(monkeypatch):
    """A curve of four knots took 16 s, for a table of half a million binomials."""
    counted, comb = [], math.comb
    monkeypatch.setattr("math.comb", lambda n, k: counted.append(k) or comb(n, k))
    bezier_pieces(Patch([0, 1 / 997, 500 / 997, 1], [[0, 0], [1, 2], [2, 0], [3, 1]]), 1000)
    assert len(counted) < 10_000
