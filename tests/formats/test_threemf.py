"""3MF: what the core specification asks of a file, what reads back, and what is refused."""

import io
import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest

from gtb_cli.errors import ExportError
from gtb_cli.formats.export import encode_mesh
from gtb_cli.formats.meshfiles import decode_mesh
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.solids.thickening import thicken
from tests.tiny_meshes import encoded, model, surface

CORE = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"
CORNERS = '<vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="1" z="0"/>'
TRIANGLE = f'<mesh><vertices>{CORNERS}</vertices><triangles><triangle v1="0" v2="1" v3="2"/></triangles></mesh>'


def tree_of(data: bytes) -> ElementTree.Element:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        assert archive.namelist() == ["[Content_Types].xml", "_rels/.rels", "3D/3dmodel.model"]
        assert {entry.date_time for entry in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        return ElementTree.fromstring(archive.read("3D/3dmodel.model"))


def archive(
    objects: str,
    build: str = '<item objectid="1"/>',
    name: str = "3D/3dmodel.model",
    prolog: str = "",
    method: int = zipfile.ZIP_STORED,
) -> bytes:
    """A file as other programs write it."""
    file = io.BytesIO()
    text = f'{prolog}<model xmlns="{CORE[1:-1]}"><resources>{objects}</resources><build>{build}</build></model>'
    with zipfile.ZipFile(file, "w", method) as written:
        written.writestr(name, text)
    return file.getvalue()


def test_a_solid_has_a_material_for_each_patch():
    solid = thicken(model(), 0.1)
    data = encoded(solid, "3mf")
    tree = tree_of(data)
    assert tree.get("unit") == "millimeter"
    assert [item.get("objectid") for item in tree.iter(f"{CORE}item")] == ["1"]
    (one,) = tree.iter(f"{CORE}object")
    assert (one.get("name"), one.get("type"), one.get("pid"), one.get("pindex")) == ("two", "model", "2", "0")
    assert [base.get("name") for base in tree.iter(f"{CORE}base")] == ["left_half", "right"]
    materials = [int(each.get("p1", 0)) for each in tree.iter(f"{CORE}triangle")]
    assert materials == [k for k, (_, start, stop) in enumerate(solid.groups) for _ in range(stop - start)]
    read = decode_mesh(data, "x")
    assert read.mesh.groups == (("left_half", *solid.groups[0][1:]), ("right", *solid.groups[1][1:]))
    assert np.abs(read.mesh.vertices - solid.vertices).max() < 2**-22
    np.testing.assert_array_equal(read.mesh.cells, solid.cells)
    assert not read.has_indices
    assert encoded(solid, "3mf") == data


def test_a_mesh_with_a_boundary_is_a_surface_and_collapsed_faces_are_left_out():
    flat = surface(2)
    corners = flat.vertices + 5
    corners[flat.cells[0, 1]] = corners[flat.cells[0, 0]] + 1e-12
    tree = tree_of(encoded(Mesh(corners, flat.cells), "3mf", unit="in"))
    (one,) = tree.iter(f"{CORE}object")
    assert (one.get("type"), one.get("pid"), tree.get("unit")) == ("surface", None, "inch")
    assert len([*tree.iter(f"{CORE}vertex")]) == len(corners) - 1
    places = [{each.get(f"v{k}") for k in (1, 2, 3)} for each in tree.iter(f"{CORE}triangle")]
    assert 0 < len(places) < len(flat.cells)
    assert all(len(place) == 3 for place in places)
    with pytest.raises(ExportError, match="is a single point"):
        encode_mesh(Mesh(1e-12 * flat.vertices + 1, flat.cells), "3mf")


def test_objects_are_placed_where_components_and_items_say():
    """A row (x y z 1) is multiplied from the left."""
    turned = "0 1 0 -1 0 0 0 0 1 10 0 0"  # x to y, y to −x, then 10 along x
    objects = (
        f'<object id="1" name="leaf">{TRIANGLE}</object><object id="5"><components>'
        f'<component objectid="1" transform="{turned}"/><component objectid="1"/></components></object>'
    )
    read = decode_mesh(
        archive(objects, '<item objectid="5" transform="1 0 0 0 1 0 0 0 1 2 0 0"/>', "a.MODEL"), "x"
    ).mesh
    expected = [[12, 0, 0], [12, 1, 0], [11, 0, 0], [2, 0, 0], [3, 0, 0], [2, 1, 0]]
    np.testing.assert_allclose(read.vertices, expected)
    assert read.groups == (("leaf", 0, 1), ("leaf", 1, 2))


def test_mirrored_objects_keep_their_outer_sides():
    mirrored = '<item objectid="1" transform="-1 0 0 0 1 0 0 0 1 0 0 0"/>'
    read = decode_mesh(archive(f'<object id="1">{TRIANGLE}</object>', mirrored), "x").mesh
    np.testing.assert_array_equal(read.vertices[read.cells[0]], [[0, 1, 0], [-1, 0, 0], [0, 0, 0]])


def test_a_unit_brings_glb_to_metres_and_reads_back_as_it_was():
    plain, scaled = (decode_mesh(encoded(model(), "glb", **unit), "x").mesh for unit in ({}, {"unit": "mm"}))
    np.testing.assert_allclose(scaled.vertices, plain.vertices, rtol=1e-15)
    trimesh = pytest.importorskip("trimesh")
    scene = trimesh.load(io.BytesIO(encoded(model(), "glb", unit="cm")), file_type="glb")
    np.testing.assert_allclose(
        np.ptp(scene.bounds, axis=0), 0.01 * np.ptp(model().bounds, axis=0)[[0, 2, 1]], rtol=1e-6
    )
    for kind, unit, message in [("obj", "mm", "OBJ has none"), ("glb", "km", ".*one of mm, cm, m, in, ft, got 'km'")]:
        with pytest.raises(ExportError, match=f"unit: {message}"):
            encode_mesh(model(), kind, unit=unit)
