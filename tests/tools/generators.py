"""Inputs made by rules: models with degenerate patches, command lines whose output is an input."""

import json
import random

# --- models

# Hulls, by their number of corners
CORNERS = {
    3: [[0, 0], [1, 0], [0, 1]],
    4: [[0, 0], [1, 0], [1, 1], [0, 1]],
    5: [[0, 2], [0, 0], [2, 0], [2, 1], [1, 2]],
    6: [[0, 1], [0, 0], [1, 0], [2, 1], [2, 2], [1, 2]],
}

OPTIONS = (
    [], ["--normals"], ["--thickness", "0.1"], ["--thickness", "-0.01", "--normals"], ["-f", "ply", "--uv"],
    ["-f", "glb", "--normals"], ["-f", "stl"], ["--parametrization", "toric"], ["--require", "watertight"],
    ["-f", "ply", "--attribute", "mean_curvature"],
)  # fmt: skip


def model(rng: random.Random) -> tuple[bytes, list[str]]:
    """A model whose patches share edges, repeat, turn round or lose an edge or all faces; and options of a mesh."""
    patches: list[dict[str, object]] = []
    scale = 10.0 ** rng.choice([0, 0, 0, -9, 9])
    for _ in range(rng.randint(1, 6)):
        patches.append(_patch(rng, patches, scale))
    options = ["-n", str(rng.randint(1, 4))] if rng.random() < 0.8 else ["--tolerance", f"{rng.choice([1, 5, 20])}%"]
    return json.dumps({"patches": patches}).encode(), [*options, *rng.choice(OPTIONS)]


def _patch(rng: random.Random, patches: list[dict[str, object]], scale: float) -> dict[str, object]:
    if patches and rng.random() < 0.15:
        return _repeated(rng, rng.choice(patches))
    knots = [*CORNERS[rng.choice(list(CORNERS))]]
    sides = len(knots)
    knots += [[rng.choice([0.5, 0.25]), rng.choice([0.5, 0.25])] for _ in range(rng.choice([0, 0, 1, 2]))]
    points = [[scale * rng.uniform(-1, 1) for _ in range(3)] for _ in knots]
    if patches and rng.random() < 0.6:  # an edge of a patch that is there
        other = rng.choice(patches)["control_points"]
        points[0], points[1] = other[1], other[0]
    kind = rng.choice(["whole", "whole", "point", "edge", "flat", "line", "two edges"])
    if kind == "point":
        points = [points[0]] * len(points)
    elif kind == "edge":
        points[1] = points[0]
    elif kind == "two edges":
        points[1], points[sides - 1] = points[0], points[sides - 2]
    elif kind == "flat":
        points = [[x, y, 0] for x, y, _ in points]
    elif kind == "line":
        points = [[x, 0, 0] for x, _, _ in points]
    patch: dict[str, object] = {"knots": knots, "control_points": points}
    if rng.random() < 0.4:
        patch["weights"] = [10.0 ** rng.randint(-3, 3) for _ in knots]
    return patch


def _repeated(rng: random.Random, patch: dict[str, object]) -> dict[str, object]:
    """The same once more; or the other way round, by knots that are mirrored."""
    if rng.random() < 0.5:
        return dict(patch)
    return patch | {"knots": [[v, u] for u, v in patch["knots"]]}


# --- command lines

# With a spec, parameters and a mesh, each followed by another name of it
LINES = (
    "info {0} -o {1}", "check {0} -o {1}", "decompose {0} --lifting 0,1,0 -o {1}", "boundary {0} 0 -o {1}",
    "coefficients {0} -o {1}", "elevate {0} -o {1}", "eval {0} {2} -o {1}", "eval {0} {2} -o {3}", "fit {2} -o {3}",
    "diff {0} {0} -o {1}", "diff {4} {0} -o {5}", "diff {0} {4} -o {5}", "mesh {0} -f obj -o {1}",
    "mesh {0} -n 1 -o new.obj --manifest {1}", "mesh {0} {4} -n 1 -o meshes",
    "knot-limit {0} --merge 1:0 -f glb -o {1}", "degenerate {0} --lifting 0,1,0 -x 2 -n 1 -f glb -o {1}",
)  # fmt: skip


def overwriting_line(rng: random.Random) -> list[str]:
    """A command line in a folder of `s.toml`, `p.txt` and `meshes/s.obj`, that names one of its inputs as an output."""
    names = [name for file in ("s.toml", "p.txt", "meshes/s.obj") for name in (file, _alias(rng, file))]
    return rng.choice(LINES).format(*names).split()


def _alias(rng: random.Random, file: str) -> str:
    """Another name of a file: `up` is a link to the folder, and `to-…` one to the file."""
    return rng.choice([file, f"./{file}", f"meshes/../{file}", f"up/{file}", f"to-{file.replace('/', '-')}"])
