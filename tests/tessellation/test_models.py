"""Models of several patches: the real ones of `specs/` and a thousand random ones; no cracks, and true openings."""

import tracemalloc
from collections import Counter
from functools import cache
from io import BytesIO
from math import factorial

import numpy as np
import pytest
import trimesh
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from gtb_cli.errors import DomainError
from gtb_cli.knots.even_triangulation import triangulation
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.models.joints import Joint
from gtb_cli.models.model import Model
from gtb_cli.models.same_edges import find_joints
from gtb_cli.tessellation.complexes import joined_complex
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.edges import edge_points_at
from gtb_cli.theory.patch import Patch
from tests.marks import mostly_long
from tests.specs import SPECS, load
from tests.surfaces import area, assert_closed, product, volume
from tests.tiny_meshes import encoded

DIGITS = 1e-11  # the linear parametrisation's residual, ten times over, as a fraction of a model's size
RANDOM_DIGITS = 1e-9  # the same for random patches, whose points may move a hundred times faster than their parameters

# Degrees between normals across edges of the closed solid: its six digits, over ribbons a tenth of an edge wide
CREASE = 3e-3

NAMES = ("teapot", "hebesphenorotunda", "box-corner")
MODELS = {name: load(SPECS / f"{name}.toml") for name in NAMES}

CUBIC = [[i, j] for j in range(4) for i in range(4 - j)]
BICUBIC = [[i, j] for j in range(4) for i in range(4)]


@cache
def meshed(name: str, **options: object) -> Mesh:
    return tessellate(MODELS[name], **options)


def size(model: Model) -> float:
    return float(np.ptp(np.concatenate([patch.control_points for patch in model.patches]), axis=0).max())


def boundary(mesh: Mesh) -> np.ndarray:
    """(b, 2) directed edges of one face; along every other edge two faces run, in opposite directions."""
    edges = mesh.cells[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    once, count = np.unique(edges, axis=0, return_counts=True)
    assert (count == 1).all()
    code = once @ np.array([len(mesh.vertices), 1])
    return once[~np.isin(code, once @ np.array([1, len(mesh.vertices)]))]


def components(edges: np.ndarray, count: int) -> np.ndarray:
    """(count,) which connected part of a graph each vertex belongs to."""
    links = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1])


@cache
def edge_points(patch: Patch, edge: int, count: int) -> np.ndarray:
    """(count, 3) points at equal fractions of an edge."""
    return edge_points_at(patch, edge, np.linspace(0.0, 1.0, count))


def open_edges(name: str) -> Counter[str]:
    """Names of the patches with open edges, without their last number."""
    patches = MODELS[name].patches
    return Counter(str(patches[p].name).rsplit("-", 1)[0] for p, _ in find_joints(patches).open)


# The specs


def test_the_teapot_is_welded_but_for_its_true_openings():
    joints = find_joints(MODELS["teapot"].patches)
    assert len(joints.shared) == 52
    assert len(joints.collapsed) == 8
    assert not joints.closed
    assert not any((joints.almost, joints.crowded, joints.one_sided, *joints.flipped))
    rings = {"rim": 4, "lid": 4, "handle-upper": 2, "handle-lower": 2, "spout-lower": 2, "spout-upper": 2}
    assert open_edges("teapot") == rings


@pytest.mark.parametrize("options", mostly_long([{"resolution": 6}, {"tolerance": 0.02}]), ids=str)
def test_the_teapot_has_four_parts_and_six_rings(options):
    mesh = tessellate(MODELS["teapot"], **options)
    rim = boundary(mesh)
    rings = components(rim, len(mesh.vertices))[rim[:, 0]]
    assert len(np.unique(rings)) == 6
    part = components(mesh.edges, len(mesh.vertices))
    used = (np.bincount(part), np.bincount(part[mesh.edges[:, 0]]), np.bincount(part[mesh.cells[:, 0]]))
    # Body and lid are discs (one ring each), handle and spout are tubes (two).
    assert sorted((used[0] - used[1] + used[2]).tolist()) == [0, 0, 1, 1]


def test_corners_of_cells_are_in_the_domains_of_their_own_patches():
    model, n = MODELS["teapot"], 3
    mosaic = joined_complex(model.patches, model.joints, n)
    assert (mosaic.parameters[mosaic.cells] != mosaic.corners).any()
    for index, patch in enumerate(model.patches):
        part = triangulation(patch.domain, n)
        found, expected = mosaic.corners[mosaic.cell_patch == index], part.parameters[part.cells]
        assert np.array_equal(found, expected[:, [0, 2, 1]] if model.joints.flipped[index] else expected)


def test_a_large_model_takes_a_few_times_the_memory_of_its_mesh():
    tracemalloc.start()
    mesh = tessellate(MODELS["teapot"], 60, normals=False)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(mesh.cells) > 200_000
    assert peak < 6 * sum(rows.nbytes for rows in (mesh.vertices, mesh.cells, mesh.parameters, mesh.origin.patch))


def test_the_box_corner_is_open_only_where_the_box_goes_on():
    model = MODELS["box-corner"]
    joints = find_joints(model.patches)
    assert len(joints.shared) == 12
    assert sum("hole" in (model.patches[j.first[0]].name, model.patches[j.second[0]].name) for j in joints.shared) == 6
    assert not any((joints.almost, joints.crowded, joints.one_sided, *joints.flipped))
    assert open_edges("box-corner") == {"rounding": 3, "face": 3}


@pytest.mark.parametrize(("name", "degrees"), [("hebesphenorotunda", CREASE), ("box-corner", 1e-11)])
def test_smooth_models_have_the_same_normals_on_both_sides_of_an_edge(name, degrees):
    assert max(seam.angle for seam in MODELS[name].seams) < degrees


# Meshes of them

LONG = [{"resolution": 2, "parametrization": "toric"}, {"resolution": 3}, {"resolution": 7}, {"tolerance": 0.015}]
OPTIONS = ({"resolution": 2}, *mostly_long([{"tolerance": 0.1}, *LONG]))


@pytest.mark.parametrize("options", [{"resolution": 1}, *OPTIONS], ids=str)
def test_the_closed_solid_is_watertight(options):
    mesh = meshed("hebesphenorotunda", **options)
    assert_closed(mesh)
    assert len(mesh.vertices) - len(mesh.edges) + len(mesh.cells) == 2
    # The divergence theorem gives the same for x, y and z only if nothing is missing.
    a, b, c = (mesh.vertices[corner] for corner in mesh.cells.T)
    flux = np.einsum("ij,ij->j", a + b + c, np.cross(b - a, c - a)) / 6
    assert flux == pytest.approx(volume(mesh), rel=1e-12)
    assert volume(mesh) > 3


@pytest.mark.parametrize("name", mostly_long(["box-corner", "teapot"]))
@pytest.mark.parametrize("options", OPTIONS, ids=str)
def test_open_models_are_open_at_their_openings_only(name, options):
    model = MODELS[name]
    mesh = meshed(name, **options)
    rim = boundary(mesh)
    # The number of edges that leave a vertex of the boundary is that of edges that arrive there.
    assert np.array_equal(np.sort(rim[:, 0]), np.sort(rim[:, 1]))
    openings = np.concatenate([edge_points(model.patches[p], e, 4001) for p, e in find_joints(model.patches).open])
    assert cKDTree(openings).query(mesh.vertices[rim[:, 0]])[0].max() < 2e-3  # the samples are nearer to each other
    if "resolution" in options:
        assert len(rim) == options["resolution"] * open_edges(name).total()


def test_files_of_the_closed_solid_are_solids_to_another_program():
    mesh = meshed("hebesphenorotunda", tolerance=0.1)
    for format in ("stl", "ply", "obj"):
        read = trimesh.load(BytesIO(encoded(mesh, format)), file_type=format, force="mesh")
        read.merge_vertices()
        assert read.is_volume
        assert len(read.faces) == len(mesh.cells)
        assert read.volume == pytest.approx(volume(mesh), rel=1e-5)  # float32


# The same model in other words


def in_other_words(model: Model, rng: np.random.Generator) -> Model:
    """Patches and their knots in another order, knots mapped and mirrored, weights scaled as leaves the surface."""
    patches = []
    for index in rng.permutation(len(model.patches)).tolist():
        p = model.patches[index]
        matrix = rng.normal(size=(2, 2))
        while not 0.2 < abs(np.linalg.det(matrix)) < 5:
            matrix = rng.normal(size=(2, 2))
        weights = np.exp(p.log_products + rng.normal() + p.knots @ rng.normal(size=2) / p.domain.size)
        order = rng.permutation(len(p.knots))
        c = rng.uniform(0.5, 2, len(order))
        knots = p.knots @ matrix + rng.normal(size=2)
        patches.append(Patch(knots[order], p.control_points[order], (weights / c)[order], c[order], name=p.name))
    return Model(tuple(patches), model.name)


def farthest(a: np.ndarray, b: np.ndarray) -> float:
    """Largest distance from a point of one set to the nearest of the other."""
    return float(max(cKDTree(b).query(a)[0].max(), cKDTree(a).query(b)[0].max()))


@pytest.mark.parametrize("name", mostly_long(reversed(NAMES)))
def test_other_words_give_the_same_surface(name):
    rng = np.random.default_rng(sum(map(ord, name)))
    model, other = MODELS[name], in_other_words(MODELS[name], rng)
    assert sum(patch.name == theirs.name for patch, theirs in zip(model.patches, other.patches, strict=True)) < 10
    one, two = find_joints(model.patches), find_joints(other.patches)
    counts = [[len(getattr(each, kind)) for kind in ("shared", "open", "collapsed")] for each in (one, two)]
    assert counts[0] == counts[1]
    assert any(two.flipped)
    assert not any((two.almost, two.crowded, two.one_sided))
    mesh, theirs = tessellate(model, 6), tessellate(other, 6)
    assert len(mesh.vertices) == len(theirs.vertices)
    assert farthest(mesh.vertices, theirs.vertices) < DIGITS * size(model)
    np.testing.assert_allclose(mesh.bounds, theirs.bounds, atol=DIGITS * size(model))
    assert len(boundary(mesh)) == len(boundary(theirs))
    # Diagonals of quadrilaterals may be the other ones.
    assert area(theirs) == pytest.approx(area(mesh), rel=2e-3)
    if one.closed:
        assert_closed(theirs)
        assert volume(theirs) == pytest.approx(volume(mesh), rel=2e-3)


@pytest.mark.parametrize(("scale", "shift"), [(1e-9, 0.0), (1e9, 0.0), (1.0, 1e7)])
@pytest.mark.parametrize("name", mostly_long(reversed(NAMES)))
def test_models_may_be_tiny_huge_or_far_away(name, scale, shift):
    model = MODELS[name]
    other = Model(tuple(p.replace(control_points=scale * p.control_points + shift) for p in model), model.name)
    rounding = DIGITS * scale * size(model) + 8e-16 * abs(shift)  # of sums of some hundred terms
    mesh, theirs = tessellate(model, 3), tessellate(other, 3)
    assert np.array_equal(mesh.cells, theirs.cells)
    assert np.abs(scale * mesh.vertices + shift - theirs.vertices).max() < 4 * rounding
    boundary(theirs)
    if name == "hebesphenorotunda":
        assert_closed(tessellate(other, tolerance=0.1 * scale))


@pytest.mark.parametrize(("scale", "shift"), mostly_long([(1e-9, 0.0), (1e9, 0.0), (1.0, 1e7)]))
def test_knots_may_be_tiny_huge_or_far_away(scale, shift):
    model = MODELS["box-corner"]
    other = Model(tuple(patch.replace(knots=scale * patch.knots + shift) for patch in model.patches), model.name)
    found = find_joints(other.patches)
    assert (len(found.shared), len(found.open), found.almost) == (12, 6, ())
    mesh, theirs = tessellate(model, 5), tessellate(other, 5)
    assert np.array_equal(mesh.cells, theirs.cells)
    # Parameters far away are rounded to 2e-9 of knots 24 apart.
    assert np.abs(mesh.vertices - theirs.vertices).max() < (1e-7 if shift else DIGITS * size(model))


# Random closed models of two patches


def polygon(rng: np.random.Generator, sides: int) -> np.ndarray:
    """(sides, 2) corners of a convex polygon: on an ellipse, neither too near each other nor in half of it."""
    gaps = 0.3 + rng.random(sides)
    angle = 2 * np.pi * (rng.random() + np.cumsum(gaps) / gaps.sum())
    return np.column_stack([np.cos(angle), np.sin(angle)]) @ (np.eye(2) + 0.3 * rng.normal(size=(2, 2)))


def closed_pair(rng: np.random.Generator) -> Model:
    """Two patches over different polygons that have all edges in common, each said in its own way."""
    sides = int(rng.integers(3, 8))
    corner, following = np.eye(sides), np.roll(np.eye(sides), -1, axis=0)
    places = [(i, t) for i in range(sides) for t in rng.uniform(0.08, 0.92, rng.integers(0, 4))]
    between = np.array([(1 - t) * corner[i] + t * following[i] for i, t in places]).reshape(-1, sides)
    rim = np.vstack([corner, between])  # how much of each corner there is in a knot
    corners = np.column_stack([polygon(rng, sides), 0.3 * rng.normal(size=sides)])
    points, logs = rim @ corners, rng.normal(size=len(rim))
    points[sides:] += 0.1 * rng.normal(size=(len(between), 3))
    patches = []
    for height in (1.0, -1.0):
        vertices = np.roll(polygon(rng, sides)[:: rng.choice([1, -1])], rng.integers(sides), axis=0)
        inner = rng.dirichlet(2 * np.ones(sides), rng.integers(1, 5))
        lifted = inner @ corners + height * np.abs(rng.normal(size=(len(inner), 1))) * [0, 0, 1]
        # Any numbers at the corners, linear between them: scalings that leave all edges.
        weights = np.exp(np.concatenate([logs + rim @ rng.normal(size=sides), rng.normal(size=len(inner))]))
        knots = 10.0 ** rng.uniform(-3, 3) * np.vstack([rim, inner]) @ vertices + rng.normal(size=2)
        order, c = rng.permutation(len(knots)), rng.uniform(0.2, 5, len(knots))
        patches.append(Patch(knots[order], np.vstack([points, lifted])[order], (weights / c)[order], c[order]))
    return Model(tuple(patches))


def gap(model: Model, joint: Joint, count: int = 17) -> float:
    """Largest distance between points at equal fractions of two joined edges, each by its own patch."""
    one, other = (edge_points(model.patches[p], edge, count) for p, edge in (joint.first, joint.second))
    return float(np.abs(one - (other[::-1] if joint.opposite else other)).max())


@pytest.mark.parametrize("seed", mostly_long(range(3)))
def test_a_hundred_random_closed_pairs_have_no_crack(seed):
    """All cells fit; for some pairs so do the mesh, and the points of each patch alone on its edges."""
    rng = np.random.default_rng(seed)
    for number in range(100 if seed else 30):
        model = closed_pair(rng)
        sides = len(model.patches[0].domain.vertices)
        joints = model.joints
        assert joints.closed
        assert len(joints.shared) == sides
        n = 1 + number % 4
        cells = joined_complex(model.patches, joints, n).cells
        edges = cells[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        assert np.array_equal(*(np.unique(side, axis=0) for side in (edges, edges[:, ::-1])))
        assert len(np.unique(edges, axis=0)) == len(edges)
        assert cells.max() + 1 - len(edges) // 2 + len(cells) == 2
        if number % 25 == seed:
            assert max(gap(model, joint) for joint in joints.shared) < RANDOM_DIGITS * size(model)
            mesh = tessellate(model, n)
            assert_closed(mesh)
            assert volume(mesh) > 0
    options = {"tolerance": 0.02 * size(model)} if seed < 3 else {"resolution": 5, "parametrization": "toric"}
    assert_closed(tessellate(model, **options))


# Where two patches meet in more than one edge: bugs that were


def pillow(knots: list[list[int]], inside: float) -> Patch:
    """A flat patch of degree 3 with inner control points lifted."""
    points = np.array(knots, dtype=float)
    on_edge = (points == 0).any(axis=1) | (points == 3).any(axis=1) | ((points.sum(axis=1) == 3) & (len(knots) == 10))
    return Patch(knots, np.column_stack([points, np.where(on_edge, 0.0, inside)]))


@pytest.mark.parametrize("knots", [CUBIC, BICUBIC], ids=["triangles", "quadrilaterals"])
@pytest.mark.parametrize("options", [*({"resolution": n} for n in (1, 4)), {"tolerance": 0.05}], ids=str)
def test_patches_that_share_two_edges_at_a_corner_have_no_side_in_common(knots, options):
    """The corner cells of both patches had the same three vertices: a side with four faces, and no end to refining."""
    model = Model((pillow(knots, 1.0), pillow(knots, -1.0)))
    mesh = tessellate(model, **options)
    assert_closed(mesh)
    assert len(np.unique(np.sort(mesh.cells, axis=1), axis=0)) == len(mesh.cells)


def test_a_tube_of_two_halves_ends_in_two_rings_between_the_same_vertices():
    """With one cell to an edge, the arcs of a ring had the same ends: refinement took them for one and had no end."""
    half = [[[x, s * y, z] for x, y in ((1, 0), (0, 2), (-1, 0))] for s in (1, -1) for z in (0.0, 1.0, 2.0)]
    model = Model((product(half[:3], [1, 0.5, 1], [1, 1, 1]), product(half[3:], [1, 0.5, 1], [1, 1, 1])))
    joints = find_joints(model.patches)
    assert (len(joints.shared), len(joints.open)) == (2, 4)
    mesh = tessellate(model, tolerance=0.02)
    rim = boundary(mesh)
    assert len(np.unique(components(rim, len(mesh.vertices))[rim[:, 0]])) == 2
    assert len(mesh.vertices) - len(mesh.edges) + len(mesh.cells) == 0


@pytest.mark.parametrize("count", mostly_long([2, 3]))
@pytest.mark.parametrize("options", [*({"resolution": n} for n in (2, 3)), {"tolerance": 0.05}], ids=str)
def test_slices_of_a_melon_have_two_edges_that_are_points(count, options):
    def slice_of(number: int) -> Patch:
        rings = []
        for j in range(4):
            for i in range(4):
                turn = 2 * np.pi * (number + i / 3) / count
                radius = 1.2 if j in (1, 2) else 0.0
                rings.append([radius * np.cos(turn), radius * np.sin(turn), (-1.5, -0.5, 0.5, 1.5)[j]])
        return Patch(BICUBIC, rings)

    model = Model(tuple(slice_of(number) for number in range(count)))
    assert find_joints(model.patches).closed
    assert_closed(tessellate(model, **options))
    with pytest.raises(DomainError, match="too low, every face is a point or a line"):
        tessellate(model, 1)


def rolled(radii: list[float]) -> Model:
    """A Bézier triangle rolled up around the z-axis so that two of its edges are one line: a cone, from its tip on.

    The radii are those of its rows; where the last one is 0, the third edge is a second tip.
    """
    degree = len(radii) - 1
    knots = [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]
    turns = [2 * np.pi * i / (i + j) if i and j else 0.0 for i, j in knots]
    points = [
        (radii[i + j] * np.cos(turn), radii[i + j] * np.sin(turn), i + j)
        for (i, j), turn in zip(knots, turns, strict=True)
    ]
    counts = [factorial(degree) / (factorial(i) * factorial(j) * factorial(degree - i - j)) for i, j in knots]
    return Model((Patch(knots, points, coefficients=counts),))


@pytest.mark.parametrize(
    "radii", [[0, 1, 2, 3, 4], [0, 1.7, 2.1, 1.7, 0], [0, 2, 3, 3, 2, 0]], ids=["cone", "drop", "big drop"]
)
@pytest.mark.parametrize("options", [*({"resolution": n} for n in (3, 4)), {"tolerance": 0.05}], ids=str)
def test_a_patch_with_two_edges_that_are_one_keeps_the_tip_between_them(radii, options):
    """The tip's last cells had the same vertices: they were lost, and refinement beside them had no end."""
    model = rolled(radii)
    mesh = tessellate(model, **options)
    if radii[-1]:
        rim = boundary(mesh)
        assert len(np.unique(components(rim, len(mesh.vertices))[rim[:, 0]])) == 1
        assert len(mesh.vertices) - len(mesh.edges) + len(mesh.cells) == 1
    else:
        assert_closed(mesh)
    cells = np.sort(mesh.cells, axis=1)
    assert (np.diff(cells, axis=1) > 0).all()
    assert len(np.unique(cells, axis=0)) == len(cells)
    assert (mesh.vertices == 0).all(axis=1).any()
    assert len(mesh.cells) < 2000
    if "tolerance" in options:
        along = np.linspace(0, 0.2, 50)
        seam = model.patches[0].evaluate(np.column_stack([along, np.zeros(50)]))
        gap = trimesh.proximity.closest_point_naive(trimesh.Trimesh(mesh.vertices, mesh.cells, process=False), seam)[1]
        assert gap.max() <= options["tolerance"]


def test_a_tip_beside_edges_that_are_points_has_no_cell_twice():
    """A coarse start had two cells with the same vertices, once the corners between such edges were one."""
    hexagon = [(0, 0), (2, 0), (4, 2), (4, 4), (2, 4), (0, 2)]
    middles = [(1, 0), (3, 1), (4, 3), (3, 4), (1, 3), (0, 1)]
    point, seam = (1.4, 0.9, 0.1), (0.8, 0.9, 0.4)
    corners = [(-0.4, -0.1, -0.3), point, point, point, (-1.6, -2, 0.1), point]
    between = [seam, point, point, (-1.2, -2, 2.1), (-0.1, 2, -0.2), seam]
    inner = [(0.4, 0.3, -0.9), (-1.9, 0.2, 1)]
    patch = Patch([*hexagon, *middles, (1.64, 2.03), (2.67, 3.24)], [*corners, *between, *inner])
    for tolerance in (1.0, 0.3, 0.1):
        mesh = tessellate(Model((patch,)), tolerance=tolerance)
        assert len(np.unique(np.sort(mesh.cells, axis=1), axis=0)) == len(mesh.cells)
        assert not len(mesh.crowded_sides)


# Where edges do not match


def neighbours(offset: list[float], knot: float = 1.0) -> tuple[Patch, Patch]:
    """Two biquadratic squares side by side; the middle of the second's edge is off, its knot too."""
    rows = [[[x, y, 0.0] for x in (0.0, 0.5, 1.0)] for y in (0.0, 0.5, 1.0)]
    one = product(rows, [1, 1, 1], [1, 1, 1])
    points = one.control_points + np.array([1.0, 0, 0])
    points[3] += offset
    knots = one.knots.copy()
    knots[3, 1] = knot
    return one, Patch(knots, points, one.weights, one.coefficients)


@pytest.mark.parametrize("offset", [1e-10, 1e-7, 1e-5, 1e-3, 0.1])
def test_edges_that_almost_match_are_reported_with_their_distance_and_not_welded(offset):
    """Those that match to rounding are welded, and far ones are not mentioned."""
    pair = neighbours([0, 0, offset])
    joints = find_joints(pair)
    assert len(joints.shared) == (offset == 1e-10)
    if offset in (1e-10, 0.1):
        assert not joints.almost
        return
    ((first, second, distance),) = joints.almost
    assert (first, second) == ((0, 1), (1, 3))
    assert distance == pytest.approx(offset / 2, rel=1e-6)  # a parabola has half the height of its middle point
    mesh = tessellate(Model(pair), 4)
    assert len(boundary(mesh)) == 32
    assert len(np.unique(components(mesh.edges, len(mesh.vertices)))) == 2
