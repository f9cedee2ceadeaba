"""`gtb check`: the paper's properties, measured."""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING, Any

import click

from gtb_cli.language.reading import Reading
from gtb_cli.shell.several import ReportRequest, report_options
from gtb_cli.shell.streams import is_terminal, spec_of

if TYPE_CHECKING:
    from gtb_cli.checks.report import Finding, ModelReport, Report


@click.command
@report_options()
def check(request: ReportRequest) -> None:
    """\b
    Example: gtb check specs/pentagon.toml

    Measure every property that the paper proves, on this patch.

    Each property gets a line: whether it holds, the largest violation and what rounding allows (relative to sizes),
    where the paper states it, and what was measured. A property whose conditions are not met is "not applicable", one
    that rounding hides is "not decided", and a number without a verdict is "measured". In a model, each patch and the
    joints between patches are checked; what fails is listed, and --json has the rest. Exit status 1 if one fails.
    """
    from gtb_cli.checks.report import counts

    is_plain = os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb" or not is_terminal(request.streams.output)
    found = request.report(
        _checked,
        record=_data,
        line=lambda name, row: f"{'holds' if row.holds else 'fails'}  {name}: {counts(row.findings)}",
        text=lambda row: click.unstyle(_text(row)) if is_plain else _text(row),
    )
    if not all(row.holds for row in found):
        raise click.exceptions.Exit(1)


def _checked(spec: str, reading: Reading, weld: float | str | None) -> Report | ModelReport:
    from gtb_cli.checks.properties import check as measure
    from gtb_cli.models.model import with_weld

    with spec_of(spec, reading) as read:
        return measure(with_weld(read, weld))


def _data(report: Report | ModelReport) -> dict[str, Any]:
    from gtb_cli.checks.report import Report

    head = {"name": report.name, "holds": report.holds}
    if isinstance(report, Report):
        return {**head, "properties": list(map(_finding_data, report.findings))}
    return {**head, "patches": list(map(_data, report.patches)), "joints": list(map(_finding_data, report.joints))}


def _finding_data(found: Finding) -> dict[str, Any]:
    """Return a finding as plain data; numbers that are not finite become null, since JSON cannot write them."""
    value, bound = (x if x is not None and math.isfinite(x) else None for x in (found.value, found.bound))
    named = {"name": found.name, "reference": found.reference, "status": found.status}
    return {**named, "value": value, "bound": bound, "reason": found.reason}


def _rows(findings: tuple[Finding, ...]) -> str:
    verdict_colours = {"holds": "green", "fails": "red", "measured": "cyan", "not decided": "yellow"}
    lines = []
    for found in findings:
        value, bound = ("" if x is None else f"{x:.3g}" for x in (found.value, found.bound))
        figures = f"{value} {'>' if found.status == 'fails' else '<='} {bound}" if bound else value
        status = click.style(f"{found.status:14}", fg=verdict_colours.get(found.status))
        lines.append(f"{status}  {found.name:40}  {figures:20}  {found.reference}: {found.reason}\n")
    return "".join(lines)


def _text(report: Report | ModelReport) -> str:
    """Write a row for each property; for a model, for the properties of its joints and for what fails in patches."""
    from gtb_cli.checks.report import Report, counts

    findings = report.findings if isinstance(report, Report) else report.joints
    text = f"{_rows(findings)}{counts(findings)}\n"
    for index, part in enumerate([] if isinstance(report, Report) else report.patches):
        failing = tuple(found for found in part.findings if found.status == "fails")
        name = f"patch {index}" + (f" ({part.name})" if part.name else "")
        text += f"{name}: {counts(part.findings)}\n{_rows(failing)}"
    return text
