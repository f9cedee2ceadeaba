"""`gtb approve`: new meshes → golden ones."""

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from functools import partial

import click

from gtb_cli.errors import Fault, GtbError
from gtb_cli.shell.folders import files_in
from gtb_cli.shell.gathering import gathered, option
from gtb_cli.shell.messages import Console
from gtb_cli.shell.options import INPUT, console_option, difference_option, ignore_option
from gtb_cli.shell.several import attempted
from gtb_cli.shell.streams import opened
from gtb_cli.shell.watching import stamp
from gtb_cli.verdicts.comparing import Comparing
from gtb_cli.verdicts.verdict import Verdict
from gtb_cli.vocabulary import FORMATS, suffix_of


@click.command
@click.argument("golden", metavar="GOLDEN")
@click.argument("out", metavar="OUT", type=INPUT)
@click.argument("names", metavar="[NAME]...", nargs=-1)
@option("--prune", bool)(help="Also remove the files of GOLDEN that OUT does not have.")
@gathered("comparing", Comparing, difference_option, ignore_option)
@console_option
def approve(golden: str, out: str, names: tuple[str, ...], prune: bool, comparing: Comparing, console: Console) -> None:
    """\b
    Example: gtb mesh specs/pentagon.toml -o out/ && gtb approve golden out

    Take the meshes of the folder OUT over into the folder GOLDEN: all that differ, or that GOLDEN does not have, as
    gtb diff GOLDEN OUT says with the same options; or only those with the names that it prints, or that match patterns
    such as 'part-*', even if they differ by less than the tolerance. Nothing is written through links in GOLDEN, or
    taken over through links that lead out of OUT.

    Every mesh is read first, and what changes is said. If one cannot be read, or OUT has no files, nothing is taken
    over. All files appear together: if one cannot be written, GOLDEN stays as it was.
    """
    for folder in (out, golden) if os.path.lexists(golden) else (out,):
        if not os.path.isdir(folder):
            raise GtbError(f"{folder}: is not a folder")
    places = [os.path.join(os.path.realpath(folder), "") for folder in (golden, out)]
    if os.path.join(os.path.commonpath(places), "") in places:
        raise click.UsageError("GOLDEN and OUT are the same folder, or one in the other")
    unreadable = dict[str, str]()
    new = files_in(out, unreadable)
    if not new and not unreadable:
        raise GtbError(f"{out}: has no files to take over")
    stamps = {path: stamp(path) for path in new.values()}
    found: Iterable[Verdict] = (Verdict(name, (os.path.join(golden, name), new[name]), "extra") for name in sorted(new))
    if os.path.isdir(golden) and files_in(golden, unreadable):
        found = comparing.each(golden, out)
    elif unreadable:
        raise GtbError(*unreadable.values())
    verdicts = {verdict.name: verdict for verdict in found}
    chosen = _named(names, verdicts, golden, out) if names else [each for each in verdicts.values() if not each.same]
    taken = [each for each in chosen if os.path.lexists(each.paths[1])]
    gone = [each for each in chosen if not os.path.lexists(each.paths[1])]
    if names and gone and not prune:
        raise GtbError(*(Fault(f"has no file {each.name}; --prune removes {each.paths[0]}", out) for each in gone))
    rest = [verdicts[name] for name in verdicts.keys() - {each.name for each in gone if prune}]
    if prune and (faults := _what_has_to_stay(golden, gone, rest)):
        raise GtbError(*faults)
    for line in _take_over((golden, out), taken, comparing, stamps):
        console.note(line)
    for verdict in gone if prune else ():
        path = verdict.paths[0]
        try:
            os.unlink(path)
            while not os.path.samefile(path := os.path.dirname(path), golden) and not os.listdir(path):
                os.rmdir(path)
        except OSError as error:
            raise GtbError(f"cannot remove {error.filename}: {error.strerror}") from None
        console.note(f"{verdict.paths[0]}: removed")
    left = sum(os.path.lexists(each.paths[0]) for each in rest) - len(taken)
    console.note(f"{golden}: {len(taken)} taken over, {left} left as they are")
    if gone and not prune:
        are, them = ("file is", "it") if len(gone) == 1 else ("files are", "them")
        console.warn(f"{golden}: {len(gone)} {are} not in {out}; --prune removes {them}")


def _named(names: Sequence[str], verdicts: Mapping[str, Verdict], golden: str, out: str) -> list[Verdict]:
    """Return the verdicts on files, but for equal bytes, with names as `gtb diff` prints them, or that match these."""
    chosen, unknown = dict[str, None](), list[str]()
    for name in names:
        if not name:
            raise click.UsageError("a name of a file is empty")
        here = [name, os.path.normpath(name), *(os.path.relpath(name, folder) for folder in (golden, out))]
        found = [*dict.fromkeys(each for each in here if each in verdicts)]
        if found[1:]:
            raise GtbError(Fault(f"{name} may be {' or '.join(verdicts[each].paths[0] for each in found)}", out))
        found = found or [key for key in verdicts if any(fnmatchcase(key, each) for each in here)]
        unknown += [] if found else [name]
        chosen |= dict.fromkeys(found)
    if unknown:
        raise GtbError(*(Fault(f"has no file {name}", out) for name in unknown))
    return [verdict for name in chosen if not (verdict := verdicts[name]).same or verdict.found is not None]


def _take_over(
    folders: tuple[str, str], taken: Sequence[Verdict], comparing: Comparing, stamps: Mapping[str, object]
) -> list[str]:
    """Replace all files of the first folder or none; return what changes in each."""
    from gtb_cli.files import StagedFiles

    changes, errors = list[str](), list[str | Fault]()
    with StagedFiles() as files:
        for verdict in taken:
            target, source = verdict.paths
            found = attempted(source, partial(_read, folders=folders, verdict=verdict, comparing=comparing))
            if isinstance(found, GtbError):
                errors += found.args
            elif stamp(source) != stamps.get(source):
                errors.append(Fault("was changed after it was compared", source))
            elif not errors:
                changes.append(f"{target}: {found[1]}")
                try:
                    files.make_folder(os.path.dirname(target))
                except OSError as error:
                    raise GtbError(f"cannot make the folder {error.filename}: {error.strerror}") from None
                files.add(target, [found[0]])
        if errors:
            raise GtbError(*errors, Fault("nothing was taken over", folders[0]))
    return changes


def _read(source: str, folders: tuple[str, str], verdict: Verdict, comparing: Comparing) -> tuple[bytes, str]:
    """Read a new file, unless it may not take the place of the old one, and say what changes."""
    (golden, out), target = folders, verdict.paths[0]
    if suffix_of(target) != suffix_of(source):
        raise GtbError(f"{source}: is a file of another kind than {target}")
    if os.path.realpath(target) != os.path.join(os.path.realpath(golden), os.path.relpath(target, golden)):
        raise GtbError(f"{target}: is a link, or in a folder that is one: nothing is written there")
    folder, place = os.path.realpath(out), os.path.realpath(source)
    if os.path.commonpath([folder, place]) != folder:
        raise GtbError(f"{source}: is a link, or in a folder that is one, and leads to {place}: it is not taken over")
    if not os.path.isfile(source):  # reading a pipe would wait for its writer
        raise GtbError(*(verdict.errors or [Fault("is not a file", source)]))
    with opened(source) as file:
        content = file.read()
    return content, _changed(verdict, content, comparing)


def _changed(verdict: Verdict, content: bytes, comparing: Comparing) -> str:
    """Say what changes, old → new; raises `GtbError` if the new file is a mesh that cannot be read."""
    source = verdict.paths[1]
    if suffix_of(source) not in FORMATS:
        if verdict.word == "unreadable":  # then one of both is a spec that is not, perhaps the old one
            comparing.read(source)
        return ", ".join([*(verdict.found.faults if verdict.found else ()), f"{len(content)} bytes"])
    from gtb_cli.distances.operands import decoded
    from gtb_cli.review.changes import change

    new = decoded(content, source, comparing.recipe).known.mesh
    made = change(replace(verdict, word="different", found=None, meshes=(verdict.meshes[0], new)))
    if made.new is None or made.new.measures is None:
        raise GtbError(f"{source}: has no faces, or vertices that are not finite")
    if made.old is None:
        count = f"{made.new.faces} {'segments' if new.is_curve else 'faces'}"
        return f"new, {count}" if verdict.word == "extra" else count
    what = [f"{row.label} {row.old or '–'} → {row.new or '–'}" for row in made.rows if row.old != row.new]
    found = verdict.found
    apart = [f"{found.distance:.3g} apart", *found.words, *found.faults] if found is not None else []
    return ", ".join(apart + what) or "the same measures"


def _what_has_to_stay(golden: str, gone: Sequence[Verdict], rest: Iterable[Verdict]) -> list[Fault]:
    """Say why files are not removed: they are in folders that are links, or what stays is a link to them."""
    kept = {os.stat(path).st_ino: path for path in (each.paths[0] for each in rest) if os.path.exists(path)}
    faults = []
    for path, name in ((each.paths[0], each.name) for each in gone):
        if os.path.realpath(os.path.dirname(path)) != os.path.dirname(os.path.join(os.path.realpath(golden), name)):
            faults.append(Fault("is in a folder that is linked, where --prune removes nothing", path))
        elif other := kept.get(os.lstat(path).st_ino):  # also where A.obj and a.obj are one file
            faults.append(Fault(f"is what {other} leads to, which stays", path))
    return faults
