"""The file formats: what each holds and refuses, and every file read back by other programs."""

import io
import os
import sys
from dataclasses import replace

import meshio
import numpy as np
import pytest

from gtb_cli.errors import ExportError
from gtb_cli.formats.export import encode_mesh, held_vertices, warnings_for, write_mesh
from gtb_cli.formats.meshfiles import read_mesh
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.vocabulary import FORMATS
from tests.marks import mostly_long
from tests.tiny_meshes import curve, encoded, model, surface


@pytest.mark.parametrize("format", FORMATS)
def test_no_picture_library_is_needed(format, monkeypatch):
    monkeypatch.setitem(sys.modules, "PIL", None)
    assert encoded(model(), format, normals=FORMATS[format].normals != "never", uv=True)


@pytest.mark.parametrize("format", FORMATS)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_no_number_that_is_not_finite_is_written(format, value, tmp_path):
    vertices = surface().vertices.copy()
    vertices[[7, 12], 1] = value
    with pytest.raises(ExportError, match=rf"vertex 7: coordinates: must be finite, got [\d.]+ {value}"):
        write_mesh(replace(surface(), vertices=vertices), tmp_path / f"mesh.{format}")
    assert not list(tmp_path.iterdir())
    for field, label in (("normals", "normal"), ("parameters", "uv")):
        values = getattr(surface(), field).copy()
        values[3, 0] = value
        mesh = replace(surface(), **{field: values})
        encoded(mesh, format, normals=False)
        if FORMATS[format].normals != "never":
            with pytest.raises(ExportError, match=f"vertex 3: {label}: must be finite"):
                encode_mesh(mesh, format, normals=True, uv=True)


@pytest.mark.parametrize("format", ["ply", "stl", "glb"])
def test_numbers_too_large_for_32_bits_are_refused_where_they_do_not_fit(format):
    mesh = replace(surface(), vertices=surface().vertices * 1e39)
    with pytest.raises(ExportError, match="too large for 32-bit numbers"):
        encode_mesh(mesh, format)
    assert warnings_for(mesh, format) == []
    if format != "glb":
        assert encoded(mesh, format, ascii=True)
    assert encoded(mesh, "obj")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"cells": np.array([[0, 1, 25]])}, "cells: expected indices from 0 to 24, got 25"),
        ({"cells": np.array([[0, 1, 2**32 + 1]])}, "cells: expected indices from 0 to 24, got 4294967297"),
        ({"cells": np.array([[0, 1, -1]])}, "cells: expected indices from 0 to 24, got -1"),
        ({"cells": np.zeros((0, 3), dtype=np.int64)}, "the mesh is empty: 25 vertices, 0 cells"),
        ({"groups": (("a", 0, 3),)}, "groups: they end at cell 3 of 32"),
        ({"groups": (("a", 0, 3), ("b", 4, 32))}, "groups: 'b' has cells 4 to 32, expected it to start at 3"),
    ],
)
@pytest.mark.parametrize("format", FORMATS)
def test_a_mesh_that_is_not_one_is_refused(change, message, format):
    with pytest.raises(ExportError, match=message):
        encode_mesh(replace(surface(), **change), format)


def test_normals_and_uv_must_be_there_to_be_written():
    bare = replace(surface(), normals=None, parameters=None)
    for format in ("obj", "ply", "glb"):
        with pytest.raises(ExportError, match="normals: the mesh has none"):
            encode_mesh(bare, format, normals=True)
        with pytest.raises(ExportError, match="uv: the mesh has no parameters"):
            encode_mesh(bare, format, uv=True)


def test_an_ordinary_mesh_has_no_warnings():
    for format in FORMATS:
        for mesh in (surface(), model()):
            assert warnings_for(mesh, format, normals=True) == []
    assert warnings_for(curve(), "obj") == []


def test_warned_where_32_bits_move_or_merge_vertices():
    # 32-bit numbers of this size are whole, and no coordinate is half a unit from 1e7.
    far = replace(surface(), vertices=surface().vertices * 0.2 + 1e7)
    for format in ("ply", "stl", "glb"):
        moved, merged = warnings_for(far, format)
        assert "32-bit numbers move vertices by up to 0.4" in moved
        assert "32-bit numbers merge the corners of 32 of 32 triangles" in merged
        assert ("`ascii`" in moved) == (format != "glb")
    (moved,) = warnings_for(replace(surface(), vertices=surface().vertices + 1e4), "stl")
    assert moved.startswith("STL: 32-bit numbers move vertices by up to 0.0004")
    for format in ("ply", "stl"):
        assert warnings_for(far, format, ascii=True) == []
    assert warnings_for(far, "obj") == []
    close = replace(curve(), vertices=np.concatenate([curve().vertices[:-1], curve().vertices[[-2]] * (1 + 1e-9)]))
    assert warnings_for(close, "glb") == [
        "GLB: 32-bit numbers merge the corners of 1 of 10 segments; OBJ keeps their digits"
    ]
    pole = replace(surface(), vertices=surface().vertices * [1.0, 0.0, 0.0])  # collapsed as it is: no loss
    assert warnings_for(pole, "ply") == []


@pytest.mark.parametrize("ascii", mostly_long([False, True]))
@pytest.mark.parametrize("format", FORMATS)
def test_the_vertices_that_a_format_holds_are_those_read_from_its_file(format, ascii, tmp_path):
    shown = ascii and FORMATS[format].text == "on request"
    for size in (1.0, 1e7, 1e-30):
        vertices = np.random.default_rng(1).uniform(-1, 1, (3 * 2800, 3)) * [1, 2, 3] * size + 5 * size
        mesh = Mesh(vertices, np.arange(len(vertices)).reshape(-1, 3))
        path = tmp_path / f"x.{format}"
        write_mesh(mesh, path, ascii=shown, up="z")
        held = held_vertices(mesh, format, shown)
        assert np.array_equal(read_mesh(path).vertices, held)
        assert np.array_equal(held, vertices) == shown


def test_warned_of_readers_that_refuse(tmp_path, capsys):
    assert warnings_for(curve(), "ply") == ["PLY: meshio and assimp read no file with edges, as a curve has"]
    write_mesh(curve(), tmp_path / "c.ply")
    with pytest.raises(SystemExit):  # so it does
        meshio.read(tmp_path / "c.ply")
    assert "element edge" in capsys.readouterr().out
    assert warnings_for(Mesh(np.eye(4, 3), np.array([[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]])), "stl") == []
    assert warnings_for(surface(1), "stl") == ["STL: admesh reads no file of fewer than 4 facets, and this has 2"]


def test_warned_of_what_is_left_out():
    assert warnings_for(surface(), "stl", uv=True) == ["STL: holds no texture coordinates, none are written"]
    assert warnings_for(curve(), "obj", normals=True) == ["OBJ: a curve has no normals, none are written"]
    small = replace(surface(), parameters=surface().parameters * 1e-9)
    assert len(warnings_for(small, "obj", uv=True)) == 1
    assert warnings_for(surface(), "obj", uv=True) == warnings_for(small, "ply", uv=True) == []


def test_the_suffix_decides_the_format(tmp_path):
    write_mesh(surface(), tmp_path / "mesh.PLY")
    assert (tmp_path / "mesh.PLY").read_bytes() == encoded(surface(), "ply")
    write_mesh(surface(), str(tmp_path / "mesh.txt"), "obj")
    assert (tmp_path / "mesh.txt").read_bytes() == encoded(surface(), "obj")
    with pytest.raises(ExportError, match=r"mesh\.txt: expected a name that ends in \.obj, \.ply, \.stl, \.glb"):
        write_mesh(surface(), tmp_path / "mesh.txt")
    with pytest.raises(ExportError, match="format: expected one of obj, ply, stl, glb, 3mf, got 'off'"):
        write_mesh(surface(), tmp_path / "mesh.off", "off")


def test_a_file_object_is_written_to(tmp_path):
    buffer = io.BytesIO()
    write_mesh(surface(), buffer, "glb")
    assert buffer.getvalue() == encoded(surface(), "glb")
    with pytest.raises(ExportError, match="cannot tell the format of a file without a name"):
        write_mesh(surface(), io.BytesIO())
    with pytest.raises(ExportError, match="expected a binary one"):
        write_mesh(surface(), io.StringIO(), "obj")
    with open(tmp_path / "mesh.stl", "wb") as file:
        write_mesh(surface(), file)
        assert (tmp_path / "mesh.stl").read_bytes() == encoded(surface(), "stl")  # flushed, so errors show


def test_a_full_disk_behind_a_file_object_is_an_export_error():
    with (
        open("/dev/full", "wb", buffering=0) as full,
        pytest.raises(ExportError, match="cannot write /dev/full: No space left on device"),
    ):
        write_mesh(surface(), full, "obj")


def test_a_closed_pipe_is_passed_on():
    reader, writer = os.pipe()
    os.close(reader)
    with open(writer, "wb", buffering=0) as pipe, pytest.raises(BrokenPipeError):
        write_mesh(surface(), pipe, "obj")


@pytest.mark.parametrize("scale", [1e-320, 1e-300, 1e-30, 1e30, 1e300])
def test_no_size_of_a_mesh_warns(scale):
    for mesh in (surface(), model(), curve()):
        scaled = replace(mesh, vertices=mesh.vertices * scale)
        assert encoded(scaled, "obj")
        assert encoded(scaled, "ply", ascii=True)
        warnings_for(scaled, "glb")
        if not mesh.is_curve:
            assert encoded(scaled, "stl", ascii=True)
        if scale < 1e38:
            assert encoded(scaled, "ply")
            assert encoded(scaled, "glb")
