"""The properties that the paper proves: where it states them, and the functions that measure them."""

from typing import NamedTuple

from gtb_cli.checks import basis, curve, degeneration, ends, injectivity, lattice, surface
from gtb_cli.checks.probe import Measure


class Property(NamedTuple):
    """A property: where the paper states it for curves and for surfaces (None: not at all), and its measure.

    Patches with the same rational basis have the findings about properties `of_basis` in common.
    """

    name: str
    of_curves: str | None
    of_surfaces: str | None
    measure: Measure
    of_basis: bool = False


# Properties in the order in which they are reported
PROPERTIES = (
    Property("definition", "Def. 3.1", "Def. 4.1", basis.definition),
    Property("nonnegativity", "Thm 2.1 (a)", "Thm 2.3 (a)", basis.nonnegativity, of_basis=True),
    Property("partition of unity", "Thm 2.1 (b)", "Thm 2.3 (b)", basis.partition_of_unity, of_basis=True),
    Property("corners", "Thm 2.1 (d), Sec. 3 (b)", "Thm 2.3 (d), Sec. 4 (c)", basis.corners),
    Property("boundary curves", None, "Thm 2.3 (c), Thm 4.0", surface.boundaries),
    Property("convex hull", "Sec. 3 (a)", "Sec. 4 (a)", basis.hull),
    Property("affine invariance", "Sec. 3 (a)", "Sec. 4 (a)", basis.affine_invariance),
    Property("weights times coefficients", "eq. 202", "eq. 205", basis.products),
    Property("edge scale", "Remark 3.1", "Remark 3.1", basis.edge_scale),
    Property("classical Bézier", "Thm 2.1 (e), Sec. 3 (d)", "Thm 2.3 (e), Sec. 4 (b)", lattice.classical_bezier),
    Property("total positivity", "Thm 2.1 (c)", None, curve.total_positivity),
    Property("strict total positivity", "Thm 2.2", None, curve.strict_total_positivity),
    Property("progressive iteration", "Sec. 3 (c)", None, curve.progressive_iteration),
    Property("variation diminishing", "Thm 3.3", None, curve.variation_diminishing),
    Property("convexity", "Sec. 3 (i)", None, curve.convexity),
    Property("end tangents", "Sec. 3 (e)", None, ends.end_tangents),
    Property("end tangent lengths", "eq. 302", None, ends.end_tangent_lengths),
    Property("one weight to infinity", "Sec. 3 (g)", None, curve.one_weight),
    Property("isoparametric curves", None, "Sec. 4 (d)", surface.isoparametric_curves),
    Property("injective for all weights", None, "Craciun et al. 2010", injectivity.for_all_weights),
    Property("sign of the Jacobian", None, "Craciun et al. 2010", injectivity.jacobian_sign),
    Property("multiple knots", "Thm 3.1, Cor. 3.1", "Thm 4.1", degeneration.multiple_knots),
    Property("weights of the degeneration", "eq. 304", "eq. 403", degeneration.weights),
    Property("toric degeneration", "Thm 3.2", "Thm 4.2", degeneration.toric_degeneration),
    Property("linear precision", "Ex. 4.1", "Ex. 4.1", basis.linear_precision, of_basis=True),
    Property(
        "linear precision, linear parametrization",
        "Ex. 4.1",
        "Ex. 4.1",
        basis.linear_precision_of_linear,
        of_basis=True,
    ),
    Property("coefficients of unity", "eq. 8", "eq. 8", basis.coefficients_of_unity, of_basis=True),
)
