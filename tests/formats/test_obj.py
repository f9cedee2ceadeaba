"""OBJ text: byte for byte what trimesh's exporter and Python's own formatting write."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
import trimesh
from hypothesis import given, strategies as st
from trimesh.exchange.obj import export_obj
from trimesh.visual import TextureVisuals
from trimesh.visual.material import SimpleMaterial

from gtb_cli.formats.export import encode_mesh
from gtb_cli.formats.numbers_written import BLOCK_ROWS, decimals, obj_blocks
from gtb_cli.meshes.mesh import Mesh
from tests.specs import memory_below
from tests.tiny_meshes import encoded, lines, model, surface


def trimesh_obj(mesh: Mesh, *, normals: bool, uv: bool) -> str:
    other = trimesh.Trimesh(mesh.vertices, mesh.cells, vertex_normals=mesh.normals, process=False)
    if uv:
        other.visual = TextureVisuals(uv=mesh.parameters, material=SimpleMaterial())
    return export_obj(other, include_normals=normals, include_texture=uv, digits=decimals(mesh.vertices))


@pytest.mark.parametrize("normals", [False, True])
@pytest.mark.parametrize("uv", [False, True])
@pytest.mark.parametrize("scale", [1.0, 1e-9, 1e-3, 47.11, 1e5, 1e9])
@pytest.mark.parametrize("shift", [0.0, -1e7])
def test_obj_lines_are_those_of_trimesh(normals, uv, scale, shift):
    mesh = replace(surface(7), vertices=surface(7).vertices * scale + shift)
    expected = trimesh_obj(mesh, normals=normals, uv=uv)
    kinds = ("v", "vn", "vt", "f")
    text = encoded(mesh, "obj", normals=normals, uv=uv).decode()
    assert text == "".join(f"{line}\n" for line in lines(expected, *kinds))
    assert len(lines(expected, "vt")) == uv * len(mesh.vertices)  # trimesh drops what it fails to write


def test_obj_lines_are_those_of_trimesh_across_blocks_and_growing_indices():
    mesh = surface(110)  # 12321 vertices, 24200 triangles: more than a block of each
    assert len(mesh.vertices) > BLOCK_ROWS
    assert encoded(mesh, "obj").decode() == "".join(
        f"{line}\n" for line in lines(trimesh_obj(mesh, normals=False, uv=False), "v", "f")
    )


def as_percent(values: np.ndarray, digits: int) -> str:
    return "".join("v " + " ".join(f"%.{digits}f" % x for x in row) + "\n" for row in values.tolist())


def as_obj(values: np.ndarray) -> str:
    return b"".join(obj_blocks(Mesh(values, np.empty((0, 3), int)))).decode()


def with_decimals(values: np.ndarray, digits: int) -> str:
    """Write numbers with a chosen number of decimals: as the normals of a vertex of the size that asks for it."""
    size, none = np.full((1, 3), 10.0 ** (8 - digits)), np.empty((0, 3), int)
    assert decimals(size) == digits
    text = b"".join(obj_blocks(Mesh(size, none, normals=values, normal_of=none))).decode()
    return "".join(line.replace("vn", "v", 1) + "\n" for line in lines(text, "vn"))


@given(st.lists(st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 3), min_size=1, max_size=30))
def test_obj_formats_any_double_as_percent_does(rows):
    values = np.array(rows)
    assert as_obj(values) == as_percent(values, decimals(values))


@given(st.lists(st.tuples(*[st.floats(-1e6, 1e6)] * 3), min_size=1, max_size=30), st.integers(8, 24))
def test_obj_formats_with_any_number_of_decimals(rows, digits):
    values = np.array(rows)
    assert with_decimals(values, digits) == as_percent(values, digits)


@given(
    st.integers(8, 20).flatmap(
        lambda digits: st.tuples(st.just(digits), st.lists(st.integers(0, 10**digits), min_size=3, max_size=30))
    )
)
def test_obj_rounds_the_neighbours_of_every_half(drawn):
    """Halves of the last place, the doubles nearest to them, and one to each side."""
    digits, counts = drawn
    halves = np.array([float(Fraction(2 * count + 1, 2 * 10**digits)) for count in counts])
    values = np.stack([halves, np.nextafter(halves, -np.inf), -np.nextafter(halves, np.inf)], axis=1)
    assert with_decimals(values, digits) == as_percent(values, digits)


def test_obj_rounds_exact_halves_to_even():
    # k/2^9 has exactly nine decimals, the last of them a 5.
    odd = (2 * np.arange(3 * 4096) + 1) / 512.0
    values = np.concatenate([odd, -odd, odd + 2.0**20]).reshape(-1, 3)
    assert with_decimals(values, 8) == as_percent(values, 8)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0.00000000"),
        (-0.0, "-0.00000000"),
        (-1e-20, "-0.00000000"),
        (5e-324, "0.00000000"),
        (0.016527635, "0.01652763"),  # the double is below the half, its product with 1e8 is the half
        (0.999999995, "1.00000000"),
        (9.9999999975, "10.00000000"),
        (-99.999999996, "-100.00000000"),
        (999999.999999999, "1000000.00000000"),
        (2.0**52, "4503599627370496.00000000"),
        (-(2.0**62), "-4611686018427387904.00000000"),
        (1e25, "10000000000000000905969664.00000000"),
    ],
)
def test_obj_formats_edge_cases(value, text):
    assert with_decimals(np.array([[value, 1.0, value]]), 8) == f"v {text} 1.00000000 {text}\n"


@pytest.mark.parametrize("columns", [2, 3])
@pytest.mark.parametrize("extras", [(), ("uv",), ("normals",), ("uv", "normals")])
def test_obj_references_of_every_length(columns, extras):
    ends = [10**k + d for k in range(12) for d in (-1, 0, 1)]
    cells = np.array([[n, n + 1, 1][:columns] for n in ends])
    mesh = Mesh(np.ones((1, 3)), cells, normals=np.zeros((1, 3)) if "normals" in extras else None)
    text = b"".join(obj_blocks(mesh, np.zeros((1, 2)) if "uv" in extras else None)).decode()
    pattern = {(): "{0}", ("uv",): "{0}/{0}", ("normals",): "{0}//{0}", ("uv", "normals"): "{0}/{0}/{0}"}[extras]
    if columns == 2:  # a segment has no normals
        pattern = {"{0}//{0}": "{0}", "{0}/{0}/{0}": "{0}/{0}"}.get(pattern, pattern)
    letter = {2: "l", 3: "f"}[columns]
    assert lines(text, "f", "l") == [
        " ".join([letter, *(pattern.format(n + 1) for n in row)]) for row in cells.tolist()
    ]


@pytest.mark.parametrize("uv", [None, np.zeros((4, 2))])
def test_obj_corners_have_normals_of_their_own(uv):
    cells, normal_of = np.array([[0, 1, 2], [2, 1, 3]]), np.array([[0, 1, 2], [12345, 4, 9]])
    mesh = Mesh(np.eye(4, 3), cells, normals=np.zeros((12346, 3)), normal_of=normal_of)
    text = b"".join(obj_blocks(mesh, uv)).decode()
    join = "{0}//{1}" if uv is None else "{0}/{0}/{1}"
    assert lines(text, "f") == [
        " ".join(["f", *(join.format(v + 1, n + 1) for v, n in zip(*rows, strict=True))])
        for rows in zip(cells, normal_of, strict=True)
    ]


@pytest.mark.parametrize(
    ("size", "digits"), [(1.0, 8), (9.99, 8), (0.99, 9), (0.1, 9), (1e-9, 17), (1e9, 8), (5e-324, 332), (1e308, 8)]
)
def test_decimals_keep_nine_digits_of_the_extent(size, digits):
    assert decimals(np.array([[0.0, 0.0, 0.0], [size, 0.0, size / 2]])) == digits
    assert digits == 8 or f"{size:.{digits}f}".lstrip("0.")[8:].isdigit()


def test_decimals_of_a_point():
    assert decimals(np.array([[3e-4, -2e-3, 0.0]])) == 11
    assert decimals(np.zeros((5, 3))) == 8


def test_obj_groups_stand_before_their_faces():
    mesh = replace(model(), groups=(("left half", 0, 18), ("", 18, 18), ("left\nhalf\\", 18, 68)))
    text = lines(encoded(mesh, "obj"), "g", "f")
    assert [(k, line) for k, line in enumerate(text) if line[0] == "g"] == [(0, "g left_half"), (19, "g left_half_")]
    same = replace(model(), groups=(("a", 0, 18), ("a", 18, 68)))
    assert lines(encoded(same, "obj"), "g") == ["g a", "g a-2"]


def test_obj_references_up_to_the_largest_number_of_32_bits():
    last = 2**31 - 2  # counted from 1 it is one more
    for cells in ([[last - 2, last - 1, last]], [[0, last // 2, last]]):
        text = b"".join(obj_blocks(Mesh(np.ones((1, 3)), cells))).decode()
        assert lines(text, "f") == [" ".join(["f", *(str(n + 1) for n in row)]) for row in cells]


def test_obj_memory_is_a_block_not_the_file():
    mesh = surface(400)
    with memory_below(6e6):
        assert sum(map(len, encode_mesh(mesh, "obj"))) > 12e6
