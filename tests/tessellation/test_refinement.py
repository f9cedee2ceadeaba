"""Chord tolerance: the promise, measured by samples of its own, and what it costs in triangles."""

import math

import numpy as np
import pytest

from gtb_cli.errors import ToleranceError
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.nearest import cell_distances
from gtb_cli.models.joints import unjoined
from gtb_cli.models.model import Model
from gtb_cli.moment import solve
from gtb_cli.moment.solve import LogSum
from gtb_cli.tessellation.complexes import joined_complex
from gtb_cli.tessellation.refinement import _Refinement
from gtb_cli.tessellation.refinement_samples import MIN_SAMPLES, PeakParameters
from gtb_cli.tessellation.sampler import Sampler
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.patch import Patch
from tests.marks import long, mostly_long
from tests.patches import pentagon
from tests.specs import SPECS, load
from tests.surfaces import away, diagonal, rim

PENTAGON = np.array([[0, 2], [1, 2], [0, 6 / 5], [8 / 7, 8 / 7], [2, 1], [0, 0], [6 / 5, 0], [2, 0]])
HEIGHTS = np.array([0, 4, 2, 5, 2, 0, 2, 0.0])
WEIGHTS = np.array([2, 2, 5, 7, 2, 3, 5, 2.0])
LIFTING = np.array([1, 0, 3, 2, 0, 1, 3, 1.0])

GRID = np.array([[i, j] for i in range(4) for j in range(4)], dtype=float)
BICUBIC = np.array([math.comb(3, i) * math.comb(3, j) for i in range(4) for j in range(4)], dtype=float)

SLACK = 1e-9  # part of the tolerance by which an independent sample may exceed it through rounding
NOISE = 0.05  # by which part two measurements of one mesh at random points may differ


def patch(z=HEIGHTS, weights=WEIGHTS, knots=PENTAGON, **more) -> Patch:
    return Patch(knots, np.column_stack([PENTAGON, z]), weights, **more)


def spike() -> Patch:
    weights = WEIGHTS.copy()
    weights[3] = 1e6
    return patch(weights=weights)


def near_edge() -> Patch:
    """Knots 0.05 from two edges: exponents that small have infinite slopes in the toric parametrisation."""
    knots = PENTAGON.copy()
    knots[2], knots[6] = (0.05, 1.2), (1.2, 0.05)
    return patch(knots=knots)


def almost_merged() -> Patch:
    """Step 0.99 of the knot limit of Example 4.2."""
    knots = PENTAGON.copy()
    knots[3] = knots[3] + 0.99 * (knots[1] - knots[3])
    return patch(knots=knots)


def bicubic(scale: float = 1.0, shift: float = 0.0) -> Patch:
    z = np.array([0, 0.5, 0.5, 0, 0.5, 1, 1, 0.5, 0.5, 1, 1, 0.5, 0, 0.5, 0.5, 0])
    return Patch(GRID, scale * np.column_stack([GRID, z]) + shift, None, BICUBIC)


HARD = {
    "pentagon": patch(),
    "knots near an edge": near_edge(),
    "weights times 600^λ": patch(np.where(np.arange(8) == 3, 18, HEIGHTS), WEIGHTS * 600**LIFTING),
    "almost merged knots": almost_merged(),
    "one weight of a million": spike(),
    "small": bicubic(1e-9),
    "large": bicubic(1e9),
    "far away": bicubic(1.0, 1e7),
    "repeated knot": Patch(
        np.vstack([PENTAGON, PENTAGON[3]]), np.vstack([np.column_stack([PENTAGON, HEIGHTS]), [1, 1, -3]])
    ),
}


def largest_distance(shape: Patch, mesh: Mesh, samples: int = 10_000) -> float:
    """From random points of the surface to the cells in whose parameters they lie: no less than to the mesh."""
    rng = np.random.default_rng(7)
    each = max(3, samples // len(mesh.cells))
    weights = rng.dirichlet(np.ones(mesh.cells.shape[1]), (len(mesh.cells), each))
    u = np.einsum("kwc,kcd->kwd", weights, mesh.parameters[mesh.cells]).reshape(-1, shape.dimension)
    points = shape.evaluate(u, "linear")
    corners = [mesh.vertices[np.repeat(column, each)] for column in mesh.cells.T]
    return float(cell_distances(points, *corners).max())


def domain_areas(triangles) -> np.ndarray:
    """Twice the signed areas of (k, 3, 2) triangles."""
    (x, y), (z, w) = (triangles[:, k].T - triangles[:, 0].T for k in (1, 2))
    return x * w - y * z


def assert_conforming(mesh: Mesh) -> None:
    """Each side belongs to one cell or to two that run through it in opposite directions; no vertex hangs."""
    directed = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    assert len(np.unique(directed, axis=0)) == len(directed)
    sides, count = np.unique(np.sort(directed, axis=1), axis=0, return_counts=True)
    assert count.max() <= 2
    # A hanging vertex would leave open sides inside: the open ones must form closed loops on the domain's boundary.
    open_sides = sides[count == 1]
    assert (np.unique(open_sides, return_counts=True)[1] == 2).all()
    assert len(mesh.vertices) - len(sides) + len(mesh.faces) == 1


def test_a_knot_inside_a_cell_is_sampled_however_narrow_its_peak():
    peaks, first = PeakParameters([spike().domain], np.zeros(1, int)), np.zeros(1, int)
    assert PENTAGON[3].tolist() in peaks._held(first, first, first, PENTAGON[None, [5, 4, 1]])[1].tolist()


def test_few_and_wide_cells_are_sampled_on_finer_lattices():
    def steps(n: int, points_in_all: int) -> list[int]:
        mosaic = joined_complex([bicubic()], unjoined(bicubic()), n)
        return _Refinement(mosaic, Sampler([bicubic()]), 1.0, 1000, points_in_all).steps_at(np.arange(2)).tolist()

    assert [steps(1, 0), steps(4, 0), steps(8, 0), steps(8, 200)] == [[32] * 2, [8] * 2, [4] * 2, [12] * 2]


@pytest.mark.parametrize("name", HARD)
@pytest.mark.parametrize("part", mostly_long([1e-2, 2e-3]))
def test_the_surface_is_within_the_tolerance(name, part):
    shape = HARD[name]
    tolerance = part * diagonal(shape)
    mesh = tessellate(shape, tolerance=tolerance)
    assert largest_distance(shape, mesh) <= tolerance * (1 + SLACK)
    assert_conforming(mesh)
    areas = domain_areas(mesh.parameters[mesh.faces])
    assert (areas > 0).all()
    corners = shape.domain.vertices
    fan = np.stack([np.broadcast_to(corners[0], corners[:-2].shape), corners[1:-1], corners[2:]], axis=1)
    assert areas.sum() == pytest.approx(domain_areas(fan).sum(), rel=1e-9)


REFUSED = {
    "hopeless": (patch, 1e-10, {}, r"1e-10 needs about \de\+\d+ faces, more than 5000000, as estimated with \d{4} "),
    "too many": (patch, 1e-4, {"max_faces": 500}, r"500 faces; with \d+ samples are still up to 0\.\d+ from their"),
    "rounding": (lambda: bicubic(1.0, 1e7), 1e-9, {}, "below the rounding of coordinates of size 1e"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_tolerances_that_cannot_be_reached_are_refused_with_the_reason(name):
    shape, tolerance, options, message = REFUSED[name]
    with pytest.raises(ToleranceError, match=message):
        tessellate(shape(), tolerance=tolerance, **options)


@pytest.mark.parametrize(
    ("name", "part", "limit"), [("pentagon", 1e-5, 30_000), ("cubic-bezier", 1e-9, 3000), ("cubic-bezier", 1e-8, 8700)]
)
def test_what_is_foreseen_is_refused_before_it_is_made(name, part, limit):
    """The limit is a third of the 90,721 faces, a tenth of the 36,744 and 90 % of the 9,686 segments of the meshes."""
    shape = load(SPECS / f"{name}.toml")
    with pytest.raises(ToleranceError, match="needs about") as refusal:
        tessellate(shape, tolerance=part * diagonal(shape), max_faces=limit)
    now, fewer = str(refusal.value).split("with ")[1].split(" of them; ")
    assert int(now) < limit / 2
    assert len(tessellate(shape, tolerance=float(fewer.split()[0]), max_faces=limit).cells) > limit / 10


def test_a_flat_patch_takes_the_triangles_of_its_domain():
    flat = patch(z=PENTAGON.sum(axis=1))
    assert len(tessellate(flat, tolerance=1e-6).faces) == 5
    assert len(tessellate(Patch(GRID, GRID), tolerance=1e-6).faces) == 2


def test_a_flat_patch_whose_parameters_slide_takes_no_more():
    """In the plane of the surface there is no distance, whatever the control points inside do."""
    rng = np.random.default_rng(0)
    inside = ((GRID > 0) & (GRID < 3)).astype(float)
    moved = GRID + 0.2 * rng.normal(size=GRID.shape) * inside
    slid = Patch(GRID, np.column_stack([moved, moved[:, 0]]), rng.random(16) + 0.3)
    assert len(tessellate(slid, tolerance=1e-4).faces) == 2
    bent = GRID.copy()
    bent[1] += [-0.3, 0]
    assert len(tessellate(Patch(GRID, bent), tolerance=1e-2).faces) > 2


def concave(inner: tuple[float, float]) -> Patch:
    """A flat patch around a rounded concave corner: with straight sides in Δ, triangles there fold over each other."""
    knots = [(i, j) for j in range(3) for i in range(3)]
    points = [(-2, -1), (-1, -1), (-1, -2), (-3.5, -1), inner, (-1, -3.5), (-5, -1), (-5, -5), (-1, -5)]
    return Patch(knots, points, [1, 2**-0.5, 1, 1, 2**-0.5, 1, 1, 2**-0.5, 1], [1, 2, 1, 2, 4, 2, 1, 2, 1])


@pytest.mark.parametrize("inner", [(-3, -3), pytest.param((1, 1), marks=long)], ids=["one to one", "folding"])
@pytest.mark.parametrize("tolerance", mostly_long([0.06, 0.006]))
def test_a_flat_patch_with_curved_sides_is_covered(inner, tolerance):
    """By the nearest triangles; where the surface itself folds over its boundary, too."""
    shape = concave(inner)
    mesh = tessellate(shape, tolerance=tolerance)
    u = np.random.default_rng(3).uniform(0, 2, (20_000, 2))
    u[:2000, 0] = 0
    u[2000:4000, 1] = 0
    assert away(shape.evaluate(u), mesh) <= tolerance * (1 + SLACK)
    assert_conforming(mesh)
    if inner == (-3, -3):
        assert len(mesh.faces) < 4 * len(mesh.open_sides)  # a polygon takes two triangles less than it has sides
        assert len(set(np.sign(domain_areas(mesh.vertices[mesh.faces][:, :, :2])))) == 1
        assert largest_distance(shape, mesh) > tolerance  # of the cells in whose parameters the points lie


@pytest.mark.parametrize("part", mostly_long([1e-2, 3e-3, 1e-3]))
def test_a_gentle_surface_takes_no_more_than_the_best_uniform_mesh(part):
    shape = bicubic()
    mesh = tessellate(shape, tolerance=part * diagonal(shape))
    reached = largest_distance(shape, mesh)
    n = math.isqrt((len(mesh.faces) - 1) // 2)
    assert largest_distance(shape, tessellate(shape, n, parametrization="linear")) > reached * (1 - NOISE)


@pytest.mark.parametrize("name", mostly_long(["pentagon", "nonagon", "hexagon", "bezier-triangle", "trapezoid"]))
def test_few_triangles_are_thin(name):
    """Longest side over height: 1.15 for an equilateral triangle; the README says what was measured."""
    shape = load(SPECS / f"{name}.toml")
    mesh = tessellate(shape, tolerance=2e-3 * diagonal(shape))
    a, b, c = (mesh.vertices[corner] for corner in mesh.faces.T)
    longest = np.max([np.linalg.norm(side, axis=1) for side in (b - a, c - b, a - c)], axis=0)
    aspect = longest**2 / np.linalg.norm(np.cross(b - a, c - a), axis=1)
    assert np.median(aspect) < 4
    assert np.quantile(aspect, 0.99) < 27


def test_an_eighth_of_example_4_4_beats_any_uniform_mesh():
    shape = HARD["weights times 600^λ"]
    mesh = tessellate(shape, tolerance=2e-3 * diagonal(shape))
    # Chord errors fall with the square of the number of segments at best: 31 segments would be a third as many.
    n = math.isqrt(3 * len(mesh.faces) // 5)
    for parametrization in ("linear", "toric"):
        uniform = tessellate(shape, n, parametrization=parametrization)
        assert len(uniform.faces) > 2.8 * len(mesh.faces)
        if parametrization == "linear":
            assert largest_distance(shape, uniform) > largest_distance(shape, mesh)


def test_triangles_are_well_shaped_where_the_surface_is_gentle():
    """Shape: 4√3 area / (sum of squared sides), 1 for an equilateral triangle, √3/2 for half a square."""
    mesh = tessellate(bicubic(), tolerance=2e-3)
    a, b, c = (mesh.vertices[column] for column in mesh.faces.T)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    shape = 4 * math.sqrt(3) * area / sum(((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a)))
    assert shape.min() > 0.5


def test_curves_are_refined_where_they_bend():
    knots = [0, math.sqrt(2) / 4, 0.5, math.sqrt(2) / 2, 1]
    shape = Patch(knots, [[0, 0], [0.4, 1.3], [2, 2], [3.7, 1.5], [4, 0]], [1, 10, 2000, 6, 5])
    for tolerance in (1e-2, 1e-4):
        mesh = tessellate(shape, tolerance=tolerance)
        assert largest_distance(shape, mesh) <= tolerance * (1 + SLACK)
        assert (mesh.edges[:, 1] - mesh.edges[:, 0] != 0).all()
        order = np.argsort(mesh.parameters[:, 0])
        steps = zip(order[:-1].tolist(), order[1:].tolist(), strict=True)
        assert sorted(map(tuple, mesh.edges.tolist())) == sorted(steps)


def nearest_distance(shape: Patch, mesh: Mesh, samples: int = 4000) -> float:
    """From points of the surface, and of its rim, to the nearest of all triangles."""
    corners = shape.domain.vertices
    shares = np.random.default_rng(5).dirichlet(np.full(len(corners), 0.7), samples)
    return away(shape.evaluate(np.concatenate([shares @ corners, rim(shape)])), mesh)


def overshooting(by: float) -> Patch:
    """A flat bicubic whose inner control points pull it over its straight sides."""
    points = GRID.copy()
    points[5, 0] -= 2 * by
    points[9, 0] += by
    return Patch(GRID, points, None, BICUBIC)


@long
def test_a_flat_patch_is_looked_at_beside_one_that_is_split():
    """While the other one still fails, nothing is known of it."""
    points = np.column_stack([GRID + np.array([10, 0]), 3 * bicubic().control_points[:, 2]])
    bent = Patch(GRID, points, None, BICUBIC)
    for patches in ((bent, overshooting(2.0)), (overshooting(2.0), bent)):
        mesh = tessellate(Model(patches), tolerance=2e-3)
        assert max(nearest_distance(each, mesh) for each in patches) <= 2e-3 * (1 + SLACK)


@long
def test_a_surface_that_turns_back_along_a_side_is_reached():
    """In the plane, the middle and one quarter of such a side are on it: only the other quarter shows."""
    shape = overshooting(5.0)
    assert nearest_distance(shape, tessellate(shape, tolerance=2e-3), 60_000) <= 2e-3 * (1 + SLACK)


@pytest.mark.parametrize("tolerance", [0.56, 0.6, 0.65])
def test_a_surface_that_bulges_between_its_sides_is_reached(tolerance):
    """A paraboloid whose sides are 0.5 from a triangle, its middle 2/3."""
    knots = [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (0, 2)]
    points = [(i + j / 2, j * 3**0.5 / 2, z) for (i, j), z in zip(knots, [0, 1, 0, 1, 1, 0], strict=True)]
    shape = Patch(knots, points, None, [1, 2, 1, 2, 2, 1])
    assert nearest_distance(shape, tessellate(shape, tolerance=tolerance)) <= tolerance * (1 + SLACK)


@pytest.mark.parametrize("tolerance", [1.0, 0.3, 0.05])
@pytest.mark.parametrize("alone", [False, True])
def test_a_patch_with_an_edge_that_is_a_point_does_not_vanish(tolerance, alone):
    """Two sides and a point: as one triangle it would be a line, and the patch would have no faces."""
    knots = [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (0, 2)]
    points = [(0, 0, 0)] * 3 + [(5, -0.4, 0), (5, 0.4, 0), (10, 0, 0)]
    lens = Patch(knots, points, None, [1, 2, 1, 2, 2, 1])
    mesh = tessellate(Model((lens,) if alone else (lens, bicubic(1.0, 20.0))), tolerance=tolerance)
    assert mesh.groups[0][2] > 0
    assert nearest_distance(lens, mesh) <= tolerance * (1 + SLACK)


@pytest.mark.parametrize("apart", [1e-2, 1e-4, 1e-6])
def test_an_arc_between_knots_that_crowd_is_not_passed_by(apart):
    """In linear parameters the arc is only as long as the knots are apart: nine times the tolerance was missed."""
    curve = Patch([0, apart, 2 * apart, 1], [[0, 0], [0.5, 1], [1, 0], [3, 0]])
    mesh = tessellate(curve, tolerance=0.01)
    exponents = np.linspace(-30, 30, 4001)[:, None] / apart * curve.knots.T
    weights = np.exp(exponents - exponents.max(axis=1, keepdims=True))
    arc = weights / weights.sum(axis=1, keepdims=True) @ curve.control_points
    assert away(arc, mesh) <= 0.01
    assert len(mesh.cells) < 50


@pytest.mark.parametrize("knot", mostly_long([((1.77, 0.0006),), ((0.0001, 1.0),)], 0))
def test_a_knot_near_an_edge_does_not_cut_up_its_neighbourhood(knot):
    """While slivers passed on the rule for slivers, 26 marked edges became 12,684, and in the end millions of faces."""
    knots = PENTAGON.copy()
    knots[3] = knot
    shape = patch(knots=knots)
    mesh = tessellate(shape, tolerance=1e-2 * diagonal(shape), max_faces=1000)
    assert largest_distance(shape, mesh, 20_000) <= 1e-2 * diagonal(shape) * (1 + SLACK)


def test_new_points_are_looked_for_beside_their_neighbours(monkeypatch):
    cold, minimised = [], solve._minimised
    monkeypatch.setattr(solve, "_minimised", lambda one, p, *rest: cold.append(p.shape[1]) or minimised(one, p, *rest))
    mesh = tessellate(pentagon(), tolerance=2e-3, normals=False)
    assert sum(cold) < 0.01 * len(mesh.faces)  # of some 8,000 samples; it was 0.07


@long
def test_among_random_knots_points_are_looked_for_from_their_neighbours(monkeypatch):
    """Starts from the knots nearest to an edge were worse than none: 25 evaluations for each of 20,000 samples."""
    rng = np.random.default_rng(1)
    knots = np.concatenate([[[0, 0], [1, 0], [1, 1], [0, 1]], rng.random((296, 2))])
    shape = Patch(knots, np.column_stack([knots, np.sin(4 * knots[:, 0])]), np.exp(0.3 * rng.standard_normal(300)))
    evaluated, evaluate = [], LogSum.moments
    monkeypatch.setattr(LogSum, "moments", lambda self, s: evaluated.append(s.shape[1]) or evaluate(self, s))
    tessellate(shape, tolerance=0.05, normals=False)
    assert sum(evaluated) < 8 * MIN_SAMPLES


def test_a_ridge_between_samples_is_found():
    """Weights up to 10^12 times others: between samples of 12 steps, a ridge was 1.27 tolerances high."""
    rng = np.random.default_rng(161)
    n = int(rng.integers(4, 14))
    knots = rng.normal(size=(n, 2)) * 0.5
    points = np.column_stack([knots + 0.2 * rng.normal(size=knots.shape), rng.normal(size=n)])
    shape, tolerance = Patch(knots, points, 10.0 ** rng.uniform(-6, 6, n)), 0.012862
    mesh = tessellate(shape, tolerance=tolerance, normals=False)
    s = np.array([0.95, 18.15]) + rng.uniform(-1, 1, (2000, 2))
    shares = np.exp(s @ (knots - knots.mean(axis=0)).T + shape.log_products)
    assert away(shares @ points / shares.sum(axis=1, keepdims=True), mesh) <= tolerance


@long
def test_a_layer_between_knots_at_an_edge_is_found():
    """Knots 1e-6 to 0.1 from edges of a square: between one of them and a corner, 2.2 tolerances were missed."""
    rng = np.random.default_rng(100)
    low = np.column_stack([rng.random(5), 10 ** rng.uniform(-6, -1, 5)])
    right = np.column_stack([1 - 10 ** rng.uniform(-6, -1, 3), rng.random(3)])
    knots = np.concatenate([[[0, 0], [1, 0], [1, 1], [0, 1]], low, right])
    weights = 10 ** rng.uniform(-1, 1, 12)
    rng.normal(size=(12, 3)), rng.choice(3)
    points = np.column_stack([knots, rng.normal(size=12)])
    tolerance = 0.005 * float(np.linalg.norm(np.ptp(points, axis=0)))
    mesh = tessellate(Patch(knots, points, weights), tolerance=tolerance, normals=False)
    share = np.linspace(0.01, 0.99, 200)[:, None]
    knot = knots[knots[:, 0].argsort()[-3]]
    assert 0 < 1 - knot[0] < 1e-4
    u = np.concatenate([(1 - share) * knot + share * corner for corner in ([1, 0], [1, 1])])
    assert away(Patch(knots, points, weights).evaluate(u, "linear"), mesh) <= tolerance
