"""Points and weights for integrals over Δ of functions that, like T_i, are powers of the distance from its boundary."""

from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray, planar_cross
from gtb_cli.errors import DomainError
from gtb_cli.theory.patch import Patch


class Quadrature(NamedTuple):
    """A rule ``∫ f ≈ Σ_q weights_q f(parameters_q)`` over Δ: (m, d) parameters inside, and (m,) positive weights."""

    parameters: FloatArray
    weights: FloatArray


def quadrature(patch: Patch, order: int = 24) -> Quadrature:
    """Return points and weights in Δ that integrate T_i, their products and derivatives.

    Each edge and the middle of Δ span a triangle, which is halved; in each half, which has one corner of Δ, points are
    ``(1 − r) corner + r ((1 − φ) middle of the edge + φ middle of Δ)``, where r and φ are fifth powers of the nodes of
    Gauss's rule with `order` points. For a curve, each half is cut so.

    Parameters
    ----------
    patch : Patch
        Only its domain counts.
    order : int
        1 to 256: nodes in each direction; there are 2 r order² points over a domain with r edges, 2 order on a curve.

    Returns
    -------
    Quadrature
        ``rule.parameters`` for `Patch.evaluate`, `Patch.basis` and their derivatives in either parametrisation, and
        ``rule.weights``, in the units of the knots to the power d. Their sum is the measure of Δ.

    Raises
    ------
    DomainError
        The order is not a whole number from 1 to 256.

    Notes
    -----
    For f that is a smooth function times h^α near an edge (h the distance from it, α > −1), or times r^β near a corner
    (r the distance, β > −2), the error falls like ``order^(−10 (α + 1))`` and ``order^(−10 (β + 2))``, down to rounding
    and to the strip along the boundary that floats cannot tell from it. Polynomials of degree 2 order/5 − 2 are exact.

    Take the linear parametrisation for areas and stiffness: there first derivatives are bounded near edges. In the
    toric one they grow like h^(δ − 1), δ < 1 the next layer's height: with small δ, much of the area is in that strip.
    """
    if isinstance(order, bool) or not isinstance(order, int | np.integer) or not 1 <= order <= 256:
        raise DomainError(f"order: expected a whole number from 1 to 256, got {order!r}")
    shape = patch.domain
    nodes, gauss = np.polynomial.legendre.leggauss(int(order))
    y = (1 + nodes) / 2
    power = 5  # of the nodes, that is the distance from an edge or corner
    distance, steps = y**power, gauss / 2 * power * y ** (power - 1)
    v, middle = shape.vertices, shape.vertices.mean(axis=0)
    if shape.dimension == 1:
        places, weights = v[:, None] + distance[:, None] * (middle - v)[:, None], np.tile(steps * shape.size / 2, 2)
    else:
        following = np.roll(v, -1, axis=0)
        corners = np.concatenate([v, following])
        along, inwards = np.tile((v + following) / 2, (2, 1)) - corners, middle - corners
        r, phi = distance[:, None, None], distance[:, None]
        places = corners[:, None, None] + r * ((1 - phi) * along[:, None, None] + phi * inwards[:, None, None])
        weights = (np.abs(planar_cross(along, inwards))[:, None, None] * (steps * distance)[:, None] * steps).ravel()
    places = places.reshape(-1, shape.dimension)
    # Places that floats cannot tell from an edge move towards the middle, until they can. Their distances are found by
    # differences, as a sum over all coordinates would lose digits far from the origin.
    inward = shape.normals / shape.normal_lengths[:, None]
    distances, farthest = (
        np.stack([(at - corner) @ normal for corner, normal in zip(v, inward, strict=True)], axis=1)
        for at in (places, middle[None])
    )
    lacking = np.maximum(4 * shape.tolerance - distances, 0.0)
    return Quadrature(places + (lacking / farthest).max(axis=1, keepdims=True) * (middle - places), weights)
