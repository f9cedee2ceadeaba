"""Holes filled by `gtb fill`, as generalized Bézier patches and by Open CASCADE: what is missed, and how they bend.

`python -m tests.benchmarks.filling FILE.gbp …` prints the figures of fillings of sets of ribbons: E = ∫ κ₁² + κ₂² and
MV = area · ∫ |∇H|², without the outermost hundredth, and thousandth, of the way to the middle; and those at corners.
A `.gbp` file is a whole GB patch.
Without files, or for numbers of sides, the hole is cut into the graph of a cubic: a regular polygon around which the
graph is known, with its tangent planes and curvatures. The distance from the graph inside is of the size of the hole.
"""

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gtb_cli.fairing.energy import energy_samples
from gtb_cli.filling.certificate import Filling
from gtb_cli.filling.fairest import NEARER, VISIBLE
from gtb_cli.filling.hole_corners import end_normals
from gtb_cli.filling.hole_files import read_loop
from gtb_cli.filling.one_patch import fill_loop
from gtb_cli.filling.sides import HoleSide, bernstein, side_normals, stations
from gtb_cli.filling.strips import strip_side
from gtb_cli.knots.domain import domain
from gtb_cli.knots.even_triangulation import central_triangulation
from gtb_cli.solids.solidity import folded_pairs
from gtb_cli.tessellation.tessellate import tessellate
from tests.benchmarks.gb import GeneralizedBezier, polygon
from tests.benchmarks.jets import bending, normals
from tests.benchmarks.open_cascade import Filled

Graph = Callable[[np.ndarray], np.ndarray]

POWERS = np.array([(i, k - i) for k in range(4) for i in range(k + 1)])


def cubic(seed: int) -> tuple[Graph, Graph]:
    """A cubic of x and y whose size is that of the unit disk, and its gradient."""
    factors = np.random.default_rng(seed).normal(size=len(POWERS)) * 0.3 / (1 + (POWERS.sum(axis=1) == 3))
    i, j = POWERS.T

    def value(p: np.ndarray) -> np.ndarray:
        return np.asarray((p[:, :1] ** i * p[:, 1:] ** j) @ factors)

    def gradient(p: np.ndarray) -> np.ndarray:
        x, y = p[:, :1], p[:, 1:]
        return np.stack([(x ** abs(i - 1) * i * y**j) @ factors, (x**i * j * y ** abs(j - 1)) @ factors], axis=1)

    return value, gradient


def sides(n: int, value: Graph, gradient: Graph) -> list[HoleSide]:
    """The edges of a regular polygon, each with three rows of the strip that the graph is beside it."""
    found, v, t = [], polygon(n), np.arange(4)[:, None] / 3
    for k in range(n):
        start, end = v[k], v[(k + 1) % n]
        places, inward = start + t * (end - start), np.array([start[1] - end[1], end[0] - start[0]])
        # The slope is quadratic across, so that its difference is exact.
        curvature = (gradient(places + inward) - gradient(places - inward)) @ inward / 2
        first = np.column_stack([places, value(places)])
        second = first + np.column_stack([np.tile(inward, (4, 1)), gradient(places) @ inward]) / 2
        third = 2 * second - first + np.column_stack([np.zeros((4, 2)), curvature / 2])
        rows = [np.linalg.solve(bernstein(3, t[:, 0]), row) for row in (first, second, third)]
        found.append(strip_side(f"side {k}", [np.column_stack([row, np.ones(4)]) for row in rows], 2))
    return found


MISSING, FINE = "not installed", 200  # segments along an edge, with which folds are looked for


HEAD = "E and MV at .01, at .001, degrees from planes, at corners at 1e-3, 1e-5, κ · edge there, folds, seconds"


def line(name: str, figures: Sequence[float], seconds: float) -> str:
    return f"  {name:13}" + " ".join(f"{figure:8.3g}" for figure in (*figures, seconds))


def about_corners(corners: np.ndarray, found: Sequence[HoleSide], at: Callable[..., tuple[np.ndarray, float]]) -> Any:
    """Largest degrees of normals from the planes of corners, and curvatures times the shorter edge: at two distances.

    `at` returns normals and the largest curvature at places that are these shares of edges of the domain away.
    """
    share, figures = np.linspace(0.05, 0.95, 19)[:, None], []
    ends = [end_normals(side) for side in found]
    for far in (1e-3, 1e-5):
        for k, corner in enumerate(corners):
            ways = np.roll(corners, -1, axis=0)[k] - corner, corners[k - 1] - corner
            n, curved = at(corner + far * (share * ways[0] + (1 - share) * ways[1]))
            sine = np.linalg.norm(np.cross(n, ends[k][0] + ends[k - 1][1]), axis=1).max() / 2
            edges = [np.linalg.norm(np.ptp(found[j].ends, axis=0)) for j in (k - 1, k)]
            figures.append((np.degrees(np.arcsin(min(sine, 1))), curved * min(edges)))
    return np.reshape(figures, (2, len(corners), 2)).max(axis=1).T.ravel()


def measured(
    jets: Callable[[np.ndarray], np.ndarray],
    areas: Callable[[np.ndarray], np.ndarray],
    edge: Callable[[int, np.ndarray], np.ndarray],
    found: Sequence[HoleSide],
) -> list[float]:
    """The figures of a surface over a regular polygon.

    `jets` and `areas` are those of its own parameters at places in the polygon, `edge` the jets along a side.
    """
    region, bends = domain(polygon(len(found)), "unit"), []
    for cut in (VISIBLE, NEARER):
        places, sizes, _ = energy_samples(region, 40, cut)
        bent = bending(jets(places), sizes * areas(places))
        bends += [bent.energy, bent.variation]
    t = stations()
    away = (t > 0.02) & (t < 0.98)  # as `Filling.contacts`
    angles = []
    for k, side in enumerate(found):
        sine = np.linalg.norm(np.cross(normals(edge(k, t[away])), side_normals(side)[away]), axis=1)
        angles.append(np.degrees(np.arcsin(np.minimum(sine, 1))).max())

    def at(places: np.ndarray) -> tuple[np.ndarray, float]:
        there = jets(places)
        return normals(there), bending(there, np.ones(len(places))).curvature

    mesh = central_triangulation(region, FINE)
    vertices = jets(mesh.parameters * (1 - 1e-9))[0]  # corners are limits
    folds = len(folded_pairs(vertices, mesh.cells))
    return [*bends, max(angles), *about_corners(polygon(len(found)), found, at), folds]


def of_filling(filling: Filling) -> list[float]:
    """The same figures of a filling."""
    patch, sides = filling.patch, filling.sides

    def at(places: np.ndarray) -> tuple[np.ndarray, float]:
        seen = patch.curvature(places, "linear")
        largest = np.abs(seen.mean) + np.sqrt(np.maximum(seen.mean**2 - seen.gaussian, 0))
        return patch.normals(places, "linear"), float(largest.max())

    bends = [each for b in (filling.bending, filling.bending_nearer) for each in (b.energy, b.variation)]
    mesh = tessellate(patch, FINE, normals=False)
    folds = len(folded_pairs(mesh.vertices, mesh.faces))
    return [*bends, filling.angle, *about_corners(patch.knots[: len(sides)], sides, at), folds]


def fillings(found: Sequence[HoleSide]) -> Iterator[tuple[str, Filling, float, str]]:
    """Yield fillings with planes and, where it is known, with curvature: name, processor seconds, and what is left.

    What is left of the given curvatures across at the edges, and a hundredth of a side inside, is the largest
    difference, of the largest of them.
    """
    for continuity in ("g1", "g2") if all(side.bend is not None for side in found) else ("g1",):
        begin = time.process_time()
        filling = fill_loop(found, continuity=continuity)
        seconds, text = time.process_time() - begin, ""
        if continuity == "g2":
            most = max(np.abs(side.bend).max() for side in found if side.bend is not None)
            edge, inside = (max(getattr(c, name) for c in filling.contacts) / most for name in ("bend", "bend_inside"))
            text = f"; curvatures across differ by {edge:.0e}, and by {inside:.0%} a hundredth inside"
        yield f"gtb fill {continuity}", filling, seconds, text


def ribbons(path: str) -> None:
    """Print the figures of three fillings of a `.gbp` file."""
    found, _ = read_loop(Path(path).read_bytes(), path)
    assert isinstance(found, list)
    print(f"{Path(path).name}, {len(found)} sides: {HEAD}", flush=True)
    for name, filling, seconds, text in fillings(found):
        print(line(name, of_filling(filling), seconds) + text, flush=True)
    gb, corner = GeneralizedBezier.read(path), polygon(len(found))

    def gb_edge(k: int, t: np.ndarray) -> np.ndarray:
        on = corner[k] + t[:, None] * (np.roll(corner, -1, axis=0)[k] - corner[k])
        return gb.jets((1 - 1e-9) * on)  # some coordinates have only limits on an edge

    begin = time.process_time()
    figures = measured(gb.jets, lambda places: np.ones(len(places)), gb_edge, found)
    print(line("GB", figures, time.process_time() - begin), flush=True)
    of_open_cascade(found)


def of_open_cascade(found: Sequence[HoleSide]) -> None:
    try:
        Filled(found)  # the first takes in the libraries
        begin = time.process_time()
        other = Filled(found)
        seconds = time.process_time() - begin
    except (ImportError, RuntimeError) as error:
        print(f"  Open CASCADE: {MISSING if isinstance(error, ImportError) else error}")
        return
    figures = measured(
        lambda places: other.at(other.parameters(places)[0]),
        lambda places: other.parameters(places)[1],
        lambda k, t: other.at(other.on_edge(k, t)[0]),
        found,
    )
    print(line("Open CASCADE", figures, seconds), flush=True)


def cubics(counts: Sequence[int]) -> None:
    for n in counts:
        value, gradient = cubic(n)
        found = sides(n, value, gradient)
        size = float(np.ptp(np.concatenate([side.ends for side in found]), axis=0).max())

        def missed(points: np.ndarray, value: Graph = value, size: float = size) -> str:
            return f"{np.abs(points[:, 2] - value(points[:, :2])).max() / size:.1e}"

        print(f"{n} sides, distance from the graph, and {HEAD}", flush=True)
        for name, filling, seconds, text in fillings(found):
            far = missed(filling.patch.evaluate(energy_samples(filling.patch.domain, 20)[0], "linear"))
            print(f"  {far}" + line(name, of_filling(filling), seconds) + text, flush=True)
        try:
            other = Filled(found)
            places = energy_samples(domain(polygon(n), "unit"), 20)[0]
            print(f"  {missed(other.at(other.parameters(places)[0])[0])}  Open CASCADE", flush=True)
            of_open_cascade(found)
        except ImportError:
            print(f"  Open CASCADE: {MISSING}", flush=True)


def main(words: Sequence[str]) -> None:
    for word in words:
        if word.endswith(".gbp"):
            ribbons(word)
    cubics([int(word) for word in words if word.isdecimal()] or ([] if words else range(3, 9)))


if __name__ == "__main__":
    main(sys.argv[1:])
