"""`gtb degenerate` and `gtb knot-limit`: files, names, records, refusals."""

import json
from pathlib import Path

import numpy as np
import pytest

from gtb_cli.knots.decomposition import regular_decomposition
from gtb_cli.language.loading import parse
from tests.marks import mostly_long
from tests.shell import SPECS, gtb, names
from tests.specs import load

SURFACE = str(SPECS / "example-4.4.toml")
MOVING = str(SPECS / "example-4.2.toml")
LINE = str(SPECS / "example-3.4.toml")


pytestmark = pytest.mark.usefixtures("measured_roughly")


def lines(path: Path, kind: str) -> list[str]:
    return [line for line in path.read_text().splitlines() if line.startswith(f"{kind} ")]


# --- degenerate


@pytest.mark.parametrize("n", mostly_long([3, 6]))
def test_the_sequence_of_example_44(n, tmp_path):
    out = tmp_path / "new" / "folder"
    values = ["5", "100", "600", "1e6", "1e30"]
    result = gtb("degenerate", SURFACE, *(f"-x{x}" for x in values), "-n", n, "-o", out, status=0)
    assert result.out == b""
    files = [f"example-4.4-x{x}.obj" for x in values] + ["example-4.4-limit.obj"]
    assert names(out) == sorted([*files, "sequence.json"])
    record = json.loads((out / "sequence.json").read_text())
    assert list(record) == ["schema", "name", "meshes", "rate"]
    assert record["rate"]["predicted"] == pytest.approx(72 / 97)
    assert "distances from the limit fall as x^-0.742 or faster in theory\n" in result.err
    assert record["name"] == "example-4.4"
    assert [entry["file"] for entry in record["meshes"]] == files
    assert list(record["meshes"][0]) == ["file", "x", "vertices", "faces", "distance_to_limit", "distance_error"]
    assert [entry["x"] for entry in record["meshes"]] == [5, 100, 600, 10**6, 1e30, "inf"]
    distances = [entry["distance_to_limit"] for entry in record["meshes"]]
    assert distances == sorted(distances, reverse=True)
    assert distances[-2] < 1e-5
    assert distances[-1] == 0
    faces = lines(out / files[0], "f")
    assert len(faces) == (2 * 2 + 3) * n**2
    for entry in record["meshes"]:
        assert lines(out / entry["file"], "f") == faces
        assert (entry["faces"], entry["vertices"]) == (len(faces), len(lines(out / entry["file"], "v")))
        assert f"{out / entry['file']}: {entry['vertices']} vertices, {len(faces)} faces" in result.err


@pytest.mark.parametrize("command", [["degenerate", SURFACE, "-x5"], ["knot-limit", MOVING, "--merge", "3:1"]])
def test_distances_are_left_out(command, tmp_path, monkeypatch):
    monkeypatch.setattr("gtb_cli.sequences.measurement.FarthestSearch", None)
    result = gtb(*command, "-n", 2, "--no-distance", "-o", tmp_path / "folder", status=0)
    assert "from the limit" not in result.err
    assert "its film reaches" not in result.err
    record = json.loads((tmp_path / "folder" / "sequence.json").read_text())
    assert {entry["distance_to_limit"] for entry in record["meshes"]} == {None}
    assert all(entry.get("distance_to_limit_with_film") is None for entry in record["meshes"])


def test_the_spec_of_one_x(tmp_path):
    result = gtb("degenerate", SURFACE, "-x", "5", "--emit-spec")
    assert (result.status, result.err) == (0, "")
    found = parse(result.out, "out.toml")
    patch = load(SURFACE)
    assert found.weights.tolist() == (patch.weights * 5.0**patch.lifting).tolist()
    assert found.replace(weights=patch.weights) == patch
    for x, sign in (("inf", 1), ("0", -1)):
        limit = parse(gtb("degenerate", SURFACE, "-x", x, "--emit-spec").out, "out.toml")
        assert len(limit.patches) == len(regular_decomposition(patch.knots, sign * patch.lifting).cells)
    assert names(tmp_path) == []
    both = gtb("degenerate", SURFACE, "-x", "5", "-n1", "--no-distance", "--emit-spec", "-o", tmp_path)
    assert both.out == result.out
    assert len(names(tmp_path)) == 3
    far = parse(gtb("degenerate", SURFACE, "-x1e200", "--emit-spec").out, "out.toml")
    np.testing.assert_allclose(far.log_weights, patch.log_weights + patch.lifting * np.log(1e200), rtol=1e-14)


# --- knot-limit


def test_the_sequence_of_example_42(tmp_path):
    result = gtb("knot-limit", MOVING, "--merge", "3:1", "--steps", "0,0.8", "-n4", "-o", tmp_path, status=0)
    files = [f"example-4.2-{label}.obj" for label in ("step0", "step0.8", "limit")]
    assert names(tmp_path) == sorted([*files, "sequence.json"])
    record = json.loads((tmp_path / "sequence.json").read_text())
    assert [entry["file"] for entry in record["meshes"]] == files
    assert [entry["step"] for entry in record["meshes"]] == [0, 0.8, 1]
    assert len({"\n".join(lines(tmp_path / name, "f")) for name in files}) == 1
    assert record["meshes"][1]["distance_to_limit"] == pytest.approx(0.559, abs=0.02)
    assert record["meshes"][1]["distance_to_limit_with_film"] < 0.5
    assert record["meshes"][2]["distance_to_limit"] == 0
    # The merged patch alone is as far from itself with the film as the film reaches: what the steps keep.
    assert record["meshes"][2]["distance_to_limit_with_film"] == pytest.approx(0.559, abs=0.02)
    assert f"limit.obj: {record['meshes'][2]['vertices']} vertices" in result.err
    assert "its film reaches 0.5" in result.err
    warning = [line for line in result.err.splitlines() if line.startswith("gtb: warning: ")]
    assert len(warning) == 1
    assert "knot 3 comes to the corner (1, 2), where the limit is pointwise only" in warning[0]
