"""Lengths, areas and volumes of curves, surfaces and closed surfaces, by quadrature; of meshes: `meshes.measures`."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray, cross, dot, row_blocks
from gtb_cli.meshes.frame import Frame
from gtb_cli.models.model import Model
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.patch import Patch
from gtb_cli.theory.quadrature import quadrature
from gtb_cli.values import grouped


class Extent(NamedTuple):
    """A length, area or volume."""

    value: float
    error: float  # an estimate, and not a bound


def extents(shape: Patch | Model) -> dict[str, Extent]:
    """Return the length of curves; or the area of surfaces and, if they are closed, the volume inside, by name.

    What overflows is left out. Lengths are integrals between the vertices of a mesh within a tolerance, as steep
    weights bend a curve where even places miss it; areas and volumes by `quadrature`, of higher and higher order. Their
    error is three times the larger of the last two changes, and at least 1e-12 of the size.
    """
    if shape.dimension == 1:
        return _lengths(shape)
    joints = (shape if isinstance(shape, Model) else Model((shape,))).joints
    frame = Frame.around(*(patch.control_points for patch in shape.patches))
    values, errors = _all_integrals(shape.patches, frame)
    values[:, 1] *= np.where(joints.flipped, -1, 1)
    value, error = values.sum(axis=0), errors.sum(axis=0)
    error[1] += 4 * value[0] * frame.length(max((joint.distance for joint in joints.shared), default=0.0), -1)  # strips
    names = ["area", "volume"] if joints.closed else ["area"]
    error = np.maximum(error, 1e-12 * value[0])
    return _in_model_units(frame, {name: (value[k], error[k], k + 2) for k, name in enumerate(names)})


def coverage(patches: Sequence[Patch], frame: Frame) -> tuple[FloatArray, FloatArray]:
    """Return areas, or lengths, of patches in a frame, and integrals of e^{<w, x>} over them, (p, 2); and their errors.

    If two surfaces in the same place are covered equally often, then the sums of both are equal, however they are cut
    into patches; if not, then they are so only by chance. The weights are from 1/e to e.
    """
    values, errors = _all_integrals(patches, frame)
    return values[:, ::2], errors[:, ::2]


def _all_integrals(patches: Sequence[Patch], frame: Frame) -> tuple[FloatArray, FloatArray]:
    """Return the integrals of `_integrals` over some patches, (p, 3), and their errors; equal bases share a rule."""
    most = 2_500_000  # values of T_i, by the last rules of all patches together
    alike = grouped((patch.rational_basis, index) for index, patch in enumerate(patches))
    values, errors = np.zeros((2, len(patches), 3))
    for members in (some[k : k + 100] for some in alike.values() for k in range(0, len(some), 100)):
        nets = frame.inside(np.stack([patches[index].control_points for index in members]))
        values[members], errors[members] = _integrals(patches[members[0]], nets, most // len(alike))
    return values, errors


def _integrals(patch: Patch, nets: FloatArray, most: int) -> tuple[FloatArray, FloatArray]:
    """Return areas, volumes towards the origin, and weighted areas of (p, n, 3) nets of a patch, (p, 3); and errors.

    For curves, they are lengths, and the second says nothing.
    """
    orders = (8, 12, 16, 24, 32, 48, 64, 96, 128)
    sums, errors, rows = np.zeros((len(orders), len(nets), 3)), np.zeros((len(nets), 3)), np.arange(len(nets))
    for k, order in enumerate(orders):
        if not len(rows) or (k > 2 and 2 * len(patch.domain.vertices) * order**2 * len(patch.knots) > most):
            break
        sums[k:, rows] = _integrals_of(patch, nets[rows], order)
        if k > 1:
            errors[rows] = 3 * np.abs(np.diff(sums[k - 2 : k + 1, rows], axis=0)).max(axis=0)
            rows = rows[(errors[rows, :2] > 1e-9 * np.abs(sums[k, rows, :1])).any(axis=1)]
    return sums[-1], errors


def _integrals_of(patch: Patch, nets: FloatArray, order: int) -> FloatArray:
    """Return the integrals of `_integrals` by the rule of an order, (p, 3).

    In the linear parametrisation ∂S/∂p = Cov(b, a) Cov(a, a)⁻¹, with T_i as probabilities of knots a_i and points b_i:
    T is an exponential family. Where rounding leaves no determinant, as within 1e-14 of an edge, there is no area.
    """
    basis, rule, knots = patch.rational_basis, quadrature(patch, order), patch.domain.knots
    result = np.zeros((len(nets), 3))
    values = np.moveaxis(nets, 0, 1).reshape(len(knots), -1)
    for rows in row_blocks(len(rule.weights), max(1, 500_000 // max(len(knots), 3 * len(nets)))):
        p, weights = rule.parameters[rows], rule.weights[rows]
        t = basis.values(basis.locations(p, "linear"), len(p))
        offsets = [axis - own[:, None] for axis, own in zip(knots.T, p.T, strict=True)]
        u, v = t * offsets[0], t * offsets[-1]
        (uu, uv), vv = ((u * each).sum(axis=1) for each in (offsets[0], offsets[-1])), (v * offsets[-1]).sum(axis=1)
        points, across = (t @ values).reshape(-1, 3), (u @ values).reshape(-1, 3)
        determinant, product = (uu, 0.0) if patch.dimension == 1 else (uu * vv - uv**2, uu * vv)
        across = across if patch.dimension == 1 else cross(across, (v @ values).reshape(-1, 3))
        scale = weights / np.where(determinant > 1e-14 * product, determinant, np.inf)
        area, uneven = np.sqrt(dot(across, across)), np.exp(points @ (0.51, 0.33, 0.16))
        for column, each in enumerate((area, dot(points, across) / 3, area * uneven)):
            result[:, column] += scale @ each.reshape(len(p), -1)
    return result


def _lengths(shape: Patch | Model) -> dict[str, Extent]:
    """Return the length of curves, by Gauss's rule between the vertices of a mesh, and beside it of a coarser mesh."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    frame = Frame.around(*(patch.control_points for patch in shape.patches))
    sums = np.zeros(2)
    for patch in shape.patches:
        placed = patch.replace(control_points=frame.inside(patch.control_points))
        for k, tolerance in enumerate((1e-4, 1e-6)):  # in the frame
            mesh = tessellate(placed, tolerance=tolerance, normals=False)
            assert mesh.parameters is not None
            ends = np.sort(mesh.parameters.ravel())
            places = ends[:-1, None] + np.diff(ends)[:, None] * (nodes + 1) / 2
            slopes = placed.derivatives(places.ravel(), 1, "linear").reshape(-1, 3)
            sums[k] += np.sqrt(dot(slopes, slopes)) @ (np.diff(ends)[:, None] * weights / 2).ravel()
    return _in_model_units(frame, {"length": (sums[1], max(abs(sums[1] - sums[0]), 1e-9 * sums[1]), 1)})


def _in_model_units(frame: Frame, found: dict[str, tuple[float, float, int]]) -> dict[str, Extent]:
    """Return values and errors of the frame, with their dimensions, in model units; what overflows is left out."""
    scaled = {name: Extent(*frame.length(np.array(both), power).tolist()) for name, (*both, power) in found.items()}
    return {name: extent for name, extent in scaled.items() if np.isfinite(extent).all()}
