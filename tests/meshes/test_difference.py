"""When two meshes are the same: which vertices belong together, which tolerance holds, and what is proved."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from gtb_cli.formats.meshfiles import decode_mesh
from gtb_cli.meshes.difference import DEFAULT_TOLERANCE, difference
from gtb_cli.meshes.mesh import KnownMesh, Mesh, known_exactly
from gtb_cli.meshes.nearest import NearestCells
from gtb_cli.solids.wall_depth import wall_of_faces
from tests.marks import mostly_long
from tests.solids.test_wall_depth import CUBE
from tests.tiny_meshes import curve, encoded, model, plane, surface

RNG = np.random.default_rng(3)

FORMATS = ("spec", "obj", "ply", "stl", "glb")

OFFSET = 4096.0  # far enough from the origin that 32-bit numbers are 2⁻¹¹ to 2⁻¹² apart


def through(mesh: Mesh, kind: str) -> KnownMesh:
    """A mesh as it comes back from a file."""
    return known_exactly(mesh) if kind == "spec" else decode_mesh(encoded(mesh, kind), kind)


def moved(mesh: Mesh, by: float, vertex: int = 7) -> Mesh:
    vertices = mesh.vertices.copy()
    vertices[vertex, 2] += by
    return Mesh(vertices, mesh.cells, groups=mesh.groups)


def shuffled(mesh: Mesh) -> tuple[Mesh, np.ndarray]:
    """Vertices and cells in another order, and triangles from another corner on; and where each vertex was."""
    place = RNG.permutation(len(mesh.vertices))
    cells = np.argsort(place)[mesh.cells][RNG.permutation(len(mesh.cells))]
    turn = RNG.integers(0, 3, (len(cells), 1)) if cells.shape[1] == 3 else RNG.integers(0, 2, (len(cells), 1))
    return Mesh(
        mesh.vertices[place], np.take_along_axis(cells, (turn + np.arange(cells.shape[1])) % cells.shape[1], axis=1)
    ), place


@pytest.mark.parametrize(("first", "second"), [*itertools.product(FORMATS, FORMATS)])
@pytest.mark.parametrize("offset", [0.0, OFFSET])
def test_a_mesh_is_the_same_in_every_format(first, second, offset):
    mesh = Mesh(surface(5).vertices + offset, surface(5).cells)
    found = difference(through(mesh, first), through(mesh, second))
    assert (found.same, found.method, found.is_proved) == (True, "vertices", True)
    assert found.distance <= found.resolution <= found.tolerance


@pytest.mark.parametrize(("kind", "step"), [("ply", 2.0**-11), ("stl", 2.0**-11), ("glb", 2.0**-11), ("obj", 1e-8)])
def test_no_tolerance_is_below_what_a_format_holds(kind, step):
    """From 4096 on 32-bit numbers are 2⁻¹¹ apart; nine digits at the size of the model are eight decimals."""
    mesh = Mesh(surface(5).vertices + OFFSET, surface(5).cells)
    found = difference(through(mesh, kind), known_exactly(mesh), 1e-12)
    assert found.asked == 1e-12
    assert found.tolerance == found.resolution
    assert found.resolution == pytest.approx(math.sqrt(3) * step / 2, rel=1e-2)  # and roundings in double precision
    twice = difference(through(mesh, kind), through(mesh, kind), 1e-12)
    assert twice.tolerance == pytest.approx(math.sqrt(3) * step, rel=1e-2)


def test_the_tolerance_is_relative_to_the_smaller_mesh():
    large = Mesh(2 * surface(3).vertices, surface(3).cells)
    diagonal = float(np.linalg.norm(np.ptp(surface(3).vertices, axis=0)))
    for pair in ((surface(3), large), (large, surface(3))):
        found = difference(*map(known_exactly, pair))
        assert found.diagonal == pytest.approx(diagonal)
        assert found.tolerance == pytest.approx(DEFAULT_TOLERANCE * diagonal)
        assert difference(*map(known_exactly, pair), "2%").tolerance == pytest.approx(0.02 * diagonal)


@pytest.mark.parametrize("mesh", [surface(9), model(), curve(20)], ids=["surface", "model", "curve"])
def test_any_order_of_vertices_and_faces_is_the_same_mesh(mesh):
    other, place = shuffled(mesh)
    for kind in FORMATS if not mesh.is_curve else ():
        assert difference(through(other, kind), through(mesh, "obj")).method == "vertices"
    by = 0.4 * difference(known_exactly(mesh), known_exactly(mesh)).tolerance
    found = difference(known_exactly(mesh), known_exactly(moved(other, by)))
    assert (found.same, found.method, found.bound) == (True, "vertices", found.distance)
    assert found.distance == pytest.approx(by, rel=1e-3)
    assert (found.vertex, found.other_vertex) == (place[7], 7)


def test_vertices_without_faces_do_not_count_nor_the_order_far_from_the_origin():
    """There, in 32-bit numbers all vertices are at one place, and tell nothing."""
    mesh, far = surface(4), Mesh(surface(4).vertices + 1e8, surface(4).cells)
    more = Mesh(np.vstack([[[9.0, 9, 9]], mesh.vertices]), mesh.cells[::-1] + 1)
    for one, other in ((mesh, more), (far, shuffled(far)[0])):
        found = difference(known_exactly(one), known_exactly(other))
        assert (found.same, found.method, found.distance) == (True, "vertices", 0.0)


def test_a_value_that_stands_for_none_hides_no_difference_of_others():
    heat, off = np.append(np.linspace(0.5, 1, 24), -9999.0), 1e-4 * (np.arange(25) == 3)
    one, other = (known_exactly(replace(surface(4), attributes={"heat": values})) for values in (heat, heat + off))
    assert not difference(one, other).same


@pytest.mark.parametrize(("far", "is_told"), [(20.0, False), (1000.0, True)])
def test_a_few_vertices_that_make_a_mesh_a_hundred_times_as_large_are_told(far, is_told):
    vertices = np.concatenate([surface(4).vertices, surface(4).vertices[[0, 1, 5]] + far])
    mesh = known_exactly(Mesh(vertices, np.concatenate([surface(4).cells, [[25, 26, 27]]])))
    assert (difference(mesh, mesh).stray is not None) == is_told


def test_values_of_what_moved_by_a_step_of_its_grid_are_not_called_others():
    flat = plane(4)
    held = {"x": flat.vertices[:, 0], "height": RNG.random(len(flat.vertices))}
    one = known_exactly(replace(flat, attributes=held))
    new = Mesh(flat.vertices + np.array([0.25, 0, 0]), np.delete(flat.cells, 5, axis=0), attributes=held)
    found = difference(one, known_exactly(new))
    assert found.words == ("moved by (0.25, 0, 0)", "1 face is missing, near (0.0833333333 1.33333333 0)")
    assert found.values == ()
    other = replace(new, attributes={**held, "x": held["x"] + 0.1})
    assert difference(one, known_exactly(other)).values[0].startswith("x: up to 0.1 apart")
    further = Mesh(np.vstack([new.vertices, [[9, 9, 9]]]), new.cells, attributes={k: [*v, 0] for k, v in held.items()})
    found = difference(one, known_exactly(further))  # nothing tells which vertex was which
    assert not found.words
    assert found.values[-1].startswith("at the same places, x: up to 0.25 apart")


def test_beyond_the_tolerance_another_order_or_other_faces_are_another_surface():
    for mesh, other in (
        (surface(9), moved(shuffled(surface(9))[0], 1e-3)),
        (surface(6), Mesh(surface(6).vertices, surface(6).cells.reshape(-1, 6)[:, [0, 1, 5, 1, 2, 5]].reshape(-1, 3))),
    ):
        found = difference(known_exactly(mesh), known_exactly(other))
        assert (found.same, found.method) == (False, "surface")
        assert found.distance > 0
    assert difference(known_exactly(other), known_exactly(other)).same


def test_vertices_that_are_nearer_to_each_other_than_the_tolerance():
    found = difference(known_exactly(surface(5)), known_exactly(shuffled(surface(5))[0]), 0.5)
    assert (found.same, found.method) == (True, "vertices")  # each is nearest to its own
    found = difference(known_exactly(surface(5)), known_exactly(moved(shuffled(surface(5))[0], 0.4)), 0.5)
    assert found.same
    assert found.distance <= 0.4 + 1e-12


def test_what_coincides_in_32_bits_only():
    """Two corners of a mesh are 1e-9 apart: one place in an STL file, two in an OBJ file."""
    mesh = surface(4)
    split = mesh.cells.copy()
    split[5, 1] = len(mesh.vertices)
    other = Mesh(np.vstack([mesh.vertices, mesh.vertices[mesh.cells[5, 1]] + [0, 0, 1e-9]]), split)
    found = difference(through(other, "stl"), known_exactly(other))
    assert (found.same, found.method) == (True, "vertices")


@pytest.mark.parametrize("offset", mostly_long([1e8, 0.0]))
def test_what_coincides_in_32_bits_is_compared_in_64(offset):
    """A corner that leaves its vertex by less than 32-bit numbers tell apart, in meshes that have more digits."""
    mesh = surface(4)
    here = Mesh(mesh.vertices + offset, mesh.cells)
    soup = here.vertices[mesh.cells.ravel()]
    corner = int(np.flatnonzero(mesh.cells.ravel() == mesh.cells[-1, 0])[-1])  # not the first one at its place
    step = 2e-8 if not offset else 0.25
    soup[corner, 2] += step
    found = difference(known_exactly(here), known_exactly(Mesh(soup, np.arange(len(soup)).reshape(-1, 3))))
    assert not found.same
    assert found.distance > step / 10  # of the surfaces: the corner is beside others


def split(mesh: Mesh, face: int) -> Mesh:
    """The mesh with one face cut into three at its middle: other faces of the same surface."""
    middle, (i, j, k), m = mesh.vertices[mesh.cells[face]].mean(axis=0), mesh.cells[face], len(mesh.vertices)
    cells = np.concatenate([np.delete(mesh.cells, face, axis=0), [[i, j, m], [j, k, m], [k, i, m]]])
    return Mesh(np.concatenate([mesh.vertices, [middle]]), cells)


def turned(mesh: Mesh, faces: slice) -> Mesh:
    cells = mesh.cells.copy()
    cells[faces] = cells[faces, ::-1]
    return Mesh(mesh.vertices, cells)


def soup(mesh: Mesh) -> Mesh:
    return Mesh(mesh.vertices[mesh.cells.ravel()], np.arange(mesh.cells.size).reshape(-1, 3))


def with_faces(mesh: Mesh, *faces: list[int]) -> Mesh:
    return Mesh(mesh.vertices, np.concatenate([mesh.cells, faces]))


def with_a_speck(mesh: Mesh) -> Mesh:
    """A further tiny triangle, on a face."""
    corners, count = mesh.vertices[mesh.cells[7]], len(mesh.vertices)
    speck = corners.mean(axis=0) + 0.01 * (corners - corners.mean(axis=0))
    return Mesh(np.concatenate([mesh.vertices, speck]), np.concatenate([mesh.cells, [[count, count + 1, count + 2]]]))


def cut_on_one_side(mesh: Mesh) -> Mesh:
    """A vertex in the middle of an edge of one of its two faces."""
    (i, j, k), m = mesh.cells[-1], len(mesh.vertices)
    cells = np.concatenate([mesh.cells[:-1], [[i, m, k], [m, j, k]]])
    return Mesh(np.concatenate([mesh.vertices, [mesh.vertices[[i, j]].mean(axis=0)]]), cells)


SABOTAGE = {
    "one face turned over": (lambda mesh: turned(mesh, slice(8, 9)), "orientation"),
    "all faces turned over": (lambda mesh: turned(mesh, slice(None)), "orientation"),
    "a face missing": (lambda mesh: Mesh(mesh.vertices, np.delete(mesh.cells, 8, axis=0)), "connectivity"),
    "the last face missing": (lambda mesh: Mesh(mesh.vertices, mesh.cells[:-1]), "connectivity"),
    "a face twice": (lambda mesh: with_faces(mesh, mesh.cells[8]), "connectivity"),
    "all faces twice": (lambda mesh: Mesh(mesh.vertices, np.concatenate([mesh.cells] * 2)), "connectivity"),
    "both sides of a face": (lambda mesh: with_faces(mesh, mesh.cells[8, ::-1]), "connectivity"),
    "a face without area": (lambda mesh: with_faces(mesh, [3, 3, 4]), "connectivity"),
    "a face that is a line": (lambda mesh: with_faces(mesh, [1, 1, 1]), "connectivity"),
    "no shared vertices": (soup, "connectivity"),
    "a vertex that is no longer shared": (
        lambda mesh: Mesh(
            np.concatenate([mesh.vertices, mesh.vertices[mesh.cells[8, :1]]]),
            np.concatenate([np.delete(mesh.cells, 8, 0), [[len(mesh.vertices), *mesh.cells[8, 1:]]]]),
        ),
        "connectivity",
    ),
    "a speck": (with_a_speck, "connectivity"),
    "an edge cut on one side": (cut_on_one_side, "connectivity"),
}


@pytest.mark.parametrize("name", mostly_long(sorted(SABOTAGE, key="the last face missing".__eq__), len(SABOTAGE) - 1))
@pytest.mark.parametrize("tolerance", mostly_long([None, "1%"]))
@pytest.mark.parametrize("arranged", [lambda mesh: mesh, lambda mesh: shuffled(mesh)[0], lambda mesh: split(mesh, 2)])
def test_what_is_in_the_same_place_and_yet_different(name, tolerance, arranged):
    """Also where vertices and faces are in another order, or other faces are cut besides; each way."""
    change, aspect = SABOTAGE[name]
    mesh = surface(4)
    a, b = known_exactly(mesh), known_exactly(arranged(change(mesh)))
    for pair in ((a, b), (b, a)):
        found = difference(*pair, tolerance)
        assert not found.same, found
        far = "missing" in name  # and its place is farther from others than the tolerance
        found = difference(*pair, "20%" if far else tolerance, ignore=[aspect])
        assert found.same
        assert bool(found.turned) == (aspect == "orientation")
        assert bool(found.remarks) == (aspect == "connectivity")
    plain = difference(known_exactly(mesh), known_exactly(arranged(mesh)), tolerance)
    assert (plain.same, plain.turned, plain.remarks) == (True, 0, ())


@pytest.mark.parametrize("kind", ["obj", "ply", "stl", "glb", "3mf"])
def test_turned_faces_in_files(kind):
    mesh = surface(4)
    found = difference(through(mesh, kind), through(turned(mesh, slice(3, 5)), kind))
    assert (found.same, found.method, found.turned) == (False, "vertices", 2)
    rolled = Mesh(mesh.vertices, np.roll(mesh.cells, 1, axis=1)[::-1])
    assert difference(through(mesh, kind), through(rolled, kind), ignore=["attributes"]).same
    shared = difference(through(mesh, kind), through(soup(mesh), kind), ignore=["attributes"]).same
    assert shared == (kind in ("stl", "glb", "3mf"))  # where faces do not tell which vertices they share


@pytest.mark.parametrize(("reverse", "turned"), [(False, 5), (True, 0)])
def test_faces_that_look_to_both_sides_or_nowhere_are_not_turned_by_a_mirror(reverse, turned):
    """Four faces of a tetrahedron, a lone one, a sheet with a face on each side, and one that is a line."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3], [5, 5, 5.0]])
    cells = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3], [1, 2, 4], [0, 1, 4], [1, 0, 4], [3, 4, 3]])
    mirrored = Mesh(vertices * [-1, 1, 1], cells[:, ::-1] if reverse else cells)
    found = difference(known_exactly(Mesh(vertices, cells)), known_exactly(mirrored))
    assert (found.words, found.turned) == (("mirrored in x",), turned)


def test_other_faces_with_vertices_within_a_large_tolerance_are_no_difference():
    for tolerance in ("1%", "10%", "50%"):
        found = difference(known_exactly(plane(8)), known_exactly(plane(9)), tolerance)
        assert (found.same, found.remarks) == (True, ())


def test_which_face_is_there_twice_counts():
    mesh = surface(3)
    one, two = (with_faces(mesh, mesh.cells[face]) for face in (2, 5))
    assert not difference(known_exactly(one), known_exactly(two)).same
    assert difference(known_exactly(one), known_exactly(shuffled(one)[0])).same


def test_the_order_of_faces_does_not_decide():
    """Lists of equal indices say nothing where vertices, too, are in another order; nor does the first corner."""
    mesh = plane(4)  # which has symmetries
    turn = np.lexsort((mesh.vertices[:, 0], -mesh.vertices[:, 1]))
    for other in (
        Mesh(mesh.vertices * [-1, -1, 1], mesh.cells),
        Mesh(mesh.vertices[turn], np.argsort(turn)[mesh.cells]),
    ):
        again = known_exactly(Mesh(other.vertices, np.roll(other.cells, 1, axis=1)))
        assert difference(known_exactly(other), again).same
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    cells = np.array([[0, 1, 2], [0, 2, 3]])
    half = known_exactly(Mesh(np.roll(square, 2, axis=0), cells))
    found = difference(known_exactly(Mesh(square, cells)), half)
    assert (found.same, found.method, found.distance) == (True, "vertices", 0.0)
    slid = mesh.vertices + [0.01, 0, 0] * (np.arange(len(mesh.vertices)) == 12)[:, None]
    results = [
        difference(known_exactly(mesh), known_exactly(Mesh(slid, cells)))
        for cells in (mesh.cells, mesh.cells[::-1], np.roll(mesh.cells, 1, axis=1))
    ]
    assert {(found.method, found.distance) for found in results} == {("vertices", results[0].distance)}


@pytest.mark.parametrize("exponent", [-280, 280])
def test_extreme_sizes(exponent):
    scale = 10.0**exponent
    mesh = Mesh(surface(4).vertices * scale, surface(4).cells)
    other = shuffled(mesh)[0]
    assert difference(known_exactly(mesh), known_exactly(other)).method == "vertices"
    assert not difference(known_exactly(mesh), known_exactly(moved(mesh, 1e-6 * scale))).same


def test_a_curve_is_not_a_surface_even_where_nothing_is_apart():
    segment = Mesh(np.array([[0.0, 0, 0], [1, 0, 0]]), np.array([[0, 1]]))
    flat = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [0.5, 0, 0]]), np.array([[0, 1, 2]]))
    found = difference(known_exactly(segment), known_exactly(flat))
    assert (found.same, found.distance) == (False, 0.0)


def test_what_could_not_be_proved_is_said(monkeypatch):
    found = difference(known_exactly(plane(5)), known_exactly(plane(7)))
    assert (found.same, found.is_proved, found.method) == (True, True, "surface")
    assert found.bound <= 1.1 * found.tolerance
    monkeypatch.setattr("gtb_cli.meshes.hausdorff.MAX_CUTS", 0)
    found = difference(known_exactly(plane(5)), known_exactly(plane(7)))
    assert (found.same, found.is_proved) == (True, False)
    assert found.bound > 0.01
    assert difference(known_exactly(plane(5)), known_exactly(plane(7)), 1.0).is_proved
    assert difference(known_exactly(plane(5)), known_exactly(surface(7))).is_proved  # a distance that there is


def test_coinciding_bodies_are_the_same_in_any_order():
    """Of two bodies in one place, faces of one were matched with those of the other."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    box = Mesh(corners, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]))
    count = len(corners)
    double = Mesh(np.tile(box.vertices, (2, 1)), np.concatenate([box.cells, box.cells + count]))
    inside = Mesh(double.vertices, np.concatenate([box.cells, box.cells[:, ::-1] + count]))
    for mesh in (double, inside):
        for _ in range(5):
            assert difference(known_exactly(mesh), known_exactly(shuffled(mesh)[0])).same
    assert difference(known_exactly(inside), known_exactly(Mesh(inside.vertices, inside.cells[:, ::-1]))).same
    cells = double.cells + count * (np.arange(24).reshape(8, 3) == 0)  # a face of one hangs on a corner of the other
    assert not difference(known_exactly(double), known_exactly(Mesh(double.vertices, cells))).same


@pytest.mark.parametrize("left_out", mostly_long([slice(3, 6, 2), slice(0)]))
def test_faces_that_are_there_twice_have_no_order(left_out):
    """Two faces on the same vertices: each looks to one of two sides, with one of two textures, and is in a group."""
    kinds = list(itertools.product(("1/1 2/1 3/1", "3/1 2/1 1/1", "2/1 3/1 1/2"), "ab"))
    del kinds[left_out]
    rest = (("2/1 4/1 3/1", "a"), ("1/1 2/1 4/1", "b"))
    read = {
        pair: decode_mesh(
            b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0 0\nvt 1 0\n"
            + "".join(
                f"g {group}\nf {' '.join(np.roll(corners.split(), turn))}\n"
                for turn, (corners, group) in enumerate((*pair, *rest))
            ).encode(),
            "twice.obj",
        )
        for pair in itertools.product(kinds, repeat=2)
    }
    for one, other in itertools.product(itertools.combinations_with_replacement(kinds, 2), read):
        if sorted(one) <= sorted(other):  # else they are those of a former step, the other way round
            assert difference(read[one], read[other]).same == (sorted(one) == sorted(other)), (one, other)


def test_among_crowded_faces_a_bounded_number_of_points_is_searched_for(monkeypatch):
    needles = np.random.default_rng(0).normal(size=(300, 1, 3)) * np.array([[1], [-1], [0.99]])
    assert 15_000 < NearestCells(needles).most_points < 20_000 < NearestCells(CUBE.vertices[CUBE.cells]).most_points
    searched, search, mesh = list[int](), NearestCells.search, surface(4)
    monkeypatch.setattr(NearestCells, "most_points", 9)
    monkeypatch.setattr(NearestCells, "search", lambda *given: searched.append(len(given[1])) or search(*given))
    moved = Mesh(mesh.vertices + np.array([0, 0, 1e-3]), mesh.cells)
    found = difference(known_exactly(mesh), known_exactly(split(moved, 2)), 0.01, kind="surface")
    assert "as too many long ones lie across each other" in found.uncompared[-1]
    assert 0 < max(searched) <= 9
    assert wall_of_faces(CUBE) is None


@pytest.mark.parametrize(("q", "same"), [(0.9, True), (0.901, False), (math.nan, False), (0.9001, True)])
@pytest.mark.parametrize(("size", "place"), [(1, 0), (1e-9, 0), (1e9, 0), (1, 1e7)])
def test_values_at_a_further_vertex_are_those_of_the_face_there(q, same, size, place):
    """Up to rounding where all values have four decimals."""
    corners, rest = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.3, 0.3, 0]]), 0.1234
    values = np.array([rest, 2 + rest, 3 + rest, 1 + rest, q + rest])
    cells = [[0, 1, 2], [0, 2, 3]], [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
    one, other = (known_exactly(Mesh(size * corners + place, faces, attributes={"q": values})) for faces in cells)
    assert [difference(one, other).same, difference(other, one).same] == [same, same]
