"""A second row of knots inside an edge for g2, the neighbour's curvature across it; `sides.met_with` decides on g2.

Row 1 has weights w₁ C(m − 1, j) at height ε over the edge, row 2 has w₂ C(m − 2, j) at 2 ε, both times the Bézier
weights of polars of the edge, and all else is at 3 ε or more. If V is the share of row 1 beside that of the edge, and
κ V² that of row 2, the patch is ``P + V (R₁ − P) + V² (κ (R₂ − P) − (R₁ − P)) + O(V³)``. R₁ − P lies in the tangent
plane. So the second fundamental form II is the neighbour's if and only if ``2 κ ⟨N, R₂ − P⟩ = II(R₁ − P, R₁ − P)``,
which is linear in row 2. All of II follows from the normal curvature across the edge, by ``II(P', v) = ⟨N, v'⟩`` for
fields v in the planes.
"""

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import DomainError
from gtb_cli.filling.sides import HoleSide, bernstein, binomials, edge_places, points_and_tangents, raised, stations
from gtb_cli.theory.curvature import curvatures_at
from gtb_cli.theory.patch import Patch

MIN_CROSSING = 1e-3  # of the mean length of a field: its component across an edge that it crosses
NEAREST = 1e-2  # relative size of singular values for a row that is not exact: nearer ones are far away
NULL = 1e-13  # relative size of singular values that are rounding: a field with one of them is in the planes


def polar(points: FloatArray) -> FloatArray:
    """Return the middles of neighbouring Bézier points: the polar of a curve at 1/2, which is in its tangent lines."""
    return np.asarray((points[:-1] + points[1:]) / 2)


def crosses(across: FloatArray) -> bool:
    """Tell whether a sum of fields crosses an edge everywhere: (f, 96) are components across it of fields about 1 long.

    The sum's is 1 on average. Those of fields along the edge are rounding.
    """
    factors = np.linalg.lstsq(across.T, np.ones(across.shape[1]), rcond=MIN_CROSSING**2)[0]
    return bool((factors @ across).min() > MIN_CROSSING and np.abs(across).max() > MIN_CROSSING**2)


def fields_by_height(values: FloatArray, normals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return orthonormal fields (k, m, 3), with (96, m) values of polynomials, and their relative normal components."""
    _, singular, basis = np.linalg.svd((values[:, :, None] * normals[:, None]).reshape(len(values), -1))
    heights = np.concatenate([singular, np.zeros(len(basis) - len(singular))]) / singular[0]
    return basis.reshape(len(basis), -1, 3), heights


class Rim:
    """A curve of (m + 1, 4) homogeneous Bézier points, with known normals, at the `stations`.

    There are (96, 3) points P, derivatives P', unit normals N and unit directions across, N × P'; (96,) weights; and
    ⟨N, P''⟩, `bend`.
    """

    def __init__(self, curve: FloatArray, normals: FloatArray) -> None:
        t, self.degree, self.normals = stations(), len(curve) - 1, normals
        self.weights = bernstein(self.degree, t) @ curve[:, 3]
        self.points, tangents = points_and_tangents(curve, t)
        self.rates = tangents * (self.degree / self.weights[:, None])
        self.across = np.cross(normals, self.rates / np.linalg.norm(self.rates, axis=1, keepdims=True))
        second = self.degree * (self.degree - 1) * bernstein(self.degree - 2, t) @ np.diff(curve, n=2, axis=0)
        self.bend = ((second[:, :3] - self.points * second[:, 3:]) * normals).sum(axis=1) / self.weights

    def parts(self, fields: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (…, 96) components a and g of (…, 96, 3) tangent vectors a P' + g across."""
        along = (fields * self.rates).sum(axis=-1) / (self.rates**2).sum(axis=1)
        return np.asarray(along), np.asarray((fields * self.across).sum(axis=-1))


def heights(vectors: FloatArray, rim: Rim) -> FloatArray:
    """Return (96,) ⟨N, X − ω P⟩ of (96, 4) homogeneous vectors (X, ω)."""
    return np.asarray(((vectors[:, :3] - rim.points * vectors[:, 3:]) * rim.normals).sum(axis=1))


def patch_bend(patch: Patch, edge: int, curve: FloatArray, normals: FloatArray) -> FloatArray:
    """Return (96,) normal curvatures across an edge of a patch, as limits at it; NaN where they are not finite.

    The curve is that of the edge, and the (96, 3) normals are the patch's, or opposite to them.
    """
    place, count = edge_places(patch, edge, stations()), len(normals)
    rim = Rim(curve, normals)
    signs = np.sign((patch.normals_at([place], count) * normals).sum(axis=1))
    mean = curvatures_at([patch], [place], count).mean[0]  # positive where the patch bends away from its normal
    return np.asarray(-2 * signs * mean - rim.bend / (rim.rates**2).sum(axis=1))


class SecondRow:
    """Row 2 of an edge as a quadratic function of row 1, up to fields in the tangent planes.

    Row 1 is the polar of the curve plus a sum of fields, (m, 3) Bézier points of weight 0, times factors. Row 2 has
    (m − 1,) products c ω, `weights`, times the square of the factor of row 1. Its (m − 1, 3) `tangential` shifts leave
    II as it is. `across` has (1 + f, 96) components of the polar and of the given fields across the edge.
    """

    def __init__(
        self, rim: Rim, curve: FloatArray, fields: list[FloatArray], bend: FloatArray, near_null: float = 1e-9
    ) -> None:
        # Rows below `near_null` are left out: multiples of them would be large, with data rounded in files.
        self.curve, self.fields, self._rim, self.bend = curve, fields, rim, bend
        self._near_null, t = near_null, stations()
        values, rates = bernstein(rim.degree - 1, t), (rim.degree - 1) * bernstein(rim.degree - 2, t)
        ways = [((0.5 - t) * rim.weights / rim.degree)[:, None] * rim.rates]  # to the polar, times its weights
        along, self.across = rim.parts(np.stack([*ways, *(values @ field for field in fields)]))
        mixed = [((rates @ np.diff(field, axis=0)) * rim.normals).sum(axis=1) for field in fields]
        self._along, self._mixed = along, np.stack([along[0] * rim.bend, *mixed])
        polars = polar(polar(curve))
        ratio = (rim.degree - 1) / (2 * rim.degree)  # w₂ / w₁²: that of Bézier triangles, so that polynomial rows exist
        self.weights = ratio * binomials(rim.degree - 2) * polars[:, 3]
        values = bernstein(rim.degree - 2, t)
        self._own = heights(values @ polars, rim)
        self._factor = 1 / (2 * ratio * rim.weights)
        self._matrix = (values[:, :, None] * rim.normals[:, None]).reshape(len(values), -1)
        left, singular, right = np.linalg.svd(self._matrix)
        rank = int((singular > near_null * singular[0]).sum())
        self._inverse = right[:rank].T / singular[:rank] @ left[:, :rank].T
        self.tangential = [row.reshape(-1, 3) for row in right[int((singular > NULL * singular[0]).sum()) :]]

    def chosen(self, factors: FloatArray) -> "SecondRow":
        """Return that of one sum of the fields."""
        field = np.tensordot(factors, self.fields, 1)
        return SecondRow(self._rim, self.curve, [field], self.bend, self._near_null)

    def shifts(self, factors: FloatArray) -> tuple[FloatArray, FloatArray, float]:
        """Return the (m − 1, 3) shift of row 2 from the polar of the polar, and its derivatives by the (f,) factors.

        The last is the error of II, relative to its largest terms: above rounding, this shift is only nearest to it.
        """
        f = np.concatenate([[1.0], factors])
        a, g, h = f @ self._along, f @ self.across, f @ self._mixed
        terms = self._along * h + a * self._mixed - self._along * a * self._rim.bend + self.across * g * self.bend
        wanted = (f @ terms) * self._factor - self._own
        shift = self._inverse @ wanted
        largest = np.abs(f[:, None] * terms * self._factor).max() + np.abs(self._own).max()
        error = np.abs(self._matrix @ shift - wanted).max() / (largest or 1.0)
        rates = 2 * terms[1:] * self._factor @ self._inverse.T
        return shift.reshape(-1, 3), rates.reshape(len(factors), -1, 3), float(error)


def strip_fields(rim: Rim, first: FloatArray, degree: int) -> list[FloatArray]:
    """Return rows A P' + b D₁ of a degree, (m, 3), with polynomials A and b, at an edge of a strip P + u D₁ + ….

    If the strip is polynomial, all of their sums have a row 2: 2 κ (R₂ − P) is A² P'' + 2 A b D₁' + b² D₂. `first` has
    the (d + 1, 3) Bézier points of D₁.
    """
    t, d = stations(), len(first) - 1
    along, across = bernstein(degree - d + 1, t).T, bernstein(degree - d, t).T
    ways = bernstein(d, t) @ first
    values = [*(along[:, :, None] * rim.rates), *(across[:, :, None] * ways)]
    return list(np.linalg.pinv(bernstein(rim.degree - 1, t)) @ values)


def osculating(side: HoleSide, normals: FloatArray, counts: range) -> SecondRow:
    """Return fields in the planes, and the row 2 that all of their sums have exactly, for the fewest raises.

    A field of degree e has a row 2 for some degrees m > e: of polynomial strips for m ≥ 2 e + 2 less the degree of the
    side. If none is exact, it is the nearest. Raises `DomainError` if no field crosses the edge.
    """
    exact = 1e-11  # of the terms of II, which are 100 times larger than their sum where sides are long and narrow
    assert side.bend is not None
    t, step = stations(), len(side.multiplier) - 1
    trial = np.random.default_rng(0)
    rounding, enough = 1e-9, 1e-3  # of curvatures of a patch, from its derivatives; nearer rows need more knots
    near = list[tuple[float, SecondRow]]()
    for count in counts:
        curve = raised(side.curve, count, side.multiplier)
        rim, most = Rim(curve, normals), len(curve) - 2
        if side.strip is not None:
            degree = (most - 1 + side.degree) // 2
            if degree >= side.degree:
                second = SecondRow(rim, curve, strip_fields(rim, side.strip, degree), side.bend)
                if crosses(second.across[1:]):
                    return second
            continue
        powers = range(count + 1) if step > 1 else range(1)
        for degree, power in ((e, p) for e in range(most, -1, -1) for p in powers if p * step <= e):
            # Fields of a lower degree, times a power of the side's weights, which divides those of the raised curve
            values = bernstein(degree - power * step, t)
            fields, height = fields_by_height(values, normals)
            found = [raised(field, power, side.multiplier) for field in fields[height <= NULL]]
            if not found:
                continue
            rows, factors = [raised(field, most - degree) for field in found], trial.normal(size=len(found))
            second = SecondRow(rim, curve, rows, side.bend)
            if not crosses(second.across[1:]):
                continue
            error = second.shifts(factors)[2]
            if error <= exact:
                return second
            if error > rounding:
                second = SecondRow(rim, curve, rows, side.bend, NEAREST)
                error = second.shifts(factors)[2]
            near.append((rounding if error <= rounding else max(error, enough), second))
        if near and min(error for error, _ in near) == rounding:
            break
    if near:
        return min(near, key=lambda each: each[0])[1]
    raise DomainError(
        f"{side.name}: no polynomial field of degree up to {most} follows its tangent planes and crosses it, as is "
        "needed for its neighbour's curvature: take continuity g1"
    )
