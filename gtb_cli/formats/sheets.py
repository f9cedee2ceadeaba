"""Patches as rational B-spline surfaces for CAD: exact Bézier rectangles where there are some, else fitted ones."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.formats.cad import Sheet
from gtb_cli.knots.lattice import binomial_coefficients, lattice_of
from gtb_cli.theory.bezier_pieces import DEGREE, bezier_charts
from gtb_cli.theory.model import Model
from gtb_cli.theory.patch import Patch

FIT_TOLERANCE = 1e-4
"""Largest distance of a fitted surface, as a fraction of the model's size, where nothing else is asked for."""

SEGMENTS = (8, 16, 32, 64, 128)
"""Spans of a fitted surface in each direction, tried in turn."""

CUBIC = 3

SMALLEST_WEIGHT = 1e-12
"""Smallest weight of a Bézier rectangle, relative to the largest: below it a kernel's derivatives lose all digits."""

GRADING = 2.0
"""Interpolated places are a power of even fractions, closer towards Δ's edges: a patch of real knots may have no second
derivative there. Tried with 16 spans on seven patches: 1 leaves 4e-4 … 2e-3 of the size, 2 leaves 2e-5 … 2e-4."""


class Sheets(NamedTuple):
    """Surfaces for CAD.

    Attributes
    ----------
    sheets : tuple of Sheet
    error : float
        Largest distance of fitted ones from the patches, at sample points; 0 where all are exact.
    reason : str
        Why some are not exact.
    """

    sheets: tuple[Sheet, ...]
    error: float
    reason: str


def sheets_of(spec: Patch | Model, tolerance: float | None = None) -> Sheets:
    """Return the surfaces of a patch or model as rational B-splines.

    Where every patch has Bézier pieces these are they: one for a tensor product patch, r for a patch with r corners.
    Else every patch is fitted by r cubic surfaces, as edges of exact and fitted ones would not be divided at the same
    points: between the corners, the middles of the edges and the centroid of Δ, in the linear parametrisation, so that
    edges which are the same curve get the same spline.

    Parameters
    ----------
    spec : Patch or Model
        A surface, or a model of surfaces.
    tolerance : float, optional
        Largest distance of fitted surfaces, in model units.

    Raises
    ------
    DomainError
        The spec is of curves.
    ToleranceError
        The tolerance is not reached with `SEGMENTS`.
    """
    patches = spec.patches if isinstance(spec, Model) else (spec,)
    if patches[0].dimension == 1:
        raise DomainError("is a curve, and CAD files are made of surfaces")
    try:
        return Sheets(tuple(sheet for i, patch in enumerate(patches) for sheet in exact_sheets(patch, i)), 0.0, "")
    except DomainError as fault:
        reason = str(fault)
    points = np.concatenate([patch.control_points for patch in patches])
    size = float(np.ptp(points, axis=0).max())
    allowed = FIT_TOLERANCE * size if tolerance is None else tolerance
    for segments in SEGMENTS:
        fitted = [_fitted(patch, i, segments) for i, patch in enumerate(patches)]
        error = max(found for _, found in fitted)
        if error <= allowed:
            return Sheets(tuple(sheet for sheets, _ in fitted for sheet in sheets), error, reason)
    raise ToleranceError(
        f"fitted surfaces of {SEGMENTS[-1]} × {SEGMENTS[-1]} spans are still {error:.3g} off, more than {allowed:.3g}"
    )


def exact_sheets(patch: Patch, index: int = 0) -> list[Sheet]:
    """Return the Bézier rectangles of a patch: itself, if it is one, or its charts.

    Raises
    ------
    DomainError
        It has none of a degree that CAD kernels take.
    """
    name = patch.name or f"patch-{index}"
    lattice = lattice_of(patch.domain)
    if lattice is not None and len(lattice) == 2 and max(direction.degree for direction in lattice) <= DEGREE:
        first, second = lattice
        net = np.empty((first.degree + 1, second.degree + 1, 4))
        net[first.places[:, 1], second.places[:, 1]] = homogeneous_points(patch)
        return [_bezier(name, net)]
    sheets = []
    for chart in bezier_charts(patch, DEGREE):
        along, across = (int(degree) + 1 for degree in chart.patch.knots.max(axis=0))
        sheets.append(_bezier(name, homogeneous_points(chart.patch).reshape(across, along, 4).transpose(1, 0, 2)))
    return sheets


def homogeneous_points(patch: Patch) -> FloatArray:
    """(n, 4) control points and Bézier weights: the products, over the binomials."""
    logs = patch.log_products - np.log(binomial_coefficients(patch.domain))
    weights = np.exp(logs - logs.max())
    if weights.min() < SMALLEST_WEIGHT:
        raise DomainError(
            f"has weights in a range beyond {1 / SMALLEST_WEIGHT:g}, which programs for such surfaces do not take"
        )
    return np.column_stack([patch.control_points, weights])


def _bezier(name: str, net: FloatArray) -> Sheet:
    m, n = net.shape[:2]
    knots = tuple(np.repeat([0.0, 1.0], count) for count in (m, n))
    return Sheet(name, (m - 1, n - 1), (knots[0], knots[1]), net)


def _fitted(patch: Patch, index: int, segments: int) -> tuple[list[Sheet], float]:
    """Cubic interpolants of a patch's quarters, and how far they are off between their points."""
    from scipy.interpolate import make_interp_spline

    v = patch.domain.vertices
    middles = (v + np.roll(v, -1, axis=0)) / 2
    center = v.mean(axis=0)
    fine = np.linspace(0.0, 1.0, 2 * segments + 1) ** GRADING
    sheets, worst = [], 0.0
    for k in range(len(v)):
        corners = np.array([[v[k], middles[k - 1]], [middles[k], center]])
        points = _points(patch, k, corners, fine)
        coarse = fine[::2]
        first = make_interp_spline(coarse, points[::2, ::2], CUBIC, axis=0)
        second = make_interp_spline(coarse, first.c, CUBIC, axis=1)
        net = np.moveaxis(np.asarray(second.c), 0, 1)
        values = make_interp_spline(coarse, first(fine), CUBIC, axis=1)(fine)
        worst = max(worst, float(np.sqrt(((np.asarray(values) - points) ** 2).sum(axis=2)).max()))
        net = np.concatenate([net, np.ones((*net.shape[:2], 1))], axis=2)
        knots = (np.asarray(first.t), np.asarray(second.t))
        sheets.append(Sheet(patch.name or f"patch-{index}", (CUBIC, CUBIC), knots, net))
    return sheets, worst


def _points(patch: Patch, corner: int, corners: FloatArray, places: FloatArray) -> FloatArray:
    """(k, k, 3) points on the quarter about a corner; those on edges are on them exactly."""
    s, t = places[:, None, None], places[None, :, None]
    p = (1 - s) * ((1 - t) * corners[0, 0] + t * corners[0, 1]) + s * ((1 - t) * corners[1, 0] + t * corners[1, 1])
    shape = patch.domain
    r = len(shape.vertices)
    faces = np.zeros(p.shape[:2], dtype=np.int64)
    faces[:, 0] = shape.faces.edge(corner).number
    faces[0, :] = shape.faces.edge((corner - 1) % r).number
    faces[0, 0] = shape.faces.corner(corner).number
    flat = p.reshape(-1, 2)
    locations = patch.rational_basis.locations(flat, "linear", faces.ravel())
    return patch.points_at(locations, len(flat)).reshape(*p.shape[:2], 3)
