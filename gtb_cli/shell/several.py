"""Reports on several specs, even if some of them have errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from functools import partial
from typing import Any, TypeVar

import click

from gtb_cli.errors import GtbError
from gtb_cli.shell.console import STANDARD, lines_about
from gtb_cli.shell.folders import specs_among
from gtb_cli.shell.streams import refuse_overwriting, shown_input
from gtb_cli.shell.workers import Workers

Found = TypeVar("Found")

long_option = click.option(
    "--long",
    "in_full",
    is_flag=True,
    help="Print everything, not just a line for each of several specs or an extract of a large model.",
)


def inputs_of(specs: Sequence[str], output: str) -> tuple[str, ...]:
    """Return the specs that a command was given, with those in folders; refuse one that is also its output."""
    if list(specs).count(STANDARD) > 1:
        raise click.UsageError("standard input can be read only once")
    found = specs_among(specs)
    refuse_overwriting(found, [output])
    return found


def reports_on(
    specs: Sequence[str], report: Callable[[str], Found], jobs: int
) -> tuple[list[tuple[str, Found]], list[str]]:
    """Return the name of each spec with what `report` returns for it, and the error lines of the other specs.

    Several processes share the work if `report` is a function of a module, or a partial one; this process reads
    standard input.
    """
    found: list[tuple[str, Found]] = []
    errors: list[str] = []
    attempt = partial(_attempted, report=report)
    with closing(Workers(jobs).results(attempt, [spec for spec in specs if spec != STANDARD])) as elsewhere:
        for spec in specs:
            result, lines = attempt(spec) if spec == STANDARD else next(elsewhere)
            found += [(shown_input(spec), one) for one in result]
            errors += lines
    if not found:
        raise GtbError("\n".join(errors))
    return found, errors


def _attempted(spec: str, report: Callable[[str], Found]) -> tuple[list[Found], list[str]]:
    """Return the report on a spec, or else the lines of its error."""
    try:
        return [report(spec)], []
    except GtbError as error:
        return [], str(error).split("\n")
    except Exception as error:  # noqa: BLE001 -- an error in one spec does not stop the others
        return [], [f"{shown_input(spec)}: {line}" for line in lines_about(error)]


def json_of(rows: Sequence[tuple[str, dict[str, Any]]], several: bool) -> str:
    """Return one JSON object, or for several specs a list of objects, each with the name of its file."""
    import json

    data = [{"file": name, **row} for name, row in rows] if several else rows[0][1]
    return json.dumps(data) + "\n"
