"""Reports on several specs, even if some of them have errors."""

import os
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import click

from gtb_cli.errors import GtbError
from gtb_cli.shell.console import STANDARD, lines_about, printable
from gtb_cli.shell.folders import specs_among
from gtb_cli.shell.options import Option, gathered, json_option, specs_argument, text_options, weld_option
from gtb_cli.shell.streams import refuse_overwriting, shown_input, write_text
from gtb_cli.shell.workers import Workers, jobs_option

Found = TypeVar("Found")
Task = TypeVar("Task")


def inputs_of(specs: Sequence[str], output: str) -> tuple[str, ...]:
    """Return the specs that a command was given, with those in folders; refuse one that is also its output."""
    if list(specs).count(STANDARD) > 1:
        raise click.UsageError("standard input can be read only once")
    found = specs_among(specs)
    refuse_overwriting(found, [output])
    return found


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


def _reported(spec: str, report: Callable[[str], Found]) -> Found | GtbError:
    return attempted(spec, report, spec)


@dataclass(frozen=True)
class ReportRequest:
    """The specs, and folders of them, on which a command reports, and how it does so.

    Without `in_full`, each of several specs gets a line, and a large model an extract.
    """

    specs: tuple[str, ...]
    as_json: bool
    in_full: bool
    weld: float | str | None
    jobs: int
    output: str
    spec_format: str | None

    def found(self, report: Callable[..., Found]) -> tuple[list[tuple[str, Found]], list[str]]:
        """Return what ``report(path, spec_format=…, weld=…)`` returns for each spec, by name, and the error lines.

        Several processes share the work, so `report` is a function of a module; this one reads standard input. It is a
        `GtbError` if all specs have errors.
        """
        specs = inputs_of(self.specs, self.output)
        reported = partial(_reported, report=partial(report, spec_format=self.spec_format, weld=self.weld))
        found: list[tuple[str, Found]] = []
        errors: list[str] = []
        with closing(Workers(self.jobs).results(reported, [spec for spec in specs if spec != STANDARD])) as elsewhere:
            for spec in specs:
                result = reported(spec) if spec == STANDARD else next(elsewhere)
                if isinstance(result, GtbError):
                    errors += str(result).split("\n")
                else:
                    found.append((shown_input(spec), result))
        if not found:
            raise GtbError("\n".join(errors))
        return found, errors

    def write(
        self,
        rows: Sequence[tuple[str, Found]],
        record: Callable[[Found], dict[str, Any]],
        line: Callable[[str, Found], str],
        text: Callable[[Found], str],
        gap: str = "",
    ) -> None:
        """Write the reports as JSON, in full, or with a line for each of several specs; `gap` stands between texts."""
        import json

        several = len(self.specs) > 1 or os.path.isdir(self.specs[0])
        if self.as_json:
            data = [({"file": name} if several else {}) | record(found) for name, found in rows]
            lines = [json.dumps(data if several else data[0])]
        elif several and not self.in_full:
            lines = [line(printable(name), found) for name, found in rows]
        else:
            texts = [(f"{printable(name)}\n" if several else "") + text(found) for name, found in rows]
            lines = [gap.join(texts).removesuffix("\n")]
        write_text(self.output, "\n".join(lines) + "\n")


def report_options(*more: Option) -> Option:
    """Add the specs and options of a report, and `more`; the command gets the former as `request`."""
    long_option = click.option(
        "--long",
        "in_full",
        is_flag=True,
        help="Print everything, not just a line for each of several specs or an extract of a large model.",
    )
    return gathered(
        "request",
        ReportRequest,
        specs_argument,
        json_option,
        long_option,
        weld_option,
        *more,
        jobs_option,
        text_options,
    )
