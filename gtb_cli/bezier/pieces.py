"""Exact Bézier pieces: a patch with commensurable exponents as rational Bézier rectangles, a curve as two curves.

Corner i of Δ has coordinates (s, t) in [0, 1]² in which all edge functions but h_{i−1} and h_i are 1. The basis there
is ``β_a = c_a s^{h_{i−1}(a)} t^{h_i(a)}`` (Krasauskas' charts of toric patches). The r charts tile the patch because
the cones of the normal fan tile the plane of torus coordinates. If the exponents are whole multiples of a step,
monomials become Bernstein polynomials by ``s^k = Σ_j C(j, k)/C(D, k) B_j^D(s)``.
"""

import math

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, IntArray
from gtb_cli.bezier.elevation import MAX_ELEVATED_KNOTS, MAX_PLAIN_WEIGHT
from gtb_cli.errors import DomainError
from gtb_cli.knots.hull import KNOT_TOLERANCE
from gtb_cli.language.spec_paths import SpecPath, loaded, of_patch
from gtb_cli.models.model import Model
from gtb_cli.theory.edges import patch_name
from gtb_cli.theory.patch import Patch

MAX_DEGREE = 25  # of a piece, by default
MAX_SEARCHED_DEGREE = 2000  # so that a message can name a degree above the allowed one


def bezier_pieces(spec: Patch | Model | SpecPath, max_degree: int = MAX_DEGREE) -> Model:
    """Return the exact rational Bézier pieces, up to a highest degree, of a patch or of all patches of a model.

    For each corner of each Δ, a piece is the part (s, t) ∈ [0, 1]² of the patch about it, with the knots 0 … D_1 ×
    0 … D_2, by rows in ascending t, and binomial coefficients: its parameter (D_1 s, D_2 t) gives the point with
    coordinates (s, t). The pieces of a curve are its two halves, in its direction. All weights are positive.

    Each edge is divided where the knots on it have shares proportional to c ω. This point depends only on the data of
    the edge: pieces of patches that share it are joined like the patches. `DomainError` is raised if there are no
    pieces, or only of a higher degree; its message gives the reason and an alternative. Not in the paper: these are
    Krasauskas' charts of toric patches.
    """
    found: Patch | Model = loaded(spec, Patch, Model)
    pieces: list[Patch] = []
    for index, patch in enumerate(found.patches):
        try:
            pieces += _pieces_of(patch, max_degree)
        except DomainError as error:
            raise error if found is patch else DomainError(f"{patch_name(patch, index)}: {error}") from None
    return Model(tuple(pieces), found.name)


def _pieces_of(patch: Patch, max_degree: int) -> tuple[Patch, ...]:
    if patch.dimension == 1:
        return _halves(patch, 0.0, max_degree)
    powers = _powers(patch, max_degree)
    pieces = []
    for i in range(len(patch.domain.vertices)):
        logs, points = _bernstein(patch, powers[:, [i - 1, i]])
        knots = np.array([*np.ndindex(logs.shape[::-1])], dtype=float)[:, ::-1]  # by rows
        pieces.append(_bezier(patch, knots, logs.T.ravel(), points.transpose(1, 0, 2).reshape(-1, 3), f"piece{i}"))
    return tuple(pieces)


@of_patch
def split_curve(patch: Patch, at: float, max_degree: int = MAX_DEGREE) -> Model:
    """Split a curve exactly at a parameter between its ends, into two rational Bézier curves with positive weights.

    Not in the paper: this is de Casteljau's algorithm on the homogeneous control points of the whole curve's Bézier
    form, with zeros for missing knots. `DomainError` is raised for a surface, another parameter, or no Bézier form.
    """
    max_shift = 1e-9  # of the curve's size, by which rounding may move the point
    if patch.dimension != 1:
        raise DomainError("split: is for curves, and this is a surface")
    low, high = patch.domain.vertices[:, 0].tolist()
    if not low < at < high:
        raise DomainError(f"split: expected a parameter between the ends {low:g} and {high:g}, got {at:g}")
    heights = patch.domain.edge_functions(np.array([at]))[0]
    if not heights.all():
        raise DomainError(f"split: {at:g} is an end of the curve, to rounding")
    logs = np.log(heights)
    s = float(patch.domain.normals[:, 0] @ logs)
    terms = float(np.abs(patch.domain.normals[:, 0]) @ (np.abs(logs) + 1))
    if 2 * EPS * terms * float(np.ptp(patch.knots)) > max_shift:
        shift = f"rounding may move the point at {at:g} by more than {max_shift:g} of the curve's size"
        reason = f"as knots {high - low:g} apart are exponents; divide all knots by the same number"
        raise DomainError(f"split: {shift}, {reason}")
    return Model(_halves(patch, s, max_degree), patch.name)


def bezier_degree(values: FloatArray, rounding: float) -> int | None:
    """Return the least D for which all D v / max(v) are whole numbers, for (n,) numbers v ≥ 0.

    Return None if D exceeds `MAX_SEARCHED_DEGREE`. `rounding` is the error of each number.
    """
    shares = values / values.max()
    error = rounding / float(values.max()) + 4 * EPS
    for degree in range(1, MAX_SEARCHED_DEGREE + 1):
        scaled = degree * shares
        if np.abs(scaled - np.rint(scaled)).max() <= degree * error:
            return degree
    return None


def _powers(patch: Patch, max_degree: int) -> IntArray:
    """Return the exponents h_j(a_i) in whole steps, (n, r)."""
    shape = patch.domain
    rounding = KNOT_TOLERANCE * shape.size + 4 * EPS * float(np.abs(shape.knots).max())
    degrees = []
    for j, (heights, length) in enumerate(zip(shape.heights.T, shape.normal_lengths.tolist(), strict=True)):
        degree = bezier_degree(heights, rounding * length)
        where = "" if patch.dimension == 1 else f" from edge {j}"
        if degree is None:
            step = f"no common step, or one that makes degrees above {MAX_SEARCHED_DEGREE}"
            fault = f"has no Bézier pieces: the distances of the knots{where} have {step}"
            raise DomainError(f"{fault}. A mesh within `tolerance` is possible")
        if degree > max_degree:
            raise DomainError(
                f"has Bézier pieces of degree {degree} only: the distances of the knots{where}, as fractions of the "
                f"largest, have the common denominator {degree}, and at most {max_degree} is allowed (`max_degree`). "
                "A mesh within `tolerance` is also possible"
            )
        degrees.append(degree)
    if patch.dimension == 2:
        most = max((degrees[j - 1] + 1) * (degrees[j] + 1) for j in range(len(degrees)))
        if most > MAX_ELEVATED_KNOTS:
            found = f"has Bézier pieces of {most} control points each"
            raise DomainError(f"{found}, at most {MAX_ELEVATED_KNOTS} are allowed")
    return np.asarray(np.rint(shape.heights / (shape.heights.max(axis=0) / degrees)), dtype=np.int64)


def _halves(curve: Patch, s: float, max_degree: int) -> tuple[Patch, ...]:
    """Return the two parts of a curve that meet at a torus coordinate."""
    powers = _powers(curve, max_degree)
    degree = int(powers.max())
    # De Casteljau's weights are these times powers; the Bézier form is split at v = x/(1 + x).
    x = s * (float(np.ptp(curve.domain.vertices)) / degree)
    halves = []
    for end, place in enumerate(curve.domain.vertices[:, 0].tolist()):
        shifted = curve.replace(log_weights=curve.log_weights + (curve.knots[:, 0] - place) * s)
        logs, points = _bernstein(shifted, np.pad(powers[:, [end]], [(0, 0), (0, 1)]))
        logs = logs[:, 0] - np.logaddexp(0.0, x if end == 0 else -x) * np.arange(degree + 1)
        order = slice(None) if end == 0 else slice(None, None, -1)
        halves.append(_bezier(curve, np.arange(degree + 1.0)[:, None], logs[order], points[:, 0][order], f"piece{end}"))
    return tuple(halves)


def _bezier(patch: Patch, knots: FloatArray, logs: FloatArray, points: FloatArray, suffix: str) -> Patch:
    given = {"weights": np.exp(logs)} if np.abs(logs).max() < math.log(MAX_PLAIN_WEIGHT) else {"log_weights": logs}
    return Patch(knots, points, coefficients="binomial", name=f"{patch.name or 'patch'}-{suffix}", **given)


def _bernstein(patch: Patch, powers: IntArray) -> tuple[FloatArray, FloatArray]:
    """Write Σ c ω b s^k t^l, for (n, 2) powers k, l, in Bernstein form: log weights and control points.

    They are (D_1 + 1, D_2 + 1) and (D_1 + 1, D_2 + 1, 3); all terms are positive.
    """
    first, second = map(_conversion, powers.T)
    middle = (patch.control_points.min(axis=0) + patch.control_points.max(axis=0)) / 2
    centred = patch.control_points - middle
    logs = np.empty((len(first), len(second)))
    points = np.empty((*logs.shape, 3))
    for i, row in enumerate(first):
        terms = second + row + patch.log_products
        top = terms.max(axis=1, keepdims=True)
        shares = np.exp(terms - top)
        totals = shares.sum(axis=1)
        logs[i] = top[:, 0] + np.log(totals)
        points[i] = shares @ centred / totals[:, None] + middle
    # The corner is the mean of the control points of the knots there; a single control point is kept exactly.
    if len(at_corner := np.flatnonzero((powers == 0).all(axis=1))) == 1:
        points[0, 0] = patch.control_points[at_corner[0]]
    return logs, points


def _conversion(powers: IntArray) -> FloatArray:
    """Return logarithms of C(j, k)/C(D, k) for (n,) powers k, D the largest, (D + 1, n); −inf where k > j."""
    degree = int(powers.max())
    used, columns = np.unique(powers, return_inverse=True)
    table = np.full((degree + 1, len(used)), -np.inf)
    for column, k in enumerate(used.tolist()):
        whole = math.comb(degree, k)
        table[k:, column] = [math.log(math.comb(j, k) / whole) for j in range(k, degree + 1)]
    return table[:, columns]
