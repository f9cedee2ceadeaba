"""Corners of patches that are probably not meant: in another order than their knots, or two at one place."""

from collections.abc import Iterator

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, cross, planar_cross
from gtb_cli.errors import one_of_alike
from gtb_cli.models.model import Model
from gtb_cli.solids.solidity import AS_IF
from gtb_cli.tessellation.point_order import likely_order
from gtb_cli.theory.patch import Patch


def doubtful_corners(spec: Patch | Model) -> list[str]:
    """Say where corners of surfaces are at one place, or in an order in which the lines between them cross."""
    if spec.dimension == 1:
        return []
    found = [(patch.name or "the patch", fault) for patch in spec.patches for fault in _faults(patch)]
    return one_of_alike((fault, f"{name}: {fault}") for name, fault in found)


def _faults(patch: Patch) -> Iterator[str]:
    domain, points = patch.domain, patch.control_points
    near = 64 * EPS * float(np.abs(points).max())  # two points that are one to rounding
    at_corners = [np.flatnonzero((domain.knots == corner).all(axis=1)) for corner in domain.vertices]
    for members in at_corners:
        if np.abs(points[members] - points[members[:1]]).max() > near:
            names = " and ".join(map(str, members.tolist()))
            between = "the surface passes between their control points"
            yield f"knots {names} are one corner, {AS_IF} one had another place: {between}"
    indices = np.array([members[0] for members in at_corners])
    corners = points[indices]
    gaps = np.abs(np.roll(corners, -1, axis=0) - corners).max(axis=1)
    for k in np.flatnonzero((gaps <= near) & (domain.incidence.sum(axis=0) == 2)).tolist():
        start, end = indices[k], np.roll(indices, -1)[k]
        yield f"control points {start} and {end} are the same, so that the edge between them is a point"
    if _crosses(corners):
        yield f"the lines between its corners cross, {AS_IF} {likely_order(patch, is_certain=True)}"


def _crosses(corners: FloatArray) -> bool:
    """Tell whether a closed polygon crosses itself, seen so that its area is largest or, without area, in its plane."""
    after = [*range(1, len(corners)), 0]
    around = corners - corners[0]
    size = np.abs(around).max()
    if not size:
        return False
    around /= size
    normal = cross(around, around[after]).sum(axis=0)
    around -= around.mean(axis=0)
    least = 1e-6  # an area without which lines only touch, and a polygon is as symmetric as a bow tie
    if np.linalg.norm(normal) > least:
        axes = np.linalg.svd(normal[None])[2][1:]
    else:
        _, sizes, axes = np.linalg.svd(around)
        if sizes[2] > 1e-3 * sizes[0]:  # not plane
            return False
    flat = around @ axes[:2].T
    beside = planar_cross((flat[after] - flat)[:, None], flat - flat[:, None])  # of each side and each corner
    ends = beside, beside[:, after]
    parted = (ends[0] * ends[1] < 0) & (np.minimum(*np.abs(ends)) > least)  # the second side's ends, by the first side
    return bool((parted & parted.T).any())
