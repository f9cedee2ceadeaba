"""Sides of a hole with the outer rows of a strip that they bound: its tangent planes and curvatures."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import DomainError
from gtb_cli.filling.osculation import Rim, heights
from gtb_cli.filling.sides import HoleSide, bernstein, bezier_form, side_normals, stations
from gtb_cli.models.model import Model
from gtb_cli.theory.edges import patch_name


def curve_sides(loop: Model, ribbons: Sequence[Sequence[FloatArray]]) -> list[HoleSide]:
    """Make sides from curves, each with up to two further rows of control points, of a strip quadratic across.

    Raises `DomainError` if one is not a rational Bézier curve.
    """
    names = [patch_name(curve, index) for index, curve in enumerate(loop)]
    rows = zip(loop, ribbons, names, strict=True)
    return [replace(strip_side(each[2], bezier_form(*each), 2), weld=loop.weld or 0.0) for each in rows]


def strip_side(name: str, rows: Sequence[FloatArray], degree: int) -> HoleSide:
    """Make a side from the outer rows of a strip that has a degree across: two give planes, and three curvatures.

    Rows are homogeneous Bézier points, all of one degree along the side.
    """
    t, k = stations(), len(rows[0]) - 1
    if len(rows) == 1:
        return HoleSide(name, rows[0])
    first = degree * (rows[1] - rows[0])
    point, field = bernstein(k, t) @ rows[0], bernstein(k, t) @ first
    across = field[:, :3] - point[:, :3] / point[:, 3:] * field[:, 3:]
    side = HoleSide(name, rows[0], across / point[:, 3:])
    if len(rows) == 2:
        return side
    try:
        rim = Rim(rows[0], side_normals(side))
    except DomainError:  # where the field across does not span planes; said when it is filled
        return side
    second = degree * (degree - 1) * bernstein(k, t) @ (rows[2] - 2 * rows[1] + rows[0])
    rates = k * bernstein(k - 1, t) @ np.diff(first, axis=0)
    mixed, own = (heights(values, rim) / rim.weights for values in (rates, second))
    along, g = rim.parts(across / point[:, 3:])
    bend = (own - 2 * along * mixed + along**2 * rim.bend) / g**2
    is_polynomial = np.ptp(np.concatenate(rows)[:, 3]) == 0
    return replace(side, bend=bend, strip=first[:, :3] if is_polynomial else None)
