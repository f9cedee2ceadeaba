"""Checks: specs pass them at any scale, every property is seen to fail on a patch broken for it, and known numbers."""

import math
from collections.abc import Callable
from dataclasses import fields
from functools import cache

import numpy as np
import pytest

from gtb_cli.checks import ends
from gtb_cli.checks.probe import Probe
from gtb_cli.checks.properties import PROPERTIES, check, check_patch
from gtb_cli.checks.report import Finding, within_rounding
from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.knots.lattice import binomial_coefficients
from gtb_cli.limits.degeneration import MAX_WEIGHT_LOG, degenerate, regular_control_surface
from gtb_cli.models.model import Model
from gtb_cli.theory.normals import tangents
from gtb_cli.theory.patch import Patch
from tests.laws import size
from tests.marks import mostly_long
from tests.specs import GOOD_SPECS, load, spec

SMALL = 1e-7  # what patches are broken by, of their size: not to be seen on a picture, and a million roundings

SOLVED = 1e-9  # rounding of figures that are computed here in another way: sums, and eigenvalues of small matrices


def finding(patch: Patch, name: str) -> Finding:
    (measure,) = (prop.measure for prop in PROPERTIES if prop.name == name)
    return measure(Probe(patch))


@cache
def statuses(name: str) -> dict[str, str]:
    return {found.name: found.status for found in check_patch(spec(name)).findings}


PATCHES = [path.stem for path in GOOD_SPECS if isinstance(load(path), Patch)]


# --- what holds


@pytest.mark.parametrize("name", mostly_long(PATCHES, 10))
def test_every_spec_has_the_properties(name):
    # Properties with conditions that patches of ordinary size in `specs/` do not always fulfil
    expected_not_to_apply = {
        "classical Bézier",
        "isoparametric curves",
        "multiple knots",
        "toric degeneration",
        "coefficients of unity",
        "convexity",
        "injective for all weights",
        "sign of the Jacobian",
    }
    report = check(spec(name))
    assert report.holds
    for found in report.findings:
        assert found.reason
        if found.status == "not applicable":
            assert found.name in expected_not_to_apply
            assert found.value is found.bound is None
        elif found.status == "measured":
            assert found.bound is None
        else:
            assert found.value <= found.bound
    kind = 1 if spec(name).dimension == 1 else 2
    assert [found.name for found in report.findings] == [prop.name for prop in PROPERTIES if prop[kind]]


@pytest.mark.parametrize(("index", "name"), mostly_long(enumerate(PATCHES), 6))
def test_they_hold_at_any_size_and_place(index, name):
    """Each spec at one of the sizes with the knots small, and one with them large or far away."""
    scales = [(1e-9, 0, 1e9, 0), (1e9, 0, 1e-9, 0), (1, 1e7, 1, 1e7), (1e-2, 0, 1e4, 1e7), (1e4, 1e7, 1, 0)]
    patch = spec(name)
    for scale, shift, points_scale, points_shift in (scales[3 * (index % 2)], scales[(1, 2, 4)[index % 3]]):
        points = patch.control_points * points_scale + points_shift
        moved = patch.replace(knots=patch.knots * scale + shift, control_points=points)
        report = check_patch(moved)
        assert report.holds
        # Even then most of it can be told.
        assert sum(found.status == "holds" for found in report.findings) >= 8


def test_conditions_are_named_where_they_are_not_fulfilled():
    space = Patch([0, 1, 2.5, 3], [[0, 0, 0], [1, 2, 0], [2, 2, 1], [3, 0, 4]])
    assert "not in a plane" in finding(space, "convexity").reason
    assert "planes" in finding(space, "variation diminishing").reason
    zigzag = Patch([0, 1, 2.5, 3], [[0, 0], [1, 2], [2, -2], [3, 0]])
    assert "not convex" in finding(zigzag, "convexity").reason
    spiral = [[math.cos(t) * (9 - t), math.sin(t) * (9 - t)] for t in range(9)]
    assert "not convex" in finding(Patch(range(9), spiral), "convexity").reason
    line = Patch([0, 1, 3], [[0, 0], [1, 1], [2, 2]])
    assert "on a line" in finding(line, "convexity").reason
    assert "not a rectangle" in finding(spec("bezier-triangle"), "isoparametric curves").reason
    assert "equally spaced" in finding(spec("example-3.1"), "classical Bézier").reason
    double = Patch([0, 1, 1, 2], [[0, 0], [1, 1], [2, 0], [3, 3]])
    for name in ("strict total positivity", "progressive iteration", "coefficients of unity"):
        assert finding(double, name).status == "not applicable"
        assert "repeated" in finding(double, name).reason
    assert finding(double, "total positivity").status == finding(double, "multiple knots").status == "holds"


@pytest.mark.parametrize(
    "patch",
    [
        Patch([0, 1], [[0, 0], [1, 1]]),
        Patch([0, 1], [[1, 2], [1, 2]]),
        Patch([0, 0, 1, 1], [[0, 0], [2, 0], [1, 1], [5, 1]], [1, 3, 2, 2]),
        Patch([3, 0, 1, 2], [[3, 0], [0, 0], [1, 5], [2, 5]]),
        Patch([0, 1, 1.0001, 2], [[0, 0], [1, 1], [2, 1], [3, 0]]),
        Patch([0, 1, 2, 3], [[0, 0], [0, 0], [2, 1], [3, 0]]),
        Patch([0, 50, 120], [[0, 0], [1, 1], [2, 0]], [1, 1e-30, 1e30]),
        Patch([0, 1, 2], [[0, 0], [1, 1], [2, 0]], log_weights=[0, 2000, -3000]),
        Patch(range(60), [[t, math.sin(t)] for t in range(60)]),
        Patch([[0, 0], [1, 0], [0, 1]], np.zeros((3, 3))),
        Patch([[0, 0], [1, 0], [0, 1]], [[0, 0, 0], [1, 0, 0], [2, 0, 0]]),
        Patch([[0, 0], [1, 0], [0, 1], [0, 0], [0.2, 0.2]], np.eye(5)[:, :3]),
        Patch([[0, 0], [1, 0], [1, 1], [0, 1]], np.eye(4)[:, :3], edge_scale=[1, 2, 3, 4]),
        Patch([[0, 0], [3, 0], [3, 3], [0, 3], [1, 1]], np.eye(5)[:, :3], lifting=[0, 0, 0, 0, 1e-7]),
        Patch([[0, 0], [3, 0], [3, 3], [0, 3], [1, 1]], np.eye(5)[:, :3], lifting=[5, 5, 5, 5, 5]),
        Patch([[0, 0], [1, 0], [1, 1e-6], [0, 1e-6]], np.eye(4)[:, :3]),
    ],
    ids=range(16),
)
def test_unusual_patches_have_the_properties(patch):
    report = check_patch(patch)
    assert [found for found in report.findings if found.status == "fails"] == []


@pytest.mark.parametrize("knots", [[0, 1e-12, 1], [0, 1e-12, 0.5, 1], [0, 0.3, 1 - 1e-12, 1]], ids=str)
def test_what_the_tolerance_of_knots_hides_is_not_decided(knots):
    report = check_patch(Patch(knots, [[i, i * i] for i in range(len(knots))]))
    assert report.holds
    hidden = {found.name: found.reason for found in report.findings if found.status == "not decided"}
    assert "count as on it" in hidden["definition"]
    assert repr(report).endswith(f"{len(hidden)} not decided>")


def test_knots_that_count_as_on_an_edge_are_moved_onto_it():
    patch = Patch([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 1e-12]], np.eye(5)[:, :3])
    assert patch.knots[4, 1] > 0
    assert Probe(patch).sharpened().patch.knots[4, 1] == pytest.approx(0, abs=1e-20)


def test_an_end_without_a_limit_does_not_hide_the_other():
    found = [Finding("not applicable", None, None, ""), Finding("fails", 1.0, 0.1, ""), Finding("holds", 0.0, 0.1, "")]
    assert [ends._worst(found).status, ends._worst(found[::2]).status] == ["fails", "not applicable"]


def test_parameters_that_are_not_found_are_not_a_failure(monkeypatch):
    def missing(patch, u, parametrization="toric"):
        raise ToleranceError("2 parameters were not found")

    monkeypatch.setattr(Patch, "evaluate", missing)
    found = {found.name: found for found in check_patch(spec("example-3.1")).findings}
    for name in ("linear precision, linear parametrization", "convexity", "variation diminishing"):
        assert found[name].status == "not decided"
        assert found[name].reason == "could not be measured: 2 parameters were not found"


# --- what fails


def with_points(change: Callable[[Patch, np.ndarray], np.ndarray]) -> type[Patch]:
    """Return patches that are wrong by a little in their points; their copies are, too."""

    class Broken(Patch):
        def points_at(self, locations, count):
            return change(self, super().points_at(locations, count))

    return Broken


def with_basis(change: Callable[[np.ndarray], np.ndarray]) -> type[Patch]:
    """Return patches that are wrong by a little in their basis."""

    class Broken(Patch):
        def basis(self, u):
            return change(super().basis(u))

    return Broken


def broken(patch: Patch, kind: type[Patch]) -> Patch:
    return kind(**{field.name: getattr(patch, field.name) for field in fields(patch)})


def negative(values):
    """One value in a thousand is below zero by nearly nothing."""
    values = values.copy()
    values.ravel()[500::1000] = -1e-300
    return values


def permuted(values):
    """Two neighbours are exchanged."""
    return values[:, [0, 2, 1, *range(3, values.shape[1])]]


def wavy(patch, points):
    """A straight line crosses small waves often."""
    t = (points[:, :1] - points[:, :1].min()) / size(patch)
    return points + 0.02 * size(patch) * np.sin(60 * t) * [0, 1, 0]


def dented(patch, points):
    """A convex curve has a dent that can hardly be seen."""
    middle = points[len(points) // 2]
    distance = ((points - middle) ** 2).sum(axis=1, keepdims=True) / size(patch) ** 2
    return points + 0.1 * np.exp(-200 * distance) * (patch.control_points.mean(axis=0) - middle)


def enlarged(patch, points):
    """Points are a little too far from the middle."""
    middle = patch.control_points.mean(axis=0)
    return middle + (1 + 1e-3) * (points - middle)


def turned_points(patch, points):
    """Points are turned about the first control point by a small angle."""
    return points + SMALL * np.cross(points - patch.control_points[0], [0, 0, 1.0])


class OtherBoundary(Patch):
    """The curve of an edge is another one."""

    def boundary(self, edge):
        curve = super().boundary(edge)
        return curve.replace(weights=curve.weights * np.linspace(1, 1 + 1e-6, len(curve.weights)) ** 2 + 1e-6)


class Unsolvable(Patch):
    """Nothing can be evaluated."""

    def points_at(self, locations, count):
        raise DomainError("parameters: none will do")


Shifted = with_points(lambda patch, points: points + SMALL * size(patch))
OffThePlane = with_points(lambda patch, points: points + SMALL * size(patch) * np.eye(3)[2])
BesideItsCorners = with_points(lambda patch, points: points * (1 + 1e-14))  # by the last digits, as if by rounding
Stretched = with_points(lambda patch, points: points * (1 + 1e-3))
CoefficientsCount = with_points(lambda patch, points: points + SMALL * size(patch) * patch.coefficients[0])
ScaleCounts = with_points(lambda patch, points: points + SMALL * size(patch) * patch.domain.normal_lengths[0])
KnotsCount = with_points(lambda patch, points: points + SMALL * size(patch) * len(patch.knots))
Endless = with_points(lambda patch, points: np.full_like(points, np.nan))
Larger, Turned, Wavy, Dented = map(with_points, (enlarged, turned_points, wavy, dented))
Incomplete = with_basis(lambda values: values * (1 - SMALL))
LeakingEdges = with_basis(lambda values: (values + SMALL) / (values + SMALL).sum(axis=1, keepdims=True))
Diverging = with_basis(lambda values: values[:, ::-1])  # the collocation matrix has a negative eigenvalue
Negative, Permuted = map(with_basis, (negative, permuted))

FLAT = Patch([[0, 0], [2, 0], [2, 1], [0, 1.5], [1, 1]], [[0, 0], [2, 0], [2, 2], [0, 3], [1, 1]])
STRAIGHT = Patch([0, 1, 3], [[0, 0], [3, 0], [5, 0]])

BREAKS = {
    "definition": [("pentagon", Shifted), ("example-3.1", Shifted)],
    "nonnegativity": [("pentagon", Negative), ("example-3.1", Negative)],
    "partition of unity": [("pentagon", Incomplete), ("cubic-bezier", Incomplete)],
    "corners": [("pentagon", BesideItsCorners), ("pentagon", Permuted), ("cubic-bezier", BesideItsCorners)],
    "boundary curves": [("hexagon", LeakingEdges), ("hexagon", OtherBoundary), ("trapezoid", Shifted)],
    "convex hull": [
        *(("hexagon", Larger), ("example-3.1", Larger), ("example-3.1", OffThePlane)),
        *((FLAT, Larger), (FLAT, OffThePlane), (STRAIGHT, Larger)),
    ],
    "affine invariance": [("pentagon", Shifted), ("example-3.1", Shifted)],
    "weights times coefficients": [("trapezoid", CoefficientsCount), ("example-2.1", CoefficientsCount)],
    "edge scale": [("pentagon", ScaleCounts), ("example-3.1", ScaleCounts)],
    "classical Bézier": [("cubic-bezier", Shifted), ("bezier-triangle", Shifted), ("bicubic", Shifted)],
    "total positivity": [("example-3.1", Permuted)],
    "strict total positivity": [("example-3.1", Permuted)],
    "progressive iteration": [("example-3.1", Diverging)],
    "variation diminishing": [("example-3.1", Wavy)],
    "convexity": [("example-3.1", Dented)],
    "end tangents": [("example-3.1", Turned), ("cubic-bezier", Shifted)],
    "end tangent lengths": [("example-3.1", Stretched)],
    "one weight to infinity": [("example-3.1", Shifted)],
    "isoparametric curves": [("bicubic", Shifted)],
    "multiple knots": [("repeated-knot", KnotsCount)],
    "weights of the degeneration": [("pentagon", Shifted), ("example-3.1", Shifted)],
    "toric degeneration": [("pentagon", Larger), ("example-3.4", Larger)],
    "linear precision, linear parametrization": [("pentagon", Shifted), ("example-3.1", Shifted)],
}


@pytest.mark.parametrize(("name", "patch", "kind"), [(name, *pair) for name in BREAKS for pair in BREAKS[name]])
def test_a_check_sees_what_is_broken(name, patch, kind):
    whole = spec(patch) if isinstance(patch, str) else patch
    assert finding(whole, name).status == "holds"
    found = finding(broken(whole, kind), name)
    assert found.status == "fails"
    assert found.value > found.bound


def test_every_property_with_a_verdict_is_broken_here():
    without_verdict = {"linear precision", "coefficients of unity"}
    without_verdict |= {"injective for all weights", "sign of the Jacobian"}
    assert set(BREAKS) == {prop.name for prop in PROPERTIES} - without_verdict


@pytest.mark.parametrize("are_ordinary", [False, True])
@pytest.mark.parametrize("name", ["pentagon", "example-3.1", "bicubic"])
def test_a_wrong_sign_in_the_weights_of_a_degeneration_is_seen(are_ordinary, name, monkeypatch):
    """Weights within floats, or those beyond, get the inverse of their factors."""

    def wrong(patch, x, lifting=None):
        right = degenerate(patch, x, lifting)
        if (np.abs(right.log_weights).max() <= MAX_WEIGHT_LOG) != are_ordinary:
            return right
        return patch.replace(log_weights=2 * patch.log_weights - right.log_weights)

    assert finding(spec(name), "weights of the degeneration").status == "holds"
    monkeypatch.setattr("gtb_cli.checks.limit_checks.degenerate", wrong)
    found = finding(spec(name), "weights of the degeneration")
    assert found.status == "fails"
    assert found.value > 0.01


WRONG_TANGENTS = {
    "back into the curve at the end": lambda right, chord, at_end: right * np.where(at_end, -1, 1),
    "along the chord": lambda right, chord, at_end: np.tile(chord / np.linalg.norm(chord), (len(right), 1)),
    "turned by a little": lambda right, chord, at_end: right + SMALL * np.roll(right, 1, axis=1),
    "none": lambda right, chord, at_end: np.full_like(right, np.nan),
}


@pytest.mark.parametrize("wrong", WRONG_TANGENTS)
def test_a_wrong_tangent_at_an_end_is_seen(wrong, monkeypatch):
    def of(patch, t, *arguments):
        first, last = patch.knots.argmin(), patch.knots.argmax()
        chord = patch.control_points[last] - patch.control_points[first]
        return WRONG_TANGENTS[wrong](tangents(patch, t, *arguments), chord, np.ravel(t)[:, None] == patch.knots[last])

    assert finding(spec("example-3.1"), "end tangents").status == "holds"
    monkeypatch.setattr("gtb_cli.checks.ends.tangents", of)
    found = finding(spec("example-3.1"), "end tangents")
    assert found.status == "fails"
    assert found.value > found.bound


@pytest.mark.parametrize("kind", [Unsolvable, Endless])
@pytest.mark.parametrize("name", ["pentagon", "bicubic", "example-3.4"])
def test_a_patch_without_points_fails(name, kind):
    report = check_patch(broken(spec(name), kind))
    assert not report.holds
    failing = {found.name: found.reason for found in report.findings if found.status == "fails"}
    of_points = {"definition", "corners", "convex hull", "affine invariance", "edge scale", "toric degeneration"}
    assert of_points - {name for name, status in statuses(name).items() if status == "not applicable"} <= set(failing)
    if kind is Unsolvable:
        assert failing["corners"] == "could not be measured: parameters: none will do"


def test_progressive_iteration_of_the_bernstein_basis():
    """The Bernstein operator of degree n has the eigenvalues n!/((n − k)! nᵏ)."""
    for n in (2, 3, 5):
        points, binomials = [[i, i * i] for i in range(n + 1)], [math.comb(n, i) for i in range(n + 1)]
        patch = Patch(range(n + 1), points, coefficients=binomials)
        found = finding(patch, "progressive iteration")
        assert found.status == "holds"
        assert found.value == pytest.approx(1 - math.factorial(n) / n**n, abs=SOLVED)


def test_linear_precision_is_a_number():
    """Mathematics.md, section 7: 0.40 and 0.22 on a pentagon of size 2; a Bernstein basis has none."""
    assert finding(spec("pentagon"), "linear precision").value == pytest.approx(0.40 / 2, abs=0.005)
    unit = spec("pentagon").replace(edge_normals="unit")
    assert finding(unit, "linear precision").value == pytest.approx(0.22 / 2, abs=0.005)
    bernstein_patch = Patch([0, 1, 2], [[0, 0], [1, 1], [2, 0]], coefficients=[1, 2, 1])
    assert finding(bernstein_patch, "linear precision").value < SOLVED


def test_coefficients_of_unity_are_a_number_or_the_values():
    """Mathematics.md, section 5: C(n, i)/nⁿ for knots 0 … n; for Example 2.1 the ends' (1 − t) and t are all."""
    assert finding(spec("cubic-bezier"), "coefficients of unity").value == pytest.approx(1 / 27, rel=SOLVED)
    found = finding(spec("example-2.1"), "coefficients of unity")
    assert found.status == "measured"
    assert found.value is None
    assert "not all positive" in found.reason


def test_a_broken_law_is_measured_at_its_size():
    assert finding(broken(spec("pentagon"), Incomplete), "partition of unity").value == pytest.approx(SMALL, rel=1e-6)
    larger = finding(broken(STRAIGHT, Larger), "convex hull")
    assert larger.value == pytest.approx(1e-3 * (8 / 3) / 5, rel=1e-6)  # of 5, the middle being at 8/3


def test_off_the_lattice_by_less_than_is_forgiven():
    """Knots typed with seven digits are a lattice for coefficients; the distance from the Bézier curve is theirs."""
    knots = [0, 0.3333333, 0.6666667, 1]
    patch = Patch(knots, [[0, 0], [1, 2], [2, 2], [3, 0]], coefficients=[1, 3, 3, 1])
    binomial_coefficients(patch.domain)  # does not refuse
    found = finding(patch, "classical Bézier")
    assert found.status == "holds"
    assert 1e-9 < found.value < 1e-6


# --- models


def test_a_model_is_checked_patch_by_patch_and_joint_by_joint():
    model = regular_control_surface(spec("pentagon"))
    report = check(model)
    assert report.holds
    assert [part.name for part in report.patches] == [f"pentagon-cell{i}" for i in range(5)]
    joints = {found.name: found for found in report.joints}
    assert joints["joined edges"].status == "holds"
    # Three triangles and two quadrilaterals: 17 edges; the pentagon's hull has 7 of the decomposition's edges.
    assert joints["open edges"].value == 7
    assert "5 joints" in joints["joined edges"].reason
    assert joints["orientation"].value == joints["crowded edges"].value == 0


def test_a_model_of_curves_has_joined_ends():
    model = regular_control_surface(spec("example-3.4"))
    report = check(model)
    assert report.holds
    assert {found.name: found.value for found in report.joints}["open edges"] == 2


def test_a_broken_patch_of_a_model_is_seen_at_its_joints():
    first, *others = regular_control_surface(spec("pentagon")).patches
    report = check(Model((broken(first, Larger), *others)))
    assert not report.holds
    assert {found.name: found.status for found in report.joints}["joined edges"] == "fails"
    assert not report.patches[0].holds
    assert all(part.holds for part in report.patches[1:])


def test_patches_without_common_edges():
    model = Model((spec("pentagon"), spec("pentagon").replace(control_points=spec("pentagon").control_points + 9)))
    report = check(model)
    assert report.joints[0].status == "not applicable"
    assert report.joints[1].value == 10


def test_a_bound_for_rounding_that_proves_nothing_decides_nothing():
    found = [within_rounding(value, bound, "").status for value, bound in ((0.0, 0.001), (0.0, 0.1), (0.2, 0.1))]
    assert found == ["holds", "not decided", "fails"]
