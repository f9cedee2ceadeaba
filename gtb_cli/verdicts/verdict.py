"""The verdict on two files, and on all files of two folders: in one word, as text and as plain data."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, get_args

from gtb_cli.errors import Fault
from gtb_cli.shell.messages import error_record
from gtb_cli.verdicts.telling import OTHER_KIND, difference_record, difference_text
from gtb_cli.vocabulary import printable, without_commands

if TYPE_CHECKING:
    from gtb_cli.meshes.difference import Difference
    from gtb_cli.meshes.mesh import Mesh

Word: TypeAlias = Literal["same", "different", "missing", "extra", "unreadable"]
WORDS: tuple[Word, ...] = get_args(Word)


@dataclass(frozen=True)
class Verdict:
    """The verdict on two files; without `found` if only their bytes were compared, or one is missing."""

    name: str  # of the two in their folders; of the second, if these are not folders
    paths: tuple[str, str]  # as messages show them; also of a file that is missing
    word: Word
    found: Difference | None = None
    warnings: tuple[str, ...] = ()  # where the answer does not quite fit the question
    is_rounded: bool = False  # whether bytes differ in last digits of numbers alone
    errors: tuple[Fault, ...] = ()  # why a file is unreadable
    renamed: str = ""  # the name of a file in the other folder with equal bytes, if this one is missing there
    meshes: tuple[Mesh | None, Mesh | None] = (None, None)  # None if they are the same, or not meshes

    @property
    def same(self) -> bool:
        """Whether the files are the same within the tolerance."""
        return self.word == "same"

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the files are not the same, beside their distance, in sentences."""
        told = (*self.found.words, *self.found.faults) if self.found else ()
        reasons = (*map(str, self.errors), *told, *self.warnings)
        reasons += (f"is called {self.renamed} in the other folder",) * bool(self.renamed)
        reasons += ("other bytes",) * (self.word == "different" and self.found is None)
        return reasons + (OTHER_KIND,) * (self.found is not None and not self.found.same_kind)

    @property
    def text(self) -> str:
        """A line with the verdict and, if two meshes are not the same, lines with what differs."""
        if self.word == "unreadable":
            return ""
        if self.word in ("missing", "extra"):
            there, other = self.paths if self.word == "missing" else self.paths[::-1]
            renamed = f", where it is called {self.renamed}" if self.renamed else ""
            folder = other[: -len(self.name)].rstrip(os.sep)
            return f"{printable(f'{self.word}: {there} is not in {folder}{renamed}')}\n"
        equal = "the same numbers but for last digits" if self.is_rounded else "equal bytes"
        text = difference_text(self.found) if self.found else f"{equal if self.same else 'other bytes'}\n"
        return f"{printable(f'{self.word}: {self.paths[0]} and {self.paths[1]}')}: {without_commands(text)}"

    @property
    def record(self) -> dict[str, Any]:
        """The verdict as plain data, ready for ``json.dumps``."""
        if self.errors:
            return {"same": False, "errors": [*map(error_record, self.errors)]}
        files: list[dict[str, Any]] = [{"file": path} for path in self.paths]
        if self.found is None:
            report: dict[str, Any] = {"same": self.same, "distance": 0.0 if self.same else None, "method": "bytes"}
        else:
            report = difference_record(self.found) | {"warnings": [*self.warnings]}
            for file, measures in zip(files, self.found.measures, strict=False):
                file |= measures.record()
        return report | dict(zip("ab", files, strict=True))


@dataclass(frozen=True)
class Verdicts:
    """The verdicts on all files of two folders, sorted by name; or the one on two files."""

    each: tuple[Verdict, ...]
    of_folders: bool

    @property
    def counts(self) -> dict[Word, int]:
        """How many files have each verdict."""
        return {word: sum(each.word == word for each in self.each) for word in WORDS}

    @property
    def status(self) -> int:
        """The exit status: 0 if all are the same, 2 if one could not be read, else 1."""
        return 2 if self.counts["unreadable"] else int(self.counts["same"] < len(self.each))

    @property
    def text(self) -> str:
        """What is said of two files; of folders, of each file that is not the same, and how many there are of each."""
        if not self.of_folders:
            return self.each[0].text
        told = sorted((each for each in self.each if not each.same), key=lambda each: WORDS.index(each.word))
        counts = ", ".join(f"{count} {word}" for word, count in self.counts.items() if count or word != "unreadable")
        return "".join(each.text for each in told) + f"{counts}\n"

    @property
    def record(self) -> dict[str, Any]:
        """The verdicts as plain data, ready for ``json.dumps``."""
        if not self.of_folders:
            return self.each[0].record
        return {
            "same": self.status == 0,
            "files": [{"name": each.name, **each.record} for each in self.each if each.word in ("same", "different")],
            **{word: [each.name for each in self.each if each.word == word] for word in ("missing", "extra")},
            "renamed": {each.name: each.renamed for each in self.each if each.word == "missing" and each.renamed},
            "errors": [{"name": each.name, **error_record(error)} for each in self.each for error in each.errors],
        }
