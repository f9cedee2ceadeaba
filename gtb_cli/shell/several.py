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
Task = TypeVar("Task")

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
    elsewhere = Workers(jobs).results(partial(_attempted, report=report), [spec for spec in specs if spec != STANDARD])
    with closing(elsewhere):
        for spec in specs:
            result = _attempted(spec, report) if spec == STANDARD else next(elsewhere)
            if isinstance(result, GtbError):
                errors += str(result).split("\n")
            else:
                found.append((shown_input(spec), result))
    if not found:
        raise GtbError("\n".join(errors))
    return found, errors


def _attempted(spec: str, report: Callable[[str], Found]) -> Found | GtbError:
    return attempted(spec, report, spec)


def attempted(spec: str, function: Callable[[Task], Found], task: Task) -> Found | GtbError:
    """Return ``function(task)``, or the error in this spec: whatever it is, it does not stop the other specs."""
    try:
        return function(task)
    except Exception as error:  # noqa: BLE001 -- returned, and reported with an exit status that says so
        return fault(spec, error)


def fault(spec: str, error: Exception) -> GtbError:
    """Return an error with the name of the spec in which it is; one of ours has it."""
    if isinstance(error, GtbError):
        return error
    return GtbError("\n".join(f"{shown_input(spec)}: {line}" for line in lines_about(error)))


def json_of(rows: Sequence[tuple[str, dict[str, Any]]], several: bool) -> str:
    """Return one JSON object, or for several specs a list of objects, each with the name of its file."""
    import json

    data = [{"file": name, **row} for name, row in rows] if several else rows[0][1]
    return json.dumps(data) + "\n"
