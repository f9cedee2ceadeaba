"""Reads the plain data of a whole spec as a `Patch` or `Model`: named numbers, included files, patches, copies."""

from collections.abc import Callable, Iterator
from itertools import islice
from typing import Any

from gtb_cli.errors import DomainError, SpecError
from gtb_cli.language.document import shown
from gtb_cli.language.keys_and_values import FINITE, POSITIVE, Table, Values
from gtb_cli.language.names import Unknown, numbers_in_no_let, read_numbers
from gtb_cli.language.patch_reader import INCLUDE_KEYS, MAX_PATCHES, MODEL_KEYS, PATCH_KEYS, Reader
from gtb_cli.language.reading import NO_LET, Let
from gtb_cli.language.scanner import Path
from gtb_cli.models.model import Model, diagonal_of
from gtb_cli.theory.patch import Patch

# Returns the patches of an included file whose ``let`` has other numbers, the last of which stand at a path, or none if
# it has faults, noted elsewhere; `SpecError`: it cannot be included.
Include = Callable[[str, Let, Path], tuple[Patch, ...]]


def read_spec(
    values: Values, include: Include, data: object, name: str | None, row: int | None, given: Let, unknown: Unknown
) -> Patch | Model | None:
    """Read a whole document; None if faults, here or in included files, leave the model without patches.

    `row` is that of `Reader`; `given` and `unknown` are those of `read_numbers`.
    """
    if not isinstance(data, dict):
        values.faults.add((), f"must be a table with the keys of a patch, got {shown(data)}")
        return None
    if "let" not in data and (loose := numbers_in_no_let(data)):
        values.faults.add((next(iter(loose)),), "the line [let] is missing before this: expressions use it")
        data = {key: entry for key, entry in data.items() if key not in loose} | {"let": loose}
    read_numbers(data, values, given, unknown)
    reader = Reader(values, row)
    if "patches" not in data and "include" not in data:
        return reader.patch(data, (), name)
    return _model(reader, include, data, name)


def _model(reader: Reader, include: Include, data: dict[str, Any], name: str | None) -> Model | None:
    values, faults = reader.values, reader.values.faults
    table = Table(data, (), values)
    table.unknown_keys(MODEL_KEYS, dict.fromkeys(PATCH_KEYS, "belongs in one of the [[patches]]"))
    title = table.name(name)
    length: Any = data.get("weld")
    if is_percentage := isinstance(length, str) and length.rstrip().endswith("%"):
        length = length.rstrip()[:-1]
    distance = values.number(length, ("weld",), POSITIVE) if "weld" in data else None
    included, owners = _included(values, include, data)
    given = data.get("patches", [])
    if not isinstance(given, list) or ("patches" in data and not given):
        faults.add(("patches",), f"must be a list of at least one table ([[patches]]), got {shown(given)}")
        return None
    tables = [*islice(_of_one_each(given), MAX_PATCHES + 1)]
    if (count := len(included) + max(len(given), len(tables))) > MAX_PATCHES:
        faults.add(("patches",), f"must be at most {MAX_PATCHES}, got {count}")
        return None
    patches = [*included, *_own(reader, tables, included, owners)]
    if faults.count or not patches:
        if not patches and not faults.count and data.get("include") == []:
            faults.add(("include",), "must name a file where there are no [[patches]]")
        return None
    if distance is not None and is_percentage:
        distance = distance * diagonal_of(patches) / 100
    try:
        return Model(tuple(patches), title, distance)
    except DomainError as error:
        reader.domain_fault((), error)
        return None


def _included(values: Values, include: Include, data: dict[str, Any]) -> tuple[list[Patch], dict[str, str]]:
    """Read the patches of included files, and the file of each patch by its name."""
    patches: list[Patch] = []
    owners: dict[str, str] = {}
    names = data.get("include", [])
    if not isinstance(names, list):
        values.faults.add(("include",), f"must be a list of file names, got {shown(names)}")
        return patches, owners
    for i, entry in enumerate(names):
        path: Path = ("include", i)
        table = Table(entry if (is_table := isinstance(entry, dict)) else {"file": entry}, path, values)
        table.unknown_keys(INCLUDE_KEYS)
        name = table.entries.get("file")
        if not isinstance(name, str) or not name:
            expected = "the name of a file" if is_table else "the name of a file or a table"
            fault = "is missing" if is_table and name is None else f"must be {expected}, got {shown(name)}"
            values.faults.add((*path, "file") if is_table else path, fault)
            continue
        try:
            found = include(name, _numbers(table), (*path, "let"))
        except SpecError as error:
            values.faults.add(path, str(error))
            continue
        if is_table:
            from gtb_cli.language.copies import included_copies

            found = tuple(included_copies(found, table, MAX_PATCHES - len(patches)))
        if taken := [patch.name for patch in found if patch.name in owners]:
            way_out = f'{{file = "{name}", name = "other"}} would call it {shown(f"other-{taken[0]}")}'
            values.faults.add(path, f"{name} has a patch {shown(taken[0])}, as has {owners[taken[0]]}: {way_out}")
        owners.update({patch.name: name for patch in found if patch.name is not None})
        patches += found
    return patches, owners


def _numbers(table: Table) -> Let:
    """Read the numbers that an included file gets in place of those of its own ``let``."""
    let = table.entries.get("let", {})
    if not isinstance(let, dict):
        table.fault("let", f"must be a table of numbers, got {shown(let)}")
        return NO_LET
    found = {name: table.values.number(value, (*table.path, "let", name), FINITE) for name, value in let.items()}
    return {name: number for name, number in found.items() if number is not None}


def _own(
    reader: Reader, tables: list[tuple[Path, object]], included: list[Patch], owners: dict[str, str]
) -> list[Patch]:
    """Read the patches of this file, in order; `owners` has the names of the included ones before them."""
    from gtb_cli.language.copies import Copy, carried_out, read_copy  # one patch has none

    values, faults = reader.values, reader.values.faults
    patches: dict[int, list[Patch]] = {}
    copies: dict[int, Copy] = {}
    named: dict[str, Patch | None] = {patch.name: patch for patch in included if patch.name is not None}
    several: dict[str, Path] = {}
    hidden: set[int] = set()  # patches that are only copied
    count = len(included) + len(tables)
    for i, (path, table) in enumerate(tables):
        entries = table if isinstance(table, dict) else {}
        if not isinstance(flag := entries.get("hidden", False), bool):
            faults.add((*path, "hidden"), f"must be true or false, got {shown(flag)}")
        elif flag:
            hidden.add(i)
        if "copy" in entries:
            if copy := read_copy(entries, path, values, MAX_PATCHES - count + 1):
                copies[i] = copy
                count += len(copy.names) - 1
            continue
        patch = reader.patch(table, path, None)
        patches[i] = [] if patch is None else [patch]
        name = entries.get("name")
        if not isinstance(name, str):
            continue
        if name in owners:
            faults.add((*path, "name"), f"{shown(name)} is the name of a patch of {owners[name]}, too")
        elif name in named:
            several[name] = (*path, "name")
        named[name] = patch
    if len(copies) + len(patches) == len(tables):  # otherwise a copy that others may need is missing
        patches |= carried_out(copies, named, several, values)
    if hidden and len(hidden) == len(tables) and not included:
        faults.add(("patches",), "are all hidden: there is nothing to show")
    return [patch for i in sorted(patches.keys() - hidden) for patch in patches[i]]


def _of_one_each(tables: list[object]) -> Iterator[tuple[Path, object]]:
    """Yield tables of patches with their paths; one that copies several patches as one for each."""
    for i, table in enumerate(tables):
        names = table.get("copy") if isinstance(table, dict) else None
        if isinstance(table, dict) and isinstance(names, list) and names and all(isinstance(x, str) for x in names):
            prefix = f"{title}-" if isinstance(title := table.get("name"), str) else None
            for name in names:
                yield ("patches", i), table | {"copy": name} | ({} if prefix is None else {"name": prefix + name})
        else:
            yield ("patches", i), table
