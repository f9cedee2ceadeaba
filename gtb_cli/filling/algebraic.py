"""The quadric, cubic or quartic on which sides of a hole lie with their planes; where there is one, fills follow it."""

from collections.abc import Callable, Sequence
from functools import partial
from itertools import product

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.filling.sides import points_and_tangents, stations
from gtb_cli.filling.tangent_rows import EdgeRows


def ways_to_surface(edges: Sequence[EdgeRows]) -> Callable[[FloatArray], FloatArray] | None:
    """Find F of least degree that has the curves and planes of all edges of a hole of size 1, if there is one.

    Return the function that returns (m, 3) ways from (m, 3) points near its zeros to them, along gradients. F has the
    least Σ F² + ⟨∇F, N × T⟩², T the tangent, for a given Σ ⟨∇F, N⟩².
    """
    apart = 1e-3  # singular values of it and of others: what it may be off inside, of the hole's size
    least_slope = 0.1  # of the largest slope across: with less, the surface is singular near an edge
    rounding = 1e-10  # of singular values
    each = slice(None, None, 4)  # of the stations, which are more than such a surface needs
    given = [edge.normals[each] for edge in edges if edge.normals is not None]
    if len(given) < len(edges):
        return None
    at = [points_and_tangents(edge.curve, stations()[each]) for edge in edges]
    points, tangents, normals = (np.concatenate(part) for part in (*zip(*at, strict=True), given))
    across = np.cross(normals, tangents / np.linalg.norm(tangents, axis=1, keepdims=True))
    for degree in (2, 3, 4):  # that of a torus
        powers = np.array([p for p in product(range(degree + 1), repeat=3) if sum(p) <= degree])
        # Of each monomial, along each axis, the factors of others in its derivative
        rates = np.stack([powers[:, k] * (powers - powers[:, None] == e).all(axis=2) for k, e in enumerate(np.eye(3))])
        value = _monomials(points, powers)
        along, rise = (sum(way[:, [k]] * (value @ rates[k]) for k in range(3)) for way in (across, normals))
        table, singular, basis = np.linalg.svd(np.concatenate([value, along, rise]), full_matrices=False)
        if singular[-1] <= rounding * singular[0]:  # F that vanish twice on all edges, as a plane's square
            return None
        _, off, best = np.linalg.svd(table[: -len(rise)], full_matrices=False)
        factors = (best[-1] / singular) @ basis
        rises = rise @ factors
        if off[-1] <= apart * off[-2] and np.min(rises * np.sign(rises.sum())) > least_slope * np.abs(rises).max():
            return partial(_ways, powers, np.stack([factors, *(rates @ factors)], axis=1))
    return None


def _ways(powers: IntArray, factors: FloatArray, points: FloatArray) -> FloatArray:
    """Return the ways from points to zeros of a sum of monomials, given (k, 4) factors of its and its slopes'."""
    found = points
    for _ in range(3):  # of Newton's method, which has converged then
        value, *slope = (_monomials(found, powers) @ factors).T
        with np.errstate(all="ignore"):  # where it has no gradient, NaN is far away
            found = found - (value / np.square(slope).sum(axis=0) * np.array(slope)).T
    return found - points


def _monomials(points: FloatArray, powers: IntArray) -> FloatArray:
    """Return (m, k) monomials with (k, 3) powers of (m, 3) points."""
    x, y, z = (axis ** np.arange(powers.max() + 1)[:, None] for axis in points.T)
    return np.asarray((x[powers[:, 0]] * y[powers[:, 1]] * z[powers[:, 2]]).T)
