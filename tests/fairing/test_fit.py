"""Curves and surfaces through points, and surfaces near them; the iteration converges as its matrix says."""

import math

import numpy as np
import pytest

from gtb_cli.checks.properties import check_patch
from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.fairing.fit import MAX_POINTS, RESIDUAL_TOLERANCE, fit, surface_near, surface_through
from gtb_cli.language.loading import from_dict, parse
from gtb_cli.language.writer import to_dict
from gtb_cli.tessellation.tessellate import tessellate
from tests.marks import long
from tests.shell import BICUBIC, CURVE, PENTAGON, gtb
from tests.specs import load


def helix(n: int) -> np.ndarray:
    return np.array([[math.cos(t), math.sin(t), t / 5] for t in np.linspace(0, 6, n)])


@pytest.mark.parametrize("n", [2, 3, 10, 70, MAX_POINTS])
def test_a_curve_passes_its_points(n):
    found = fit(helix(n))
    size = np.abs(helix(n)).max()
    assert found.distance <= RESIDUAL_TOLERANCE * size
    np.testing.assert_allclose(found.curve.evaluate(found.parameters), helix(n), atol=2 * RESIDUAL_TOLERANCE * size)
    assert found.curve.evaluate(found.curve.domain.vertices).tolist() == helix(n)[[0, -1]].tolist()
    assert (np.diff(found.parameters) > 0).all()


def test_more_points_of_a_circle_make_a_better_circle():
    errors = []
    for n in (10, 20, 40):
        curve = fit(helix(n)).curve
        points = curve.evaluate(np.linspace(*curve.domain.vertices[:, 0], 1000))
        errors.append(np.abs(np.hypot(points[:, 0], points[:, 1]) - 1).max())
    assert errors[0] < 0.02
    assert errors[1] < errors[0] / 3
    assert errors[2] < errors[1] / 3


def test_parameters_are_spread_evenly():
    """With equal steps of the parameter, no step along the curve is much longer than another."""
    curve = fit(helix(50)).curve
    points = curve.evaluate(np.linspace(*curve.domain.vertices[:, 0], 2000))
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert steps.max() < 3 * steps.mean()


def test_rounds_are_what_the_eigenvalues_say():
    """Each round shrinks what is missed by the spectral radius of I − C, in the end."""
    found = fit(helix(12))
    matrix = found.curve.basis(found.parameters)
    radius = np.abs(1 - np.linalg.eigvals(matrix)).max()
    expected = math.log(RESIDUAL_TOLERANCE) / math.log(radius)
    assert 0.6 * expected < found.rounds < 1.2 * expected
    assert fit(helix(50)).rounds < 1.5 * fit(helix(12)).rounds


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1e9])
def test_any_size(scale):
    found, plain = fit(helix(9) * scale), fit(helix(9))
    np.testing.assert_allclose(
        found.curve.control_points, plain.curve.control_points * scale, rtol=1e-9, atol=1e-11 * scale
    )
    np.testing.assert_allclose(found.parameters, plain.parameters * scale, rtol=1e-12)


@pytest.mark.parametrize(
    ("points", "knots"),
    [
        (np.random.default_rng(3).normal(size=(7, 2)).tolist(), [0, 1, 1.5, 3, 3.2, 5, 8]),
        ([[0, 0], [1, 1], [2, 1], [3, 0]], [0, 1e-12, 1, 2]),
        ([[0, 0], [1, 1], [2, 0], [1, 1], [0, 0]], None),
    ],
)
def test_knots_may_be_given_and_points_may_come_back(points, knots):
    found = fit(points, knots)
    assert knots in (None, found.curve.knots[:, 0].tolist())
    np.testing.assert_allclose(found.curve.evaluate(found.parameters)[:, :2], points, atol=1e-11)
    is_extreme = knots is not None and 1e-12 in knots  # nearly a repeated knot
    assert is_extreme or check_patch(found.curve).holds


@pytest.mark.parametrize("seed", range(8))
def test_points_may_be_uneven(seed):
    """Chords from 0.01 to 10: weights beyond floats, and basis functions that are nearly the same."""
    rng = np.random.default_rng(seed)
    points = np.cumsum(10.0 ** rng.uniform(-2, 1, (int(rng.integers(5, 40)), 2)), axis=0)
    found = fit(points)
    np.testing.assert_allclose(found.curve.evaluate(found.parameters)[:, :2], points, atol=1e-11 * points.max())
    assert from_dict(to_dict(found.curve)) == found.curve


@pytest.mark.parametrize("seed", range(4))
def test_curves_through_very_uneven_points_can_be_meshed(seed):
    """Chords from a billionth to 1: with knots as uneven, rounding of the weights was more than meshes bear."""
    rng = np.random.default_rng(seed)
    chords = 10.0 ** rng.uniform(-9, 0, 12)[:, None] * [[0.6, 0.8]] * rng.choice([-1, 1], (12, 2))
    curve = fit(np.cumsum(chords, axis=0)).curve
    assert len(tessellate(curve, resolution=200).vertices) == 201


@pytest.mark.parametrize(
    ("points", "knots", "message"),
    [
        ([[0, 0]], None, "points: expected 2 to 100, got 1"),
        (np.arange(202).reshape(101, 2), None, "got 101"),
        ([[0, 0], [1, 1], [1, 1]], None, "points: 1 and 2 coincide"),
        ([0, 1, 2], None, r"points: expected shape \(n, 3\) or \(n, 2\)"),
        ([[0, 0], [1, math.nan]], None, r"points\[1\]\[1\]: must be finite"),
        ([[0, 0], [1, 1]], [0, 1, 2], "knots: expected 2, one for each point, got 3"),
        ([[0, 0], [1, 1], [2, 1]], [0, 1, 1], "knots: must ascend, got 1 before 1"),
        ([[0, 0], [1, 1], [2, 1]], [0, 2, 1], "knots: must ascend, got 2 before 1"),
    ],
)
def test_what_has_no_curve(points, knots, message):
    with pytest.raises(DomainError, match=message):
        fit(points, knots)


def test_an_iteration_that_does_not_end_is_an_error(monkeypatch):
    monkeypatch.setattr("gtb_cli.fairing.fit.MAX_ROUNDS", 5)
    with pytest.raises(ToleranceError, match=r"still misses a point by .* after 5 rounds"):
        fit(helix(9))


# --- surfaces


def inner_parameters(patch, count: int) -> np.ndarray:
    rng = np.random.default_rng(4)
    return rng.dirichlet(np.ones(len(patch.domain.vertices)), count) @ patch.domain.vertices


def test_points_of_a_patch_with_their_parameters_give_it_back():
    """A plane, without energy, is found to rounding, and a surface nearly."""
    patch = load(PENTAGON)
    p = inner_parameters(patch, 200)
    plane = patch.replace(control_points=np.pad(patch.knots, [(0, 0), (0, 1)]))
    for expected, distance in ((plane, 1e-9), (patch, 1e-2)):
        found = surface_near(expected.evaluate(p, "linear"), patch, p)
        assert found.distance < distance


def test_points_without_parameters_are_projected():
    """A gentle bump is found from the plane; residuals are what the surface says."""
    patch = load(BICUBIC)
    low, high = patch.domain.vertices.min(axis=0), patch.domain.vertices.max(axis=0)
    share = (patch.knots - low) / (high - low)
    plane = patch.replace(control_points=np.column_stack([share, np.zeros(len(share))]))
    xy = np.random.default_rng(5).random((300, 2))
    points = np.column_stack([xy, 0.2 * xy[:, 0] * (1 - xy[:, 0]) + 0.1 * xy[:, 1] ** 2])
    found = surface_near(points, plane)
    assert found.distance < 2e-3
    assert found.mean <= found.distance
    again = found.patch.evaluate(found.parameters, "linear")
    assert np.linalg.norm(again - points, axis=1).max() == pytest.approx(found.distance)


@pytest.mark.parametrize("name", [BICUBIC, PENTAGON, "specs/hexagon.toml"])
def test_as_many_points_as_knots_are_met(name):
    """At the knots without parameters: there the linear parametrisation gives the net of knots itself."""
    patch = load(name)
    points = np.random.default_rng(6).normal(size=(len(patch.knots), 3))
    found = surface_through(points, patch)
    np.testing.assert_allclose(found.patch.evaluate(patch.knots, "linear"), points, atol=1e-10)
    inside = patch.domain.center + 0.9 * (patch.knots - patch.domain.center)
    other = surface_through(points, patch, inside)
    np.testing.assert_allclose(other.patch.evaluate(inside, "linear"), points, atol=1e-10)


def test_rounds_of_a_cubic_triangle_are_what_bernsteins_operator_says():
    """Its least eigenvalue at the lattice is 3! / 3³ = 2/9, and each round leaves 7/9 of what is missed."""
    patch = load("specs/bezier-triangle.toml").replace(weights=np.ones(10))
    points = np.random.default_rng(7).normal(size=(10, 3))
    expected = math.log(RESIDUAL_TOLERANCE) / math.log(7 / 9)
    assert surface_through(points, patch).rounds == pytest.approx(expected, rel=0.1)


def test_knots_that_coincide_cannot_meet_two_points():
    patch = load(BICUBIC)
    knots = patch.knots.copy()
    knots[5] = knots[6]
    points = np.random.default_rng(6).normal(size=(len(knots), 3))
    with pytest.raises(ToleranceError, match="the surface still misses a point"):
        surface_through(points, patch.replace(knots=knots, coefficients=None))


def test_fit_takes_surfaces_by_what_is_given():
    patch = load(BICUBIC)
    through = fit(patch.control_points, patch=patch)
    np.testing.assert_array_equal(through.patch.evaluate(patch.domain.vertices), patch.control_points[[0, 3, 15, 12]])
    near = fit(patch.evaluate(inner_parameters(patch, 20)), patch=patch)
    assert near.distance < 0.01
    with pytest.raises(DomainError, match="knots: are for curves"):
        fit([[0, 0, 0]], [1], patch=patch)
    with pytest.raises(DomainError, match="parameters: are those of a surface"):
        fit([[0, 0, 0]], parameters=[[0, 0]])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([[0, 0, 0]], load(CURVE)), "this is a curve"),
        (([[0, 0]], load(BICUBIC)), "points: expected shape"),
        (([[0, 0, 0]], load(BICUBIC), [[0, 0], [1, 1]]), r"parameters: expected shape \(1, 2\)"),
        (([[0, 0, 0]], load(BICUBIC), [[50, 50]]), "outside the domain"),
    ],
)
def test_what_cannot_be_fitted(arguments, message):
    with pytest.raises(DomainError, match=message):
        surface_near(*arguments)
    with pytest.raises(DomainError, match="points: expected 16, one for each knot, got 1"):
        surface_through([[0, 0, 0]], load(BICUBIC))


def test_the_command_fits_a_surface():
    patch = load(BICUBIC)
    p = inner_parameters(patch, 60)
    rows = np.column_stack([p, patch.evaluate(p, "linear")])
    text = "\n".join(" ".join(map(repr, row)) for row in rows.tolist()).encode()
    result = gtb("fit", "-", "--patch", BICUBIC, stdin=text)
    assert result.status == 0
    assert "60 points, 0 rounds" in result.err
    assert len(parse(result.text).knots) == len(patch.knots)
    net = "\n".join(" ".join(map(repr, row)) for row in patch.control_points.tolist()).encode()
    assert "16 points, " in gtb("fit", "-", "--patch", BICUBIC, stdin=net).err
    assert "expected 3 or 5 numbers, got 2" in gtb("fit", "-", "--patch", BICUBIC, stdin=b"0 0\n", status=2).err
    assert gtb("fit", "-", "--patch", "-", stdin=b"").status == 2
    assert gtb("fit", "-", "--patch", BICUBIC, "--knots", "0,1", stdin=b"").status == 2


# --- the command


def test_fit_prints_a_spec(tmp_path):
    text = b"# points\n0 0\n1, 2\n\n3\t1 # the third\n4 3\n"
    result = gtb("fit", stdin=text)
    assert result.status == 0
    curve = parse(result.text)
    np.testing.assert_allclose(curve.knots[:, 0], np.cumsum([0, 5**0.5, 5**0.5, 5**0.5]), rtol=1e-15)
    path = tmp_path / "way.txt"
    path.write_bytes(text)
    named = gtb("fit", path)
    assert named.text == 'name = "way"\n' + result.text
    assert "4 points" in named.err
    assert gtb("fit", path, "-q").err == ""
    knots = gtb("fit", "--knots", "0, 1, sqrt(2), 4", stdin=b"0 0 0\n1 2 0\n3 1 1\n4 3 1\n").text
    assert parse(knots).knots[:, 0].tolist() == [0, 1, math.sqrt(2), 4]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"", "<stdin>: has no points"),
        (b"# none\n", "<stdin>: has no points"),
        (b"1 2\n1\n", "<stdin>:2: expected 2 numbers, got 1"),
        (b"1\n", "<stdin>:1: expected 2 or 3 numbers, got 1"),
        (b"1 2\n1 x\n", "<stdin>:2: 'x' is not a number"),
        (b"1 2\n1 \xff\n", "is not a number"),
        (b"1 2\n1 inf\n", "<stdin>: points[1][1]: must be finite"),
        (b"1 2\n", "<stdin>: points: expected 2 to 100, got 1"),
        (b"1 2 3\n" * 441, "<stdin>: points: expected 2 to 100, got 441; --patch fits a surface to more"),
        pytest.param(b"1 2\n" * 1_000_001, "<stdin>: has more than 1000000 points", marks=long),
    ],
)
def test_points_that_are_none(text, message):
    result = gtb("fit", stdin=text)
    assert result.status == 2
    assert result.out == b""
    assert message in result.err
