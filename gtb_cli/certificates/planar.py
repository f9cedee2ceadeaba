"""Certificates of patches whose control points are in a plane, and lie there in the order of the knots.

With the determinants [ijk] of the knots, and of the control points, the Jacobian of P by the torus coordinates is
``Σ T_i T_j T_k [a_i a_j a_k] [b_i b_j b_k]``, summed over all triples. Where no product is negative, P nowhere turns
back (G. Craciun, L. García-Puente, F. Sottile, Some geometrical aspects of control points for toric patches, 2010).
"""

from fractions import Fraction
from functools import cached_property
from itertools import combinations

import numpy as np

from gtb_cli.arrays import EPS, BoolArray, FloatArray
from gtb_cli.certificates.curve import CurveCertificate
from gtb_cli.certificates.deadline import Deadline
from gtb_cli.theory.edges import edge_curve
from gtb_cli.theory.patch import Patch


class PlanarCertificate:
    """Proofs that the triangles of a plane patch are together within a tolerance of it.

    Neither the patch nor the mesh turns back. So each winds at least once around its points, and the other one winds as
    often around those that are not between the two boundaries, and holds them. Only the boundary needs a tolerance.
    """

    def __init__(self, patch: Patch, deadline: Deadline) -> None:
        points, max_knots = patch.control_points, 40  # with more, there are too many triples
        self.patch, self.middle, self.deadline = patch, points.mean(axis=0), deadline
        axes = np.linalg.svd(points - self.middle, full_matrices=False)[2]
        self.plane = axes[:2].T
        self.height = float(np.abs((points - self.middle) @ axes[2]).max() + 16 * EPS * np.abs(points).max())
        self.turn = 0.0  # 1 or −1 if the patch does not turn back
        if len(points) <= max_knots:
            triples = np.array(list(combinations(range(len(points)), 3)))
            apart = ~patch.domain.incidence[triples].all(axis=1).any(axis=1)  # knots on one edge are so to all digits
            signs = apart * _turns(patch.knots[triples]) * _turns(((points - self.middle) @ self.plane)[triples])
            self.turn = float(np.sign(signs.min() + signs.max()))  # 0 with both signs

    def serves(self, tolerance: float) -> bool:
        """Tell whether the patch does not turn back, and is so nearly plane that its boundary decides."""
        return bool(self.turn) and self.height <= tolerance / 10

    def failing(self, u: FloatArray, corners: FloatArray, tolerance: float) -> BoolArray:
        """Mark triangles that turn back, or have sides on the boundary that are not certain to be near its curves.

        They have (k, 3, 2) corners in Δ, and (k, 3, 3) in the mesh.
        """
        fails = np.asarray(_turns(u) * _turns((corners - self.middle) @ self.plane) * self.turn < 0)
        shape = self.patch.domain
        is_on = (shape.heights_of_columns(u.reshape(-1, 2)) == 0).reshape(-1, *u.shape[:2])
        # Of the part of the boundary between both planes' places, the rest of the tolerance is left along the plane.
        left = tolerance - 2 * self.height
        for edge, on in enumerate(is_on & np.roll(is_on, -1, axis=2)):
            row, side = np.nonzero(on)
            ends = row[:, None], np.column_stack([side, (side + 1) % 3])
            length = shape.along(edge, np.roll(shape.vertices, -1, axis=0)[edge : edge + 1])
            curve = self._curves[edge]
            s = curve.torus_coordinates(np.clip(shape.along(edge, u[ends].reshape(-1, 2)) / length, 0, 1))
            chords, s = corners[ends], s.reshape(-1, 2)
            order = np.argsort(s, axis=1), np.arange(len(s))[:, None]
            fails[row[curve.failing(s[order[::-1]], chords[order[::-1]], left)]] = True
        return fails

    @cached_property
    def _curves(self) -> list[CurveCertificate]:
        curves = [edge_curve(self.patch, edge) for edge in range(len(self.patch.domain.vertices))]
        return [
            CurveCertificate(Patch(each.knots, each.points, log_weights=each.log_weights), self.deadline)
            for each in curves
        ]


def _turns(corners: FloatArray) -> FloatArray:
    """(m,) signs of the determinants of (m, 3, 2) triangles, exact."""
    first, second = (np.diff(corners[:, [0, k]], axis=1)[:, 0] for k in (1, 2))
    products = first * second[:, ::-1]
    signs = np.sign(products[:, 0] - products[:, 1])
    for row in np.flatnonzero(np.abs(products[:, 0] - products[:, 1]) <= 8 * EPS * np.abs(products).sum(axis=1)):
        (ax, ay), (bx, by), (cx, cy) = ([Fraction(x) for x in corner] for corner in corners[row].tolist())
        exact = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        signs[row] = (exact > 0) - (exact < 0)
    return np.asarray(signs)
