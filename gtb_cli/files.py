"""Files that appear whole or not at all: written under a temporary name, flushed, renamed."""

import os
import re
import stat
from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import IO, Self

from gtb_cli.errors import ExportError, Fault, GtbError, SpecError

_unfinished: dict[str, None] = {}  # temporary files, and folders made for them, in order of creation
_ledger: int | None = None  # descriptor of a file with their names, for a process that waits for this one


def replace_file(path: str | os.PathLike[str], blocks: Iterable[bytes]) -> None:
    """Write `blocks` to a file in an existing folder: the result is the whole new file or the untouched old one.

    A symbolic link is followed within its folder only. The new file keeps the mode of the old one, and its owner and
    group if the system lets this process give files away; without an old one it gets the usual mode. A path that is not
    a regular file (`/dev/null`, a FIFO, `/dev/stdout`) is written to directly. Raises an `ExportError` with the name
    and the system's reason, and a `BrokenPipeError` if `path` is a pipe whose reader has closed it.
    """
    shown = os.fspath(path)
    try:
        if _target(shown) is None:
            # Opening /dev/stdout by name would restart at the beginning of a redirected file.
            descriptor = _descriptor(shown)
            with open(os.open(shown, os.O_WRONLY) if descriptor is None else os.dup(descriptor), "wb") as file:
                write_all(file, blocks)
            return
    except BrokenPipeError:
        raise
    except OSError as error:
        raise _refusal(shown, error) from error
    with StagedFiles() as files:
        files.add(shown, blocks)


def read_file(path: str | os.PathLike[str], limit: int, fault: type[GtbError] = SpecError) -> bytes:
    """Read at most `limit` bytes of a file; `fault` with its name and the system's reason if it cannot be read."""
    shown = os.fspath(path)
    try:
        with open(path, "rb") as file:
            return read_up_to(file, limit)
    except OSError as error:
        raise fault(Fault(str(error.strerror or error), shown or repr(shown))) from None
    except ValueError as error:  # a null character in the path
        raise fault(f"{shown!r}: {error}") from None


def read_up_to(file: IO[bytes], limit: int) -> bytes:
    """Read at most `limit` bytes; Python itself takes memory for as many as it is asked for, however few there are."""
    block_bytes = 1 << 20
    with suppress(OSError):  # it stands for no file of the system
        block_bytes = max(block_bytes, os.fstat(file.fileno()).st_size + 1)
    blocks: list[bytes] = []
    while limit > 0 and (block := file.read(min(limit, block_bytes))):
        blocks.append(block)
        limit -= len(block)
    return b"".join(blocks)


def sha256_of(path: str) -> bytes:
    """Return the sha256 of a regular file, of as many bytes as the system gives as its size: some of /proc never end.

    Raises an `OSError` if it cannot be read.
    """
    import hashlib

    with open(path, "rb") as file:
        left, found = os.fstat(file.fileno()).st_size, hashlib.sha256()
        while block := file.read(min(left, 1 << 20)):
            found.update(block)
            left -= len(block)
    return found.digest()


class StagedFiles:
    """Several files that appear together when the `with` block ends, or not at all.

    Every file is first written in full under a temporary name; the renames come last. A `folder` that is missing is
    also made, with its parents, under a temporary name, and appears with all its files in one step. If anything fails
    before that, no file appears and no folder stays; if a rename fails, the `ExportError` says which files are new
    already. A Ctrl-C during the renames finishes them and is then passed on.

    `record` is the name of the file that lists the others, to be added last. An old one is removed before the first
    rename: if the process is killed between renames, no record says that old and new files belong together.
    """

    def __init__(self, folder: str | os.PathLike[str] | None = None, record: str | None = None) -> None:
        self.folder = None if folder is None else os.fspath(folder)
        self._record = record
        self._old_record = ""
        self._staged: dict[str, str] = {}  # target -> temporary
        self._made: list[str] = []
        self._hidden: str | None = None  # the new folder, until it gets its name

    def __enter__(self) -> Self:
        if self.folder is None:
            return self
        _check_path(self.folder)
        place = os.path.abspath(self.folder)
        try:
            if not os.path.lexists(place):
                self._hidden = _temporary_name(place)
                self.make_folder(self._hidden)
            elif not os.path.isdir(self.folder):
                raise ExportError(f"cannot write to {self.folder or repr(self.folder)}: it is not a folder")
        except BaseException as error:
            discard(self._made)
            if isinstance(error, OSError):
                raise _refusal(self.folder, error) from error
            raise
        return self

    def make_folder(self, folder: str) -> None:
        """Make a folder, with its parents, where there is none; it goes again unless files in it appear."""
        missing = [folder]
        while missing[-1] and not os.path.lexists(missing[-1]):
            missing.append(os.path.dirname(missing[-1]))
        for place in missing[-2::-1]:
            self._made.append(place)
            begin(place)
            with suppress(FileExistsError):  # another process may make the same folder
                os.mkdir(place)

    def add(self, path: str, blocks: Iterable[bytes]) -> None:
        """Write `blocks` under a temporary name, to become a file of the folder or of any that exists.

        Raises an `ExportError` if the file was added before, or cannot be written; the others may still appear.
        """
        try:
            target = _target(path)
            if target is None:
                raise ExportError(f"cannot write {path}: it is not a regular file")
            if target in self._staged:
                raise ExportError(f"cannot write {path}: two files of this name")
            if self._hidden is not None and os.path.dirname(target) == os.path.realpath(str(self.folder)):
                temporary = os.path.join(self._hidden, os.path.basename(target))
            else:
                temporary = _temporary_name(target)
            if os.path.basename(path) == self._record:
                self._old_record = target
            self._staged[target] = temporary
            try:
                _stage(temporary, target, blocks)
            except BaseException:
                del self._staged[target]
                _discard(temporary)
                raise
        except OSError as error:
            raise _refusal(path, error) from error

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            if kind is None:
                self._rename()
        except KeyboardInterrupt:
            # A sequence half old and half new would be worse than a late stop.
            self._rename()
            raise
        finally:  # files without a final name go, and folders made for them
            discard([*self._made, *self._staged.values()])

    def _rename(self) -> None:
        """Give all files their names, in a new folder last; continue if that was interrupted."""
        if os.path.lexists(self._old_record) and os.path.lexists(self._staged[self._old_record]):
            _discard(self._old_record)
        new: list[str] = []
        for inside in (False, True):
            if inside and self._hidden is not None:
                with suppress(OSError):  # another process may have made the folder: its files are then replaced
                    os.rename(self._hidden, os.path.abspath(str(self.folder)))
            for target, temporary in self._staged.items():
                if (os.path.dirname(temporary) == self._hidden) != inside or not os.path.lexists(temporary):
                    continue
                try:
                    os.replace(temporary, target)
                except OSError as error:
                    also = f"; new already: {', '.join(new)}" if new else ""
                    raise ExportError(f"{_refusal(target, error)}{also}") from error
                new.append(target)


def discard(places: Sequence[str] | None = None) -> None:
    """Remove files, by default all unfinished files, and folders that are empty without them, the latest first."""
    for place in reversed(list(_unfinished) if places is None else places):
        _discard(place)


def begin(place: str) -> None:
    """Note a temporary file, or a folder made for some, before it is made: if all else fails, it will be removed."""
    _unfinished[place] = None
    if _ledger is not None:
        os.write(_ledger, os.fsencode(os.path.abspath(place)) + b"\0")


def list_unfinished_in(descriptor: int) -> None:
    """Also write the names of temporary files to an open file, from now on, each with a NUL at its end."""
    global _ledger
    _ledger = descriptor


def _check_path(path: str) -> None:
    if "\0" in path:
        raise ExportError(f"cannot write {path!r}: a path holds no NUL character")


def place_outside(path: str) -> str:
    """Return where a link leads that leads out of the folder in which it stands; nothing for any other path."""
    if not os.path.islink(path):
        return ""
    folder, place = os.path.realpath(os.path.dirname(path)), os.path.realpath(path)
    return place if os.path.commonpath([folder, place]) != folder else ""


def refuse_link_out(path: str) -> None:
    """Refuse a link out of its folder, as somebody else may have made it, unless to a stream, a device or a folder."""
    is_file = (place := place_outside(path)) and (os.path.isfile(place) or not os.path.exists(place))
    if is_file and _descriptor(path) is None:
        raise ExportError(f"cannot write {path}: it is a link that leads out of its folder, to {place}")


def _target(path: str) -> str | None:
    """Return the regular file that `path` names, or None if it must be written to directly."""
    _check_path(path)
    if _descriptor(path) is not None:
        return None
    refuse_link_out(path)
    try:
        status = os.stat(path)
    except FileNotFoundError:
        if not os.path.basename(path):
            raise ExportError(f"cannot write {path or repr(path)}: no file is named") from None
        return os.path.realpath(path)
    if stat.S_ISDIR(status.st_mode):
        raise ExportError(f"cannot write {path}: it is a folder")
    if not stat.S_ISREG(status.st_mode):
        return None
    if not os.access(path, os.W_OK):
        # A rename would succeed, and a write-protected file would be lost.
        raise ExportError(f"cannot write {path}: the file is write-protected")
    return os.path.realpath(path)


def _descriptor(path: str) -> int | None:
    """Return the number of the open file that `path` stands for, as `/dev/stdout` does, or None."""
    path, streams = os.path.abspath(path), {"/dev/stdin": 0, "/dev/stdout": 1, "/dev/stderr": 2}
    for _ in range(40):  # as many links as Linux follows
        if (match := re.fullmatch(r"/(?:dev|proc/self)/fd/(\d+)", path)) or path in streams:
            return int(match[1]) if match else streams[path]
        if not os.path.islink(path):
            return None
        path = os.path.normpath(os.path.join(os.path.dirname(path), os.readlink(path)))
    return None


def _temporary_name(target: str) -> str:
    return os.path.join(os.path.dirname(target), f".gtb-{os.urandom(8).hex()}")


def _stage(temporary: str, target: str, blocks: Iterable[bytes]) -> None:
    """Write `blocks` to the new file `temporary`, with the mode and owner that `target` has or would get."""
    old: os.stat_result | None = None
    with suppress(FileNotFoundError):
        old = os.stat(target)
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
    begin(temporary)
    with open(os.open(temporary, flags, 0o666 if old is None else 0o600), "wb") as file:
        if old is not None:
            _make_like(file.fileno(), temporary, old)
        write_all(file, blocks)
        os.fsync(file.fileno())


def _make_like(descriptor: int, path: str, old: os.stat_result) -> None:
    """Give an open file the mode of another and, if allowed, its owner."""
    mode = stat.S_IMODE(old.st_mode)
    if hasattr(os, "fchown"):
        own = os.fstat(descriptor)
        if (own.st_uid, own.st_gid) != (old.st_uid, old.st_gid):
            try:
                os.fchown(descriptor, old.st_uid, old.st_gid)
            except OSError:
                with suppress(OSError):  # only root gives files away; anyone may choose one of their own groups
                    os.fchown(descriptor, -1, old.st_gid)
                mode &= ~(stat.S_ISUID | stat.S_ISGID)  # the old file was not meant to run as another owner
    # By the descriptor if the system can: the path may have been replaced by a link.
    os.chmod(descriptor if os.chmod in os.supports_fd else path, mode)


def write_all(file: IO[bytes], blocks: Iterable[bytes]) -> None:
    """Write blocks to an open file, and flush it."""
    for block in blocks:
        file.write(block)
    file.flush()


def _discard(place: str) -> None:
    with suppress(OSError):  # a folder is not empty: it holds finished files, or files of another process
        os.rmdir(place) if os.path.isdir(place) else os.unlink(place)
    _unfinished.pop(place, None)


def _refusal(path: str, error: OSError) -> ExportError:
    reason = error.strerror or str(error)
    folder = os.path.dirname(path) or os.curdir
    if isinstance(error, FileNotFoundError) and not os.path.isdir(folder):
        reason = f"the folder {folder} does not exist"
    return ExportError(f"cannot write {path}: {reason}")
