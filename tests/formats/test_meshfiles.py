"""Mesh files: ours, those of other programs, odd ones, and damaged ones."""

import io
import itertools
import json
import math
import random
import struct
import zipfile
from collections.abc import Iterator
from pathlib import Path

import meshio
import numpy as np
import pytest
import trimesh
from hypothesis import given, strategies as st

from gtb_cli.errors import GtbError
from gtb_cli.formats import threemf
from gtb_cli.formats.glb_tree import glb_chunks
from gtb_cli.formats.meshfiles import decode_mesh, format_of, read_mesh
from gtb_cli.formats.obj import read_obj
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.vocabulary import FORMATS
from tests.formats.test_threemf import TRIANGLE as ONE_FACE, archive
from tests.marks import mostly_long
from tests.specs import memory_below, quickly
from tests.tiny_meshes import curve, encoded, glb_file, model, surface, two_curves
from tests.tools.judge import judge, seeds
from tests.tools.mutations import mutated

SINGLE = 2.0**-24  # relative error of rounding to a 32-bit number


TEXT = {"ascii": True}
OPTIONS = [("obj", {}), ("ply", {}), ("ply", TEXT), ("stl", {}), ("stl", TEXT), ("glb", {}), ("3mf", {})]

TRIANGLE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def with_z_up(points) -> np.ndarray:
    """What is up along y, as in glTF, upright along z."""
    x, y, z = np.moveaxis(np.asarray(points, dtype=float), -1, 0)
    return np.stack([x, -z, y], axis=-1)


def decoded(data: bytes | str, format: str | None = None) -> Mesh:
    return decode_mesh(data.encode() if isinstance(data, str) else data, "file", format).mesh


def is_triangle(data: bytes | str, format: str | None = None) -> bool:
    read = decoded(data, format)
    return np.array_equal(read.vertices, TRIANGLE) and read.cells.tolist() == [[0, 1, 2]]


def refusal(data: bytes | str, format: str | None = None) -> str:
    with pytest.raises(GtbError) as caught:
        decoded(data, format)
    message = str(caught.value)
    assert message.startswith("file: ")
    assert "\n" not in message
    return message.removeprefix("file: ")


@pytest.mark.parametrize("format", ["obj", "ply", "stl"])
def test_text_may_begin_with_a_byte_order_mark(format):
    data = encoded(surface(), format, ascii=format != "obj")
    for said in (None, format):
        assert (decoded(b"\xef\xbb\xbf" + data, said).vertices == decoded(data).vertices).all()


@pytest.mark.parametrize(("format", "options"), OPTIONS)
@pytest.mark.parametrize("make", [surface, curve, model, two_curves])
def test_what_we_write_reads_back(format, options, make):
    decimals = 0.5e-8 + 1e-15  # error of rounding to the 8 decimals that OBJ files of this size have
    mesh = make()
    if mesh.is_curve and not FORMATS[format].curves:
        return
    data = encoded(mesh, format, **options)
    assert format_of(data) == format
    known = decode_mesh(data, "file")
    read = known.mesh
    corners, expected = read.vertices[read.cells], mesh.vertices[mesh.cells]
    assert corners.shape == expected.shape
    error = np.abs(corners - expected)
    assert (error <= known.half_steps).all()
    largest = np.abs(expected).max()
    assert error.max() <= (decimals if format == "obj" else 0 if options else SINGLE * largest)
    assert known.half_steps.max() <= (
        1.01e-8 if format == "obj" else 1e-14 * largest if options else 2 * SINGLE * largest
    )
    assert len(read.vertices) == len(mesh.vertices)
    if format != "stl":
        assert np.array_equal(read.cells, mesh.cells)
        full = decoded(encoded(mesh, format, **options, normals=True, uv=True))
        assert np.array_equal(full.cells, mesh.cells)
    if format in ("obj", "glb") and mesh.groups:
        assert [group[1:] for group in read.groups] == [group[1:] for group in mesh.groups]


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("shift", [0.0, 1e7])
def test_at_any_size_and_place(scale, shift):
    mesh = Mesh(surface().vertices * scale + shift * scale, surface().cells)
    for format, options in OPTIONS:
        if format == "3mf" and shift:  # faces that 32-bit numbers make points are left out
            continue
        known = decode_mesh(encoded(mesh, format, **options), "file")
        error = np.abs(known.mesh.vertices[known.mesh.cells] - mesh.vertices[mesh.cells])
        assert (error <= known.half_steps).all()


@pytest.mark.parametrize("format", ["obj", "ply", "stl"])
@pytest.mark.parametrize("binary", [False, True])
def test_files_that_meshio_writes(format, binary, tmp_path):
    mesh = surface()
    path = tmp_path / f"x.{format}"
    theirs = meshio.Mesh(mesh.vertices, [("triangle", mesh.cells)])
    theirs.write(path, **({"binary": binary} if format != "obj" else {}))
    read = read_mesh(path)
    assert np.allclose(read.vertices[read.cells], mesh.vertices[mesh.cells], atol=1e-6)


@pytest.mark.parametrize("format", ["obj", "ply", "stl", "glb"])
def test_files_that_trimesh_writes(format):
    shape = trimesh.creation.icosphere(subdivisions=2)
    read = decoded(shape.export(file_type=format), format)
    corners = with_z_up(shape.triangles) if format == "glb" else shape.triangles
    assert np.allclose(read.vertices[read.cells], corners, atol=1e-6)


def test_nodes_of_a_scene_as_trimesh_places_them():
    box = trimesh.creation.box()
    scene = trimesh.Scene()
    for index, angle in enumerate((0.3, 1.7)):
        place = trimesh.transformations.rotation_matrix(angle, [1, 2, 3], [0.5, 0, index])
        scene.add_geometry(box, node_name=f"box{index}", geom_name="box", transform=place)
    data = scene.export(file_type="glb")
    read = decoded(data)
    theirs = trimesh.load(io.BytesIO(data), file_type="glb").to_geometry()
    ours, places = read.vertices[read.cells].mean(axis=1), with_z_up(theirs.triangles.mean(axis=1))
    assert np.allclose(np.sort(ours, axis=0), np.sort(places, axis=0), atol=1e-6)
    assert {name for name, _, _ in read.groups} == {"box0", "box1"}


def facet(points: np.ndarray = TRIANGLE) -> str:
    corners = "".join(f"vertex {x} {y} {z}\n" for x, y, z in points)
    return f"facet normal 0 0 1\nouter loop\n{corners}endloop\nendfacet\n"


@pytest.mark.parametrize(
    "text",
    [
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3",
        "# x\n\nv 0 0 0 1\nv 1 0 0 1\n  v 0 1 0 1\nvt 0 0\nf 1/1 2/1 3/1\n",
        "v\t0\t0\t0\r\nv 1 0 0\r\nv 0 1 0\r\nvn 0 0 1\r\nf 1//1 2//1 3//1\r\n",
        "v 0 0 0 .1 .2 .3\nv 1 0 0 .1 .2 .3\nv 0 1 0 .1 .2 .3\nf -3 -2 -1\n",
        "mtllib a.mtl\no a_b\nv 0 0 0\nv 1 \\\n0 0\nv 0 1 0\nusemtl m\ns off\nf 1/2/3 2/2/3 3/2/3\n",
        "v 0.0 0.0 0.0\rv 1.0 0.0 0.0\rv 0.0 1.0 0.0\rf 1 2 3\r",
        f"solid\n{facet()}endsolid\n",
        f"solid a solid of many words\n{facet()}endsolid a solid of many words",
        f"  solid x\r\n  {facet()}end solid x\r\n".lstrip(),
        f"SOLID X\n{facet().upper()}ENDSOLID X\n",
        f"solid a\nendsolid a\nsolid b\n{facet()}endsolid\n",
    ],
)
def test_text_as_programs_write_it(text):
    assert is_triangle(text, "stl" if "facet" in text.lower() else "obj")


@pytest.mark.parametrize(
    ("text", "cells"),
    [
        (
            "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\nv -1 0.5 0\nf -1 1/1 2/2\nf 1 2 3\nf 1 2 3 4 5\n",
            [[0, 1, 2], [0, 2, 3], [4, 0, 1], [0, 1, 2], [0, 1, 2], [0, 2, 3], [0, 3, 4]],
        ),
        ("v 0 0 0\nv 1 0 0\nv 1 1 0\nl 1 2 3\nl 3/1 1/1\nl 1 2\n", [[0, 1], [1, 2], [2, 0], [0, 1]]),
    ],
)
def test_obj_polygons_polylines_and_references_backwards(text, cells):
    assert decoded(text).cells.tolist() == cells


def test_obj_blocks_do_not_matter():
    data = encoded(model(), "obj", normals=True)
    whole = read_obj(data)
    cut = read_obj(data, block=1)
    assert np.array_equal(cut.vertices, whole.vertices)
    assert np.array_equal(cut.cells, whole.cells)
    assert cut.groups == whole.groups


@pytest.mark.parametrize(
    ("text", "step"),
    [
        ("v 0.123456 1.000000 2.500000\nv 1.0 0 0\nv 0 1 0\nf 1 2 3\n", 0.5e-5),  # 7 digits at a size of 2.5
        ("v 0.1234 1.0000 2.5000\nv 1.0000 0.0000 0.0000\nv 0.0000 1.0000 0.0000\nf 1 2 3\n", 0.5e-4),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", 0),
        ("v 0.0 0.0 0.0\nv 1.0 0.0 0.0\nv 0.0 1.5 0.0\nf 1 2 3\n", 0),
        ("v 0.1 0.30000000000000004 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", 0),
    ],
)
def test_digits_tell_what_a_text_can_hold(text, step):
    known = decode_mesh(text.encode(), "file")
    assert 0.09 * step <= known.half_steps.max() <= 1.01 * step + 1e-14


def ply(body: bytes | str, *lines: str, format: str = "ascii") -> bytes:
    header = "\n".join(["ply", f"format {format} 1.0", *lines, "end_header"])
    return header.encode() + b"\n" + (body.encode() if isinstance(body, str) else body)


XYZ = ("element vertex 3", "property float x", "property float y", "property float z")
FACE = ("element face 1", "property list uchar int vertex_indices")


@pytest.mark.parametrize(("order", "name"), [("<", "little"), (">", "big")])
@pytest.mark.parametrize(("kind", "letter"), [("float", "f"), ("double", "d"), ("int16", "h")])
def test_ply_binary_of_both_orders_and_any_type(order, name, kind, letter):
    lines = [line.replace("float", kind) for line in XYZ]
    lines.insert(2, "property uchar red")
    rows = b"".join(struct.pack(f"{order}{letter}B{letter}{letter}", int(x), 7, int(y), int(z)) for x, y, z in TRIANGLE)
    body = rows + struct.pack(f"{order}H3I", 3, 0, 1, 2)
    face = ("element face 1", "property list ushort uint vertex_index")
    assert is_triangle(ply(body, *lines, *face, format=f"binary_{name}_endian"))


def test_ply_with_polygons_of_several_sizes_and_other_lists():
    faces = [[0, 1, 2], [0, 1, 2, 3, 4], [4, 2, 0], [1, 2, 3, 4]]
    points = np.arange(15.0).reshape(5, 3) ** 1.5
    lines = ["element vertex 5", *XYZ[1:], "element face 4", "property uchar flag"]
    lines += ["property list uchar int vertex_indices"]
    lines += ["property list uchar float more", "element other 2", "property short a"]
    body = points.astype("<f4").tobytes()
    for index, face in enumerate(faces):
        body += bytes([9, len(face)]) + np.array(face, dtype="<i4").tobytes() + bytes([index]) + bytes(4 * index)
    body += bytes(4)
    read = decoded(ply(body, *lines, format="binary_little_endian"))
    expected = [[0, 1, 2], [0, 1, 2], [0, 2, 3], [0, 3, 4], [4, 2, 0], [1, 2, 3], [1, 3, 4]]
    assert read.cells.tolist() == expected
    text = "".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in points.tolist())
    text += "".join(f"9 {len(f)} {' '.join(map(str, f))} {i} {'0.5 ' * i}\n\n" for i, f in enumerate(faces)) + "1\n2\n"
    assert decoded(ply(text, *lines)).cells.tolist() == expected


def test_ply_text_is_read_where_the_machine_has_32_bits(monkeypatch):
    def narrow(values, counts, axis=None):
        assert isinstance(counts, int) or np.can_cast(counts.dtype, np.intp), counts.dtype
        return repeat(values, counts, axis)

    repeat = np.repeat
    monkeypatch.setattr(np, "intp", np.int32)  # as Python in a browser has it
    monkeypatch.setattr(np, "repeat", narrow)
    faces = ["element face 2", FACE[1], "property list uchar int more"]
    text = ply("0 0 0\n1 0 0\n0 1 0\n4 0 2 1 0 2 5 5\n3 0 1 2 1 5\n", *XYZ, *faces)
    read = decode_mesh(text, "file", "ply")
    assert read.mesh.cells.tolist() == [[0, 2, 1], [0, 1, 0], [0, 1, 2]]
    assert any("more" in name for name in read.values())


def test_ply_text_with_a_fraction_for_each_face():
    face = ("element face 1", "property float quality", *FACE[1:])
    body = "0 0 0\n1 0 0\n0 1 0\n0.5 3 0 1 2\n"
    assert decoded(ply(body, *XYZ, *face)).cells.tolist() == [[0, 1, 2]]
    faces = ["element face 2", *face[1:]]
    message = "element face: expected a whole number: '0.5 3 0 1 1.5'"
    for rows in ("0.5 3 0 1 1.5\n0.5 3 0 1 2\n", "0.5 3 0 1 2\n0.5 3 0 1 1.5\n"):
        assert message in refusal(ply(body.replace("0.5 3 0 1 2\n", rows), *XYZ, *faces))


def test_ply_of_32_bit_numbers_as_text_holds_no_more():
    body = "0 0 0\n1 0 0\n0 0.30000000000000004 0\n3 0 1 2\n"
    assert decode_mesh(ply(body, *XYZ, *FACE), "file").half_steps.max() == pytest.approx(SINGLE, rel=1e-6)


@pytest.mark.parametrize("start", [b"solid x", b"\xef\xbb\xbf"])
def test_a_binary_stl_may_begin_like_a_text(start):
    data = encoded(surface(), "stl")
    assert np.array_equal(decoded(start + data[len(start) :]).cells, decoded(data).cells)


def glb(tree: dict, binary: bytes) -> bytes:
    return glb_file(json.dumps(tree).encode(), binary)


def primitive(mode: int, count: int = 5, **more) -> dict:
    return {
        "asset": {"version": "2.0"},
        "nodes": [{"mesh": 0}],
        "meshes": [{"name": "m", "primitives": [{"attributes": {"POSITION": 0}, "mode": mode}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 12 * count}],
        "buffers": [{"byteLength": 12 * count}],
        **more,
    }


POINTS = np.arange(15, dtype="<f4").reshape(5, 3)


@pytest.mark.parametrize(
    ("mode", "cells"),
    [
        (1, [[0, 1], [2, 3]]),
        (2, [[0, 1], [1, 2], [2, 3], [3, 4], [4, 0]]),
        (3, [[0, 1], [1, 2], [2, 3], [3, 4]]),
        (4, [[0, 1, 2]]),
        (5, [[0, 1, 2], [2, 1, 3], [2, 3, 4]]),
        (6, [[0, 1, 2], [0, 2, 3], [0, 3, 4]]),
    ],
)
def test_glb_of_every_mode(mode, cells):
    read = decoded(glb(primitive(mode), POINTS.tobytes()))
    assert read.cells.tolist() == cells
    assert np.array_equal(read.vertices, with_z_up(POINTS))


@pytest.mark.parametrize("make", [surface, model, two_curves])
@pytest.mark.parametrize("up", [None, "y", "z"])
def test_glb_stands_upright_and_reads_back_as_it_was(make, up):
    """glTF 2.0, section 3.3: +Y is up. A file with z up says so, and so it reads back, too."""
    mesh, data = make(), encoded(make(), "glb", up=up)
    theirs = trimesh.load(io.BytesIO(data), file_type="glb", process=False)
    bounds = mesh.bounds if up == "z" else mesh.with_y_up.bounds
    assert np.allclose(theirs.bounds, bounds, atol=1e-6)
    assert np.array_equal(decoded(data).vertices, mesh.vertices.astype(np.float32))
    for extras in ("z", {"up": "x"}, ["up"], None):
        tree, body = glb_chunks(data)
        tree["asset"]["extras"] = extras  # those of others
        found = decoded(glb(tree, body)).vertices
        assert np.array_equal(
            found, with_z_up(mesh.vertices.astype(np.float32)) if up == "z" else decoded(data).vertices
        )


def test_glb_nodes_within_nodes_and_interleaved_numbers():
    tree = primitive(4, 3)
    tree["nodes"] = [
        {"children": [1, 2], "translation": [1, 0, 0]},
        {"mesh": 0, "scale": [2, 2, 2], "rotation": [0, 0, 0.5**0.5, 0.5**0.5]},
        {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1]},
    ]
    tree["bufferViews"][0] |= {"byteStride": 16, "byteLength": 48}
    rows = np.zeros((3, 4), dtype="<f4")
    rows[:, :3] = TRIANGLE
    read = decoded(glb(tree, rows.tobytes()))
    turned = [[1, 0, 0], [1, 2, 0], [-1, 0, 0]]  # a quarter turn around z, twice the size, and moved
    assert np.allclose(read.vertices, with_z_up([*turned, *(TRIANGLE + np.array([1, 0, 5]))]), atol=1e-12)


def test_mirrored_glb_nodes_keep_their_outer_sides():
    """By glTF, section 3.7.4, the determinant of a node's place defines which way round a face is seen."""
    tree = primitive(4, 3)
    tree["nodes"] = [{"children": [1], "scale": [-1, 1, 1]}, {"mesh": 0}]
    read = decoded(glb(tree, TRIANGLE.astype("<f4").tobytes()))
    a, b, c = read.vertices[read.cells[0]]
    assert np.cross(b - a, c - a).tolist() == [0, -1, 0]  # z of the file is −y here


def little(body: bytes, *lines: str) -> bytes:
    return ply(body, *lines, format="binary_little_endian")


def scene(changes: dict) -> bytes:
    return glb(primitive(4) | changes, b"")


def refused() -> Iterator[tuple[str, bytes, str]]:
    """Yield the format, a text, and a part of the message, for each case of a table."""
    for section in (Path(__file__).parent / "damaged.txt").read_text(encoding="utf-8").split("\n=== ")[1:]:
        format, _, cases = section.rstrip().partition("\n")
        for case in cases.split("\n\n"):
            *lines, message = case.split("\n")
            text = "".join(f"{line}\n" for line in lines).replace("FACET\n", facet())
            data = text.replace("TRIANGLE\n", ply("", *XYZ, *FACE).decode()).encode()
            yield (
                format,
                archive("".join(lines[:-1]), lines[-1]) if format == "3mf" else data,
                message.removeprefix("> "),
            )


DAMAGED = {
    "ply": [
        (little(b"", *XYZ, *FACE), "is cut off: it ends within the 3 rows of element vertex"),
        (little(bytes(36), *XYZ, *FACE), "is cut off: it ends within the 1 rows of element face"),
        (little(bytes(36) + b"\3", *XYZ, *FACE), "is cut off: it ends within the 1 rows of element face"),
        (little(bytes(36) + b"\3" + bytes(13), *XYZ, *FACE), "has 1 bytes more"),
        (ply("", "element vert\x1bex 1"), "has no element vertex"),
        (ply("z\n", "element \x1b 1", "property int x", "element vertex 1"), "element \ufffd: 'z' is not a whole"),
    ],
    "stl": [
        (b"junk", "is not an STL file: 4 bytes"),
        (encoded(surface(), "stl")[:-1], "says that it has 32 facets, and its size is that of 31.98"),
    ],
    "glb": [
        (b"glTX", "is not a GLB file"),
        (struct.pack("<4sII", b"glTF", 1, 12), "is glTF of version 1, expected 2"),
        (encoded(surface(), "glb")[:-4], "says that it has"),
        (struct.pack("<4sIIII", b"glTF", 2, 20, 99, 0), "is cut off within a chunk"),
        (struct.pack("<4sII", b"glTF", 2, 12), "has no description"),
        (struct.pack("<4sIIII", b"glTF", 2, 24, 4, 0x4E4F534A) + b"{{{{", "its description is not JSON"),
        (struct.pack("<4sIIII", b"glTF", 2, 24, 4, 0x4E4F534A) + b"[]  ", "its description is not an object"),
        (glb({}, b""), "has no vertices"),
        (glb(primitive(4) | {"nodes": [{"mesh": 3}]}, POINTS.tobytes()), "its description is wrong: IndexError"),
        (scene({"nodes": [{"children": [0]}]}), "has no vertices"),
        (scene({"scenes": [{"nodes": [0]}], "nodes": [{"children": [0]}]}), "has node 0 in two places"),
        (glb({"scenes": [{"nodes": [0]}], "nodes": [{"children": [k + 1]} for k in range(200)]}, b""), "within nodes"),
        (scene({"extensionsRequired": ["\x1b[2J\n"]}), "needs \ufffd[2J\ufffd, which"),
        (scene({"extensionsRequired": ["KHR_draco_mesh_compression"]}), "needs KHR_draco"),
        (glb(primitive(9), POINTS.tobytes()), "unknown mode 9"),
        (glb(primitive(4), POINTS.tobytes()[:-4]), "is cut off: an accessor is longer than the data"),
        (glb(primitive(4, 10**18), POINTS.tobytes()), "is cut off: an accessor is longer than the data"),
        (scene({"buffers": [{"uri": "x.bin"}]}), "has its numbers in another file"),
    ],
    "3mf": [
        (archive("")[:-9], "is not a whole 3MF file: "),
        (archive("", method=zipfile.ZIP_BZIP2), "is compressed in a way that no 3MF file is"),
        (archive("", name="x.xml"), "is a ZIP archive without the model"),
        (archive(40 * "<a>" + 40 * "</a>"), "has elements more than 32 deep"),
        (archive(17_000_000 * " ", method=zipfile.ZIP_DEFLATED), "or 200 times its packed size"),
        (archive(f"<!--{2_000_000 * ' '}-->"), "has an element, or a comment, of more than 1 MB"),
        (archive("", prolog='<!DOCTYPE m [<!ENTITY a "aaaa">]>'), "declares an entity"),
        (
            archive(
                f'<object id="0">{ONE_FACE}</object>'
                + "".join(
                    f'<object id="{k}"><components>{9 * f"""<component objectid="{k - 1}"/>"""}</components></object>'
                    for k in range(1, 9)
                ),
                '<item objectid="8"/>',
            ),
            "numbers, or changes of material, in all objects together",
        ),
    ],
}


@pytest.mark.parametrize(
    ("format", "data", "message"), [*refused(), *((kind, *row) for kind, rows in DAMAGED.items() for row in rows)]
)
def test_damaged_files_are_refused_with_what_is_wrong(format, data, message):
    assert message in refusal(data, format)


@pytest.mark.parametrize("share", mostly_long([0.01, 1]))
@pytest.mark.parametrize(
    ("count", "element", "message"),
    [(560_000, "<model/>", "has more elements than its"), (100_001, '<colorgroup id="1"/>', " materials and uses")],
)
def test_elements_of_3mf_are_counted(count, element, message, share, monkeypatch):
    for name in ("FREE", "MOST"):
        monkeypatch.setattr(threemf, name, int(share * getattr(threemf, name)))
    assert message in refusal(archive(math.ceil(share * count) * element, method=zipfile.ZIP_DEFLATED), "3mf")


def turned(count: int) -> bytes:
    """A mesh in many nodes, which are turned by numbers that overflow."""
    nodes = [{"mesh": 0, "rotation": [1e200] * 4} for _ in range(count)]
    return glb(primitive(4, 3) | {"nodes": nodes}, POINTS[:3].tobytes())


def alternating(count: int) -> bytes:
    """Triangles and quadrangles by turns."""
    header = "\n".join([XYZ[0].replace("3", "4"), *XYZ[1:], f"element face {count}", FACE[1]])
    faces = b"".join(struct.pack("<B3i", 3, 0, 1, 2) + struct.pack("<B4i", 4, 0, 1, 2, 3) for _ in range(count // 2))
    return ply(bytes(48) + faces, header, format="binary_little_endian")


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (lambda: b"solid\nendsolid\n" * 20_000, "has no vertices"),
        (lambda: turned(2_500), "is not finite"),
        (lambda: glb({"nodes": [*({"children": [k + 1] * 2} for k in range(30)), {}]}, b""), "in two places"),
        (lambda: ply("", *(f"element a{k} 1" for k in range(20_000)), *XYZ[:1]), "has no property x"),
        (lambda: alternating(20_000) + b"x", "has 1 bytes more"),
        (lambda: b"".join(b"v 0 0 0\nf -1 -1 -1\n" for _ in range(10_000)) + b"x\n", "line 20001: unknown keyword"),
    ],
    ids=["solids", "nodes", "tree", "elements", "lists", "turns"],
)
def test_time_goes_with_the_size_of_a_file(made, message):
    """Each of these took more than its square, or would have."""
    data = made()
    with quickly():
        assert message in refusal(data)


def one_face(format: str, corners: int) -> bytes:
    """A face, or a fan, of many corners, as few bytes as possible for each."""
    if format == "obj":
        return b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf " + b"1 2 3 " * (corners // 3) + b"\n"
    if format == "obj with slashes":
        return one_face("obj", corners).replace(b" 1 2 3", b" 1/1 2/ 3//3")
    indices = bytes([0, 1, 2]) * (corners // 3)
    if format == "ply":
        lists = ("element face 1", "property list uint uchar vertex_indices")
        body = TRIANGLE.astype("<f4").tobytes() + struct.pack("<I", len(indices)) + indices
        return ply(body, *XYZ, *lists, format="binary_little_endian")
    if format == "ply text":
        body = f"0 0 0\n1 0 0\n0 1 0\n{len(indices)} {'0 1 2 ' * (corners // 3)}\n"
        return ply(body, *XYZ, "element face 1", "property list uint uchar vertex_indices")
    tree = primitive(6, 3)
    tree["meshes"][0]["primitives"][0]["indices"] = 1
    tree["accessors"].append({"bufferView": 1, "componentType": 5121, "count": len(indices), "type": "SCALAR"})
    tree["bufferViews"].append({"buffer": 0, "byteOffset": 36, "byteLength": len(indices)})
    return glb(tree, TRIANGLE.astype("<f4").tobytes() + indices)


@pytest.mark.parametrize("format", ["obj", "obj with slashes", "ply", "ply text", "glb"])
def test_a_face_of_many_corners_takes_memory_in_proportion_to_the_file(format):
    megabyte = 1 << 20
    corners = 60_000
    data = one_face(format, corners)
    decoded(one_face(format, 30))  # what is imported does not count
    with memory_below(30 * len(data) + 2 * megabyte):
        cells = decoded(data).cells
    place = np.arange(1, corners - 1)
    assert np.array_equal(cells, np.stack([0 * place, place % 3, (place + 1) % 3], axis=1))


def test_faces_of_many_sizes_are_cut_in_their_order():
    rng = np.random.default_rng(3)
    faces = [np.sort(rng.permutation(50)[: rng.integers(3, 7)]).tolist() for _ in range(300)]
    triangles = [[face[0], *pair] for face in faces for pair in itertools.pairwise(face[1:])]
    angles = np.arange(50) / 8  # of a circle, so that all faces are convex
    points = np.round(np.stack([9 * np.cos(angles), 9 * np.sin(angles), 0 * angles], axis=1), 3)
    rows = [f"{x} {y} {z}" for x, y, z in points.tolist()]
    lines = [f"v {row}" for row in rows]
    # Vertices, references backwards and groups between faces, which are read keyword by keyword.
    obj = "\n".join([*lines[:25], "g a", "f 1 2 3", *lines[25:], "g b"])
    obj += "".join(f"\nf {' '.join(str(c - 50 if k % 2 else c + 1) for k, c in enumerate(face))}" for face in faces)
    read = decoded(obj)
    assert np.array_equal(read.vertices, points)
    assert read.cells.tolist() == [[0, 1, 2], *triangles]
    assert read.groups == (("a", 0, 1), ("b", 1, 1 + len(triangles)))
    header = ("element vertex 50", *(line.replace("float", "double") for line in XYZ[1:]), "element face 300", FACE[1])
    text = "\n".join([*rows, *(" ".join(map(str, [len(face), *face])) for face in faces), ""])
    files = [ply(text, *header)]
    for order, name in (("<", "little"), (">", "big")):
        body = b"".join(struct.pack(f"{order}B{len(face)}i", len(face), *face) for face in faces)
        files.append(ply(points.astype(f"{order}f8").tobytes() + body, *header, format=f"binary_{name}_endian"))
    for data in files:
        assert np.array_equal(decoded(data).vertices, points)
        assert decoded(data).cells.tolist() == triangles


def test_vertices_with_lists_of_several_lengths():
    lines = [XYZ[0], "property uchar a", "property list uchar short more", *XYZ[1:]]
    body = b"".join(bytes([7, k]) + bytes(2 * k) + point.astype("<f4").tobytes() for k, point in enumerate(TRIANGLE))
    body += bytes([3, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0])
    assert is_triangle(ply(body, *lines, *FACE, format="binary_little_endian"))


def test_a_small_file_cannot_stand_for_a_mesh_that_fills_the_memory():
    count = 15_000
    parts = primitive(4, count)["meshes"][0]["primitives"] * 3_000
    data = glb(primitive(4, count) | {"meshes": [{"primitives": parts}]}, bytes(12 * count))
    assert "has more than 20360000 vertices and corners" in refusal(data)


def test_a_mesh_in_many_places_is_read():
    tree, body = glb_chunks(encoded(surface(16), "glb"))
    del tree["scenes"]
    tree["nodes"] = [{"mesh": 0, "translation": [k, 0, 0]} for k in range(1000)]
    assert len(decoded(glb(tree, body)).cells) == 1000 * 512


@pytest.mark.parametrize("kind", ["junk", "folder", "missing"])
def test_what_is_not_a_mesh(kind, tmp_path):
    path = tmp_path / "x.obj"
    if kind == "junk":
        path.write_bytes(b"\x89PNG\r\n\x1a\n")
    elif kind == "folder":
        path.mkdir()
    with pytest.raises(GtbError, match=r"x\.obj: "):
        read_mesh(path)


@given(st.sampled_from(seeds("mesh")), st.integers(0, 10**9))
def test_any_damage_is_a_mesh_or_a_refusal(data, seed):
    assert judge("mesh", mutated(random.Random(seed), data)) is None
