"""What GLB and 3MF files of other programs hold, beside what ours do: each change is seen, and renumbering is none."""

import copy
import io
import zipfile
from functools import reduce

import numpy as np
import pytest

from gtb_cli import GtbError
from gtb_cli.formats.meshfiles import decode_mesh
from gtb_cli.meshes.difference import difference
from tests.formats.test_meshfiles import glb
from tests.formats.test_threemf import TRIANGLE, archive

POINTS, BYTES = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype="<f4"), bytes([255, 0, 0, 255] * 3)
MATERIAL = {"name": "red", "pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}}
TREE = {
    "asset": {"version": "2.0"},
    "nodes": [{"mesh": 0}, {"name": "empty"}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
    "materials": [MATERIAL | {"emissiveTexture": {"index": 0}}],
    "textures": [{"source": 0}],
    "images": [{"bufferView": 0, "mimeType": "image/png"}, {"bufferView": 1, "mimeType": "image/jpeg"}],
    "accessors": [
        {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
        {"bufferView": 1, "componentType": 5121, "count": 3, "type": "VEC4"},
        {"bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC4"},
    ],
    "bufferViews": [{"byteLength": 36}, {"byteOffset": 36, "byteLength": 12}, {"byteOffset": 48, "byteLength": 48}],
    "buffers": [{"byteLength": 96}],
}
BINARY = POINTS.tobytes() + BYTES + (np.frombuffer(BYTES, np.uint8) / 255).astype("<f4").tobytes()
HELD = "meshes.0.primitives.0.attributes"


def edited(**changes):
    """The file with other values at paths such as ``nodes__0__name``."""
    tree = copy.deepcopy(TREE)
    for path, value in changes.items():
        *parents, last = [int(key) if key.isdigit() else key for key in path.replace("HELD", HELD).split(".")]
        reduce(lambda inner, key: inner[key], parents, tree)[last] = copy.deepcopy(value)
    return decode_mesh(glb(tree, BINARY), "a")


LOOK = "materials in GLB: 1 cell has another one"
WEBP = {"textures.0": {"extensions": {"EXT_texture_webp": {"source": 1}}}}
VARIANT = {"meshes.0.primitives.0.extensions": {"KHR_materials_variants": {"mappings": [{"material": 1}]}}}
BASIS = {"accessors.1.bufferView": 2}
SCENE = {"scenes": [{"nodes": [0, 1]}]}
SCENES = {"scenes": [{"nodes": [0]}, {"nodes": [1]}], "nodes": [{"mesh": 0}, {"mesh": 1}]}
SCENES |= {"meshes": [*TREE["meshes"], {"primitives": [{"attributes": {"POSITION": 2}}]}]}
INDEXED = SCENES | {"meshes.1.primitives.0.indices": 1}
NODES = [{"name": "a", "mesh": 0}, {"name": "b"}, {"name": "c", "children": [0]}]
TREES, TURNED = {"nodes": NODES}, [NODES[2] | {"children": [2]}, *NODES[1::-1]]
JOINTS = {"skins": [{"joints": [1], "inverseBindMatrices": 1}]}
VIEW = {"bufferView": 0}


def image_in(view):
    return {"images.0.bufferView": 3, "bufferViews": [*TREE["bufferViews"], view]}


SPARSE = {"count": 1, "indices": VIEW | {"componentType": 5121}, "values": {"bufferView": 2}}
OTHER = "other data: description: "


@pytest.mark.parametrize(
    ("one", "other", "said"),
    [
        ({"HELD.COLOR_0": 1, "accessors.1.normalized": True}, {"HELD.COLOR_0": 1}, "color_0: up to 254 apart"),
        ({"HELD.COLOR_0": 1, "accessors.1.normalized": True}, {"HELD.COLOR_0": 2}, ""),
        ({"HELD._NORMALS": 1}, {"HELD._NORMALS": 2}, "attribute normals: up to 254 apart"),
        ({"HELD._A": 1, "HELD._a": 1}, {"HELD._A": 1, "HELD._a": 2}, "attribute a: up to 254 apart"),
        ({"materials.0.name": "a"}, {"materials.0.name": "b"}, ""),
        ({"images.0.name": "a"}, {"samplers": [{"wrapS": 1}], "materials.0.alphaMode": "OPAQUE"}, ""),
        (image_in({"byteLength": 4}), image_in({"byteOffset": 8, "byteLength": 4}), ""),
        ({}, {"images.0.bufferView": 1}, LOOK),
        ({}, {"textures.0.source": 1}, LOOK),
        ({"textures.0": {"extensions": {"EXT_texture_webp": {"source": 0}}}}, WEBP, LOOK),
        ({}, {"materials.0.doubleSided": True}, LOOK),
        ({}, {"materials.0.extensions": {"KHR_materials_unlit": {}}}, LOOK),
        ({"materials.0.extensions": {"a": {}}}, {"materials.0.extensions": {"a": {"texCoord": 0}}}, LOOK),
        ({}, {"materials.0.extras": {"source": "a", "index": 9}}, LOOK),
        (VARIANT | {"materials": [MATERIAL, MATERIAL]}, VARIANT | {"materials": [MATERIAL, {}]}, OTHER),
        (VARIANT | {"materials": [MATERIAL, {}]}, VARIANT | {"materials": [MATERIAL, {"alphaMode": "OPAQUE"}]}, ""),
        ({}, {"nodes.1.translation": [1, 0, 0]}, OTHER),
        ({"scenes": [{"nodes": [0, 1]}]}, {"scenes": [{"nodes": [1, 0]}], "asset.generator": "a"}, ""),
        ({}, {"extras": {"a": 1}}, OTHER),
        (SCENE, {"scenes": [{"nodes": [0, 1], "extras": {"a": 1}}]}, OTHER),
        (SCENES | {"meshes.1.primitives.0.attributes.POSITION": 1}, SCENES, OTHER),
        (INDEXED, INDEXED | {"accessors.1.byteOffset": 4, "accessors.1.count": 2}, OTHER),
        (TREES | {"nodes.1.children": [0], "nodes.2.children": []}, TREES, OTHER),
        (TREES | {"skins": [{"joints": [2]}]}, TREES | {"nodes": TURNED, "skins": [{"joints": [0]}]}, ""),
        (JOINTS | {"accessors.1.normalized": True}, JOINTS, OTHER),
        (JOINTS | {"accessors.1.sparse": SPARSE}, JOINTS | {"accessors.1.sparse": SPARSE, **BASIS}, OTHER),
        ({"materials.0.alphaCutoff": 1}, {"materials.0.alphaCutoff": 1.0, "materials.0.extensions": {}}, ""),
        ({}, {"nodes.0.extras": {"a": 1}}, OTHER),
        ({"nodes.1.extras": {"a": 1}}, {"nodes.0.extras": {"a": 1}}, OTHER),
        ({"cameras": [{"input": "text"}]}, {"cameras": [{"input": "other"}]}, OTHER),
        (
            {"meshes.0.primitives.0.targets": [{"POSITION": 1}], "accessors.1.sparse": SPARSE},
            {"meshes.0.primitives.0.targets": [{"POSITION": 1}], "accessors.1.sparse": SPARSE | {"values": VIEW}},
            OTHER,
        ),
        ({"nodes.0.weights": [0]}, {"nodes.0.weights": [1]}, OTHER),
        ({}, {"meshes.0.primitives.0.targets": [{"POSITION": 0}]}, OTHER),
        ({"skins": [{"joints": [1]}]}, {"skins": [{"joints": [1]}], "nodes.1.translation": [3, 0, 0]}, OTHER),
        ({"animations": [{"samplers": [{"input": 1}]}]}, {"animations": [{"samplers": [{"input": 2}]}]}, OTHER),
        ({"nodes.1.name": "arm"}, {"nodes.1.name": "leg"}, OTHER),
        ({"nodes.1": {"children": [0]}}, {"nodes.1": {"name": "leg", "children": [0]}}, ""),  # of all there is
    ],
)
def test_what_a_glb_file_says(one, other, said):
    values = difference(edited(**one), edited(**other)).values
    assert [each.startswith(said) for each in values] == [True] * bool(said), values


def test_few_bytes_of_glb_cannot_stand_for_many():
    many = {f"HELD._{k}": 2 for k in range(9)} | {"accessors.2.count": 10**9}
    with pytest.raises(GtbError, match="1000000000 rows for 3 vertices"):
        edited(**many).values()
    tree = copy.deepcopy(TREE)
    tree["meshes"][0]["primitives"][0]["attributes"] |= {f"_{k}": 2 for k in range(20_000)}
    tree["nodes"] += [{"mesh": 0} for _ in range(200)]
    with pytest.raises(GtbError, match="has more than 2"):
        decode_mesh(glb(tree, BINARY), "a")
    tree = copy.deepcopy(TREE)
    tree["nodes"] += [{"mesh": 0, "name": f"{k}\ud800"} for k in range(5000)]  # not many for what they are
    assert len(decode_mesh(glb(tree, BINARY), "a").values()) == 3
    tree["animations"] = [{"samplers": [{"input": 2}] * 1000}]
    decode_mesh(glb(tree, BINARY), "a").values()
    with pytest.raises(GtbError, match="has rows of numbers that overlap"):
        edited(**{"bufferViews.0.byteStride": 4})
    with pytest.raises(GtbError, match="expected 4 numbers, got 3"):
        edited(**{"materials.0": {"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0]}}})


COLOURS = '<colorgroup id="9"><color color="#FF0000"/><color color="#0000FF"/></colorgroup>'
THING = f'{COLOURS}<object id="1" pid="9" pindex="0">{TRIANGLE}</object>'


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("#FF0000", "#FF0001", "materials in 3MF: 1 cell has another one"),
        ('pindex="0"', 'pindex="1"', "materials in 3MF: 1 cell has another one"),
        ("<triangle ", '<triangle p2="1" p1="0" ', "materials in 3MF: 1 cell has another one"),
        ("<triangle ", '<triangle paint_color="4" ', "materials in 3MF: 1 cell has another one"),
        ('pid="9"', 'pid="8"', "materials in 3MF: 1 cell has another one"),
        ("</triangles>", '</triangles><beamlattice minlength="1"/>', "other data: extensions: only in the second"),
        (
            '<item objectid="1"/>',
            '<item objectid="1" printable="0"/>',
            "objects that are not printed, or support: only",
        ),
        ('id="1"', 'id="7"', ""),
        ('id="9"', 'id="8"', ""),
        ("<triangle ", '<triangle p2="0" p3="0" p1="0" ', ""),
    ],
)
def test_what_a_3mf_file_says(old, new, said):
    assert_said(THING, '<item objectid="1"/>', old, new, said)


def assert_said(objects, build, old, new, said):
    one, other = (
        decode_mesh(archive(one, other), "a")
        for one, other in ((objects, build), (objects.replace(old, new), build.replace(old, new)))
    )
    values = difference(one, other).values
    assert [each.startswith(said) for each in values] == [True] * bool(said), values


FURTHER = '<t id="4"/><t id="5"/><g id="6" texid="4"/><s:stack xmlns:s="s"><s:vertex x="0"/></s:stack>'
BASE = '<basematerials id="9"><base name="PLA"/></basematerials>'
PAINTED = TRIANGLE.replace("<triangle ", '<triangle s:paint="C" ')
PARTS = [
    f'<object id="{k}" name="{name}" pid="9" pindex="0">{PAINTED}</object>' for k, name in enumerate(("rim", "hub"))
]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"PLA"', '"ABS"', "other data: material: not the same"),
        (' s:paint="C"', ' q:paint="C"', ""),
        ('s:paint="C"', 's:paint="8"', "materials in 3MF: 2 cells have another one"),
        ('"rim"', '"tyre"', "objects: 1 cell has another one"),
        ('name="hub"', 'name="hub" partnumber="7"', "other data: extensions: not the same"),
        ('name="hub"', 'name="hub" q:UUID="7" xmlns:q="q"', ""),
        ('vertex x="0"/', 'vertex x="1"/', "other data: extensions: not the same"),
        ('texid="4"', 'texid="5"', "other data: extensions: not the same"),
        ('"4"', '"8"', ""),
        ('"both"', '"wheel"', "other data: extensions: not the same"),
    ],
)
def test_what_parts_of_a_3mf_file_say(old, new, said):
    moved = '<item objectid="1" transform="1 0 0 0 1 0 0 0 1 4 0 0"/>'
    both = '<object id="7" name="both"><components><component objectid="0"/></components></object>'
    items = f'<item objectid="7"/>{moved}'
    assert_said(FURTHER + BASE + "".join(PARTS) + both, items, old, new, said)


@pytest.mark.parametrize(
    ("name", "is_seen"),
    [
        ("3D/Textures/a.png", True),
        ("Metadata/model_settings.config", True),
        ("Metadata/plate_1.png", False),
        ("3D/_rels/3dmodel.model.rels", False),
    ],
)
def test_further_files_in_a_3mf_archive(name, is_seen):
    found = []
    for content in (b"a", b"b"):
        file = io.BytesIO(archive(THING))
        with zipfile.ZipFile(file, "a") as written:
            written.writestr(name, content)
        found.append(decode_mesh(file.getvalue(), "a"))
    assert difference(*found).values == is_seen * ("other data: further parts: not the same",)


CORNERS = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n"
LINES, PLAIN, NORMAL = "vt 0 0\nvt 1 1\nl 1/1 2/2\n", "f 1 2 3\nf 2 4 3\n", "\tvn 0 0 1\n f 1//1 2//1 3//1\n"


@pytest.mark.parametrize(
    ("one", "other", "said"),
    [
        (LINES, LINES.replace("1 1", "1 0.5"), "texture coordinates: up to 0.5 apart"),
        (NORMAL, NORMAL.replace("\tvn", "vn"), ""),
        (NORMAL, NORMAL.replace("0 0 1", "0 1 0"), "normals: up to 90 degrees"),
        (f"s 1\n{PLAIN}", f"s 1\n{PLAIN}".replace("\nf 2", "\ns 2\nf 2"), "smoothing groups: 1 cell has another one"),
        (f"{PLAIN}o a\ng b\nf 1 2 4\n", f"{PLAIN}o c\ng b\nf 1 2 4\n", "objects: 1 cell has another one"),
        (f"s off\n{PLAIN}", f"{PLAIN}s 1\n", ""),
    ],
)
def test_what_an_obj_file_says(one, other, said):
    values = difference(*(decode_mesh(f"{CORNERS}{text}".encode(), "a") for text in (one, other))).values
    assert [each.startswith(said) for each in values] == [True] * bool(said), values


TABLE = """ply
format ascii 1.0
element vertex 4
property int x
property int y
property int z
property float h
property list uchar int bones
element face 2
property list uchar int vertex_indices
property list uchar float tags
element camera 1
property int view
end_header
0 0 0 1e30 1 2000001
1 0 0 -9999 2 7 8
0 1 0 1 1 9
1 1 0 2 0
3 0 1 2 LONG
3 1 3 2 1 5
6
"""
FIRST, SECOND = "3 0 1 2 LONG\n", "3 1 3 2 1 5\n"


@pytest.mark.parametrize(
    ("first", "last", "said"), [(5, 5, ""), (5, 6, "tags of faces (long lists): 1 cell has another")]
)
def test_long_lists_beside_short_ones_count_in_any_order(first, last, said):
    ends = [f"3 0 1 2 70{69 * ' 5'} {number}\n" for number in (first, last)]
    rest = "3 1 3 2 1 5\n3 0 3 1 0\n"
    head = TABLE.replace("face 2", "face 3").replace(FIRST + SECOND, "FACES")
    texts = head.replace("FACES", ends[0] + rest), head.replace("FACES", rest + ends[1])
    values = difference(*(decode_mesh(text.encode(), "a") for text in texts)).values
    assert [each.startswith(said) for each in values] == [True] * bool(said), values


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("2000001", "2000000", "bones of vertices: up to 1 apart (tolerance 0)"),
        ("1 9\n", "1 9.0\n", ""),
        ("1 9\n", "0\n", "bones of vertices: at 2 corners in one of them only"),
        ("0 1 0 1 1", "0 1 0 1.001 1", "h: up to 0.001 apart"),
        (FIRST + SECOND, SECOND + FIRST, ""),
        ("LONG", "70" + 70 * " 4", "tags of faces: "),
        ("\n6\n", "\n7\n", "other data: view of camera: not the same"),
        (f"{FIRST}{SECOND}6", "3 0 1 3 1 5\n3 0 3 2 LONG\n7", "other data: view of camera: not the same"),
    ],
)
def test_what_a_ply_file_says(old, new, said):
    one, other = (text.replace("LONG", "70" + 70 * " 3").encode() for text in (TABLE, TABLE.replace(old, new)))
    values = difference(decode_mesh(one, "a"), decode_mesh(other, "a")).values
    assert [each.startswith(said) for each in values] == [True] * bool(said), values
