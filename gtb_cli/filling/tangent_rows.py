"""Rows inside an edge that are exactly in given tangent planes: raised degrees, and polynomial fields."""

from dataclasses import replace

import numpy as np

from gtb_cli.arrays import FloatArray, unit
from gtb_cli.errors import DomainError
from gtb_cli.filling.osculation import MIN_CROSSING, SecondRow, crosses, fields_by_height, osculating
from gtb_cli.filling.sides import HoleSide, bernstein, points_and_tangents, raised, stations
from gtb_cli.values import frozen


@frozen
class EdgeRows:
    """The control points at a side: its curve with its degree raised, and what may be added to the row inside it.

    The curve has (m + 1, 4) homogeneous Bézier points. Fields are rows (m, 3) of weight 0 in the planes with the (96,
    3) normals, added with any factors; without both, the row is free. `second` is row 2, where curvature is given.
    """

    curve: FloatArray
    normals: FloatArray | None
    fields: list[FloatArray] | None
    second: SecondRow | None = None

    def with_nearest(self, side: HoleSide) -> "EdgeRows":
        """Leave the single field nearest to directions across the side with length 1, and its row 2."""
        if self.fields is None or self.normals is None:
            return self
        values = bernstein(len(self.fields[0]) - 1, stations())
        table = np.array([(values @ row).ravel() for row in self.fields])
        factors = np.linalg.lstsq(table.T, _inward(side, self.normals).ravel(), rcond=MIN_CROSSING**2)[0]
        field = np.asarray(np.einsum("f,fij->ij", factors, np.array(self.fields)))
        return replace(self, fields=[field], second=self.second and self.second.chosen(factors))


def edge_rows(side: HoleSide, normals: FloatArray | None, least: int) -> EdgeRows:
    """Raise the degree of a side at least this often, and find the fields in its planes for its row."""
    step = len(side.multiplier) - 1
    if normals is None:
        # A rational side stays as it is: its row is free, and many knots would make it no fairer.
        wanted = max(least if step == 1 else 0, 2 - side.degree)
        return EdgeRows(raised(side.curve, -(-wanted // step), side.multiplier), None, None)
    first = -(-max(least, 2 - side.degree) // step)
    most = (least + 6) // step  # to find a field that crosses the edge and is exact
    counts = range(first, max(first, most) + 1)
    if side.bend is None:
        return _touching(side, normals, counts)
    second = osculating(side, normals, counts)
    return EdgeRows(second.curve, normals, second.fields, second)


def _inward(side: HoleSide, normals: FloatArray) -> FloatArray:
    """Return (96, 3) unit vectors across a side, in the planes."""
    return unit(np.cross(normals, points_and_tangents(side.curve, stations())[1]))


def _touching(side: HoleSide, normals: FloatArray, counts: range) -> EdgeRows:
    """Return fields tangent to the planes: exact ones with the fewest raises, or approximate ones if none is exact."""
    # Normal component relative to the field: rounding; or, if no field is exact, 0.2 degrees, and a message gives the
    # angle.
    exact_residual, fitted_residual = side.rounding, 3e-3
    t, inward = stations(), _inward(side, normals)
    nearly: tuple[float, EdgeRows] | None = None
    for count in counts:
        edge = raised(side.curve, count, side.multiplier)
        degree = len(edge) - 2
        values = bernstein(degree, t)
        fields, height = fields_by_height(values, normals)
        inexact = height[(height > exact_residual) & (height <= fitted_residual)].tolist()
        for bound in (exact_residual, *sorted(set(inexact))):
            chosen = fields[height <= bound]
            if len(chosen) and crosses(((values @ chosen) * inward).sum(axis=2)):
                found = EdgeRows(edge, normals, list(chosen))
                if bound == exact_residual:
                    return found
                if nearly is None or bound < nearly[0] / 2:
                    nearly = bound, found
                break
    if nearly is None:
        raise DomainError(f"{side.name}: no polynomial field of degree up to {degree} follows its tangent planes")
    return nearly[1]
