"""What changed between two versions of meshes: measures of both, and meshes small enough to be shown."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray
from gtb_cli.errors import DomainError
from gtb_cli.meshes.correspondence import nearest_cells
from gtb_cli.meshes.difference import Difference, Point
from gtb_cli.meshes.frame import Frame
from gtb_cli.meshes.measures import Measures, labelled, measure
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.review.shown_meshes import distances, simplified
from gtb_cli.verdicts.verdict import WORDS, Verdict, Word

MAX_SHOWN_FACES = 20_000  # of one mesh: finer ones look the same in a third of a window
MAX_ALL_FACES = 2_000_000  # of all meshes of a page, with which a browser still opens it


class Row(NamedTuple):
    """A number of both versions, as text; empty where a version has none."""

    label: str
    old: str
    new: str


@dataclass(frozen=True)
class Side:
    """One of two versions of a mesh: its measures, None if it has none, and what is shown of it."""

    measures: Measures | None
    mesh: Mesh | None  # None if nothing can be shown
    faces: int  # of the mesh that `mesh` simplifies; the same number if it does not
    distances: FloatArray | None = None  # (m,) from the other side, on the side where they are larger
    turned: BoolArray | None = None  # (m,) true at the corners of faces that are turned over, on the new side


@dataclass(frozen=True)
class Change:
    """A file that is not the same in both folders; a side is None if there is no mesh on it."""

    verdict: Verdict  # without meshes
    old: Side | None = None
    new: Side | None = None
    frames: tuple[Frame, Frame] | None = None  # in which each is drawn, mostly the same one; None without meshes
    scale: str = ""  # why the two frames differ, in words

    @property
    def found(self) -> Difference | None:
        """How two meshes differ."""
        return self.verdict.found

    @property
    def meshes(self) -> list[Mesh]:
        """What is shown of both, where there is anything."""
        return [side.mesh for side in (self.old, self.new) if side is not None and side.mesh is not None]

    @property
    def reasons(self) -> tuple[str, ...]:
        """What differs, in sentences."""
        return (*self.verdict.reasons, *([self.scale] if self.scale else []))

    @property
    def coloured(self) -> str:
        """The side that has the point farthest from the other, and distances, old or new; empty if there are none."""
        sides = {"old": self.old, "new": self.new}
        return next((key for key, side in sides.items() if side is not None and side.distances is not None), "")

    @property
    def amount(self) -> float:
        """How much differs, in tolerances; infinite if no number says it."""
        if self.found is None or not self.found.same_kind or self.found.faults:
            return np.inf
        return self.found.distance / self.found.tolerance if self.found.tolerance else np.inf

    @property
    def amounts(self) -> tuple[str, str]:
        """How far both are apart, and the tolerance, in few digits; empty if that was not measured."""
        return self.found.amounts if self.found else ("", "")

    @property
    def largest(self) -> Point | None:
        """Where the coloured side is farthest from the other."""
        if self.found is None or not self.coloured:
            return None
        return (self.found.forward if self.coloured == "old" else self.found.backward).at

    @property
    def rows(self) -> list[Row]:
        """The measures of both versions, in the order of `gtb info`, with digits enough to show what differs.

        There are none where one file is unreadable: the other one's would look like a change.
        """
        if self.verdict.word == "unreadable":
            return []
        old, new = (labelled(side.measures.record()) if side and side.measures else {} for side in (self.old, self.new))
        return [_row(label, old.get(label), new.get(label)) for label in dict.fromkeys((*old, *new))]


@dataclass(frozen=True)
class Review:
    """All changes between two folders, or files; the first ones have changed most."""

    names: tuple[str, str]
    changes: tuple[Change, ...]
    same: int  # how many files are the same

    @property
    def counts(self) -> dict[Word, int]:
        """How many files have each verdict that there is, and how many are the same."""
        words = Counter(change.verdict.word for change in self.changes)
        words["same"] = self.same
        return {word: words[word] for word in WORDS if words[word] or word == "same"}


def change(verdict: Verdict) -> Change:
    """Return what is shown of a file that is not the same: meshes of at most `MAX_SHOWN_FACES`, and what colours them.

    These are the distances of two curves, or surfaces, or the turned faces of those within the tolerance.
    """
    (old, new), found = verdict.meshes, verdict.found
    if found is None or not found.same_kind or not (found.distance > found.tolerance or found.turned):
        sides = _side(old), _side(new)
    elif found.distance > found.tolerance and found.forward.distance > found.backward.distance:
        sides = _side(old, new, found), _side(new)
    else:
        sides = _side(old), _side(new, old, found)
    return _framed(Change(replace(verdict, meshes=(None, None)), *sides))


def review(names: tuple[str, str], changes: Iterator[Change | None]) -> Review:
    """Gather changes, None for a file that is the same; all of them together have at most `MAX_ALL_FACES` shown."""
    same, kept, most = 0, list[Change](), MAX_SHOWN_FACES
    for each in changes:
        if each is None:
            same += 1
            continue
        kept.append(_at_most(each, most) if most < MAX_SHOWN_FACES else each)  # cells that were divided stay so
        while most > 1 and sum(len(mesh.cells) for one in kept for mesh in one.meshes) > MAX_ALL_FACES:
            most //= 2
            kept = [_at_most(one, most) for one in kept]
    words = [WORDS[-1], *WORDS]  # what is unreadable first
    kept.sort(key=lambda each: (words.index(each.verdict.word), -each.amount, each.verdict.name))
    return Review(names, tuple(kept), same)


def _side(mesh: Mesh | None, other: Mesh | None = None, found: Difference | None = None) -> Side | None:
    """Return what is shown of a mesh, coloured by its distances from another if there is one."""
    if mesh is None:
        return None
    try:
        measures = measure(mesh)
    except DomainError:  # no cells, or vertices that are not finite: nothing to measure, nor to look at
        return Side(None, None, len(mesh.cells))
    shown, kept = simplified(mesh, MAX_SHOWN_FACES)
    if other is None or found is None:
        return Side(measures, shown, len(mesh.cells))
    if found.distance <= found.tolerance:
        marked = np.zeros(len(shown.vertices), dtype=bool)
        marked[shown.cells[nearest_cells(shown, other, found.tolerance)[1]]] = True
        return Side(measures, shown, len(mesh.cells), turned=marked)
    if found.method == "vertices" and np.array_equal(mesh.cells, other.cells):
        frame = Frame.around(shown.vertices, others := other.vertices[kept])
        apart = np.linalg.norm(frame.inside(shown.vertices) - frame.inside(others), axis=1)
        return Side(measures, shown, len(mesh.cells), frame.length(apart))
    shown, apart = distances(shown, other, found.distance)
    return Side(measures, shown, len(mesh.cells), apart)


def _framed(change: Change) -> Change:
    """Return a change with the frames in which it is drawn: two where a mesh would be a dot beside the other."""
    dot = 0.05  # extent of a mesh in a frame that holds both
    points = [mesh.vertices for mesh in change.meshes]
    if not points:
        return change
    common = Frame.around(*points)
    extents = [float(np.ptp(common.inside(each), axis=0).max()) for each in points]
    if len(points) == 1 or min(extents) > dot:
        return replace(change, frames=(common, common))
    (least, small), (most, large) = sorted(zip(extents, ("old", "new"), strict=True))
    reason = f"{large} is {most / least:.4g} times as large as {small}" if least else f"{small} is a dot beside {large}"
    if dot * most < least or not most:
        reason = "old and new are far apart"
    return replace(change, frames=(Frame.around(points[0]), Frame.around(points[1])), scale=reason)


def _at_most(change: Change, most: int) -> Change:
    """Return a change whose meshes have at most so many faces."""

    def coarser(side: Side | None) -> Side | None:
        if side is None or side.mesh is None or len(side.mesh.cells) <= most:
            return side
        mesh, kept = simplified(side.mesh, most)
        apart = None if side.distances is None else side.distances[kept]
        corners = None if side.turned is None else side.turned[kept]
        return Side(side.measures, mesh, side.faces, apart, corners)

    return replace(change, old=coarser(change.old), new=coarser(change.new))


def _row(label: str, old: object, new: object) -> Row:
    """Write two values to 6 digits; if they differ and would look the same, to 9 or 12. More are rounding."""
    for digits in (6, 9, 12):
        texts = [_text(value, digits) for value in (old, new)]
        if old == new or texts[0] != texts[1]:
            break
    return Row(label, *texts)


def _text(value: Any, digits: int) -> str:
    if value is None:
        return ""
    if isinstance(value, list):
        return " ".join(_text(each, digits) for each in value)
    return str(value) if isinstance(value, int) else f"{value + 0.0:.{digits}g}"  # no -0
