"""Open CASCADE's filling of a hole with tangent planes, for comparison: a B-spline surface, trimmed."""

from collections.abc import Sequence

import numpy as np

from gtb_cli.filling.sides import HoleSide, bernstein, stations
from tests.benchmarks.gb import polygon
from tests.benchmarks.jets import FACTORIALS, POWERS


class Filled:
    """A filling over a regular polygon: rays from its middle go to rays in the parameter plane of the B-spline.

    Raises ImportError without Open CASCADE, and RuntimeError if it fills nothing.
    """

    def __init__(self, sides: Sequence[HoleSide], continuity: str = "G1") -> None:
        from OCP import GeomAbs
        from OCP.BRep import BRep_Tool
        from OCP.BRepOffsetAPI import BRepOffsetAPI_MakeFilling
        from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
        from OCP.TopExp import TopExp_Explorer
        from OCP.TopoDS import TopoDS

        filling = BRepOffsetAPI_MakeFilling()
        self._kept = []
        for side in sides:
            edge, face = _outside(side)
            self._kept.append((edge, face))
            filling.Add(edge, face, getattr(GeomAbs, f"GeomAbs_{continuity}"))
        try:
            filling.Build()
            shape = filling.Shape()
        except Exception as error:
            raise RuntimeError(f"Open CASCADE: {type(error).__name__}") from error
        self._face = TopoDS.Face(TopExp_Explorer(shape, TopAbs_FACE).Current())
        self.surface = BRep_Tool.Surface_s(self._face)
        explorer = TopExp_Explorer(self._face, TopAbs_EDGE)
        curves = []
        while explorer.More():
            edge = TopoDS.Edge(explorer.Current())
            found = BRep_Tool.CurveOnSurface_s(edge, self._face, 0.0, 1.0)
            first, last = BRep_Tool.Range_s(edge)
            curves.append((found, first, last))
            explorer.Next()
        self._curves = []
        for side in sides:  # each with that nearest to it, and from its start
            ends, candidates = side.ends, []
            for curve, first, last in curves:
                a, b = (self._point(curve, t) for t in (first, last))
                candidates.append((np.abs(np.array([a, b]) - ends).max(), curve, first, last))
                candidates.append((np.abs(np.array([b, a]) - ends).max(), curve, last, first))
            self._curves.append(min(candidates, key=lambda each: each[0])[1:])
        self.middle = self._middle(len(sides))

    def _middle(self, n: int) -> np.ndarray:
        """The point from which all of the boundary is seen at the largest distances from its tangents, if any is."""
        from scipy.optimize import linprog

        t = np.linspace(0, 1, 65)
        places, rates = (np.concatenate(part) for part in zip(*(self.on_edge(k, t) for k in range(n)), strict=True))
        across = np.column_stack([-rates[:, 1], rates[:, 0]])
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        outline = places - places.mean(axis=0)
        if (outline[:, 0] * rates[:, 1] - outline[:, 1] * rates[:, 0]).sum() < 0:
            across = -across
        # across · (m − place) ≥ distance, which is to be large
        bounds = linprog(
            [0, 0, -1],
            A_ub=np.column_stack([-across, np.ones(len(t) * n)]),
            b_ub=-(across * places).sum(axis=1),
            bounds=[(None, None)] * 3,
        )
        if bounds.x[2] <= 0:
            raise RuntimeError("Open CASCADE: the region is not star-shaped, and is not measured")
        return np.asarray(bounds.x[:2])

    def _point(self, curve: object, t: float) -> np.ndarray:
        uv = curve.Value(t)  # type: ignore[attr-defined]
        p = self.surface.Value(uv.X(), uv.Y())
        return np.array([p.X(), p.Y(), p.Z()])

    def on_edge(self, side: int, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(m, 2) parameters on the image of a side at (m,) t in [0, 1], and their derivatives by t."""
        from OCP.gp import gp_Pnt2d, gp_Vec2d

        curve, first, last = self._curves[side]
        found = np.empty((2, len(t), 2))
        p, rate = gp_Pnt2d(), gp_Vec2d()
        for k, share in enumerate(t.tolist()):
            curve.D1(first + share * (last - first), p, rate)
            found[:, k] = (p.X(), p.Y()), (rate.X() * (last - first), rate.Y() * (last - first))
        return found[0], found[1]

    def parameters(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(m, 2) parameters of places in the polygon, and how much larger areas are there."""
        n = len(self._curves)
        corners = polygon(n)
        side = np.floor(np.arctan2(places[:, 1], places[:, 0]) % (2 * np.pi) / (2 * np.pi / n)).astype(int) % n
        found, scale = np.empty_like(places), np.empty(len(places))
        for k in range(n):
            here = np.flatnonzero(side == k)
            frame = np.array([corners[k], corners[(k + 1) % n]])
            shares = places[here] @ np.linalg.inv(frame)
            length = shares.sum(axis=1)
            ends, rates = self.on_edge(k, shares[:, 1] / np.where(length > 0, length, 1))
            out = ends - self.middle
            found[here] = self.middle + length[:, None] * out
            scale[here] = np.abs(out[:, 0] * rates[:, 1] - out[:, 1] * rates[:, 0]) / abs(np.linalg.det(frame))
        return found, scale

    def at(self, parameters: np.ndarray) -> np.ndarray:
        """The jets (10, m, 3) of the B-spline."""
        from OCP.gp import gp_Pnt, gp_Vec

        jets = np.empty((len(POWERS), len(parameters), 3))
        point = gp_Pnt()
        rates = {power: gp_Vec() for power in POWERS[1:]}
        order = [(1, 0), (0, 1), (2, 0), (0, 2), (1, 1), (3, 0), (0, 3), (2, 1), (1, 2)]
        for k, (u, v) in enumerate(parameters.tolist()):
            self.surface.D3(u, v, point, *(rates[power] for power in order))
            jets[0, k] = point.X(), point.Y(), point.Z()
            for i, power in enumerate(POWERS[1:], 1):
                jets[i, k] = rates[power].X(), rates[power].Y(), rates[power].Z()
        return jets / FACTORIALS[:, None, None]


def _outside(side: HoleSide) -> tuple[object, object]:
    """The edge, and a face on its other side that touches the side's planes: a Bézier strip fitted to the ribbon."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
    from OCP.collections import Array2_double, Array2_gp_Pnt
    from OCP.Geom import Geom_BezierSurface
    from OCP.gp import gp_Pnt
    from OCP.TopAbs import TopAbs_EDGE
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    assert side.across is not None
    values = bernstein(side.degree, stations())
    # Fields of ribbons are polynomials of the curve's degree, those of rational sides nearly so
    field = np.linalg.lstsq(values, side.across / (values @ side.curve[:, 3:]) ** 2, rcond=None)[0]
    points, weights = side.curve[:, :3] / side.curve[:, 3:], side.curve[:, 3]
    table = Array2_gp_Pnt(1, side.degree + 1, 1, 2)
    factors = Array2_double(1, side.degree + 1, 1, 2)
    for j, (point, away, weight) in enumerate(zip(points, field, weights, strict=True), 1):
        table.SetValue(j, 1, gp_Pnt(*point.tolist()))
        table.SetValue(j, 2, gp_Pnt(*(point - away).tolist()))
        for row in (1, 2):
            factors.SetValue(j, row, float(weight))
    face = BRepBuilderAPI_MakeFace(Geom_BezierSurface(table, factors), 1e-9).Face()
    explorer, best = TopExp_Explorer(face, TopAbs_EDGE), []
    while explorer.More():
        edge = TopoDS.Edge(explorer.Current())
        first, last = BRep_Tool.Range_s(edge)
        ends = [BRep_Tool.Curve_s(edge, 0.0, 1.0).Value(t) for t in (first, (first + last) / 2, last)]
        found = np.array([[p.X(), p.Y(), p.Z()] for p in ends])
        middle = bernstein(side.degree, np.array([0.5])) @ side.curve
        best.append((float(np.abs(found[1] - middle[0, :3] / middle[0, 3]).max()), edge))
        explorer.Next()
    return min(best, key=lambda each: each[0])[1], face
