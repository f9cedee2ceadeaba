"""Holes cut into the graph of a cubic, filled by `gtb fill` and by Open CASCADE: what is missed, and how it bends.

`python -m tests.benchmarks.filling` prints a table. The hole is a regular polygon around which the graph is known, with
its tangent planes; the distance from the graph inside is of the size of the hole.
"""

import sys
import time
from collections.abc import Callable, Sequence

import numpy as np

from gtb_cli.design.fill import fill_loop
from gtb_cli.design.sides import HoleSide, bernstein, stations
from gtb_cli.fairing.energy import energy_samples

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


def corners(n: int) -> np.ndarray:
    turns = np.arange(n) * 2 * np.pi / n
    return np.column_stack([np.cos(turns), np.sin(turns)])


def bezier(places: np.ndarray, value: Graph) -> np.ndarray:
    """(4, 4, 3) or (4, 3) Bézier points of the graph over a grid of places, with steps of a third."""
    points = np.concatenate([places, value(places.reshape(-1, 2)).reshape(*places.shape[:-1], 1)], axis=-1)
    inverse = np.linalg.inv(bernstein(3, np.arange(4) / 3))
    points = np.tensordot(inverse, points, 1)
    return points if points.ndim == 2 else np.tensordot(inverse, points, (1, 1)).swapaxes(0, 1)


def sides(n: int, value: Graph, gradient: Graph) -> list[HoleSide]:
    found, v, t = [], corners(n), stations()[:, None]
    for k in range(n):
        start, end = v[k], v[(k + 1) % n]
        along = end - start
        inward = np.array([-along[1], along[0]])
        curve = bezier(start + np.arange(4)[:, None] / 3 * along, value)
        slopes = gradient(start + t * along) @ inward
        across = np.column_stack([np.tile(inward, (len(t), 1)), slopes])
        found.append(HoleSide(f"side {k}", np.column_stack([curve, np.ones(4)]), across))
    return found


def open_cascade(n: int, value: Graph) -> np.ndarray:
    """(m, 3) vertices of a mesh of Open CASCADE's filling between faces of the graph outside the hole."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.BRepOffsetAPI import BRepOffsetAPI_MakeFilling
    from OCP.collections import Array2_gp_Pnt
    from OCP.Geom import Geom_BezierSurface
    from OCP.GeomAbs import GeomAbs_G1
    from OCP.gp import gp_Pnt
    from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS

    filling, v, kept = BRepOffsetAPI_MakeFilling(), corners(n), []
    for k in range(n):
        start, end = v[k], v[(k + 1) % n]
        out = 0.3 * (start + end) / 2
        steps = np.arange(4) / 3
        places = start + steps[:, None, None] * out + steps[None, :, None] * (end - start)
        table = Array2_gp_Pnt(1, 4, 1, 4)
        for (i, j), point in zip(np.ndindex(4, 4), bezier(places, value).reshape(-1, 3).tolist(), strict=True):
            table.SetValue(i + 1, j + 1, gp_Pnt(*point))
        face = BRepBuilderAPI_MakeFace(Geom_BezierSurface(table), 1e-9).Face()
        explorer = TopExp_Explorer(face, TopAbs_EDGE)
        edges = []
        while explorer.More():
            edges.append(TopoDS.Edge(explorer.Current()))
            explorer.Next()

        def off(edge: object, middle: np.ndarray = (start + end) / 2) -> float:
            p = BRep_Tool.Curve_s(edge, 0.0, 1.0).Value(0.5)
            return float(np.hypot(p.X() - middle[0], p.Y() - middle[1]))

        kept.append(face)
        filling.Add(min(edges, key=off), face, GeomAbs_G1)
    filling.Build()
    shape = filling.Shape()
    BRepMesh_IncrementalMesh(shape, 1e-3)
    explorer = TopExp_Explorer(shape, TopAbs_FACE)
    mesh = BRep_Tool.Triangulation_s(TopoDS.Face(explorer.Current()), TopLoc_Location())
    return np.array([(p.X(), p.Y(), p.Z()) for p in (mesh.Node(i + 1) for i in range(mesh.NbNodes()))])


def main(counts: Sequence[int]) -> None:
    for n in counts:
        value, gradient = cubic(n)
        found, begin = sides(n, value, gradient), time.process_time()
        filling = fill_loop(found)
        seconds = time.process_time() - begin
        points = filling.patch.evaluate(energy_samples(filling.patch.domain, 20)[0], "linear")
        size = float(np.ptp(np.concatenate([side.ends for side in found]), axis=0).max())
        missed = np.abs(points[:, 2] - value(points[:, :2])).max() / size
        bent = filling.bending
        text = f"{n} sides: {missed:.1e} from the graph, {filling.angle:.0e} degrees, {filling.folds} folds"
        text += f", {seconds:.2f} s, bending {bent.energy:.3g}, variation {bent.variation:.2g}"
        try:
            other = open_cascade(n, value)
            text += f"; Open CASCADE: {np.abs(other[:, 2] - value(other[:, :2])).max() / size:.1e}"
        except ImportError:
            text += "; Open CASCADE is not installed"
        print(text, flush=True)


if __name__ == "__main__":
    main([int(word) for word in sys.argv[1:]] or range(3, 9))
