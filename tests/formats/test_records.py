"""What PLY, STL and GLB files hold, as trimesh's exporters or the room `formats` write them."""

import json
from dataclasses import replace

import numpy as np
import plyfile
import pytest
import stl
import trimesh
from trimesh.exchange.gltf import export_glb
from trimesh.exchange.ply import export_ply
from trimesh.exchange.stl import export_stl
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from gtb_cli.errors import ExportError
from gtb_cli.formats.export import encode_mesh, write_mesh
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.vocabulary import PATCH_COLOURS
from tests.tiny_meshes import curve, encoded, model, surface, two_curves

UNIT = 1e-7  # error of a unit vector in 32 bits


@pytest.mark.parametrize("ascii", [False, True])
def test_ply_holds_normals_uv_and_attributes(ascii, tmp_path):
    mesh = replace(surface(), attributes={"chord error": np.linspace(0, 1, 25)})
    write_mesh(mesh, tmp_path / "mesh.ply", ascii=ascii, normals=True, uv=True)
    data = plyfile.PlyData.read(tmp_path / "mesh.ply")
    vertex = data["vertex"]
    assert [p.name for p in vertex.properties] == ["x", "y", "z", "nx", "ny", "nz", "s", "t", "chord_error"]
    expected = np.column_stack([mesh.vertices, mesh.normals, mesh.parameters, mesh.attributes["chord error"]])
    found = np.column_stack([vertex[p.name] for p in vertex.properties])
    if ascii:
        np.testing.assert_array_equal(found, expected)  # doubles, to the last bit
    else:
        np.testing.assert_array_equal(found, expected.astype(np.float32))
    assert np.vstack(data["face"]["vertex_indices"]).tolist() == mesh.cells.tolist()


def test_ply_of_a_curve_is_what_trimesh_writes():
    theirs = export_ply(curve().to_trimesh(), encoding="binary").splitlines(keepends=True)
    assert encoded(curve(), "ply") == b"".join(line for line in theirs if not line.startswith(b"comment"))


@pytest.mark.parametrize("name", ["x", "nx", "s"])
def test_ply_refuses_an_attribute_named_like_a_property(name):
    with pytest.raises(ExportError, match=f"attributes: PLY has a property '{name}' already"):
        encode_mesh(replace(surface(), attributes={name: np.zeros(25)}), "ply")


@pytest.mark.parametrize("scale", [1.0, 1e-9, 1e9])
@pytest.mark.parametrize("ascii", [False, True])
def test_stl_normals_are_those_of_the_triangles_at_any_size(ascii, scale, tmp_path):
    mesh = replace(surface(), vertices=surface().vertices * scale)
    write_mesh(mesh, tmp_path / "mesh.stl", ascii=ascii)
    corners = surface().vertices[mesh.cells]
    expected = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    expected /= np.linalg.norm(expected, axis=1)[:, None]
    np.testing.assert_allclose(
        stl.Mesh.from_file(str(tmp_path / "mesh.stl"), calculate_normals=False).normals, expected, atol=UNIT
    )


def test_stl_as_text_has_a_name_and_no_blank_lines():
    text = encoded(replace(surface(), name="bent é\nsquare"), "stl", ascii=True).decode("ascii")
    assert text.startswith("solid bent_?_square\nfacet normal ")
    assert text.endswith("endfacet\nendsolid bent_?_square\n")
    assert all(text.split("\n")[:-1])


def tree_of(glb: bytes) -> dict:
    size = int.from_bytes(glb[12:16], "little")
    assert int.from_bytes(glb[8:12], "little") == len(glb)
    return json.loads(glb[20 : 20 + size])


def twins() -> Mesh:
    """Two bent squares that are the same but for their place, whose faces and normals a file holds once."""
    return model(3, 3)


@pytest.mark.parametrize("options", [{}, {"normals": True}, {"normals": True, "uv": True}], ids="-".join)
@pytest.mark.parametrize("make", [surface, model, twins])
def test_binary_files_are_what_trimesh_writes(make, options):
    mesh = make()
    bare = trimesh.Trimesh(mesh.vertices, mesh.cells, vertex_normals=mesh.normals, process=False)
    assert encoded(mesh, "stl", **options) == export_stl(bare)
    if "uv" in options:
        bare.vertex_attributes |= zip("st", mesh.parameters.astype("<f4").T, strict=True)  # doubles as a `visual`
    assert encoded(mesh, "ply", **options) == export_ply(bare, vertex_normal="normals" in options)
    scene = trimesh.Scene(base_frame="world")
    material = PBRMaterial(metallicFactor=0.0, roughnessFactor=1.0, doubleSided=True)
    for name, start, stop in mesh.groups or [("bent square", 0, len(mesh.cells))]:
        used, places = np.unique(mesh.cells[start:stop], return_inverse=True)
        part = trimesh.Trimesh(
            mesh.with_y_up.vertices[used],
            places.reshape(-1, 3),
            vertex_normals=mesh.with_y_up.normals[used],
            visual=TextureVisuals(uv=mesh.parameters[used] if "uv" in options else None, material=material),
            process=False,
        )
        plain = name.replace(" ", "_")
        scene.add_geometry(part, node_name=plain, geom_name=plain)
    expected = export_glb(scene, include_normals="normals" in options)
    found = encoded(mesh, "glb", **{"normals": False} | options)
    tree, wanted = tree_of(found), tree_of(expected)
    assert wanted["asset"].pop("generator")
    for view in tree["bufferViews"]:
        del view["target"]
    for each, unsaid in (("accessors", "byteOffset"), ("meshes", "extras")):  # 0, and nothing
        wanted[each] = [{key: value for key, value in entry.items() if key != unsaid} for entry in wanted[each]]
    length = tree["buffers"][0]["byteLength"]
    if mesh.groups:  # what is ours: a node above the parts, which have colours
        assert tree["nodes"].pop() == {"name": mesh.name, "children": wanted["scenes"][0].pop("nodes")}
        assert tree["scenes"][0].pop("nodes") == [len(mesh.groups)]
        assert len(tree.pop("materials")) == len(mesh.groups)
        assert wanted.pop("materials")
        primitives = [part["primitives"][0] for part in tree["meshes"]]
        assert [part.pop("material") for part in primitives] == [*range(len(mesh.groups))]
        assert {part["primitives"][0].pop("material") for part in wanted["meshes"]} == {0}
    assert tree == wanted
    assert found[-length:] == expected[-length:]


def test_glb_of_a_group_called_like_the_root_of_a_scene():
    tree = tree_of(encoded(replace(model(), groups=(("world", 0, 18), ("world_", 18, 68))), "glb"))
    nodes = [{"name": "world", "mesh": 0}, {"name": "world_", "mesh": 1}, {"name": "two", "children": [0, 1]}]
    assert tree["nodes"] == nodes


def test_glb_is_smooth_where_the_mesh_has_normals_and_its_parts_have_the_colours_of_3mf():
    tree = tree_of(encoded(model(), "glb"))
    assert all("NORMAL" in part["primitives"][0]["attributes"] for part in tree["meshes"])
    assert [material["name"] for material in tree["materials"]] == ["left_half", "right"]
    shown = [material["pbrMetallicRoughness"]["baseColorFactor"][:3] for material in tree["materials"]]
    srgb = [[round(255 * (1.055 * x ** (1 / 2.4) - 0.055)) for x in colour] for colour in shown]  # IEC 61966-2-1
    assert ["#" + "".join(f"{part:02X}" for part in colour) for colour in srgb] == [*PATCH_COLOURS[: len(shown)]]
    assert b"NORMAL" not in encoded(model(), "glb", normals=False)
    assert b"NORMAL" not in encoded(replace(model(), normals=None), "glb")


@pytest.mark.parametrize(
    "data", [encoded(make(), "glb", normals=True, uv=True) for make in (surface, model, two_curves)]
)
def test_glb_says_which_views_hold_vertices_and_which_indices(data):
    """The Khronos validator asks for it (BUFFER_VIEW_TARGET_MISSING)."""
    tree = tree_of(data)
    targets = {}
    for primitive in (primitive for part in tree["meshes"] for primitive in part["primitives"]):
        numbers = primitive["attributes"].values()
        targets |= {tree["accessors"][number]["bufferView"]: 34962 for number in numbers}
        targets[tree["accessors"][primitive["indices"]]["bufferView"]] = 34963
    said = [view.get("target") for view in tree["bufferViews"]]
    assert said == [targets.get(number) for number in range(len(said))]


def test_glb_uv_of_a_curve_run_upwards_from_0():
    glb = encoded(curve(4), "glb", uv=True)
    tree = tree_of(glb)
    accessor = tree["accessors"][tree["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"]]
    view = tree["bufferViews"][accessor["bufferView"]]
    body = glb[len(glb) - tree["buffers"][0]["byteLength"] :]
    uv = np.frombuffer(body, "<f4", 10, view["byteOffset"]).reshape(5, 2)
    assert uv.tolist() == [[t, 1.0] for t in (0.0, 0.25, 0.5, 0.75, 1.0)]  # glTF counts v from the top


def test_glb_lines_are_indexed_within_their_part():
    tree = tree_of(encoded(two_curves(), "glb"))
    assert [node["name"] for node in tree["nodes"][:2]] == [part["name"] for part in tree["meshes"]] == ["a", "b"]
    for part, count in zip(tree["meshes"], (4, 7), strict=True):
        primitive = part["primitives"][0]
        assert primitive["mode"] == 1
        assert tree["accessors"][primitive["attributes"]["POSITION"]]["count"] == count + 1
        assert tree["accessors"][primitive["indices"]]["count"] == 2 * count
