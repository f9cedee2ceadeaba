"""Pictures of surfaces under stripes: the reflection of a room with parallel lamps on its ceiling.

``python -m tests.tools.stripes OUT.png FILE.gbp …`` draws loops filled by ``gtb fill``, with "g1" and, where curvature
is known, "g2", beside the generalized Bézier patch of the file. Stripes show normals: across a seam with equal planes
they go on, and with a kink unless curvature is the same, too. `gallery` draws one for the page.
"""

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image

import gtb_cli
from gtb_cli.errors import DomainError
from gtb_cli.filling.fill import filled
from gtb_cli.filling.hole_files import read_loop
from gtb_cli.knots.domain import domain
from gtb_cli.knots.even_triangulation import central_triangulation
from gtb_cli.meshes.shading import filled_normals
from gtb_cli.models.model import Model
from gtb_cli.plots.raster import rasterised
from gtb_cli.theory.patch import Patch
from tests.benchmarks.gb import GeneralizedBezier, polygon
from tests.benchmarks.jets import normals
from tests.shell import REPOSITORY, SPECS

FINE = 3  # pixels that are drawn for each of the picture, along both axes
LAMPS = 4.0  # between the ceiling and the horizon


class Surface(NamedTuple):
    """Triangles with (m, 3) normals of the surface at their corners."""

    vertices: np.ndarray
    normals: np.ndarray
    faces: np.ndarray


def of_patches(patches: Iterable[Patch], n: int) -> Surface:
    """Patches as meshes with n segments along each edge."""
    found = []
    for patch in patches:
        mesh = central_triangulation(patch.domain, n)
        points = patch.evaluate(mesh.parameters, "linear")  # toric ones crowd inside
        known = patch.normals(mesh.parameters, "linear")  # NaN at corners without a plane
        found.append(Surface(points, filled_normals(known, points, mesh.cells), mesh.cells))
    return joined(found)


def of_gb(path: Path, n: int) -> Surface:
    """The generalized Bézier patch of a file."""
    patch = GeneralizedBezier.read(path)
    mesh = central_triangulation(domain(polygon(len(patch.control_points)), "unit"), n)
    jets = patch.jets(mesh.parameters * (1 - 1e-9))  # corners are limits
    return Surface(jets[0], normals(jets), mesh.cells)


def joined(surfaces: Sequence[Surface]) -> Surface:
    starts = np.cumsum([0, *(len(each.vertices) for each in surfaces)])
    faces = [each.faces + start for each, start in zip(surfaces, starts, strict=False)]
    return Surface(
        np.concatenate([each.vertices for each in surfaces]),
        np.concatenate([each.normals for each in surfaces]),
        np.concatenate(faces),
    )


def camera(eye: np.ndarray, up: np.ndarray) -> np.ndarray:
    """(3, 3) directions to the right, upwards and to the eye, as rows."""
    back = eye / np.linalg.norm(eye)
    right = np.cross(up, back)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(back, right), back])


def facing(surface: Surface) -> np.ndarray:
    """A camera that looks at a surface from the front, a little from above."""
    a, b, c = np.moveaxis(surface.vertices[surface.faces], 1, 0)
    front = np.cross(b - a, c - a).sum(axis=0)
    front /= np.linalg.norm(front)
    spread = surface.vertices - surface.vertices.mean(axis=0)
    across = np.linalg.svd(spread - np.outer(spread @ front, front), full_matrices=False)[2][0]
    up = np.cross(front, across)
    return camera(front + 0.4 * up, up)


def drawn(
    surface: Surface, turn: np.ndarray, size: int, centre: np.ndarray | None = None, width: float = 0
) -> Image.Image:
    """A square picture; of the surface or, given its width, of a square about the centre."""
    places = surface.vertices @ turn.T
    low, high = places.min(axis=0), places.max(axis=0)
    middle = (low + high) / 2 if centre is None else turn @ centre
    scale = FINE * size / (width or 1.06 * max(high[:2] - low[:2]))
    places = (places - middle) * scale + [FINE * size / 2, FINE * size / 2, 0]
    raster = rasterised(places, surface.faces, FINE * size, FINE * size)
    n = raster.values(surface.faces, surface.normals) @ turn.T
    n *= np.where(n[:, 2:] < 0, -1, 1) / np.linalg.norm(n, axis=1, keepdims=True)
    lamp = LAMPS * np.arccos(np.clip(2 * n[:, 2] * n[:, 1], -1, 1)) / (np.pi / 2)
    lit = np.abs(lamp % 1 - 0.5) > 0.25
    image = np.full((FINE * size, FINE * size), 255.0)
    image[raster.triangle >= 0] = np.where(lit, 235, 40) * (0.75 + 0.25 * n[:, 2])
    image = image[::-1].reshape(size, FINE, size, FINE).mean(axis=(1, 3))
    return Image.fromarray(image.round().astype(np.uint8))


def sheet(rows: Sequence[Sequence[Image.Image | None]]) -> Image.Image:
    """Pictures of one size in rows, with gaps where there is none."""
    size = max(image.width for row in rows for image in row if image)
    whole = Image.new("L", (size * max(map(len, rows)), size * len(rows)), 255)
    for y, row in enumerate(rows):
        for x, image in enumerate(row):
            if image:
                whole.paste(image, (x * size, y * size))
    return whole


def loops(paths: Sequence[Path], n: int = 256, size: int = 420) -> Image.Image:
    """One row for each file: filled with "g1", with "g2" or a gap, and its generalized Bézier patch."""
    rows = []
    for path in paths:
        sides, _ = read_loop(path.read_bytes(), str(path))
        assert not isinstance(sides, Model)
        first = of_patches(filled(sides, None, None).patches, n)
        try:
            second = of_patches(filled(sides, None, None, continuity="g2").patches, n)
        except DomainError as error:
            print(f"{path.name}: {error}", file=sys.stderr)
            second = None
        turn = facing(first)
        rows.append([each and drawn(each, turn, size) for each in (first, second, of_gb(path, n))])
        print(path.name, flush=True)
    return sheet(rows)


def draw(target: Path) -> None:
    """Draw the page's picture: a corner of the rounded cube among its neighbours, and a loop, with "g1" and "g2"."""
    row = [panel(kind) for panel in (of_a_cube, of_a_loop) for kind in ("g1", "g2")]
    sheet([row]).quantize(32).save(target, "PNG", optimize=True)


def of_a_cube(kind: str, n: int = 48, size: int = 240) -> Image.Image:
    """A filled corner of the rounded cube."""
    cube = gtb_cli.load(SPECS / "rounded-cube.toml")
    assert isinstance(cube, Model)
    others = Model(patch for patch in cube if patch.name != "corner")
    near = {"face", "face-1", "top", "post", "beam-1", "rail"}
    corner = camera(np.array([3.0, 2.0, 2.2]), np.array([0.0, 0.0, 1.0]))
    patches = (*gtb_cli.fill(others, continuity=kind).patches, *(patch for patch in others if patch.name in near))
    return drawn(of_patches(patches, n), corner, size, np.full(3, 2.5), 2.2)


def of_a_loop(kind: str, n: int = 48, size: int = 240) -> Image.Image:
    """A filled loop of five sides."""
    surface = of_patches(gtb_cli.fill(REPOSITORY / "tests" / "filling" / "cagd86.gbp", continuity=kind).patches, n)
    return drawn(surface, facing(surface), size)


def main(words: Sequence[str]) -> None:
    loops([Path(word) for word in words[1:]]).save(words[0], optimize=True)


if __name__ == "__main__":
    main(sys.argv[1:])
