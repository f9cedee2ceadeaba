"""Readers that are programs; `python -m tests.tools.readers.programs NAME FOLDER FILE...` puts what they read there.

Some of them print counts and bounds, others are made to write what they have read in a format that is simple to read.
"""

import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.tools.readers.libraries import Found, joined, results

TIMEOUT = 300  # seconds for a program and a file; none takes five


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
    return joined(parts)


def read_prusa_slicer(path: str) -> Found:
    text = output("prusa-slicer", "--info", path)
    low, high = ([number(f"{end}_{axis} =", text) for axis in "xyz"] for end in ("min", "max"))
    return {"cells": int(number("number_of_facets =", text)), "bounds": [low, high]}


def version(name: str) -> str:
    """Return the first number with a point in it that a program says of itself."""
    asked = {"assimp": "version", "prusa_slicer": "--help"}.get(name, "--version")
    done = subprocess.run([name.replace("_", "-"), asked], capture_output=True, timeout=TIMEOUT, check=False)
    match = re.search(r"(?<![\d:.])\d+\.\d+(\.\d+)?", (done.stdout + done.stderr).decode("utf-8", "replace"))
    return match[0] if match else ""


if __name__ == "__main__":
    name, folder, *paths = sys.argv[1:]
    results(globals()[f"read_{name}"], version(name), folder, paths)
