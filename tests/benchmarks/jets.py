"""Taylor polynomials of third order in two variables, and how a surface bends whose polynomials these are.

A jet is an array (10, …) of the coefficients of u^i v^j, i + j ≤ 3, in the order of `POWERS`.
"""

from math import factorial

import numpy as np

from gtb_cli.fairing.variation import Bending

POWERS = [(i, total - i) for total in range(4) for i in range(total + 1)]
INDEX = {power: k for k, power in enumerate(POWERS)}
FACTORIALS = np.array([factorial(i) * factorial(j) for i, j in POWERS], dtype=float)


def variables(places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The jets (10, m) of both coordinates at (m, 2) places."""
    u, v = np.zeros((2, len(POWERS), len(places)))
    u[0], v[0] = places.T
    u[INDEX[1, 0]] = v[INDEX[0, 1]] = 1
    return u, v


def constant(value: float, like: np.ndarray) -> np.ndarray:
    jet = np.zeros_like(like)
    jet[0] = value
    return jet


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    found = np.zeros(np.broadcast_shapes(a.shape, b.shape))
    for (i, j), k in INDEX.items():
        for (p, q), other in INDEX.items():
            if i + j + p + q <= 3:
                found[INDEX[i + p, j + q]] += a[k] * b[other]
    return found


def quotient(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    found = np.zeros(np.broadcast_shapes(a.shape, b.shape))
    for (i, j), k in INDEX.items():
        rest = a[k] - sum(
            b[INDEX[p, q]] * found[INDEX[i - p, j - q]]
            for p in range(i + 1)
            for q in range(j + 1)
            if p + q  # found[k] itself is the term without
        )
        found[k] = rest / b[0]
    return found


def bending(jets: np.ndarray, areas: np.ndarray) -> Bending:
    """Integrals over a surface with jets (10, m, 3) at places that stand for (m,) areas of its domain."""

    def rate(jet: np.ndarray, i: int, j: int) -> np.ndarray:
        """A derivative's jet, right up to the order that is left."""
        found = np.zeros_like(jet)
        for (p, q), k in INDEX.items():
            if p >= i and q >= j:
                target = INDEX[p - i, q - j]
                found[target] = jet[k] * FACTORIALS[k] / FACTORIALS[target]
        return found

    def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.asarray(product(a, b).sum(axis=-1))

    u, v = rate(jets, 1, 0), rate(jets, 0, 1)
    normal = np.stack(
        [product(u[..., i], v[..., j]) - product(u[..., j], v[..., i]) for i, j in ((1, 2), (2, 0), (0, 1))], axis=-1
    )
    g, h, k = dot(u, u), dot(u, v), dot(v, v)
    first, mixed, second = (dot(rate(jets, i, 2 - i), normal) for i in (2, 1, 0))
    det = product(g, k) - product(h, h)
    numerator = product(first, k) - 2 * product(mixed, h) + product(second, g)
    mean = numerator[0] / (2 * det[0] ** 1.5)
    slope_u, slope_v = (
        numerator[at] / (2 * det[0] ** 1.5) - 1.5 * mean * det[at] / det[0] for at in (INDEX[1, 0], INDEX[0, 1])
    )
    gauss = (first[0] * second[0] - mixed[0] ** 2) / det[0] ** 2
    variation = (k[0] * slope_u**2 - 2 * h[0] * slope_u * slope_v + g[0] * slope_v**2) / det[0]
    spaces = areas * np.sqrt(det[0])
    sums = np.array([np.ones_like(mean), 4 * mean**2 - 2 * gauss, variation]) @ spaces
    largest = np.abs(mean) + np.sqrt(np.maximum(mean**2 - gauss, 0))
    return Bending(float(sums[0]), float(sums[1]), float(sums[0] * sums[2]), float(largest.max()))


def normals(jets: np.ndarray) -> np.ndarray:
    """(m, 3) unit normals."""
    found = np.cross(jets[INDEX[1, 0]], jets[INDEX[0, 1]])
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))
