"""Properties of the basis, and properties that follow from it for curves and surfaces alike."""

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, IntArray
from gtb_cli.checks.description import description
from gtb_cli.checks.probe import VALUE_ROUNDINGS, Probe, largest, principal_axes
from gtb_cli.checks.report import Finding, at_most, not_applicable, number, within_rounding
from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.knots.hull import convex_hull
from gtb_cli.moment.solve import RESIDUAL
from gtb_cli.theory.basis import partition_of_unity_coefficients


def definition(probe: Probe) -> Finding:
    """Compare points with the definition, by its powers and without logarithms."""
    rows, whole, shares = probe.powers
    if not whole.any():
        return not_applicable("the powers of the definition are beyond the range of floats: exponents are too large")
    value = probe.distance(shares @ probe.patch.control_points, probe.points[rows][whole])
    return within_rounding(value, probe.distance_rounding, "largest distance from the sum of powers, of the extent")


def nonnegativity(probe: Probe) -> Finding:
    """Look for values below zero: rounding cannot make sums and quotients of exponentials negative."""
    return at_most(largest(-probe.basis), 0.0, "largest negative value of the basis")


def partition_of_unity(probe: Probe) -> Finding:
    """Compare the sums of the basis with 1."""
    bound = EPS * (VALUE_ROUNDINGS + len(probe.patch.knots))
    return at_most(largest(np.abs(probe.basis.sum(axis=1) - 1)), bound, "largest difference of the sum from 1")


def corners(probe: Probe) -> Finding:
    """Compare T with 1 for the knot at each corner; coincident knots share it in proportion c ω."""
    patch, domain = probe.patch, probe.patch.domain
    members = domain.faces.knots[domain.faces.corners]
    logs = np.where(members, patch.log_products, -np.inf)
    shares = np.exp(logs - logs.max(axis=1, keepdims=True))
    shares /= shares.sum(axis=1, keepdims=True)
    difference = largest(np.abs(patch.basis(domain.vertices) - shares))
    distance = probe.distance(patch.evaluate(domain.vertices), shares @ patch.control_points)
    simple = bool((members.sum(axis=1) == 1).all())
    reason = "largest difference of basis or point from its control point"
    if not simple:
        reason += "; copies of a corner's knot share it in proportion c ω"
    return within_rounding(max(difference, distance), 0.0 if simple else probe.distance_rounding, reason)


def hull(probe: Probe) -> Finding:
    """Measure how far points are outside the convex hull of the control points."""
    flat_width = 1e-9  # of the extent: narrower control points are flat, without a solid hull
    control = probe.patch.control_points
    middle = control.mean(axis=0)
    control, points = ((array - middle) / probe.extent for array in (control, probe.points))
    if not np.isfinite(points).all():
        return at_most(np.inf, probe.distance_rounding, "there are points that are not finite")
    axes = principal_axes(control)
    control, points = control @ axes.T, points @ axes.T
    below, above = control.min(axis=0) - points, points - control.max(axis=0)
    outside = [float(below.max()), float(above.max())]
    rank = int((np.ptp(control, axis=0) > flat_width).sum())
    if rank == 2:
        corners = control[convex_hull(control[:, :2]), :2]
        sides = np.roll(corners, -1, axis=0) - corners
        normals = np.column_stack([sides[:, 1], -sides[:, 0]]) / np.hypot(sides[:, 0], sides[:, 1])[:, None]
        outside.append(float((points[:, :2] @ normals.T - (normals * corners).sum(axis=1)).max()))
    elif rank == 3:
        from scipy.spatial import ConvexHull

        planes = ConvexHull(control).equations
        outside.append(float((points @ planes[:, :3].T + planes[:, 3]).max()))
    return within_rounding(
        max(0.0, *outside), probe.distance_rounding, "largest distance outside the hull, of the extent"
    )


def affine_invariance(probe: Probe) -> Finding:
    """Compare the image of the patch under an affine map with the patch of the mapped control points."""
    # Neither a rotation nor a scaling; its rows are no longer than 1.4
    affine_map = np.array([[0.6, -0.8, 0.3], [0.5, 0.9, -0.4], [-0.2, 0.7, 1.1]])
    affine_shift = np.array([1.5, -0.7, 0.4])  # in extents
    gain = 4.0  # roundings of a mapped point per rounding of a point: sums of three products, and lengths of 1.4
    shift = affine_shift * probe.extent
    mapped = probe.patch.replace(control_points=probe.patch.control_points @ affine_map.T + shift)
    value = probe.distance(probe.points_of(mapped), probe.points @ affine_map.T + shift)
    return within_rounding(value, gain * probe.distance_rounding, "largest distance after a sheared map, of the extent")


def products(probe: Probe) -> Finding:
    """Check that factors moved from the coefficients to the weights change nothing."""
    patch = probe.patch
    factor = np.where(np.arange(len(patch.knots)) % 2, 0.5, 2.0)
    with np.errstate(over="ignore", under="ignore"):
        weights, coefficients = patch.weights * factor, patch.coefficients / factor
    if not (np.isfinite(coefficients) & (coefficients > 0)).all():
        return not_applicable("coefficients are at the end of the range of floats")
    if (np.isfinite(weights) & (weights > 0)).all():
        moved = patch.replace(weights=weights, coefficients=coefficients)
    else:
        moved = patch.replace(log_weights=patch.log_weights + np.log(factor), coefficients=coefficients)
    value = probe.distance(probe.points_of(moved), probe.points)
    return within_rounding(
        value, probe.distance_rounding, "largest distance with factors moved from c to ω, of the extent"
    )


def edge_scale(probe: Probe) -> Finding:
    """Compare points with the points of other edge scales that have the same moments μ = Σ T_i a_i."""
    max_steepness = 1e6  # extents per size of the hull: steeper places would magnify the solver's error, `RESIDUAL`
    patch, domain = probe.patch, probe.patch.domain
    factors = np.resize([1.5, 0.7, 1.2, 0.8, 1.1], len(domain.vertices)) * np.asarray(patch.edge_scale)
    scaled = patch.replace(edge_scale=factors)
    u = linear_samples(probe, probe.inside)
    shares = scaled.basis(u)
    moments = domain.center + shares @ (domain.knots - domain.center)
    depth = (domain.heights_of_columns(moments) / domain.normal_lengths[:, None]).min(axis=0)
    steepness = _steepness(probe, shares)
    well = (steepness <= max_steepness) & (depth > probe.knot_rounding * domain.size)
    if not well.any():
        return not_applicable("at each sample one knot has nearly all of T: moments do not tell points apart")
    moments = moments[well]
    points = patch.points_at(probe.linear.locations(moments), len(moments))
    error = RESIDUAL + probe.knot_rounding + EPS * len(patch.knots)
    bound = 2 * probe.distance_rounding + float(steepness[well].max()) * error
    value = probe.distance(scaled.evaluate(u[well]), points)
    return within_rounding(value, bound, "largest distance of points with other scales from the patch, of the extent")


def _steepness(probe: Probe, shares: FloatArray) -> FloatArray:
    """Return (m,) rates at which points move with the moments at (m, n) values of T: extents per size of the hull.

    ∂P/∂μ = Cov_T(b, a) Cov_T(a, a)⁻¹.
    """
    domain = probe.patch.domain
    knots = (domain.knots - domain.center) / domain.size
    control = (probe.patch.control_points - probe.patch.control_points[0]) / probe.extent
    deviations = knots - (shares @ knots)[:, None]
    weighted = shares[:, :, None] * deviations
    square = np.einsum("mik,mil->mkl", weighted, deviations)
    mixed = np.einsum("mik,il->mkl", weighted, control)
    if domain.dimension == 1:
        gradients = mixed / np.maximum(square, np.finfo(float).tiny)
    else:
        determinant = square[:, 0, 0] * square[:, 1, 1] - square[:, 0, 1] ** 2
        adjugate = np.stack([square[:, 1, 1], -square[:, 0, 1], -square[:, 0, 1], square[:, 0, 0]], axis=1)
        gradients = adjugate.reshape(-1, 2, 2) @ mixed / np.maximum(determinant, np.finfo(float).tiny)[:, None, None]
        flat = determinant <= VALUE_ROUNDINGS * EPS * (square[:, 0, 0] * square[:, 1, 1])
        gradients[flat] = np.inf
    return np.asarray(np.nan_to_num(np.sqrt((gradients**2).sum(axis=(1, 2))), nan=np.inf))


def linear_precision(probe: Probe) -> Finding:
    """Measure how far the toric parametrisation is from linear."""
    error = description(probe.patch).linear_precision_error / probe.patch.domain.size
    return number(error, "largest |Σ T_i a_i − u| in the toric parametrization, of the hull's size")


def linear_precision_of_linear(probe: Probe) -> Finding:
    """Compare the patch with its knots as control points, in the linear parametrisation, with the identity."""
    patch, domain = probe.patch, probe.patch.domain
    knots = np.zeros((len(patch.knots), 3))
    knots[:, : domain.dimension] = (domain.knots - domain.center) / domain.size
    p = linear_samples(probe, np.arange(len(probe.u)))
    try:
        images = patch.replace(control_points=knots).points_at(probe.linear.locations(p), len(p))
    except ToleranceError as error:
        return Finding("fails", None, None, str(error))
    expected = np.zeros_like(images)
    expected[:, : domain.dimension] = (p - domain.center) / domain.size
    value = largest(np.abs(images - expected))
    bound = RESIDUAL + probe.knot_rounding + EPS * len(patch.knots)
    return within_rounding(value, bound, "largest |Σ T_i a_i − p| in the linear parametrization, of the hull's size")


def linear_samples(probe: Probe, rows: IntArray) -> FloatArray:
    """Return (m, d) parameters, at most 300 of the given rows, spread over them."""
    return np.asarray(probe.u[rows[:: -(-len(rows) // 300)]])


def coefficients_of_unity(probe: Probe) -> Finding:
    """Solve (8); nothing guarantees that the solution is positive."""
    max_system_knots = 300  # largest number of knots for which the dense system (8) is solved
    domain = probe.patch.domain
    if probe.repetitions:
        return not_applicable("repeated knots make the system singular")
    if len(domain.knots) > max_system_knots:
        return not_applicable(f"solved for at most {max_system_knots} knots")
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            c = partition_of_unity_coefficients(domain)
    except DomainError as error:
        return number(None, str(error).removeprefix("coefficients: "))
    return number(float(c.min()), "smallest of the coefficients, which are all positive")
