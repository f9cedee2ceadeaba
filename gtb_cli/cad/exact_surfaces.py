"""Exact surfaces of patches for CAD: rational Bézier rectangles, as B-splines without inner knots."""

import math
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.bezier.pieces import MAX_DEGREE, bezier_pieces
from gtb_cli.errors import DomainError
from gtb_cli.knots.lattice import binomial_coefficients, lattice_of
from gtb_cli.theory.patch import Patch


class SplineSurface(NamedTuple):
    """A rational B-spline surface that becomes one face of its patch: clamped knots, (m, n, 4) points and weights."""

    name: str
    degrees: tuple[int, int]
    knots: tuple[FloatArray, FloatArray]
    net: FloatArray


def exact_surfaces(patch: Patch, index: int = 0) -> list[SplineSurface]:
    """Return the Bézier rectangles of a patch: the patch itself, if it is one, or its pieces.

    A `DomainError` says why there are none of a degree that CAD kernels accept.
    """
    name = patch.name or f"patch-{index}"
    lattice = lattice_of(patch.domain)
    if lattice is not None and len(lattice) == 2 and max(direction.degree for direction in lattice) <= MAX_DEGREE:
        first, second = lattice
        net = np.empty((first.degree + 1, second.degree + 1, 4))
        net[first.places[:, 1], second.places[:, 1]] = homogeneous_points(patch)
        return [_bezier(name, net)]
    surfaces = []
    for piece in bezier_pieces(patch, MAX_DEGREE):
        along, across = (int(degree) + 1 for degree in piece.knots.max(axis=0))
        surfaces.append(_bezier(name, homogeneous_points(piece).reshape(across, along, 4).transpose(1, 0, 2)))
    return surfaces


def balanced(surface: SplineSurface) -> SplineSurface:
    """Multiply the weights by l^i m^j, so that their range is least: the image is the same, at other parameters."""
    ample = 1e3  # ratio of weights that kernels take as it is
    logs = np.log(surface.net[..., 3])
    if np.ptp(logs) < math.log(ample):
        return surface
    rows = np.column_stack([np.ones(logs.size), np.indices(logs.shape).reshape(2, -1).T])
    rest = logs - (rows @ np.linalg.lstsq(rows, logs.ravel())[0]).reshape(logs.shape)
    return surface._replace(net=np.dstack([surface.net[..., :3], np.exp(rest - rest.max())]))


def homogeneous_points(patch: Patch) -> FloatArray:
    """Return (n, 4) control points and Bézier weights: the products c ω divided by the binomials."""
    least = 1e-12  # relative to the largest weight: below it, a kernel's derivatives lose all digits
    logs = patch.log_products - np.log(binomial_coefficients(patch.domain))
    weights = np.exp(logs - logs.max())
    if weights.min() < least:
        raise DomainError(f"has weights in a range beyond {1 / least:g}, which programs for such surfaces do not take")
    return np.column_stack([patch.control_points, weights])


def _bezier(name: str, net: FloatArray) -> SplineSurface:
    m, n = net.shape[:2]
    return SplineSurface(name, (m - 1, n - 1), (np.repeat([0.0, 1.0], m), np.repeat([0.0, 1.0], n)), net)
