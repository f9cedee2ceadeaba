"""Fair patches: less energy with the same boundary, and formulas of energy against differences."""

from functools import partial

import numpy as np
import pytest

from gtb_cli.errors import DomainError
from gtb_cli.fairing.descent import is_fairer
from gtb_cli.fairing.energy import energy_at, energy_samples
from gtb_cli.fairing.fair import agreed, agreed_text, fair, kept_knots
from gtb_cli.fairing.variation import Bending
from gtb_cli.language.loading import parse
from gtb_cli.models.model import Model
from gtb_cli.theory.patch import Patch
from tests.marks import long, mostly_long
from tests.shell import BICUBIC, CURVE, PENTAGON, SPECS, gtb
from tests.specs import load
from tests.surfaces import cylinder, energy, octant


def square(f) -> Patch:
    """A bicubic Bézier patch over the unit square that is the graph of a quadratic function."""
    i, j = (index.ravel() / 3 for index in np.mgrid[:4, :4])
    return Patch(np.column_stack([i, j]), np.column_stack([i, j, f(i, j)]), coefficients="binomial")


def test_energy_of_a_quadratic_graph():
    """z = xy has Bézier ordinates xy: P_xy = (0, 0, 1), the plate's energy is 2; P_x = (1, 0, y), P_y = (0, 1, x).

    The integrals are over the square with sides of 0.999.
    """
    side, patch = 0.999, square(lambda x, y: x * y)
    assert energy(patch, "thin-plate") == pytest.approx(2 * side**2, rel=1e-9)
    assert energy(patch, "dirichlet") == pytest.approx(2.5 * side**2 + side**4 / 6, rel=1e-9)


@pytest.mark.parametrize("name", mostly_long(["pentagon", "hexagon", "nonagon", "box-corner"]))
@pytest.mark.parametrize("kind", ["thin-plate", "dirichlet"])
def test_energy_agrees_with_differences(name, kind):
    found = load(SPECS / f"{name}.toml")
    patch = found.patches[0] if isinstance(found, Model) else found
    p, areas, _ = energy_samples(patch.domain, 14)
    inside = patch.domain.heights_of_columns(p).min(axis=0) / patch.domain.normal_lengths.min() > 0.05
    size = np.sqrt(areas.sum())
    x, y = (h := 1e-4 * size) * np.eye(2)
    q, at = p[inside][::7], partial(patch.evaluate, parametrization="linear")
    form = np.zeros((len(patch.knots),) * 2)
    for where in patch.rational_basis.locations(q, "linear"):
        form += energy_at(where.knots / size, patch.log_products, where.s * size, np.ones(where.s.shape[1]), kind)
    value = np.einsum("ik,ij,jk->", patch.control_points, form, patch.control_points)
    if kind == "dirichlet":
        expected = sum((((at(q + d) - at(q - d)) / (2 * h)) ** 2).sum() for d in (x, y)) * size**2
    else:
        middle = 2 * at(q)
        xx, yy = ((at(q + d) - middle + at(q - d)) / h**2 for d in (x, y))
        xy = (at(q + x + y) - at(q + x - y) - at(q - x + y) + at(q - x - y)) / (4 * h**2)
        expected = ((xx**2).sum() + 2 * (xy**2).sum() + (yy**2).sum()) * size**4
    assert value == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    ("kind", "keep"), mostly_long([("thin-plate", "tangents"), ("dirichlet", "tangents"), ("dirichlet", "boundary")], 0)
)
def test_a_fair_patch_has_less_energy_and_the_same_boundary(kind, keep):
    patch = load(SPECS / "hexagon.toml")
    result = fair(patch, kind, keep)
    before, after = result.energies
    assert after < before
    assert before == pytest.approx(energy(patch, kind), rel=1e-6)
    assert after == pytest.approx(energy(result.patch, kind), rel=1e-6)
    kept = kept_knots(patch, [keep] * 6)
    assert kept.sum() == {"boundary": 12, "tangents": 18}[keep]
    assert result.free == 19 - kept.sum()
    np.testing.assert_array_equal(result.patch.control_points[kept], patch.control_points[kept])


def curved(patch: Patch) -> np.ndarray:
    """∫ κ₁² + κ₂² dA over shares 1e-3 to 1e-2, and over shares above 1e-3, of the way to the middle.

    It is independent of the energies: curvatures of the surface, by moments of other coordinates, at the middles of
    triangles in space whose vertices are on rings that grow by a fifth.
    """
    corners, middle = patch.domain.vertices, patch.domain.vertices.mean(axis=0)
    shares = np.geomspace(1e-3, 1, 37)
    along = np.concatenate([[0], np.geomspace(1e-3, 0.5, 20)])
    along = np.concatenate([along, 1 - along[-2::-1]])
    found = np.zeros(2)
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        ring = start + along[:, None] * (end - start) - middle
        u = middle + (1 - shares)[:, None, None] * ring
        p = patch.evaluate(u.reshape(-1, 2), "linear").reshape(*u.shape[:2], 3)
        b, c = np.s_[1:, :-1], np.s_[:-1, 1:]
        for a in (np.s_[:-1, :-1], np.s_[1:, 1:]):
            areas = np.linalg.norm(np.cross(p[b] - p[a], p[c] - p[a]), axis=2) / 2
            gaussian, mean = patch.curvature(((u[a] + u[b] + u[c]) / 3).reshape(-1, 2), "linear")
            bent = np.where(areas > 0, (4 * mean**2 - 2 * gaussian).reshape(areas.shape) * areas, 0.0)
            found += bent[shares[:-1] < 0.99e-2].sum(), bent.sum()
    return found


SURFACES = ("pentagon", "nonagon", "example-4.4", "bicubic", "repeated-knot", "vase", "trapezoid")


@pytest.mark.parametrize("name", mostly_long(SURFACES, 0))
def test_a_fair_patch_bends_less_by_an_independent_integral_and_than_a_thin_plate_and_stays(name):
    """It does so near edges as well, but where these hardly bend beside the inside, as those of the trapezoid."""
    found = load(SPECS / f"{name}.toml")
    patch = found.patches[0] if isinstance(found, Model) else found
    made = fair(patch)
    before, after = curved(patch), curved(made.patch)
    assert after[1] < 0.8 * before[1]
    assert after[0] < (0.05 * before[1] if name == "trapezoid" else 0.8 * before[0])
    if name in ("trapezoid", "vase"):
        plate = fair(patch, "thin-plate").after
        assert made.after.energy < 0.8 * made.before.energy
        assert made.after.variation < min(plate.variation, made.before.variation)
        assert made.after.energy < 1.1 * plate.energy
        assert made.energies is None
        again = fair(made.patch)
        assert again.patch is made.patch
        assert again.after.variation == again.before.variation


@pytest.mark.parametrize(
    ("name", "kind"), mostly_long([("trapezoid", "thin-plate"), ("pentagon", "thin-plate"), ("vase", "dirichlet")])
)
def test_the_printed_energies_are_those_of_a_finer_quadrature(name, kind):
    """Over all of Δ the thin-plate energy of the pentagon and the hexagon is infinite; what is printed converges."""
    found = load(SPECS / f"{name}.toml")
    patch = found.patches[-1] if isinstance(found, Model) else found
    made = fair(patch, kind)
    for value, of in zip(made.energies, (patch, made.patch), strict=True):
        size = np.abs(of.control_points).max()
        assert value == pytest.approx(energy(of, kind, 112), rel=2e-5, abs=1e-12 * size**2)


def test_no_small_change_lowers_the_energy():
    patch = fair(load(BICUBIC), "thin-plate").patch
    least = energy(patch)
    rng = np.random.default_rng(2)
    free = ~kept_knots(patch, ["boundary"] * 4)
    for _ in range(2):
        moved = patch.control_points + 1e-3 * rng.normal(size=(len(patch.knots), 3)) * free[:, None]
        assert energy(patch.replace(control_points=moved)) > least


@pytest.mark.parametrize("patch", mostly_long([octant(), cylinder()]))
def test_round_surfaces_are_fair_already(patch):
    made = fair(patch)
    assert made.patch is patch
    assert made.free == 1
    assert made.after.variation < 1e-12


def test_what_the_finest_quadrature_calls_less_fair_is_left(monkeypatch):
    monkeypatch.setattr("gtb_cli.fairing.fair._least_varied", lambda _, given, free: given * [1, 1, 3])
    patch = load(PENTAGON)
    made = fair(patch)
    assert made.patch is patch
    assert made.after.energy == made.before.energy


def test_a_folded_plane_unfolds():
    patch = square(lambda x, y: 0 * x)
    folded = np.where(np.arange(16)[:, None] == 5, [3, 3, 0], patch.control_points)
    made = fair(patch.replace(control_points=folded))
    assert made.folds == 0
    assert made.after.energy < 1e-9


def test_a_peak_becomes_flat_though_its_variation_rises_on_the_way():
    corners = [[0, 0], [2, 0], [2, 2], [0, 2], [1, 1]]
    made = fair(Patch(corners, [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1]]))
    assert made.before.energy > 1
    assert made.after.energy < 1e-9


@pytest.mark.parametrize("keep", mostly_long(["curvature", "tangents"]))
def test_what_is_kept_along_edges(keep):
    """The limits on all edges, by the formulas for them; knots at heights 1, 2 and 3 determine ever more of these."""
    i, j = (index.ravel() for index in np.mgrid[:7, :7])
    bumps = np.random.default_rng(3).normal(size=(49, 3)) * 0.2
    bumps[24] += 3
    patch = Patch(np.column_stack([i, j]), np.column_stack([i, j, i * j / 6]) + bumps, coefficients="binomial")
    made = fair(patch, "thin-plate", keep)
    assert made.free == {"tangents": 9, "curvature": 1}[keep]
    assert made.patch is not patch
    t = np.linspace(0.5, 5.5, 6)
    edges = np.concatenate([np.column_stack(at) for side in (0 * t, 0 * t + 6) for at in ((t, side), (side, t))])
    sines = np.linalg.norm(np.cross(made.patch.normals(edges), patch.normals(edges)), axis=1)
    assert np.degrees(sines.max()) < 1e-12
    changes = [np.abs(a - b).max() for a, b in zip(made.patch.curvature(edges), patch.curvature(edges), strict=True)]
    assert (max(changes) < 1e-12) == (keep == "curvature")


def test_a_layer_on_the_edge_does_not_determine_its_planes():
    patch = square(lambda x, y: x * y)
    rows = patch.control_points.reshape(4, 4, 3).copy()
    rows[1] = rows[0]
    keeps = [*["boundary"] * 3, "tangents"]
    kept = kept_knots(patch.replace(control_points=rows.reshape(-1, 3)), keeps)
    assert kept.reshape(4, 4)[:3].all(), "both rows over the edge with x = 0"
    assert kept_knots(patch, keeps).sum() == 14


def model(bend: float) -> Model:
    """Two bumpy squares that meet in the middle, with one tangent plane where they are not bent."""
    i, j = (index.ravel() for index in np.mgrid[:5, :5])
    points = np.column_stack([i, j, 0.1 * i * j]) + np.random.default_rng(3).normal(size=(25, 3)) * 0.1
    across = points.reshape(5, 5, 3)
    beside = np.concatenate([across[:1], 2 * across[:1] - across[1:2], across[2:] * [-1, 1, 1 - bend]])
    beside[1, :, 2] += bend
    knots = np.column_stack([i, j])
    other = Patch(knots[:, ::-1], beside.reshape(-1, 3), coefficients="binomial")
    return Model((Patch(knots, points, coefficients="binomial"), other))


@pytest.mark.parametrize(
    ("bend", "free", "kind"), mostly_long([(0, 6, "thin-plate"), (0, 6, "variation"), (0.5, 9, "variation")])
)
def test_patches_of_a_model_meet_as_before(bend, free, kind):
    given = model(bend)
    (before,) = given.seams
    assert (before.angle < 1e-6) == (bend == 0)
    made = fair(given, kind)
    assert [part.free for part in made] == [free, free]
    after = given.replace(patches=tuple(part.patch for part in made)).seams
    assert len(after) == 1
    assert all(part.after.variation < part.before.variation for part in made)
    if bend == 0:
        assert abs(after[0].angle - before.angle) < 1e-9


@long
def test_copies_of_a_patch_are_made_fair_as_it_is():
    """A turned and shifted copy, a mirrored one, and one with another point, which is not."""
    patch = square(lambda x, y: x * y + (x == y) * x)
    points = patch.control_points
    turned, mirrored = points[:, [1, 2, 0]] + 5, points * [1, 1, -1] - 5
    other = points + np.where(np.arange(16)[:, None] == 5, 9.2, 9.0)
    one, *parts = fair(Model(tuple(patch.replace(control_points=each) for each in (points, turned, mirrored, other))))
    made = one.patch.control_points
    np.testing.assert_allclose(parts[0].patch.control_points, made[:, [1, 2, 0]] + 5, atol=1e-12)
    np.testing.assert_allclose(parts[1].patch.control_points, made * [1, 1, -1] - 5, atol=1e-12)
    edges = patch.domain.incidence.any(axis=1)
    np.testing.assert_array_equal(parts[1].patch.control_points[edges], mirrored[edges])
    assert parts[1].after is one.after
    assert parts[2].before.energy != one.before.energy


@long
def test_any_size_and_place_of_knots_and_points():
    patch = square(lambda x, y: x * y + (x == y) * x)
    expected = fair(patch).patch.control_points
    for scale, shift in [(1e-9, 0.0), (1e9, 0.0), (1.0, 1e7)]:
        moved = patch.replace(knots=patch.knots * scale, control_points=patch.control_points * scale + shift)
        np.testing.assert_allclose((fair(moved).patch.control_points - shift) / scale, expected, atol=1e-6)


@long
def test_repeated_knots_stay_where_they_are_indistinct():
    patch = load(SPECS / "pentagon.toml")
    inner = int(np.flatnonzero(~patch.domain.incidence.any(axis=1))[0])
    double = Patch(*(np.vstack([each, each[inner]]) for each in (patch.knots, patch.control_points)))
    assert np.isfinite(fair(double).patch.control_points).all()


def test_what_cannot_be_fair():
    with pytest.raises(DomainError, match="this is a curve"):
        fair(load(CURVE))
    with pytest.raises(DomainError, match="expected a Patch or Model, or the path of a spec file, got int"):
        fair(3)  # type: ignore[call-overload]
    with pytest.raises(DomainError, match="keep: expected"):
        fair(load(PENTAGON), keep="x")  # type: ignore[call-overload]
    with pytest.raises(DomainError, match="energy: expected"):
        fair(load(PENTAGON), "x")  # type: ignore[call-overload]


def test_fair_prints_a_spec():
    result = gtb("fair", BICUBIC, "--energy", "dirichlet", status=0)
    expected = fair(load(BICUBIC), "dirichlet").patch.control_points
    np.testing.assert_array_equal(parse(result.text).control_points, expected)
    assert " but for the outermost thousandth; but for the outermost hundredth: bending" in result.err


def test_quadratures_are_refined_until_they_agree_to_three_thousandths():
    """Of the pentagon the first two differ by 0.0035 outside its corners."""
    patch = load(PENTAGON)
    assert agreed(patch, [patch.control_points])[1][0].max() <= 3e-3
    said = [agreed_text(4712.3, error) for error in (1e-3, 1e-2, 0.085, 0.6)]  # in whose last digits they do
    assert said == ["4.71e+03", "4.7e+03", "5e+03", "unknown"]


def test_differences_of_quadratures_in_triangles_do_not_cancel(monkeypatch):
    """In the first two of three triangles of a region bending differs by half a unit, and not in sum."""
    sums = iter([[1, 2, 3, 4, 5, 6], [1.5, 2, 3, 4, 5, 6.6]])
    monkeypatch.setattr("gtb_cli.fairing.fair.measured", lambda *_: [[Bending(1, e, 1, 1) for e in next(sums)]])
    errors = agreed(Patch([[0, 0], [1, 0], [0, 1]], np.eye(3)), [np.eye(3)], (2, 4))[1]
    np.testing.assert_allclose(errors, [[1 / 3, 0], [1.6 / 6.6, 0]])


def test_fairer_is_what_is_less_by_a_tenth():
    assert [is_fairer(np.array([2, 3 * share]), np.array([2.0, 3.0])) for share in (0.89, 0.91, 1.05)] == [1, 0, 0]
