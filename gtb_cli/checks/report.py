"""Results of checks: findings about properties, and reports."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from html import escape
from typing import Literal


@dataclass(frozen=True)
class Finding:
    """A property, measured: its largest violation, or a number, relative to sizes, and what rounding may do, the bound.

    The status "measured" means that the number is not a verdict, "not decided" that rounding is too large for one. A
    value is infinite or not a number if a patch is broken. The reason is what was measured, or the condition that the
    patch does not fulfil; the name is the same in every version, for scripts, and empty until it is known; the
    reference is where the paper states it.
    """

    status: Literal["holds", "fails", "not applicable", "not decided", "measured"]
    value: float | None
    bound: float | None
    reason: str
    name: str = ""
    reference: str = ""


def at_most(value: float, bound: float, reason: str) -> Finding:
    """Judge a property: it holds if its largest violation is within a bound, and fails otherwise, also for NaN."""
    return Finding("holds" if value <= bound else "fails", value, bound, reason)


def within_rounding(value: float, bound: float, reason: str) -> Finding:
    """Judge like `at_most`, by a bound for rounding; not decided if rounding may do too much to tell."""
    vacuous_bound = 0.01  # size, as a fraction of what is compared, above which a bound for rounding proves nothing
    if value <= bound and bound > vacuous_bound:
        return not_decided(f"rounding may do {bound:.1g}: exponents, or distances from the origin, are too large")
    return at_most(value, bound, reason)


def number(value: float | None, reason: str) -> Finding:
    """Return a measurement without a verdict."""
    return Finding("measured", value, None, reason)


# A property is not claimed for this patch, by the condition that fails; or not measured finely enough to tell.
not_applicable = partial(Finding, "not applicable", None, None)
not_decided = partial(Finding, "not decided", None, None)


def counts(findings: Iterable[Finding]) -> str:
    """Say how many properties hold, fail, are measured, not applicable and, if there are any, not decided."""
    count = Counter(found.status for found in findings)
    text = f"{count['holds']} hold, {count['fails']} fail, {count['measured']} measured"
    text += f", {count['not applicable']} not applicable"
    return text + (f", {count['not decided']} not decided" if count["not decided"] else "")


def _holds(report: "Report | ModelReport") -> bool:
    """True if no property fails, of a patch or a joint."""
    return all(found.status != "fails" for found in report.findings)


def _described(report: "Report | ModelReport") -> str:
    return f"<{type(report).__name__} {report.name or 'without a name'}: {counts(report.findings)}>"


def _table(report: "Report | ModelReport") -> str:
    """Return HTML with a row for each finding, and how many there are of each status."""
    rows = []
    for found in report.findings:
        numbers = ("" if number is None else f"{number:.3g}" for number in (found.value, found.bound))
        cells = (found.status, found.name, *numbers, found.reason, found.reference)
        style = ' style="color:#D6001C"' if found.status == "fails" else ""
        rows.append(f"<tr{style}>{''.join(f'<td>{escape(text)}</td>' for text in cells)}</tr>")
    head = "".join(f"<th>{text}</th>" for text in ("status", "property", "measured", "bound", "what", "paper"))
    title = escape(f"{report.name or 'without a name'}: {counts(report.findings)}")
    return f"<table><caption>{title}</caption><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"


@dataclass(frozen=True, repr=False)
class Report:
    """Findings about one patch, in the order of `PROPERTIES`."""

    name: str | None
    findings: tuple[Finding, ...]
    __repr__, _repr_html_, holds = _described, _table, property(_holds)


@dataclass(frozen=True, repr=False)
class ModelReport:
    """Findings about the patches of a model, and about their joints."""

    name: str | None
    patches: tuple[Report, ...]
    joints: tuple[Finding, ...]
    __repr__, _repr_html_, holds = _described, _table, property(_holds)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All findings, about the joints first, then about each patch."""
        return (*self.joints, *(found for part in self.patches for found in part.findings))
