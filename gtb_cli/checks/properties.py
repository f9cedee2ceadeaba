"""The properties that the paper proves, each with the function that measures it on a patch or model."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple, overload

from gtb_cli.checks import basis_checks, ends, injectivity, limit_checks, reductions, total_positivity
from gtb_cli.checks.joint_checks import joint_findings
from gtb_cli.checks.probe import Probe
from gtb_cli.checks.report import Finding, ModelReport, Report, not_decided
from gtb_cli.errors import GtbError, ToleranceError
from gtb_cli.language.spec_paths import SpecPath, loaded
from gtb_cli.models.model import Model
from gtb_cli.theory.patch import Patch


class Property(NamedTuple):
    """A property: where the paper states it for curves and for surfaces (None: not at all), and its measure."""

    name: str
    of_curves: str | None
    of_surfaces: str | None
    measure: Callable[[Probe], Finding]


# Properties in the order in which they are reported
PROPERTIES = (
    Property("definition", "Def. 3.1", "Def. 4.1", basis_checks.definition),
    Property("nonnegativity", "Thm 2.1 (a)", "Thm 2.3 (a)", basis_checks.nonnegativity),
    Property("partition of unity", "Thm 2.1 (b)", "Thm 2.3 (b)", basis_checks.partition_of_unity),
    Property("corners", "Thm 2.1 (d), Sec. 3 (b)", "Thm 2.3 (d), Sec. 4 (c)", basis_checks.corners),
    Property("boundary curves", None, "Thm 2.3 (c), Thm 4.0", reductions.boundary_curves),
    Property("convex hull", "Sec. 3 (a)", "Sec. 4 (a)", basis_checks.hull),
    Property("affine invariance", "Sec. 3 (a)", "Sec. 4 (a)", basis_checks.affine_invariance),
    Property("weights times coefficients", "eq. 202", "eq. 205", basis_checks.products),
    Property("edge scale", "Remark 3.1", "Remark 3.1", basis_checks.edge_scale),
    Property("classical Bézier", "Thm 2.1 (e), Sec. 3 (d)", "Thm 2.3 (e), Sec. 4 (b)", reductions.classical_bezier),
    Property("total positivity", "Thm 2.1 (c)", None, total_positivity.total_positivity),
    Property("strict total positivity", "Thm 2.2", None, total_positivity.strict_total_positivity),
    Property("progressive iteration", "Sec. 3 (c)", None, total_positivity.progressive_iteration),
    Property("variation diminishing", "Thm 3.3", None, total_positivity.variation_diminishing),
    Property("convexity", "Sec. 3 (i)", None, total_positivity.convexity),
    Property("end tangents", "Sec. 3 (e)", None, ends.end_tangents),
    Property("end tangent lengths", "eq. 302", None, ends.end_tangent_lengths),
    Property("one weight to infinity", "Sec. 3 (g)", None, limit_checks.one_weight),
    Property("isoparametric curves", None, "Sec. 4 (d)", reductions.isoparametric_curves),
    Property("injective for all weights", None, "Craciun et al. 2010", injectivity.for_all_weights),
    Property("sign of the Jacobian", None, "Craciun et al. 2010", injectivity.jacobian_sign),
    Property("multiple knots", "Thm 3.1, Cor. 3.1", "Thm 4.1", reductions.multiple_knots),
    Property("weights of the degeneration", "eq. 304", "eq. 403", limit_checks.weights),
    Property("toric degeneration", "Thm 3.2", "Thm 4.2", limit_checks.toric_degeneration),
    Property("linear precision", "Ex. 4.1", "Ex. 4.1", basis_checks.linear_precision),
    Property("linear precision, linear parametrization", "Ex. 4.1", "Ex. 4.1", basis_checks.linear_precision_of_linear),
    Property("coefficients of unity", "eq. 8", "eq. 8", basis_checks.coefficients_of_unity),
)


@overload
def check(shape: Patch) -> Report: ...
@overload
def check(shape: Model) -> ModelReport: ...
@overload
def check(shape: SpecPath) -> Report | ModelReport: ...
def check(shape: Patch | Model | SpecPath) -> Report | ModelReport:
    """Measure every property the paper proves, on a patch, or on each patch of a model and at the joints between them.

    The parameters are fixed, so that the same patch gives the same numbers. Bounds are what rounding may do: they grow
    with the exponents, and with the distance of knots and control points from the origin relative to their extent.
    If a property holds only under conditions, whether the paper states them or not, it is "not applicable" to a patch
    that does not fulfil them; what rounding hides is "not decided". A few dozen knots take less than 0.2 s.
    """
    found: Patch | Model = loaded(shape, Patch, Model)
    if isinstance(found, Model):
        return ModelReport(found.name, tuple(map(check_patch, found)), joint_findings(found))
    return check_patch(found)


def check_patch(patch: Patch) -> Report:
    """Measure every property on a patch; see `check`."""
    probe, findings = Probe(patch), []
    for name, of_curves, of_surfaces, measure in PROPERTIES:
        reference = of_curves if patch.dimension == 1 else of_surfaces
        if reference is not None:
            findings.append(replace(_measured(measure, probe), name=name, reference=reference))
    return Report(patch.name, tuple(findings))


def _measured(measure: Callable[[Probe], Finding], probe: Probe) -> Finding:
    """Measure a property; it is not decided where rounding decides, also of knots that count as on an edge."""
    try:
        found = measure(probe)
        if found.status == "fails" and measure(probe.sharpened()).status != "fails":
            return not_decided(f"knots that are off an edge, within the tolerance, count as on it: {found.reason}")
    except ToleranceError as error:
        return not_decided(f"could not be measured: {error}")
    except GtbError as error:
        return Finding("fails", None, None, f"could not be measured: {error}")
    return found
