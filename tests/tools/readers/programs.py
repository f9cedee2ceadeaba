"""Readers that are programs; `python -m tests.tools.readers.programs NAME FOLDER FILE...` puts what they read there.

Some of them print counts and bounds, others are made to write what they have read in a format that is simple to read.
"""

import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from tests.tools.readers.libraries import Found, joined, results

TIMEOUT = 60  # seconds for a program and a file; none takes five


def output(*command: str) -> str:
    """Run a program, and return all that it says."""
    done = subprocess.run(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        stdin=subprocess.DEVNULL,
        timeout=TIMEOUT,
        check=False,
    )
    text = done.stdout.decode("utf-8", "replace")
    if done.returncode:
        raise ValueError(f"status {done.returncode}: {text.strip().splitlines()[-1:]}")
    return text


def number(pattern: str, text: str) -> float:
    """Return the number after the first place that matches."""
    match = re.search(pattern + r"\s*(-?[\d.]+(?:e[-+]?\d+)?)", text)
    if match is None:
        raise ValueError(f"says nothing of {pattern!r}: {text.strip().splitlines()[-1:]}")
    return float(match[1])


def read_admesh(path: str) -> Found:
    text = output("admesh", path)
    low, high = ([number(f"{end} {axis} =", text) for axis in "XYZ"] for end in ("Min", "Max"))
    return {"cells": int(number(r"Number of facets\s*:", text)), "bounds": [low, high]}


def read_assimp(path: str) -> Found:
    with tempfile.TemporaryDirectory() as folder:
        target = f"{folder}/scene.json"
        output("assimp", "export", path, target, "--format=assjson")
        scene = json.loads(Path(target).read_text(encoding="utf-8"))
    parts = []
    for mesh in scene.get("meshes", []):
        coordinates = mesh.get("texturecoords")
        uv = None
        if coordinates:
            width = mesh["numuvcomponents"][0]
            uv = [pair for start in range(0, len(coordinates[0]), width) for pair in coordinates[0][start : start + 2]]
        part = {"name": mesh["name"], "points": mesh["vertices"], "cells": mesh["faces"], "uv": uv}
        parts.append(part | {"normals": mesh.get("normals")})
    return joined(parts) | {"animations": len(scene.get("animations", []))}


def read_prusa_slicer(path: str) -> Found:
    text = output("prusa-slicer", "--info", path)
    low, high = ([number(f"{end}_{axis} =", text) for axis in "xyz"] for end in ("min", "max"))
    return {"cells": int(number("number_of_facets =", text)), "bounds": [low, high]}


def read_openscad(path: str) -> Found:
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "import.scad").write_text(f"import({json.dumps(path)});", encoding="utf-8")
        output("openscad", "-o", f"{folder}/mesh.off", f"{folder}/import.scad")
        words = iter(Path(folder, "mesh.off").read_text(encoding="utf-8").split()[1:])
    vertices, faces, _ = (int(next(words)) for _ in range(3))
    points = [float(next(words)) for _ in range(3 * vertices)]
    return joined(
        [{"points": points, "cells": [[int(next(words)) for _ in range(int(next(words)))] for _ in range(faces)]}]
    )


def read_ctmconv(path: str) -> Found:
    with tempfile.TemporaryDirectory() as folder:
        output("ctmconv", path, f"{folder}/mesh.obj")
        rows = [line.split() for line in Path(folder, "mesh.obj").read_text(encoding="utf-8").splitlines()]
    points, normals, uv = ([list(map(float, row[1:])) for row in rows if row[:1] == [key]] for key in ("v", "vn", "vt"))
    cells = [[int(corner.split("/")[0]) - 1 for corner in row[1:]] for row in rows if row[:1] == ["f"]]
    return joined([{"points": points, "cells": cells, "normals": normals or None, "uv": uv or None}])


def read_pcl(path: str) -> Found:
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder, "text.ply")
        command = ["pcl_ply2ply", "--format=ascii", path, str(target)]
        subprocess.run(command, capture_output=True, timeout=TIMEOUT, check=False)  # its status always is 1
        rows = [line.split() for line in target.read_text(encoding="ascii").splitlines()]
    counts = {row[1]: int(row[2]) for row in rows if row[0] == "element"}
    names = [row[2] for row in rows if row[0] == "property"]
    del rows[: rows.index(["end_header"]) + 1]
    table = np.array(rows[: counts["vertex"]], dtype=float)
    columns = dict(zip(names, table.T, strict=False))
    part: Found = {"points": table[:, :3], "attributes": columns}
    part["cells"] = [row[-3:] if "face" in counts else row for row in rows[counts["vertex"] :]]
    if "nx" in columns:
        part["normals"] = np.column_stack([columns[name] for name in ("nx", "ny", "nz")])
    if "s" in columns:
        part["uv"] = np.column_stack([columns["s"], columns["t"]])
    return joined([part])


def read_gltfpack(path: str) -> Found:
    with tempfile.TemporaryDirectory() as folder:
        text = output("gltfpack", "-v", "-noq", "-kn", "-i", path, "-o", f"{folder}/mesh.glb")
    counts = re.search(r"input: .*\((\d+) triangles, (\d+) vertices\)", text)
    if counts is None:
        raise ValueError(text)
    return {"cells": int(counts[1]), "vertices": int(counts[2])}


def read_f3d(path: str) -> Found:
    text = output("f3d", "--verbose", "--no-render", "--dry-run", "--geometry-only", path)
    counts = {
        key: sum(map(int, re.findall(rf"Number of {key}: (\d+)", text))) for key in ("points", "polygons", "lines")
    }
    return {"cells": counts["polygons"] + counts["lines"], "vertices": counts["points"]}


def version(name: str) -> str:
    """Return the first number with a point in it that a program says of itself."""
    # What makes each say its version, if anything
    versions = {
        "admesh": ("admesh", "--version"),
        "assimp": ("assimp", "version"),
        "prusa_slicer": ("prusa-slicer", "--help"),
        "openscad": ("openscad", "--version"),
        "pcl": ("pcl_ply2ply", "--version"),
        "gltfpack": ("gltfpack", "-h"),
        "f3d": ("f3d", "--version"),
    }
    if name not in versions:
        return ""
    done = subprocess.run(versions[name], capture_output=True, timeout=TIMEOUT, check=False)
    match = re.search(r"(?<![\d:.])\d+\.\d+(\.\d+)?", (done.stdout + done.stderr).decode("utf-8", "replace"))
    return match[0] if match else ""


if __name__ == "__main__":
    name, folder, *paths = sys.argv[1:]
    results(globals()[f"read_{name}"], version(name), folder, paths)
