"""`gtb approve`: new meshes → golden ones."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import click

from gtb_cli.errors import Fault, GtbError
from gtb_cli.shell.console import Console
from gtb_cli.shell.folders import files_in
from gtb_cli.shell.options import INPUT, console_option, difference_option, ignore_option
from gtb_cli.shell.streams import opened
from gtb_cli.verdicts.comparing import Answer, Comparing
from gtb_cli.vocabulary import FORMATS, suffix_of

if TYPE_CHECKING:
    from gtb_cli.meshes.difference import Aspect


@click.command
@click.argument("golden", metavar="GOLDEN")
@click.argument("out", metavar="OUT", type=INPUT)
@click.argument("names", metavar="[NAME]...", nargs=-1)
@click.option("--prune", is_flag=True, help="Also remove the files of GOLDEN that OUT does not have.")
@difference_option
@ignore_option
@console_option
def approve(
    golden: str,
    out: str,
    names: tuple[str, ...],
    prune: bool,
    tolerance: float | str | None,
    ignore: tuple[Aspect, ...],
    console: Console,
) -> None:
    """\b
    Example: gtb mesh specs/pentagon.toml -o out/ && gtb approve golden out

    Take the meshes of the folder OUT over into the folder GOLDEN: all that differ, or that GOLDEN does not have, as
    gtb diff GOLDEN OUT says with the same options; or only those with the names that it prints, even if they differ by
    less than the tolerance.

    Every mesh is read first, and what changes is said. If one cannot be read, or OUT has no files, nothing is taken
    over. All files appear together: if one cannot be written, GOLDEN stays as it was.
    """
    if not os.path.isdir(out):
        raise GtbError(f"{out}: is not a folder")
    if os.path.lexists(golden) and not os.path.isdir(golden):
        raise GtbError(f"{golden}: is not a folder")
    places = [os.path.join(os.path.realpath(folder), "") for folder in (golden, out)]
    if places[0] == places[1]:
        raise click.UsageError("GOLDEN and OUT are the same folder")
    if os.path.commonpath(places) + os.sep in places:
        raise click.UsageError("GOLDEN and OUT are one in the other")
    comparing = Comparing(tolerance=tolerance, ignore=ignore)
    answers = {answer.name: answer for answer in _answers(golden, out, comparing)}
    if unknown := [name for name in names if name not in answers]:
        raise GtbError(*(Fault(f"has no file {name}", out) for name in unknown))
    chosen = [answers[name] for name in dict.fromkeys(names)] or [each for each in answers.values() if not each.same]
    taken = [answer for answer in chosen if os.path.lexists(answer.paths[1])]
    gone = [answer for answer in chosen if not os.path.lexists(answer.paths[1])]
    if names and gone and not prune:
        raise GtbError(*(Fault(f"has no file {each.name}; --prune removes {each.paths[0]}", out) for each in gone))
    if prune and (linked := [each.paths[0] for each in gone if _is_elsewhere(golden, each)]):
        raise GtbError(
            *(Fault("is in a folder that is linked, where --prune removes nothing", path) for path in linked)
        )
    for line in _take_over(golden, taken, comparing):
        console.note(line)
    for answer in gone if prune else ():
        _remove(golden, answer.paths[0])
        console.note(f"{answer.paths[0]}: removed")
    left = len(answers) - len(taken) - (len(gone) if prune else 0)
    console.note(f"{golden}: {len(taken)} taken over, {left} left as they are")
    if gone and not prune:
        console.warn(f"{golden}: {len(gone)} files are not in {out}; --prune removes them")


def _answers(golden: str, out: str, comparing: Comparing) -> Iterable[Answer]:
    """Compare the files of two folders; all are extra if the first has none, and an empty second one is refused."""
    unreadable = dict[str, str]()
    found = files_in(out, unreadable)
    if not found and not unreadable:
        raise GtbError(f"{out}: has no files to take over")
    if os.path.isdir(golden) and files_in(golden, unreadable):
        return comparing.folders(golden, out)
    if unreadable:
        raise GtbError(*unreadable.values())
    return [Answer(name, (os.path.join(golden, name), path), "extra") for name, path in sorted(found.items())]


def _take_over(golden: str, taken: Sequence[Answer], comparing: Comparing) -> list[str]:
    """Replace all files or none; return what changes in each."""
    from gtb_cli.files import StagedFiles, discard_unfinished

    changes, errors = list[str](), list[str | Fault]()
    try:
        with StagedFiles() as files:
            for answer in taken:
                target, source = answer.paths
                try:
                    if suffix_of(target) != suffix_of(source):
                        raise GtbError(f"{source}: is a file of another kind than {target}")
                    if not os.path.isfile(source):  # reading a pipe would wait for its writer
                        raise GtbError(*(answer.errors or [Fault("is not a file", source)]))
                    with opened(source) as file:
                        content = file.read()
                    changes.append(f"{target}: {_changed(answer, content, comparing)}")
                except GtbError as error:
                    errors += error.args
                if not errors:
                    _make_folder(os.path.dirname(target))
                    files.add(target, [content])
            if errors:
                raise GtbError(*errors, Fault("nothing was taken over", golden))
    except BaseException:
        discard_unfinished()
        raise
    return changes


def _changed(answer: Answer, content: bytes, comparing: Comparing) -> str:
    """Say what changes, old → new; raises `GtbError` if the new file is a mesh that cannot be read."""
    source = answer.paths[1]
    if suffix_of(source) not in FORMATS:
        return f"{len(content)} bytes"
    from gtb_cli.distances.comparison import decoded
    from gtb_cli.review.changes import change
    from gtb_cli.review.table import rows

    new = decoded(content, source, comparing.recipe).known.mesh
    made = change(answer.name, "different", answer.meshes[0], new)
    if made.new is None or made.new.measures is None:
        raise GtbError(f"{source}: has no faces, or vertices that are not finite")
    if made.old is None:
        count = f"{made.new.faces} {'segments' if new.is_curve else 'faces'}"
        return f"new, {count}" if answer.verdict == "extra" else count
    what = [f"{row.label} {row.old or '–'} → {row.new or '–'}" for row in rows(made) if row.is_changed]
    apart = [f"{answer.found.distance:.3g} apart", *answer.found.faults] if answer.found is not None else []
    return ", ".join(apart + what) or "the same measures"


def _make_folder(folder: str) -> None:
    """Make a folder where there is none; until it has files, it goes with what is unfinished."""
    from gtb_cli.files import begin

    missing = [folder]
    while missing[-1] and not os.path.isdir(missing[-1]):
        missing.append(os.path.dirname(missing[-1]))
    for each in missing[-2::-1]:
        begin(each)
        try:
            os.mkdir(each)
        except OSError as error:
            raise GtbError(f"cannot make the folder {each}: {error.strerror}") from None


def _is_elsewhere(golden: str, answer: Answer) -> bool:
    """Tell whether a file is in a folder that is a link, or behind one."""
    place = os.path.realpath(os.path.dirname(answer.paths[0]))
    return place != os.path.join(os.path.realpath(golden), os.path.dirname(answer.name)).rstrip(os.sep)


def _remove(golden: str, path: str) -> None:
    """Remove a file, and the folders in `golden` that then are empty."""
    try:
        os.unlink(path)
        while (path := os.path.dirname(path)) != golden and not os.listdir(path):
            os.rmdir(path)
    except OSError as error:
        raise GtbError(f"cannot remove {error.filename}: {error.strerror}") from None
