"""Files and standard streams: how commands read specs and other inputs, and write outputs."""

from __future__ import annotations

import codecs
import os
import stat
import sys
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import partial
from typing import IO, TYPE_CHECKING, Any, TypeAlias

import click

from gtb_cli.errors import ExportError, Fault, GtbError, SpecError
from gtb_cli.language.reading import AS_SEEN, Reading
from gtb_cli.shell.messages import STANDARD, Console, abandon
from gtb_cli.values import grouped
from gtb_cli.vocabulary import SCHEMA, suffix_of

if TYPE_CHECKING:
    from gtb_cli.models.model import Model
    from gtb_cli.theory.patch import Patch

Spec: TypeAlias = "Patch | Model"
Tell: TypeAlias = Callable[[str], object]
STDIN = "<stdin>"  # name of standard input in messages
MAX_STEM_BYTES = 200  # longest stem of a file name, in bytes: every file system allows it with a suffix


@dataclass(frozen=True)
class Streams:
    """The output of a command, its messages, and how it reads specs."""

    console: Console
    output: str = STANDARD
    reading: Reading = AS_SEEN

    def spec_of(self, path: str) -> AbstractContextManager[Spec]:
        """Read a spec, and name it in errors, as the function `spec_of` does."""
        return spec_of(path, self.reading, self.console.warn, partial(self.console.warn, severity="note"))

    def write(self, text: str) -> None:
        """Write text to the output."""
        write_text(self.output, text)

    def write_spec(self, spec: Spec, source: str) -> None:
        """Write a spec to the output; an error names the source if no spec holds this."""
        from gtb_cli.language.writer import dump

        with about(source):
            text = dump(spec, self.output)
        self.write(text)


@contextmanager
def spec_of(path: str, reading: Reading = AS_SEEN, warn: Tell = str, note: Tell = str) -> Iterator[Spec]:
    """Read a spec from a file, or from standard input, and name it in errors about the shape that it describes.

    Its holes are filled as the reading asks. A `SpecError` has a line for each of its own errors.
    """
    from gtb_cli.language.document import spec_format_of
    from gtb_cli.language.loading import parse

    source, format = shown_input(path), reading.spec_format or spec_format_of(path)
    spec = parse(read_bytes(path), source, format, dict(reading.let), warn)
    with about(source):
        if reading.fills:
            from gtb_cli.filling.fill import with_fills

            spec = with_fills(spec, reading.fills, warn, note)
        yield spec


def single(spec: Spec) -> Patch:
    """Return a patch, or refuse a model."""
    from gtb_cli.theory.patch import Patch

    if not isinstance(spec, Patch):
        raise SpecError(f"expected a single patch, this is a model of {len(spec.patches)}")
    return spec


def read_bytes(path: str) -> bytes:
    """Read a file, or standard input; at most one byte more than a spec may have."""
    from gtb_cli.files import read_up_to
    from gtb_cli.language.document import MAX_BYTES

    with opened(path) as file:
        return read_up_to(file, MAX_BYTES + 1)


@contextmanager
def opened(path: str) -> Iterator[IO[bytes]]:
    """Open a file, or standard input, for reading bytes; failures, also of reading, are a `SpecError`."""
    if path == STANDARD and sys.stdin is None:
        raise SpecError(f"{STDIN}: standard input is closed")
    try:
        if path == STANDARD:
            yield sys.stdin.buffer
        else:
            with open(path, "rb") as file:
                yield file
    except BrokenPipeError:
        raise
    except OSError as error:
        raise SpecError(Fault(error.strerror or str(error), shown_input(path))) from None


def numbered_rows(file: IO[bytes], source: str, sizes: Collection[int]) -> Iterator[tuple[int, list[float]]]:
    """Yield the numbers in each line of a file, with the number of the line; empty lines and comments are skipped.

    `SpecError` is raised for a line with other words, and for a row whose length is not in `sizes` or not the first's.
    """
    max_line_bytes = 10_000
    for number, line in enumerate(iter(partial(file.readline, max_line_bytes + 1), b""), 1):
        if len(line) > max_line_bytes:
            raise SpecError(Fault(f"a line of more than {max_line_bytes} characters", source, number))
        if number == 1:
            line = line.removeprefix(codecs.BOM_UTF8)
        row: list[float] = []
        for word in line.partition(b"#")[0].replace(b",", b" ").split():
            try:
                row.append(float(word))
            except ValueError:
                shown = word.decode("utf-8", "backslashreplace")[:60]
                raise SpecError(Fault(f"{shown!r} is not a number", source, number)) from None
        if row and len(row) not in sizes:
            raise SpecError(Fault(f"expected {' or '.join(map(str, sizes))} numbers, got {len(row)}", source, number))
        if row:
            yield number, row
            sizes = [len(row)]


def is_regular(file: IO[bytes]) -> bool:
    """Tell whether an open file has a known end: it is neither a pipe nor a device."""
    try:
        return stat.S_ISREG(os.fstat(file.fileno()).st_mode)
    except (OSError, ValueError):  # bytes in memory
        return True


def shown_input(path: str) -> str:
    """Name an input in messages."""
    return STDIN if path == STANDARD else path or "''"


def refuse_overwriting(inputs: Iterable[str], outputs: Iterable[str]) -> None:
    """Refuse outputs, under whatever name, that are also another output, an input or a file that it includes.

    Anything but a regular file, such as a terminal, may be both. Links out of their folders are refused, too.
    """
    from gtb_cli.files import refuse_link_out

    outputs = [output for output in outputs if output != STANDARD and not is_device(output)]
    for output in outputs:
        refuse_link_out(output)
    for alike in grouped((os.path.realpath(output), output) for output in outputs).values():
        if len(alike) > 1:
            raise click.UsageError(f"{alike[1]} would be written twice")
    existing = [(output, os.stat(output)) for output in outputs if os.path.isfile(output)]
    if not existing:
        return
    from gtb_cli.language.includes import sources

    files = (file for path in inputs for file in ([path] if path == STANDARD else sources(path)))
    read = [status for file in files if (status := _status(file)) is not None]
    for output, status in existing:
        if any(os.path.samestat(status, other) for other in read):
            raise click.UsageError(f"{output} is read by this command, and would be overwritten")


def refuse_reports(paths: Iterable[str], folders: Collection[str] = ()) -> None:
    """Refuse a report that cannot be written, or would be in a folder that is compared, before the comparison."""
    for path in paths:
        place = os.path.dirname(path) or os.curdir
        if os.path.isdir(path) or not os.path.isdir(place):
            why = "it is a folder" if os.path.isdir(path) else f"the folder {place} does not exist"
            raise ExportError(f"cannot write {path}: {why}")
        for folder in folders:
            if os.path.realpath(path).startswith(os.path.join(os.path.realpath(folder), "")):
                raise click.UsageError(f"{path} would be in {folder}, and be compared the next time")


def _status(path: str) -> os.stat_result | None:
    """Return the status of an input, or None if it does not exist."""
    try:
        return os.stat(path) if path != STANDARD else os.fstat(sys.stdin.fileno())
    except (OSError, ValueError, AttributeError):
        return None


def write_blocks(output: str, blocks: Iterable[bytes]) -> None:
    """Write bytes to standard output, or a file that appears whole; `BrokenPipeError` if a pipe's reader closed it."""
    if output != STANDARD:
        from gtb_cli.files import replace_file

        replace_file(output, blocks)
        return
    if sys.stdout is None:
        raise ExportError("cannot write standard output: it is closed")
    try:
        for block in blocks:
            sys.stdout.buffer.write(block)
            sys.stdout.buffer.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        abandon(sys.stdout)
        raise ExportError(f"cannot write standard output: {error.strerror or error}") from None


def write_json(output: str, data: Any, *, by_row: bool = False) -> None:
    """Write an object, or a list of them, as JSON with its version; `by_row`: a line for each item of its lists."""
    import json

    if not by_row:
        found = [{"schema": SCHEMA, **each} for each in (data if isinstance(data, list) else [data])]
        return write_text(output, json.dumps(found if isinstance(data, list) else found[0]) + "\n")
    lists = {key: ",".join(f"\n{json.dumps(row)}" for row in rows) for key, rows in data.items()}
    text = ", ".join(f'"{key}": [{rows}\n]' for key, rows in lists.items())
    write_text(output, f'{{"schema": {SCHEMA}, {text}}}\n')


def write_text(output: str, text: str) -> None:
    """Write text as UTF-8, whatever the locale, as `write_blocks` does.

    A reader that closes its pipe has read what it wanted: what the exit status says is still to come.
    """
    try:
        write_blocks(output, [text.encode("utf-8", "backslashreplace")])
    except BrokenPipeError:
        if output == STANDARD:
            abandon(sys.stdout)


def is_terminal(output: str) -> bool:
    """Tell whether an output is standard output and a terminal."""
    return output == STANDARD and sys.stdout is not None and sys.stdout.isatty()


@contextmanager
def about(source: str) -> Iterator[None]:
    """Name the spec in errors about the shape that it describes."""
    try:
        yield
    except GtbError as error:
        raise error.within(source) from error


def is_folder(output: str) -> bool:
    """Tell whether the name of an output means a folder."""
    return os.path.isdir(output) or output.endswith(("/", os.sep))


def is_device(output: str) -> bool:
    """Tell whether an output exists and is neither file nor folder: a pipe, ``/dev/stdout``."""
    return os.path.exists(output) and not os.path.isfile(output) and not os.path.isdir(output)


def output_format(output: str, given: str | None, formats: Collection[str], more: Iterable[str] = ()) -> str:
    """Return the format given, or by the suffix of a file, which is refused if unknown; the first for other outputs."""
    suffix = suffix_of(output)
    if given is not None or suffix in formats:
        return given or suffix
    if output not in (STANDARD, "/dev/stdout") and not is_folder(output) and not is_device(output):
        known = [f".{name}" for name in (*formats, *more)]
        meant = [f", did you mean {each}?" for each in known if sorted(each) == sorted(f".{suffix}")]
        other = "gtb plot draws pictures" if suffix in ("png", "svg", "pdf") else "give -f FORMAT"
        ends = f"it does not end in {', '.join(known)}{meant[0] if meant else f'; {other}'}"
        raise ExportError(f"cannot tell the format of {output or repr(output)}: {ends}")
    return next(iter(formats))


def refuse_terminal(output: str, kind: str, way_out: str) -> None:
    """Refuse to write a binary format to a terminal."""
    if is_terminal(output):
        raise ExportError(f"{kind.upper()} is binary, and standard output is a terminal: give {way_out}")


def file_stem(name: str | None) -> str:
    """Turn any name into the stem of a file name that stays in its folder and is not hidden."""
    unsafe_characters = '/\\:*?"<>|'  # characters that some file systems do not allow in names
    kept = "".join(c if c.isprintable() and c not in unsafe_characters else "_" for c in name or "").strip()
    if kept.startswith((".", "-")):
        kept = "_" + kept[1:]
    return kept.encode("utf-8")[:MAX_STEM_BYTES].decode("utf-8", "ignore").rstrip() or "patch"


def input_stem(path: str) -> str | None:
    """Return the stem of an input's file name, as `file_stem` does; None for standard input."""
    return None if path == STANDARD else file_stem(os.path.splitext(os.path.basename(path))[0])
