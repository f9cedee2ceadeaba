"""Fillings with the curvature of their neighbours: along edges both curvatures are the given strip's."""

from dataclasses import replace

import numpy as np
import pytest

from gtb_cli.errors import DomainError
from gtb_cli.fairing.energy import energy_samples
from gtb_cli.filling.certificate import Filling, contact as contact_at
from gtb_cli.filling.fill import fill
from gtb_cli.filling.holes import ring_sides
from gtb_cli.filling.one_patch import fill_loop
from gtb_cli.filling.osculation import osculating, patch_bend
from gtb_cli.filling.sides import HoleSide, bernstein, edge_places, side_normals, stations
from gtb_cli.filling.strips import strip_side
from gtb_cli.models.model import Model
from gtb_cli.theory.curvature import curvatures_at
from gtb_cli.theory.patch import Patch
from tests.filling.loops import homogeneous
from tests.marks import long, mostly_long
from tests.shell import SPECS, gtb
from tests.specs import load

RELATIVE = 1e-9  # of the largest curvature along a side: what differences of second derivatives leave

Strips = dict[str, np.ndarray]


def strips(n: int, seed: int, degree: int = 3, rational: bool = False) -> Strips:
    """The three outer rows of each of n strips around a hole, which do not fit together at the corners."""
    rng = np.random.default_rng([n, seed])
    turns = 2 * np.pi * np.arange(n + 1) / n
    corners = np.column_stack([np.cos(turns), np.sin(turns), np.zeros(n + 1)])
    found = {}
    for k in range(n):
        share = np.arange(degree + 1)[:, None] / degree
        curve = (1 - share) * corners[k] + share * corners[k + 1]
        rows = [curve * (1 - x) + [0, 0, x * (2 - x) / 2] for x in (0, 0.3, 0.6)]
        noise = 0.05 * rng.normal(size=(3, degree + 1, 3))
        noise[0, [0, -1]] = 0
        weights = np.ones((3, degree + 1))
        if rational:
            weights = rng.uniform(0.8, 1.25, (3, degree + 1))
            weights[0, [0, -1]] = 1
        found[f"side {k}"] = np.stack([homogeneous(r + e, w) for r, e, w in zip(rows, noise, weights, strict=True)])
    return found


def sides(found: Strips) -> list[HoleSide]:
    return [strip_side(name, rows, 2) for name, rows in found.items()]


def bendings_of(rows: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean curvature vector, Gaussian curvature and unit normal of a strip along its first row."""
    m = rows.shape[1] - 1
    across = [rows[0], 2 * (rows[1] - rows[0]), 2 * (rows[2] - 2 * rows[1] + rows[0])]
    x, xu, xuu = (bernstein(m, t) @ row for row in across)
    xt, xtu = (m * bernstein(m - 1, t) @ np.diff(row, axis=0) for row in across[:2])
    xtt = m * (m - 1) * bernstein(m - 2, t) @ np.diff(rows[0], n=2, axis=0)
    w = x[:, 3:]
    p = x[:, :3] / w
    pt, pu = ((each[:, :3] - p * each[:, 3:]) / w for each in (xt, xu))
    ptt = (xtt[:, :3] - 2 * pt * xt[:, 3:] - p * xtt[:, 3:]) / w
    ptu = (xtu[:, :3] - pt * xu[:, 3:] - pu * xt[:, 3:] - p * xtu[:, 3:]) / w
    puu = (xuu[:, :3] - 2 * pu * xu[:, 3:] - p * xuu[:, 3:]) / w
    normal = np.cross(pt, pu)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    e, f, g = ((a * b).sum(axis=1) for a, b in ((pt, pt), (pt, pu), (pu, pu)))
    two = [(each * normal).sum(axis=1) for each in (ptt, ptu, puu)]
    area = e * g - f**2
    mean = (e * two[2] - 2 * f * two[1] + g * two[0]) / (2 * area)
    return mean[:, None] * normal, (two[0] * two[2] - two[1] ** 2) / area, normal


def assert_osculates(filling: Filling, found: Strips) -> None:
    t = np.array([0.05, 0.3, 0.5, 0.8, 0.95])
    for k, side in enumerate(filling.sides):
        place = edge_places(filling.patch, k, t)
        ours = curvatures_at([filling.patch], [place], len(t))
        normals = filling.patch.normals_at([place], len(t))
        mean, gaussian, wanted = bendings_of(found[side.name], t)
        np.testing.assert_allclose(np.abs((normals * wanted).sum(axis=1)), 1, rtol=1e-12)
        largest = np.sqrt(np.abs(4 * (mean**2).sum(axis=1) - 2 * gaussian).max())
        np.testing.assert_allclose(-ours.mean[0][:, None] * normals, mean, rtol=0, atol=RELATIVE * largest)
        np.testing.assert_allclose(ours.gaussian[0], gaussian, rtol=0, atol=RELATIVE * largest**2)
        assert filling.contacts[k].bend < 4 * RELATIVE * largest  # rounding weighs more nearer to the corners
    assert filling.folds == 0


STRIPS = [(4, 2, 0), (3, 2, 0), (3, 2, None), (4, 3, 0), (6, 1, 0)]


@pytest.mark.parametrize(("n", "degree", "raises"), mostly_long(STRIPS))
def test_curvatures_are_those_of_polynomial_strips(n: int, degree: int, raises: int | None) -> None:
    found = strips(n, 0, degree)
    filling = fill_loop(sides(found), continuity="g2", raises=raises)
    assert_osculates(filling, found)
    assert raises == 0 or filling.bending.energy < 50  # where they disagree, no pull makes it bend much more


@pytest.fixture(scope="module")
def plain() -> Filling:
    return fill_loop(sides(strips(4, 1, 2)), continuity="g2", raises=0)


@pytest.mark.parametrize(("scale", "shift"), mostly_long([(1e9, 0), (1e-9, 0), (1, 1e7)], 0))
def test_any_size_and_place_with_curvatures(scale: float, shift: float, plain: Filling) -> None:
    found = strips(4, 1, 2)
    for rows in found.values():
        rows[..., :3] = rows[..., :3] * scale + shift
    filling = fill_loop(sides(found), continuity="g2", raises=0)
    back, rounding = (filling.patch.control_points - shift) / scale, 1e-9 * shift or 1e-6
    np.testing.assert_allclose(back, plain.patch.control_points, atol=rounding)
    differences = [contact.bend * scale for contact in filling.contacts]
    assert max(differences) < (1e-4 if shift else RELATIVE * 100)  # of the curvature of points with nine digits less


def test_what_is_not_known_is_said() -> None:
    found = sides(strips(4, 1, 2))
    plane, vertical = replace(found[1], bend=None, strip=None), replace(found[1], bend=found[1].bend.copy())
    vertical.bend[0] = np.nan
    for side, said in (
        (plane, "its neighbour's curvature is not known: continuity g2 needs a ribbon2"),
        (replace(plane, across=None), ".* needs a ribbon and a ribbon2"),
        (vertical, "its neighbour has no finite curvature near t = 0.000"),
    ):
        with pytest.raises(DomainError, match=f"^side 1: {said}"):
            fill_loop([found[0], side, *found[2:]], continuity="g2")


WAVES = 0.1 * np.cos(30 * np.arccos(1 - 2 * stations()))  # of a curvature that no row of knots has


@pytest.mark.parametrize("bound", mostly_long([0.01, 1], 0))
def test_a_row_that_is_nearest_is_measured_and_bounded(bound: float) -> None:
    given = sides(strips(3, 1, 2))
    found = [replace(given[0], bend=given[0].bend + WAVES, strip=None), *given[1:]]
    options = {"continuity": {"": "g1", "side 0": "g2"}, "raises": 0, "g2_tolerance": bound}
    if bound < 0.1:
        with pytest.raises(DomainError, match=r"^side 0: the nearest row .* its neighbour's, \d+\.\d% of the largest"):
            fill_loop(found, **options)
        return
    filling = fill_loop(found, **options)
    assert filling.angle < 1e-9
    own = patch_bend(filling.patch, 0, filling.sides[0].curve, side_normals(filling.sides[0]))
    assert filling.contacts[0].bend == pytest.approx(np.abs(own - filling.sides[0].bend).max(), rel=1e-6)
    assert 0.05 < filling.contacts[0].bend < 0.2


def test_a_row_is_exact_to_the_rounding_of_its_neighbours_curvature() -> None:
    """Beside a bent patch of a sphere, no row is exact to 1e-11 of its terms: curvatures come from derivatives."""
    h = 0.25
    arc = np.array([[np.cos(h), -np.sin(h)], [1 / np.cos(h), 0], [np.cos(h), np.sin(h)]])
    grid = [(i, j) for i in range(3) for j in range(3)]
    points = np.array([[arc[j, 0] * arc[i, 0], arc[j, 0] * arc[i, 1], arc[j, 1]] for i, j in grid])
    points += np.array([0.08, 0.1, 0.07]) * np.sin(2 * points[:, [1, 2, 0]] + 1)
    weights = [np.cos(h) ** ((i == 1) + (j == 1)) for i, j in grid]
    neighbour = Patch(grid, points, weights, [(1 + (i == 1)) * (1 + (j == 1)) for i, j in grid])
    (side,) = ring_sides(Model([neighbour]), [(0, 1)])
    second = osculating(side, side_normals(side), range(1, 4))
    assert second.shifts(np.random.default_rng(1).normal(size=len(second.fields)))[2] < RELATIVE


@long
def test_python_takes_both_ribbons_and_so_does_a_spec(tmp_path) -> None:
    found = strips(3, 1, 2)
    curves, ribbons, ribbons2 = ([rows[k, :, :3] for rows in found.values()] for k in range(3))
    named = zip(found, curves, strict=True)
    loop = Model([Patch(np.arange(3.0), curve, np.array([1, 2, 1]), name=name) for name, curve in named])
    filling = fill(loop, ribbons, ribbons2, continuity="g2", raises=0)
    assert_osculates(filling, found)
    with pytest.raises(DomainError, match=r"^ribbons2\[0\]: is the row after a ribbon, and there is none"):
        fill(loop, None, ribbons2)
    lines = []
    for name, curve, ribbon, ribbon2 in zip(found, curves, ribbons, ribbons2, strict=True):
        rows = {"control_points": curve, "ribbon": ribbon, "ribbon2": ribbon2}
        lines += ["[[patches]]", f'name = "{name}"', "knots = [0, 1, 2]", "weights = [1, 2, 1]"]
        lines += [f"{key} = {row.tolist()}" for key, row in rows.items()]
    spec = tmp_path / "loop.toml"
    spec.write_text("\n".join(lines), encoding="utf-8")
    kinds = ["--elevate", 0, "--continuity", "g2", "--continuity", "side 1=g1", "--long"]
    assert gtb("fill", spec, *kinds, status=0).err.count("curvatures across differ by up to") == 2
    spec.write_text("\n".join(line for line in lines if not line.startswith("ribbon ")), encoding="utf-8")
    assert "ribbon2: is the row after ribbon, which is missing" in gtb("fill", spec, status=2).err
    spec.write_text("\n".join(lines).replace(str(ribbons2[0].tolist()), str(ribbons[0].tolist())), encoding="utf-8")
    assert "[0].ribbon2: is the ribbon itself; of a strip straight across" in gtb("fill", spec, status=2).err


@long
def test_a_side_may_differ() -> None:
    found = strips(3, 1, 2)
    filling = fill_loop(sides(found), continuity={"": "g2", "side 1": "g1", "side 2": "g0"}, raises=0)
    for contact, name in zip(filling.contacts, found, strict=True):
        assert (contact.bend < RELATIVE * 10) == (name in {"side 0"})
        assert (contact.angle < RELATIVE) == (name != "side 2")
    with pytest.raises(DomainError, match=r"^continuity: no side is called 'x': they are side 0, side 1, side 2"):
        fill_loop(sides(found), continuity={"x": "g2"})


def bowl(n: int, rise: float = 1 / 20) -> Strips:
    """Strips of the paraboloid z = rise (x² + y²) around the hole over a regular n-gon."""
    inverse = np.linalg.inv(bernstein(2, np.arange(3) / 2))
    turns = 2 * np.pi * np.arange(n + 1) / n
    corners = np.column_stack([np.cos(turns), np.sin(turns)])
    found = {}
    for k in range(n):
        places = corners[k] + np.arange(3)[None, :, None] / 2 * (corners[k + 1] - corners[k])
        places = places * (1 - np.arange(3)[:, None, None] / 4)
        grid = np.concatenate([places, rise * (places**2).sum(axis=2, keepdims=True)], axis=2)
        rows = np.einsum("ua,tb,abi->uti", inverse, inverse, grid)
        found[f"side {k}"] = np.concatenate([rows, np.ones((3, 3, 1))], axis=2)
    return found


@long
def test_a_hundredth_inside_curvature_is_nearly_that_at_the_edge():
    """Without a pull a third of the largest is missing there; with more than is enough, the patch varies more."""
    filling = fill_loop(sides(bowl(3, 0.5)), continuity="g2")
    inside = max(contact.bend_inside for contact in filling.contacts)
    assert 0.02 < inside / max(np.abs(side.bend).max() for side in filling.sides) < 0.1


@long
def test_neighbours_of_one_surface_agree_at_corners_and_others_are_named() -> None:
    found = bowl(5)
    filling = fill_loop(sides(found), continuity="g2")
    assert_osculates(filling, found)
    assert not any("mean curvatures" in remark for remark in filling.remarks)
    x, y, z = filling.patch.evaluate(energy_samples(filling.patch.domain, 12)[0], "linear").T
    assert np.abs(z - (x**2 + y**2) / 20).max() < 6e-4  # there are fairer surfaces than the paraboloid
    assert max(contact.bend_inside for contact in filling.contacts) < 0.06 * 0.1  # of its curvature
    found["side 1"][2, :, 2] += 0.05
    other = fill_loop(sides(found), continuity="g2", raises=0)
    named = [remark for remark in other.remarks if "mean curvatures" in remark]
    assert [remark.split(":")[0] for remark in named] == ["side 0 and side 1", "side 1 and side 2"]


@long
def test_a_corner_between_rational_patches_has_their_curvature() -> None:
    cube = load(SPECS / "rounded-cube.toml")
    index = next(k for k, patch in enumerate(cube) if patch.name == "corner")
    rest = cube.replace(patches=tuple(patch for patch in cube if patch.name != "corner"))
    filling = fill(rest, continuity="g2")
    assert [len(filling.sides), filling.folds] == [3, 0]
    assert max(contact.bend for contact in filling.contacts) < RELATIVE
    seams = [seam for seam in filling.model.seams if len(filling.model) - 1 in {seam.first[0], seam.second[0]}]
    assert len(seams) == 3
    assert max(seam.bend for seam in seams) < RELATIVE
    given = [seam.bend for seam in cube.seams if index in {seam.first[0], seam.second[0]}]
    assert min(given) > 0.1


def test_the_curvature_inside_is_that_a_hundredth_of_the_length_from_the_edge():
    """Of z = x³ over a square: 0 on the edge x = 0, and z″ / 2 = 0.03 at x = 0.01; it is said twice."""
    grid = [[i, j] for i in range(4) for j in range(2)]
    cubic = Patch(grid, [[i / 3, j, float(i == 3)] for i, j in grid], coefficients=[1, 1, 3, 3, 3, 3, 1, 1])
    side = HoleSide("x = 0", np.array([[0.0, 1, 0, 1], [0, 0, 0, 1]]), bend=np.zeros(96))
    found = contact_at(cubic, 3, side, np.tile([0.0, 0, 1], (96, 1)))
    assert (found.bend, found.bend_inside) == pytest.approx((0, 0.06), rel=1e-2)
