"""`gtb check`: the paper's properties, measured."""

from __future__ import annotations

import math
import os
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from gtb_cli.errors import GtbError, RequirementError
from gtb_cli.shell.console import Console, printable
from gtb_cli.shell.options import json_option, require_option, specs_argument, text_options, weld_option
from gtb_cli.shell.several import inputs_of, json_of, long_option, reports_on
from gtb_cli.shell.streams import about, is_terminal, read_spec, shown_input, write_text
from gtb_cli.shell.workers import jobs_option

if TYPE_CHECKING:
    from gtb_cli.checks.report import Finding, ModelReport, Report


@click.command
@specs_argument
@json_option
@long_option
@weld_option
@require_option("Exit with status 1")
@jobs_option
@text_options
def check(
    specs: tuple[str, ...],
    as_json: bool,
    in_full: bool,
    weld: float | str | None,
    require: tuple[str, ...],
    jobs: int,
    output: str,
    spec_format: str | None,
    console: Console,
) -> None:
    """\b
    Example: gtb check specs/pentagon.toml

    Measure every property that the paper proves, on this patch.

    Each property gets a line: whether it holds, the largest violation and what rounding allows (relative to sizes),
    where the paper states it, and what was measured. A property whose conditions are not met is "not applicable", and
    a number without a verdict is "measured". In a model, each patch and the joints between patches are checked; what
    fails is listed, and --json has the rest. Several specs, or those in a folder, get a line each, unless --long or
    --json asks for everything. Exit status 1 if a property or requirement fails, 2 if a spec cannot be read.
    """
    failed_status = 1  # exit status when a property fails
    from gtb_cli.checks.report import Report, counts

    several = len(specs) > 1 or os.path.isdir(specs[0])
    checked = partial(_checked, spec_format=spec_format, weld=weld, require=require)
    found, errors = reports_on(inputs_of(specs, output), checked, jobs)
    rows = [(name, report) for name, (report, _) in found]
    refused = [line for _, (_, lines) in found for line in lines]
    if as_json:
        data = [(name, _patch_data(row) if isinstance(row, Report) else _model_data(row)) for name, row in rows]
        text = json_of(data, several)
    else:
        colours = is_terminal(output) and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"
        text = ""
        for name, row in rows:
            if several and not in_full:
                text += f"{'holds' if row.holds else 'fails'}  {printable(name)}: {counts(row.findings)}\n"
                continue
            text += f"{printable(name)}\n" if several else ""
            text += _table(row.findings, colours) if isinstance(row, Report) else _model_text(row, colours)
    write_text(output, text)
    if errors:
        raise GtbError("\n".join(errors + refused))
    if refused:
        raise RequirementError("\n".join(refused))
    if not all(row.holds for _, row in rows):
        raise click.exceptions.Exit(failed_status)


def _checked(
    spec: str, spec_format: str | None, weld: float | str | None, require: tuple[str, ...]
) -> tuple[Report | ModelReport, list[str]]:
    """Return the report on a spec, and lines about requirements that its mesh does not meet."""
    from gtb_cli.checks.check import check as measure
    from gtb_cli.tessellation.recipe import Recipe, welded

    read = read_spec(spec, spec_format)
    with about(shown_input(spec)):
        loaded = welded(read, weld)
        report = measure(loaded)
        try:
            if require:
                Recipe(require=require).mesh(loaded)
        except RequirementError as error:
            return report, [f"{shown_input(spec)}: {line}" for line in str(error).split("\n")]
    return report, []


def _patch_data(report: Report) -> dict[str, Any]:
    return {"name": report.name, "holds": report.holds, "properties": [_data(found) for found in report.findings]}


def _model_data(report: ModelReport) -> dict[str, Any]:
    return {
        "name": report.name,
        "holds": report.holds,
        "patches": [_patch_data(part) for part in report.patches],
        "joints": [_data(found) for found in report.joints],
    }


def _data(found: Finding) -> dict[str, Any]:
    """Return a finding as plain data; numbers that are not finite become null, since JSON cannot write them."""
    value, bound = (x if x is not None and math.isfinite(x) else None for x in (found.value, found.bound))
    named = {"name": found.name, "reference": found.reference, "status": found.status}
    return {**named, "value": value, "bound": bound, "reason": found.reason}


def _table(findings: tuple[Finding, ...], colours: bool) -> str:
    from gtb_cli.checks.report import counts

    return f"{_rows(findings, colours)}{counts(findings)}\n"


def _rows(findings: tuple[Finding, ...], colours: bool) -> str:
    verdict_colours = {"holds": "green", "fails": "red", "measured": "cyan", "not applicable": None}
    name_width = 40  # columns for the name of a property
    figures_width = 20  # columns for the figures of a property
    lines = []
    for found in findings:
        value, bound = ("" if x is None else f"{x:.3g}" for x in (found.value, found.bound))
        figures = f"{value} <= {bound}" if bound else value
        if found.status == "fails" and found.value is not None:
            figures = f"{value} > {bound}"
        status = f"{found.status:14}"
        if colours:
            status = click.style(status, fg=verdict_colours[found.status])
        text = f"{found.reference}: {found.reason}"
        lines.append(f"{status}  {found.name:{name_width}}  {figures:{figures_width}}  {text}\n")
    return "".join(lines)


def _model_text(report: ModelReport, colours: bool) -> str:
    from gtb_cli.checks.report import counts

    text = _table(report.joints, colours)
    for index, part in enumerate(report.patches):
        failing = tuple(found for found in part.findings if found.status == "fails")
        name = f"patch {index}" + (f" ({part.name})" if part.name else "")
        text += f"{name}: {counts(part.findings)}\n{_rows(failing, colours)}"
    return text
