"""Reads the plain data of a whole spec as a `Patch` or `Model`: named numbers, included files, patches, copies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from gtb_cli.errors import DomainError, SpecError
from gtb_cli.language.document import shown
from gtb_cli.language.names import named_numbers
from gtb_cli.language.reader import MAX_PATCHES, MODEL_KEYS, PATCH_KEYS, Reader
from gtb_cli.language.scanner import Path
from gtb_cli.language.values import POSITIVE, Table, Values, likely_word, suggestion
from gtb_cli.theory.model import Model
from gtb_cli.theory.patch import Patch

if TYPE_CHECKING:
    from gtb_cli.language.copies import Copy

# Returns the patches of an included file: none if the file has faults, which are noted elsewhere. Raises `SpecError` if
# it cannot be included.
Include = Callable[[str], tuple[Patch, ...]]


class ModelReader:
    """Turns a document's data into a patch or model, and notes all faults; `second_row` is that of `Reader`."""

    def __init__(self, values: Values, include: Include, second_row: bool | None = None) -> None:
        self.values = values
        self.faults = values.faults
        self._include = include
        self._reader = Reader(values, second_row)

    def spec(self, data: object, name: str | None) -> Patch | Model | None:
        """Read a whole document; None if faults, here or in included files, leave the model without patches."""
        if not isinstance(data, dict):
            self.faults.add((), f"must be a table with the keys of a patch, got {shown(data)}")
            return None
        self.values.names = named_numbers(data, self.values, PATCH_KEYS | MODEL_KEYS)
        if "patches" not in data and "include" not in data:
            return self._reader.patch(data, (), name)
        return self._model(data, name)

    def _model(self, data: dict[str, Any], name: str | None) -> Model | None:
        for key in data:
            if key in PATCH_KEYS - MODEL_KEYS:
                self.faults.add((key,), "belongs in one of the [[patches]]")
        table = Table(data, (), self.values)
        table.unknown_keys(MODEL_KEYS, PATCH_KEYS)
        title = table.name(name)
        weld = self._weld(data)
        included, owners = self._included(data)
        tables = data.get("patches")
        if "patches" not in data:
            tables = []
        elif not isinstance(tables, list) or not tables:
            self.faults.add(("patches",), f"must be a list of at least one table ([[patches]]), got {shown(tables)}")
            return None
        if len(included) + len(tables) > MAX_PATCHES:
            self.faults.add(("patches",), f"must be at most {MAX_PATCHES}, got {len(included) + len(tables)}")
            return None
        patches = [*included, *self._own(tables, included, owners)]
        if self.faults.count or not patches:
            if not patches and not self.faults.count and data.get("include") == []:
                self.faults.add(("include",), "must name a file where there are no [[patches]]")
            return None
        try:
            model = Model(tuple(patches), title)
        except DomainError as error:
            self._reader.domain_fault((), error)
            return None
        if weld is None:
            return model
        from gtb_cli.theory.model import diagonal_of

        distance, is_percentage = weld
        return replace(model, weld=distance * diagonal_of(model.patches) / 100 if is_percentage else distance)

    def _weld(self, data: dict[str, Any]) -> tuple[float, bool] | None:
        """Read ``weld``: the number, and whether it is a percentage of the model's size."""
        if "weld" not in data:
            return None
        value = data["weld"]
        is_percentage = isinstance(value, str) and value.rstrip().endswith("%")
        text = value.rstrip()[:-1] if is_percentage else value
        number = self.values.number(text, ("weld",), POSITIVE)
        return None if number is None else (number, is_percentage)

    def _included(self, data: dict[str, Any]) -> tuple[list[Patch], dict[str, str]]:
        """The patches of included files, and the file of each patch by its name."""
        patches: list[Patch] = []
        owners: dict[str, str] = {}
        names = data.get("include", [])
        if not isinstance(names, list):
            self.faults.add(("include",), f"must be a list of file names, got {shown(names)}")
            return patches, owners
        for i, name in enumerate(names):
            path: Path = ("include", i)
            if not isinstance(name, str) or not name:
                self.faults.add(path, f"must be the name of a file, got {shown(name)}")
                continue
            try:
                found = self._include(name)
            except SpecError as error:
                self.faults.add(path, str(error))
                continue
            taken = sorted({patch.name for patch in found if patch.name in owners})
            if taken:
                fault = f"{name} has a patch {shown(taken[0])}, as has {owners[taken[0]]}"
                self.faults.add(path, fault)
            owners.update({patch.name: name for patch in found if patch.name is not None})
            patches += found
        return patches, owners

    def _own(self, tables: list[object], included: list[Patch], owners: dict[str, str]) -> list[Patch]:
        """The patches of this file, in order; `owners` has the names of the included ones before them."""
        from gtb_cli.language.copies import carried_out, read_copy  # one patch has none

        patches: dict[int, list[Patch]] = {}
        copies: dict[int, Copy] = {}
        asked: list[tuple[Path, str]] = []  # originals, those of wrong copies as well
        wrong: list[str] = []  # with what the names of wrong copies begin
        named: dict[str, Patch | None] = {patch.name: patch for patch in included if patch.name is not None}
        twice: set[str] = set()
        count = len(included) + len(tables)
        for i, table in enumerate(tables):
            path: Path = ("patches", i)
            if isinstance(table, dict) and "copy" in table:
                copy = read_copy(table, path, self.values, MAX_PATCHES - count + 1)
                if isinstance(table["copy"], str):
                    asked.append((path, table["copy"]))
                if copy is None:
                    wrong += [str(table.get("name", table["copy"]))]
                else:
                    copies[i] = copy
                    count += len(copy.names) - 1
                continue
            patch = self._reader.patch(table, path, None)
            patches[i] = [] if patch is None else [patch]
            name = table.get("name") if isinstance(table, dict) else None
            if not isinstance(name, str):
                continue
            if name in owners:
                self.faults.add((*path, "name"), f"{shown(name)} is the name of a patch of {owners[name]}, too")
            elif name in named:
                twice.add(name)
            named[name] = patch
        self._check_names(copies, named, twice)
        self._check_originals(asked, [*named, *(name for copy in copies.values() for name in copy.names)], wrong)
        if len(copies) + len(patches) == len(tables):  # otherwise a copy that others may need is missing
            for i, made in carried_out(copies, named, self.values).items():
                patches[i] = made or []
        return [patch for i in sorted(patches) for patch in patches[i]]

    def _check_originals(self, asked: list[tuple[Path, str]], known: list[str], wrong: list[str]) -> None:
        """Note copies of patches that are not there; a wrong copy may be there under a longer name."""
        some = known[:1000]  # names searched for the one that was probably meant
        there = set(known)
        for path, original in asked:
            if original in there or any(original.startswith(start) and original != start for start in wrong):
                continue
            others = [name for name in some if not name.startswith(f"{original}-")]  # which this copy would make
            likely = likely_word(original, others) if self.faults.count < self.faults.SHOWN else None
            there_are = ", ".join(map(shown, others[:10])) + ", ..." * (len(others) > 10)
            hint = f", there are {there_are}" if others else ", and no other has a name"
            self.faults.add((*path, "copy"), f"there is no patch {shown(original)}{suggestion(likely) or hint}")

    def _check_names(self, copies: dict[int, Copy], named: dict[str, Patch | None], twice: set[str]) -> None:
        """Note names of copies that are taken, and names of originals that several patches have."""
        seen = set(named)
        for copy in copies.values():
            taken = next((name for name in copy.names if name in seen), None)
            if taken is not None:
                self.faults.add(copy.path, f"makes a patch {shown(taken)}, and there is one of this name")
            seen.update(copy.names)
            if copy.original in twice:
                self.faults.add((*copy.path, "copy"), f"there are several patches {shown(copy.original)}")
