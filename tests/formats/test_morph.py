"""Sequences in one GLB file: morph targets, and an animation; read here by the letter of glTF 2.0."""

import json
import struct
from functools import cache
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from trimesh.exchange.gltf import get_schema

import gtb_cli.shell.console as console_room
from gtb_cli.errors import ExportError
from gtb_cli.formats.morph import MAX_MESHES, animated_glb
from gtb_cli.meshes.mesh import Mesh
from tests.marks import long
from tests.shell import SPECS, gtb
from tests.tiny_meshes import curve, model, surface

SURFACE = str(SPECS / "example-4.4.toml")
MOVING = str(SPECS / "example-4.2.toml")
LINE = str(SPECS / "example-3.4.toml")

DEGENERATE = ["degenerate", SURFACE, "-x5", "-x100", "-x1e30", "-n3"]
DEGENERATE_LINE = ["degenerate", LINE, "-x1", "-x3", "-x1e300", "-n5"]
MERGE = ["knot-limit", MOVING, "--merge", "3:1", "--steps", "0,0.4,0.8", "-n3"]

STORED = 2**-24  # half a unit in the last place of a 32-bit number of size 1


pytestmark = pytest.mark.usefixtures("measured_roughly")


@cache
def gltf() -> jsonschema.protocols.Validator:
    """That of the letter of glTF 2.0, which takes longer to read than a file."""
    schema = get_schema()
    kind = jsonschema.validators.validator_for(schema)
    kind.check_schema(schema)
    return kind(schema)


class Animation:
    """A GLB file of one mesh with morph targets, taken to pieces."""

    def __init__(self, data: bytes) -> None:
        magic, version, length, text_length, kind = struct.unpack("<4sIII4s", data[:20])
        assert (magic, version, length, kind) == (b"glTF", 2, len(data), b"JSON")
        assert length % 4 == text_length % 4 == 0
        self.tree = json.loads(data[20 : 20 + text_length])
        gltf().validate(self.tree)
        body_length, kind = struct.unpack("<I4s", data[20 + text_length : 28 + text_length])
        assert kind == b"BIN\0"
        self.body = data[28 + text_length :]
        assert self.tree["buffers"] == [{"byteLength": body_length}]
        assert body_length == len(self.body)
        (self.mesh,) = self.tree["meshes"]
        (self.primitive,) = self.mesh["primitives"]
        self.targets = self.primitive.get("targets", [])

    def array(self, number: int) -> np.ndarray:
        accessor = self.tree["accessors"][number]
        view = self.tree["bufferViews"][accessor["bufferView"]]
        assert view["byteOffset"] % 4 == 0
        assert view["byteOffset"] + view["byteLength"] <= len(self.body)
        kind = {5126: "<f4", 5125: "<u4"}[accessor["componentType"]]
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[accessor["type"]]
        values = np.frombuffer(self.body[view["byteOffset"] :][: view["byteLength"]], kind).reshape(-1, width)
        assert len(values) == accessor["count"]
        if "min" in accessor:
            assert (values.min(axis=0).tolist(), values.max(axis=0).tolist()) == (accessor["min"], accessor["max"])
        return values

    def base(self, name: str = "POSITION") -> np.ndarray:
        return self.array(self.primitive["attributes"][name])

    def target(self, number: int, name: str = "POSITION") -> np.ndarray:
        accessor = self.targets[number][name]
        assert {"min", "max"} <= self.tree["accessors"][accessor].keys()
        return self.array(accessor)

    def cells(self) -> np.ndarray:
        width = {1: 2, 4: 3}[self.primitive["mode"]]
        return self.array(self.primitive["indices"]).reshape(-1, width)

    def keys(self) -> tuple[np.ndarray, np.ndarray]:
        """Times and weights."""
        (animation,) = self.tree["animations"]
        (sampler,), (channel,) = animation["samplers"], animation["channels"]
        assert sampler["interpolation"] == "LINEAR"
        assert (channel["sampler"], channel["target"]["path"]) == (0, "weights")
        assert self.tree["nodes"][channel["target"]["node"]]["mesh"] == 0
        times, weights = self.array(sampler["input"])[:, 0], self.array(sampler["output"])
        assert {"min", "max"} <= self.tree["accessors"][sampler["input"]].keys()
        return times, weights.reshape(len(times), len(self.targets))

    def shape_at(self, time: float) -> np.ndarray:
        """Vertices at a time, as a player computes them: in single precision."""
        times, weights = self.keys()
        shape = self.base()
        for number in range(len(self.targets)):
            shape = shape + np.float32(np.interp(time, times, weights[:, number])) * self.target(number)
        return shape


def animation(*meshes: Mesh, labels="abcdefgh", **options: object) -> Animation:
    return Animation(b"".join(animated_glb(meshes, list(labels[: len(meshes)]), **options)))


def in_gltf(vectors: np.ndarray) -> np.ndarray:
    """Vectors with y for up, in place of z."""
    x, y, z = np.asarray(vectors).T
    return np.stack([x, z, -y], axis=1)


def moved(mesh: Mesh, height: float) -> Mesh:
    return Mesh(mesh.vertices + np.array([0, 0, height]), mesh.cells, mesh.parameters, mesh.normals, name=mesh.name)


def numbers(path: Path, kind: str) -> np.ndarray:
    """Lines of an OBJ file."""
    return np.array([line.split()[1:] for line in path.read_text().splitlines() if line.startswith(f"{kind} ")], float)


# --- the encoder


@pytest.mark.parametrize("make", [surface, curve])
def test_morph_targets_are_the_meshes(make):
    meshes = [make(), moved(make(), 1.5), moved(make(), -2)]
    read = animation(*meshes, normals=True, uv=True)
    for number, expected in enumerate(meshes[1:]):
        np.testing.assert_allclose(
            read.base() + read.target(number), in_gltf(expected.vertices), rtol=0, atol=8 * STORED
        )
        assert set(read.targets[number]) == ({"POSITION", "NORMAL"} if make is surface else {"POSITION"})
    assert (read.cells() == meshes[0].cells).all()
    assert read.mesh["extras"]["targetNames"] == ["b", "c"]
    assert read.mesh["weights"] == [0, 0]
    coordinates = read.base("TEXCOORD_0")
    np.testing.assert_allclose(coordinates[:, 0], meshes[0].parameters[:, 0], atol=STORED)


def test_normals_are_morphed():
    """A target may turn a normal; base and target together are the unit normal."""
    turned = surface()
    turned = Mesh(-turned.vertices, turned.cells, turned.parameters, turned.normals[:, [1, 2, 0]])
    read = animation(surface(), turned, normals=True)
    np.testing.assert_allclose(read.base("NORMAL"), in_gltf(surface().normals), atol=2 * STORED)
    np.testing.assert_allclose(read.base("NORMAL") + read.target(0, "NORMAL"), in_gltf(turned.normals), atol=4 * STORED)


def test_it_plays_from_mesh_to_mesh():
    meshes = [surface(), moved(surface(), 1), moved(surface(), 5)]
    read = animation(*meshes)
    times, weights = read.keys()
    assert times.tolist() == [0, 1, 2]
    assert weights.tolist() == [[0, 0], [1, 0], [0, 1]]
    for time, height in ((0, 0), (0.5, 0.5), (1, 1), (1.75, 4), (2, 5)):
        expected = in_gltf(moved(surface(), height).vertices)
        np.testing.assert_allclose(read.shape_at(time), expected, atol=16 * STORED)
        lying = animation(*meshes, up="z").shape_at(time)
        np.testing.assert_array_equal(in_gltf(lying), read.shape_at(time))


def test_far_from_the_origin_a_target_ends_where_its_mesh_is_stored():
    """What the base loses to rounding, the target gives back: no vertex is off by two roundings."""
    far = moved(surface(), 1e6 / 3)
    read = animation(far, moved(far, 1e-3))
    stored = (far.vertices + np.array([0, 0, 1e-3])).astype(np.float32)
    np.testing.assert_array_equal(read.shape_at(1), in_gltf(stored))


def test_one_mesh_stands_still():
    read = animation(surface(), extras={"number": 1})
    assert "animations" not in read.tree
    assert "weights" not in read.mesh
    assert read.mesh["extras"] == {"number": 1}


def test_a_model_is_one_mesh():
    """Its patches would be nodes with vertices of their own, and each needs targets."""
    assert (animation(model(), moved(model(), 1)).cells() == model().cells).all()


def test_meshes_that_cannot_be_morphed():
    with pytest.raises(ExportError, match="must have the same cells"):
        animation(surface(3), surface(4))
    with pytest.raises(ExportError, match="GLB: b: POSITION: too large for 32-bit numbers"):
        animation(moved(surface(), 0), moved(surface(), 1e39))
    with pytest.raises(ExportError, match="vertex 0: coordinates: too large for 32-bit numbers"):
        animation(moved(surface(), 1e39), moved(surface(), 0))
    bare = Mesh(surface().vertices, surface().cells)
    with pytest.raises(ExportError, match="normals: the mesh has none"):
        animation(surface(), bare, normals=True)
    with pytest.raises(ExportError, match=f"an animation of {MAX_MESHES + 1} meshes, more than {MAX_MESHES}"):
        animated_glb([surface(1)] * (MAX_MESHES + 1), [""] * (MAX_MESHES + 1))


# --- the commands


@pytest.mark.usefixtures("measured_roughly")
@pytest.mark.parametrize(
    ("arguments", "mode", "labels"),
    [
        (DEGENERATE, 4, ["x=5", "x=100", "x=1e30", "limit"]),
        (DEGENERATE_LINE, 1, ["x=1", "x=3", "x=1e300", "limit"]),
        (["degenerate", LINE, "-x0.5", "-x1e-9", "-n5"], 1, ["x=0.5", "x=1e-9", "limit"]),
        pytest.param(MERGE, 4, ["step=0", "step=0.4", "step=0.8", "limit"], marks=long),
    ],
)
def test_the_file_has_the_meshes_of_the_folder(arguments, mode, labels, tmp_path):
    out = tmp_path / "all.glb"
    result = gtb(*arguments, "--uv", *["--normals"] * (mode == 4), "-o", out)
    assert (result.status, result.out) == (0, b"")
    assert gtb(*arguments, "-o", tmp_path / "folder").status == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["all.glb", "folder"]
    read = Animation(out.read_bytes())
    record = json.loads((tmp_path / "folder" / "sequence.json").read_text())
    assert record.pop("schema") == 1
    files = [tmp_path / "folder" / entry.pop("file") for entry in record["meshes"]]
    assert read.primitive["mode"] == mode
    assert set(read.targets[0]) == ({"POSITION", "NORMAL"} if mode == 4 else {"POSITION"})
    np.testing.assert_array_equal(read.cells() + 1, numbers(files[0], "f" if mode == 4 else "l"))
    times, weights = read.keys()
    assert (np.diff(times) > 0).all()
    assert times.tolist() == list(range(len(files)))
    assert ((weights != 0).sum(axis=1) == [0, *[1] * (len(files) - 1)]).all()
    size = max(np.abs(numbers(path, "v")).max() for path in files)
    for time, path in zip(times, files, strict=True):
        np.testing.assert_allclose(read.shape_at(time), in_gltf(numbers(path, "v")), rtol=0, atol=4 * STORED * size)
    assert read.mesh["extras"]["targetNames"] == labels[1:]
    said = read.mesh["extras"]["sequence"]
    assert [entry.pop("label") for entry in said["meshes"]] == labels
    assert said == record
    for label in labels:
        assert f"gtb: {out}: {label}: " in result.err


@pytest.mark.usefixtures("measured_roughly")
def test_the_same_bytes_to_a_file_and_to_standard_output(tmp_path):
    merge_on_a_line = ["knot-limit", str(SPECS / "example-3.1.toml"), "--merge", "1:2", "-n5"]
    out = tmp_path / "a.GLB"
    assert gtb(*DEGENERATE_LINE, "-o", out).status == 0
    for extra in (["-f", "glb"], ["-f", "glb", "-o", "-"]):
        result = gtb(*DEGENERATE_LINE, *extra)
        assert result.out == out.read_bytes()
        assert result.err.startswith("gtb: x=1: 11 vertices, 10 segments, ")
    assert gtb(*merge_on_a_line, "-f", "glb").out == gtb(*merge_on_a_line, "-f", "glb", "-q").out


def test_a_folder_may_end_in_glb(tmp_path):
    (tmp_path / "old.glb").mkdir()
    for output in (f"{tmp_path}/old.glb", f"{tmp_path}/new.glb/"):
        assert gtb(*DEGENERATE_LINE, "-f", "glb", "-o", output).status == 0
        assert (Path(output) / "sequence.json").exists()


def test_no_animation_on_a_terminal(monkeypatch):
    monkeypatch.setattr("gtb_cli.shell.streams.is_terminal", lambda output: output == console_room.STANDARD)
    result = gtb(*DEGENERATE_LINE, "-f", "glb")
    assert (result.status, result.out) == (2, b"")
    assert "GLB is binary, and standard output is a terminal: give -o FILE" in result.err
