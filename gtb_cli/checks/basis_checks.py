"""Properties of the basis, and properties that follow from it for curves and surfaces alike."""

import numpy as np

from gtb_cli.arrays import EPS
from gtb_cli.checks.probe import VALUE_ROUNDINGS, Probe, largest, points_at_torus
from gtb_cli.checks.report import Finding, at_most, not_applicable, number, within_rounding
from gtb_cli.errors import DomainError
from gtb_cli.moment.solve import RESIDUAL
from gtb_cli.theory.basis import torus_coordinates, unity_coefficients


def definition(probe: Probe) -> Finding:
    """Compare points with the definition, by its powers in long doubles and without logarithms."""
    patch, exponents = probe.patch, probe.patch.domain.heights.astype(np.longdouble)
    rows = slice(None, None, -(-probe.heights.shape[1] * exponents.size // 1_000_000))  # for the time of long doubles
    with np.errstate(all="ignore"):
        # 0**0 is 1, and 0 to any positive power is 0.
        powers = (probe.heights.T[rows, None, :].astype(np.longdouble) ** exponents).prod(axis=2)
        beta = np.exp(patch.log_products.astype(np.longdouble)) * powers
        total = beta.sum(axis=1)
        # If the largest is near the end of the range, others that matter may be beyond it.
        whole = np.isfinite(total) & (beta.max(axis=1) * EPS**2 > np.finfo(np.longdouble).tiny)
        shares = (beta / total[:, None])[whole].astype(np.float64)
    if not whole.any():
        return not_applicable("the powers of the definition are beyond the range of floats: exponents are too large")
    value = probe.distance(shares @ patch.control_points, probe.points[rows][whole])
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
    if not np.isfinite(probe.points).all():
        return at_most(np.inf, probe.distance_rounding, "there are points that are not finite")
    control, points = probe.along_principal_axes(probe.patch.control_points, probe.points)
    outside = [(control.min(axis=0) - points).max(), (points - control.max(axis=0)).max()]
    rank = int((np.ptp(control, axis=0) > flat_width).sum())
    if rank > 1:
        from scipy.spatial import ConvexHull

        planes = ConvexHull(control[:, :rank]).equations
        outside.append((points[:, :rank] @ planes[:, :-1].T + planes[:, -1]).max())
    value = max(0.0, *map(float, outside))
    return within_rounding(value, probe.distance_rounding, "largest distance outside the hull, of the extent")


def affine_invariance(probe: Probe) -> Finding:
    """Compare the image of the patch under an affine map with the patch of the mapped control points."""
    # Neither a rotation nor a scaling; its rows are no longer than 1.4
    affine_map = np.array([[0.6, -0.8, 0.3], [0.5, 0.9, -0.4], [-0.2, 0.7, 1.1]])
    shift = np.array([1.5, -0.7, 0.4]) * probe.extent
    gain = 4.0  # roundings of a mapped point per rounding of a point: sums of three products, and lengths of 1.4
    mapped = probe.patch.replace(control_points=probe.patch.control_points @ affine_map.T + shift)
    value = probe.distance(mapped.evaluate(probe.u), probe.points @ affine_map.T + shift)
    return within_rounding(value, gain * probe.distance_rounding, "largest distance after a sheared map, of the extent")


def products(probe: Probe) -> Finding:
    """Check that factors moved between weights and coefficients change nothing."""
    coefficients = np.where(np.arange(len(probe.patch.knots)) % 2, 0.7, 2.0)
    log_weights = probe.patch.log_products - np.log(coefficients)
    moved = probe.patch.replace(coefficients=coefficients, log_weights=log_weights)
    value, bound = probe.distance(moved.evaluate(probe.u), probe.points), probe.distance_rounding
    return within_rounding(value, bound, "largest distance with factors moved between c and ω, of the extent")


def edge_scale(probe: Probe) -> Finding:
    """Compare points under other edge scales with points of the patch at the same torus coordinates."""
    patch, u = probe.patch, probe.u[probe.inside]
    factors = np.resize([1.5, 0.7, 1.2, 0.8, 1.1], len(patch.domain.vertices)) * np.asarray(patch.edge_scale)
    scaled = patch.replace(edge_scale=factors)
    s = torus_coordinates(scaled.domain, scaled.domain.heights_of_columns(u))
    value, bound = probe.distance(scaled.evaluate(u), points_at_torus(patch, s)), 4 * probe.distance_rounding
    return within_rounding(value, bound, "largest distance of points with other scales from the patch, of the extent")


def linear_precision(probe: Probe) -> Finding:
    """Measure how far the toric parametrisation is from linear."""
    domain = probe.patch.domain
    offsets = probe.basis @ (domain.knots - domain.center) - (probe.u - domain.center)
    error = largest(np.sqrt((offsets**2).sum(axis=1))) / domain.size
    return number(error, "largest |Σ T_i a_i − u| in the toric parametrization, of the hull's size")


def linear_precision_of_linear(probe: Probe) -> Finding:
    """Compare the patch with its knots as control points, in the linear parametrisation, with the identity."""
    domain, p = probe.patch.domain, probe.u[:: -(-len(probe.u) // 100)]
    missing = [(0, 0), (0, 3 - domain.dimension)]
    knots, expected = (np.pad((each - domain.center) / domain.size, missing) for each in (domain.knots, p))
    images = probe.patch.replace(control_points=knots).evaluate(p, "linear")
    bound = RESIDUAL + probe.knot_rounding + EPS * len(knots)
    reason = "largest |Σ T_i a_i − p| in the linear parametrization, of the hull's size"
    return within_rounding(largest(np.abs(images - expected)), bound, reason)


def coefficients_of_unity(probe: Probe) -> Finding:
    """Solve (8); nothing guarantees that the solution is positive."""
    most = 300  # knots for which the dense system (8) is solved
    domain = probe.patch.domain
    if probe.merged is not probe.patch:
        return not_applicable("repeated knots make the system singular")
    if len(domain.knots) > most:
        return not_applicable(f"solved for at most {most} knots")
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            c = unity_coefficients(domain)
    except DomainError as error:
        return number(None, str(error).removeprefix("coefficients: "))
    return number(float(c.min()), "smallest of the coefficients, which are all positive")
