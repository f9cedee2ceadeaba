"""Corners of patches that are probably not meant: in another order than their knots, or two at one place."""

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, IntArray, cross, planar_cross
from gtb_cli.theory.model import Model
from gtb_cli.theory.patch import Patch

SAME_PLACE = 64 * EPS  # distance of points that are one to rounding, relative to their size


def doubtful_corners(spec: Patch | Model) -> list[str]:
    """Say where corners of surfaces are one place or, joined by straight lines in their order, make these cross."""
    if spec.dimension == 1:
        return []
    return [f"{patch.name or 'the patch'}: {fault}" for patch in spec.patches for fault in _faults(patch)]


def _faults(patch: Patch) -> Iterator[str]:
    knots, points, size = patch.knots, patch.control_points, float(np.abs(patch.control_points).max())
    at_corners = [np.flatnonzero((knots == corner).all(axis=1)) for corner in patch.domain.vertices]
    for members in at_corners:
        if np.abs(points[members] - points[members[:1]]).max() > SAME_PLACE * size:
            names = " and ".join(map(str, members.tolist()))
            yield f"knots {names} are one corner, and the surface passes between their control points"
    indices = np.array([members[0] for members in at_corners])
    corners = points[indices]
    for edge, (start, end) in enumerate(zip(indices, np.roll(indices, -1), strict=True)):
        is_straight = int(patch.domain.incidence[:, edge].sum()) == 2
        if is_straight and np.abs(points[start] - points[end]).max() <= SAME_PLACE * size:
            yield f"control points {start} and {end} are the same, so that the edge between them is a point"
    if _crosses(corners):
        yield f"the lines between its corners cross, as if {_exchanged(corners, indices)}"


def _exchanged(corners: FloatArray, indices: IntArray) -> str:
    """Name two corners without whose exchange the polygon would not cross itself, if there are such."""
    many = 12  # corners from which on trying all pairs takes long
    for pair in combinations(range(len(corners) - 1, -1, -1), 2) if len(corners) < many else ():
        order = np.arange(len(corners))
        order[list(pair)] = pair[::-1]
        if not _crosses(corners[order]):
            first, second = sorted(indices[list(pair)].tolist())
            return f"control points {first} and {second} were exchanged"
    return "their control points were in another order than their knots"


def _crosses(corners: FloatArray) -> bool:
    """Tell whether a closed polygon crosses itself, seen so that its area is largest or, without area, in its plane."""
    if len(corners) < 4:
        return False
    around = corners - corners.mean(axis=0)
    normal = cross(around, np.roll(around, -1, axis=0)).sum(axis=0)
    _, sizes, axes = np.linalg.svd(around)
    least = 1e-6 * sizes[0] ** 2  # an area without which lines only touch, and a polygon is as symmetric as a bow tie
    if np.linalg.norm(normal) > least:
        plane = np.linalg.svd(normal[None])[2][1:]
    elif sizes[2] < 1e-3 * sizes[0]:
        plane = axes[:2]
    else:
        return False
    flat = around @ plane.T
    steps = np.roll(flat, -1, axis=0) - flat
    beside = planar_cross(steps[:, None], flat - flat[:, None])  # of each side and each corner
    product = beside * np.roll(beside, -1, axis=1)
    is_clear = np.minimum(np.abs(beside), np.abs(np.roll(beside, -1, axis=1))) > least
    parted = (product < 0) & is_clear  # the ends of the second side are on both sides of the first
    return bool((parted & parted.T).any())
