"""Reports on several specs, even if some of them have errors."""

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import click

from gtb_cli.errors import Fault, GtbError
from gtb_cli.shell.faults import faults_about
from gtb_cli.shell.folders import are_several, specs_among
from gtb_cli.shell.gathering import Option, gathered, option
from gtb_cli.shell.messages import STANDARD
from gtb_cli.shell.options import INPUT, json_option, streams_options, weld_option
from gtb_cli.shell.streams import Streams, refuse_overwriting, shown_input, write_json
from gtb_cli.shell.workers import Workers, jobs_option
from gtb_cli.vocabulary import printable, without_commands

Found = TypeVar("Found")


def inputs_of(specs: Sequence[str], output: str, meshes: bool = False) -> tuple[str, ...]:
    """Return the specs, or meshes, that a command was given, folders replaced by their files; refuse its output."""
    if list(specs).count(STANDARD) > 1:
        raise click.UsageError("standard input can be read only once")
    found = specs_among(specs, meshes)
    refuse_overwriting(found, [output])
    return found


def attempted(spec: str, function: Callable[[str], Found], *passing: type[Exception]) -> Found | GtbError:
    """Return ``function(spec)`` or its error, which names the spec; errors of the kinds in `passing` are raised."""
    try:
        return function(spec)
    except passing:
        raise
    except GtbError as error:
        return error
    except Exception as error:  # noqa: BLE001 -- returned, and reported with an exit status that says so
        return GtbError(*faults_about(error)).within(shown_input(spec))


@dataclass(frozen=True)
class ReportRequest:
    """The specs, and folders of them, on which a command reports, and how it does so."""

    specs: tuple[str, ...]
    as_json: bool
    in_full: bool  # else each of several specs gets a line, and a large model an extract
    weld: float | str | None
    jobs: int
    streams: Streams

    @property
    def in_lines(self) -> bool:
        """True if each of several specs gets one line."""
        return are_several(self.specs) and not self.in_full and not self.as_json

    def report(
        self,
        measured: Callable[..., Found],
        record: Callable[[Found], dict[str, Any]],
        line: Callable[[str, Found], str],
        text: Callable[[Found], str],
        gap: str = "",
        meshes: bool = False,
    ) -> list[Found]:
        """Write and return what ``measured(path, reading=…, weld=…)`` finds for each spec, or mesh.

        It is written as JSON, in full, or with a line for each of several specs; `gap` stands between texts. Several
        processes share the work, so `measured` is a function of a module; this one reads standard input. Then it is a
        `GtbError` if some specs have errors.
        """
        specs = inputs_of(self.specs, self.streams.output, meshes)
        reported = partial(attempted, function=partial(measured, reading=self.streams.reading, weld=self.weld))
        found: list[tuple[str, Found]] = []
        errors: list[Fault] = []
        with closing(Workers(self.jobs).results(reported, [spec for spec in specs if spec != STANDARD])) as elsewhere:
            for spec in specs:
                result = reported(spec) if spec == STANDARD else next(elsewhere)
                if isinstance(result, GtbError):
                    errors += result.faults
                else:
                    found.append((shown_input(spec), result))
        if not found:
            raise GtbError(*errors)
        several = are_several(self.specs)
        # "::" at the beginning of a line, also after spaces, is a command of GitHub's
        shown = [printable(f"./{name}" if name.lstrip().startswith("::") else name) for name, _ in found]
        rows = zip(shown, (each for _, each in found), strict=True)
        if self.as_json:
            data = [({"file": name} if several else {}) | record(each) for name, each in found]
            write_json(self.streams.output, data if several else data[0])
        elif self.in_lines:
            self.streams.write("".join(f"{line(name, each)}\n" for name, each in rows))
        else:
            texts = [(f"{name}\n" if several else "") + text(each) for name, each in rows]
            self.streams.write(without_commands(gap.join(texts)))
        if errors:
            raise GtbError(*errors)
        return [each for _, each in found]


def report_options(metavar: str = "SPEC...") -> Option:
    """Add the specs and options of a report; the command gets them as `request`."""
    return gathered(
        "request",
        ReportRequest,
        click.argument("specs", metavar=metavar, nargs=-1, required=True, type=INPUT),
        json_option,
        option("--long", bool, into="in_full")(
            help="Print everything, not just a line for each of several specs or an extract of a large model."
        ),
        weld_option,
        jobs_option,
        streams_options,
    )
