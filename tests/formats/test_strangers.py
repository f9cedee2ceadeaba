"""What files of other programs hold, beside what ours do: each change is seen, and renumbering is none."""

import copy
import io
import json
import tracemalloc
import zipfile
from collections.abc import Iterator
from functools import reduce
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from gtb_cli import GtbError
from gtb_cli.formats import glb as glb_room, glb_tree
from gtb_cli.formats.file_arrays import mark_of
from gtb_cli.formats.meshfiles import decode_mesh
from gtb_cli.meshes.difference import difference
from gtb_cli.meshes.mesh import KnownMesh
from tests.formats.test_meshfiles import glb
from tests.formats.test_threemf import TRIANGLE, archive
from tests.marks import mostly_long

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
    """The file with other values at paths such as `nodes.0.name`."""
    tree = copy.deepcopy(TREE)
    for path, value in changes.items():
        *parents, last = [int(key) if key.isdigit() else key for key in path.replace("HELD", HELD).split(".")]
        reduce(lambda inner, key: inner[key], parents, tree)[last] = copy.deepcopy(value)
    return decode_mesh(glb(tree, BINARY), "a")


def changed(path: Path) -> Iterator[tuple[str, str, str, str]]:
    """Yield the kind, both texts and the beginning of what is said, of each change in a table."""
    for section in path.read_text(encoding="utf-8").split("\n=== ")[1:]:
        head, *changes = section.rstrip().split("\n---")
        kind, _, text = head.partition("\n")
        for change in changes:
            edit, _, said = change.partition("\n")
            old, new = (part.strip(" ").replace("\\n", "\n").replace("\\t", "\t") for part in edit.split("->"))
            if kind == "glb":
                yield kind, f"{text}{old}", f"{text}{new}", said
            else:
                assert old in f"{text}\n", change
                yield kind, f"{text}\n", f"{text}\n".replace(old, new), said


def decoded(kind: str, text: str) -> KnownMesh:
    if kind == "glb":
        return edited(**json.loads(f"{{{text.rstrip(',')}}}"))
    if kind == "3mf":
        *objects, build = text.rstrip().split("\n")
        return decode_mesh(archive("".join(objects), build), "a")
    return decode_mesh(text.replace("LONG", "70" + 69 * " 3").encode(), "a")


@pytest.mark.parametrize(("kind", "one", "other", "said"), [*changed(Path(__file__).parent / "strangers.txt")])
def test_what_is_said_of_files_of_others(kind, one, other, said):
    faults = difference(decoded(kind, one), decoded(kind, other)).faults
    assert [each.startswith(said) for each in faults] == [True] * bool(said), faults


@pytest.mark.parametrize("share", mostly_long([0.1, 1]))
def test_attributes_of_glb_count_in_each_node(share, monkeypatch):
    monkeypatch.setattr(glb_room, "FREE", int(share**2 * glb_room.FREE))
    tree = copy.deepcopy(TREE)
    tree["meshes"][0]["primitives"][0]["attributes"] |= {f"_{k}": 2 for k in range(int(share * 2000))}
    tree["nodes"] += [{"mesh": 0} for _ in range(int(share * 2000))]
    with pytest.raises(GtbError, match="has more than 2"):
        decode_mesh(glb(tree, BINARY), "a")


def test_few_bytes_of_glb_or_3mf_cannot_stand_for_many():
    many = {f"HELD._{k}": 2 for k in range(9)} | {"accessors.2.count": 10**9}
    with pytest.raises(GtbError, match="1000000000 rows for 3 vertices"):
        edited(**many).values()
    tree = copy.deepcopy(TREE)
    tree["nodes"] += [{"mesh": 0, "name": f"{k}\ud800"} for k in range(1000)]  # not many for what they are
    assert len(decode_mesh(glb(tree, BINARY), "a").values()) == 3
    tree["animations"] = [{"samplers": [{"input": 2}] * 1000}]
    decode_mesh(glb(tree, BINARY), "a").values()
    with pytest.raises(GtbError, match="has rows of numbers that overlap"):
        edited(**{"bufferViews.0.byteStride": 4})
    with pytest.raises(GtbError, match="expected 4 numbers, got 3"):
        edited(**{"materials.0": {"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0]}}})
    with pytest.raises(GtbError, match="has 21000 nodes, more than 20"):
        edited(nodes=[{}] * 21_000)
    points = {"primitives": [{"mode": 0}] * 2000}
    with pytest.raises(GtbError, match="corners of cells in all nodes"):
        edited(meshes=[points, *TREE["meshes"]], nodes=[{"mesh": 0}] * 1000 + [{"mesh": 1}])
    cells = "".join(f'<triangle v1="0" v2="1" v3="2" p1="{k % 2}"/>' for k in range(3000))
    mesh = TRIANGLE[: TRIANGLE.index("<triangle ")] + f"{cells}</triangles></mesh>"
    objects = f'<basematerials id="2"><base name="a"/><base name="b"/></basematerials><object id="1" pid="2">{mesh}'
    with pytest.raises(GtbError, match="numbers, or changes of material, in all objects"):
        decode_mesh(archive(f"{objects}</object>", '<item objectid="1"/>' * 80), "a")


def test_what_a_mesh_of_glb_says_is_told_once_however_many_nodes_share_it(monkeypatch):
    monkeypatch.setattr(glb_tree, "mark_of", lambda *told: taken.append(sum(map(len, told))) or mark_of(*told))
    mesh, taken = TREE["meshes"][0] | {"extras": "y" * 1000, "weights": [0.5] * 100}, list[int]()
    mesh["primitives"] = mesh["primitives"] + [{"mode": 0}] * 100
    assert edited(meshes=[mesh], nodes=[{"mesh": 0}] * 100).values()
    assert sum(taken) < 100_000


def test_names_of_attributes_may_differ_in_case_only():
    names = [f"_{''.join(letters)}" for letters in product(*zip("abcdefghij", "ABCDEFGHIJ", strict=True))]
    assert len(edited(**{f"HELD.{name}": 2 for name in names}).values()) == 2 + len(names)


@pytest.mark.parametrize(
    "name", ["3D/Textures/a.png", "Metadata/model_settings.config", "further.model", "Maps/a b.png", "maps/A%20b.png"]
)
@pytest.mark.parametrize("unseen", ["", "3D/_rels/3dmodel.model.rels", "Metadata/plate_1.png"])
def test_further_files_in_a_3mf_archive(name, unseen):
    found = []
    for content in (b"a", b"b"):
        file = io.BytesIO(archive(f'<texture2d path="/Maps/a%20b.png"/><object id="1">{TRIANGLE}</object>'))
        with zipfile.ZipFile(file, "a") as written:
            written.writestr(unseen or name, content)
        found.append(decode_mesh(file.getvalue(), "a"))
    what = "extensions" if name.lower().startswith("maps") else "further parts"
    assert difference(*found).values == (not unseen) * (f"other data: {what}: not the same",)


def test_a_point_that_obj_names_often_is_written_once():
    text = b"v .1 .2 .3\nv 1 0 0\nv 0 1 0\nf 1 2 3\np" + 20_000 * b" 1" + b"\n"
    tracemalloc.start()
    decode_mesh(text, "a")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 150 * 20_000
