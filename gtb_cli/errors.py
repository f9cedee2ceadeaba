"""Errors: one root, a leaf for each case; `Fault` joins file, line, key and message (given: `language.document`)."""

from collections.abc import Hashable, Iterable
from typing import NamedTuple, Self

from gtb_cli.values import grouped


def one_of_alike(lines: Iterable[tuple[Hashable, str]]) -> list[str]:
    """Return the first of each kind of lines, given as pairs of a kind and a line, with the number of the others."""
    kinds = grouped(lines).values()
    return [f"{each[0]}; {len(each) - 1} more likewise" if len(each) > 1 else each[0] for each in kinds]


class Fault(NamedTuple):
    """A fault and its place, as far as this is known; lines and columns are counted from 1."""

    message: str
    file: str | None = None
    line: int | None = None
    column: int | None = None
    key: str | None = None  # of a value in a spec, such as patches[1].weights[3]

    def __str__(self) -> str:
        where = ":".join(str(part) for part in (self.file, self.line, self.column) if part is not None)
        return ": ".join(part for part in (where, self.key, self.message) if part)


class GtbError(Exception):
    """Root of all errors raised on purpose; its text is one clear message for a person.

    Its arguments are texts and faults. There is a fault for each line of the text.
    """

    def __str__(self) -> str:
        return "\n".join(map(str, self.args))

    @property
    def faults(self) -> list[Fault]:
        """The faults; what was raised as a text has no part but a message."""
        lines = [[arg] if isinstance(arg, Fault) else map(Fault, str(arg).split("\n")) for arg in self.args]
        return [fault for part in lines for fault in part]

    def within(self, file: str) -> Self:
        """Return the same error of a file."""
        return type(self)(*(Fault(str(f), file) if f.file is not None else f._replace(file=file) for f in self.faults))


class SpecError(GtbError, ValueError):
    """A spec file or one of its values is wrong; the message holds one line per error."""


class DomainError(GtbError, ValueError):
    """Knots without a proper convex hull, arrays of the wrong shape, or parameters outside the domain."""


class ExportError(GtbError, RuntimeError):
    """A mesh cannot be written in the requested format or to the requested place."""


class MeshError(GtbError, ValueError):
    """A mesh file is in order, but there is nothing to measure: no cells, coordinates that are not finite, no mesh."""


class ToleranceError(GtbError, RuntimeError):
    """A requested accuracy was not reached within the given limits."""


class RequirementError(GtbError, RuntimeError):
    """A result is right, but lacks a required property."""
