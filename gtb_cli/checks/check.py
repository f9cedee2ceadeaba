"""Measure the paper's properties on a patch or model: what was measured, its bound, and the verdict."""

from dataclasses import replace

from gtb_cli.checks.joints import joint_findings
from gtb_cli.checks.probe import Measure, Probe
from gtb_cli.checks.properties import PROPERTIES
from gtb_cli.checks.report import Finding, ModelReport, Report, not_applicable
from gtb_cli.errors import GtbError, ToleranceError
from gtb_cli.theory.model import Model
from gtb_cli.theory.parametrization import RationalBasis
from gtb_cli.theory.patch import Patch


def check(shape: Patch | Model) -> Report | ModelReport:
    """Measure every property the paper proves: see `check_patch` and `check_model`."""
    return check_model(shape) if isinstance(shape, Model) else check_patch(shape)


def check_patch(patch: Patch) -> Report:
    """Measure every property the paper proves, on a patch.

    Notes
    -----
    The parameters are fixed, so that the same patch gives the same numbers. Bounds are what rounding may do: they grow
    with the exponents, and with the distance of knots and control points from the origin relative to their extent.
    If a property holds only under conditions, whether the paper states them or not, it is "not applicable" to a patch
    that does not fulfil them. A few dozen knots take less than 0.2 s.

    References
    ----------
    See `PROPERTIES`, which has one for each property.
    """
    return _checked(Probe(patch))


def check_model(model: Model) -> ModelReport:
    """Measure every property on each patch of a model, and the joints between patches."""
    alike: dict[RationalBasis, list[int]] = {}
    for index, patch in enumerate(model):
        alike.setdefault(patch.rational_basis, []).append(index)
    reports: dict[int, Report] = {}
    for first, *others in alike.values():  # one basis after the other: its values may take 8 MB
        probe = Probe(model.patches[first])
        reports[first] = _checked(probe)
        reports |= {index: _checked(probe.of(model.patches[index])) for index in others}
    return ModelReport(model.name, tuple(reports[index] for index in sorted(reports)), joint_findings(model))


def _checked(probe: Probe) -> Report:
    patch, findings = probe.patch, []
    for prop in PROPERTIES:
        reference = prop.of_curves if patch.dimension == 1 else prop.of_surfaces
        if reference is not None:
            found = probe.of_basis.get(prop.name) or _measured(prop.measure, probe)
            if prop.of_basis:
                probe.of_basis[prop.name] = found
            findings.append(replace(found, name=prop.name, reference=reference))
    return Report(patch.name, tuple(findings))


def _measured(measure: Measure, probe: Probe) -> Finding:
    """Measure a property; it fails for a patch that cannot be evaluated.

    Some properties are measured in the linear parametrisation, which has a finding of its own: if it is not found, they
    do not fail.
    """
    try:
        return measure(probe)
    except ToleranceError as error:
        return not_applicable(f"could not be measured: {error}")
    except GtbError as error:
        return Finding("fails", None, None, f"could not be measured: {error}")
