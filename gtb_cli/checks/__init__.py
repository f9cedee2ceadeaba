"""The paper's properties as measurements on one patch or model: what was measured, its bound, and what follows."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gtb_cli.checks import basis, curve, degeneration, lattice, surface
from gtb_cli.checks.probe import Measure, Outcome, Probe, Status, at_most, not_applicable, number
from gtb_cli.errors import GtbError, ToleranceError
from gtb_cli.theory.joints import CURVE_TOLERANCE, EDGE_SAMPLES, Joints, edge_points
from gtb_cli.theory.model import Model
from gtb_cli.theory.patch import Patch

__all__ = ["PROPERTIES", "Finding", "ModelReport", "Property", "Report", "check", "check_model", "check_patch"]


@dataclass(frozen=True)
class Finding:
    """A property, and what was measured of it.

    Attributes
    ----------
    name : str
        Of the property; the same in every version, for scripts.
    reference : str
        Where the paper states it.
    status : {"holds", "fails", "not applicable", "measured"}
        "measured" where the number is no verdict.
    value : float or None
        The largest violation, or the number; relative to sizes, without unit. It may be infinite or not a number
        where a patch is broken.
    bound : float or None
        The property holds where ``value <= bound``: what rounding may do to this patch.
    reason : str
        What was measured, or the condition that is not fulfilled.
    """

    name: str
    reference: str
    status: Status
    value: float | None
    bound: float | None
    reason: str


@dataclass(frozen=True)
class Report:
    """Findings about one patch, in the order of `PROPERTIES`."""

    name: str | None
    findings: tuple[Finding, ...]

    @property
    def holds(self) -> bool:
        """Whether no property fails."""
        return all(finding.status != "fails" for finding in self.findings)


@dataclass(frozen=True)
class ModelReport:
    """Findings about the patches of a model, and about their joints."""

    name: str | None
    patches: tuple[Report, ...]
    joints: tuple[Finding, ...]

    @property
    def holds(self) -> bool:
        """Whether no property of a patch or joint fails."""
        return all(part.holds for part in (*self.patches, Report(self.name, self.joints)))


class Property(NamedTuple):
    """A property of the paper: where it is stated for curves and for surfaces, if it is, and what measures it."""

    name: str
    of_curves: str | None
    of_surfaces: str | None
    measure: Measure


PROPERTIES = (
    Property("definition", "Def. 3.1", "Def. 4.1", basis.definition),
    Property("nonnegativity", "Thm 2.1 (a)", "Thm 2.3 (a)", basis.nonnegativity),
    Property("partition of unity", "Thm 2.1 (b)", "Thm 2.3 (b)", basis.partition_of_unity),
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
    Property("end tangents", "Sec. 3 (e)", None, curve.end_tangents),
    Property("end tangent lengths", "eq. 302", None, curve.end_tangent_lengths),
    Property("one weight to infinity", "Sec. 3 (g)", None, curve.one_weight),
    Property("isoparametric curves", None, "Sec. 4 (d)", surface.isoparametric_curves),
    Property("multiple knots", "Thm 3.1, Cor. 3.1", "Thm 4.1", degeneration.multiple_knots),
    Property("toric degeneration", "Thm 3.2", "Thm 4.2", degeneration.toric_degeneration),
    Property("linear precision", "Ex. 4.1", "Ex. 4.1", basis.linear_precision),
    Property("linear precision, linear parametrization", "Ex. 4.1", "Ex. 4.1", basis.linear_precision_of_linear),
    Property("coefficients of unity", "eq. 8", "eq. 8", basis.coefficients_of_unity),
)
"""In the order in which they are reported."""

JOINED = 8 * CURVE_TOLERANCE
"""Largest distance between points of edges that are joined, of the model's size: their control points and knots differ
by `CURVE_TOLERANCE` at most, and their weights by a factor that near 1."""


def check(shape: Patch | Model) -> Report | ModelReport:
    """Measure every property the paper proves on a patch, or on each patch of a model and on its joints.

    Parameters
    ----------
    shape : Patch or Model

    Returns
    -------
    Report or ModelReport

    Notes
    -----
    See `check_patch` and `check_model`.
    """
    return check_model(shape) if isinstance(shape, Model) else check_patch(shape)


def check_patch(patch: Patch) -> Report:
    """Measure every property the paper proves, on a patch.

    Parameters
    ----------
    patch : Patch

    Returns
    -------
    Report

    Notes
    -----
    At a fixed set of parameters, so that the same patch gives the same numbers. Bounds are what rounding may do: they
    grow with the exponents, and with the distance of knots and control points from the origin as compared to
    their extent. Where the paper claims a property only under conditions, or more than is so, a patch that
    does not fulfil them is "not applicable". Less than 0.2 s for a few dozen knots.

    References
    ----------
    `PROPERTIES` has them, one by one.
    """
    probe = Probe(patch)
    findings = []
    for prop in PROPERTIES:
        reference = prop.of_curves if patch.dimension == 1 else prop.of_surfaces
        if reference is not None:
            findings.append(_finding(prop.name, reference, _measured(prop.measure, probe)))
    return Report(patch.name, tuple(findings))


def check_model(model: Model) -> ModelReport:
    """Measure every property on each patch of a model, and how its patches are joined.

    Parameters
    ----------
    model : Model

    Returns
    -------
    ModelReport
    """
    joints = model.joints
    return ModelReport(model.name, tuple(map(check_patch, model.patches)), tuple(_joint_findings(model, joints)))


def _measured(measure: Measure, probe: Probe) -> Outcome:
    """Measure a property; a patch that cannot be evaluated has none.

    Where the linear parametrisation, by which some properties are measured, is not found, that is no fault of theirs:
    it is a property of its own.
    """
    try:
        return measure(probe)
    except ToleranceError as error:
        return not_applicable(f"could not be measured: {error}")
    except GtbError as error:
        return Outcome("fails", None, None, f"could not be measured: {error}")


def _finding(name: str, reference: str, outcome: Outcome) -> Finding:
    return Finding(name, reference, outcome.status, outcome.value, outcome.bound, outcome.reason)


def _joint_findings(model: Model, joints: Joints) -> Iterable[Finding]:
    """How patches fit together: that joined edges are one curve, and what a closed body would not have."""
    what = "edges" if model.patches[0].dimension == 2 else "ends"
    yield _finding("joined edges", "Thm 4.0", _joined(model, joints))
    yield _finding("open edges", "Thm 4.0", number(len(joints.open), f"number of {what} with no neighbour"))
    crowded = number(len(joints.crowded), f"number of curves that more than two {what} share")
    yield _finding("crowded edges", "Thm 4.0", crowded)
    one_sided = number(len(joints.one_sided), "number of joints at which orientations cannot agree")
    yield _finding("orientation", "Thm 4.0", one_sided)
    almost = number(
        max((distance for _, _, distance in joints.almost), default=0.0) / _size(model),
        f"largest gap of the {len(joints.almost)} pairs of edges that nearly coincide, of the model's size",
    )
    yield _finding("almost joined edges", "Thm 4.0", almost)


def _joined(model: Model, joints: Joints) -> Outcome:
    if not joints.shared:
        return not_applicable("no two edges carry the same curve")
    worst = 0.0
    for joint in joints.shared:
        (p, e), (q, f) = joint.first, joint.second
        if model.patches[p].dimension == 1:
            first, second = (
                model.patches[i].evaluate(model.patches[i].domain.vertices[[j]]) for i, j in ((p, e), (q, f))
            )
        else:
            first, second = (
                edge_points(model.patches[p], e, EDGE_SAMPLES),
                edge_points(model.patches[q], f, EDGE_SAMPLES),
            )
        if joint.opposite:
            second = second[::-1]
        worst = max(worst, float(np.sqrt(((first - second) ** 2).sum(axis=1)).max()))
    return at_most(
        worst / _size(model), JOINED, f"largest distance at {len(joints.shared)} joints, of the model's size"
    )


def _size(model: Model) -> float:
    points = np.concatenate([patch.control_points for patch in model.patches])
    return float(np.ptp(points, axis=0).max()) or 1.0
