"""Files that appear whole or not at all, whatever happens while they are written."""

import errno
import os
import re
import signal
import stat
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from gtb_cli import files
from gtb_cli.errors import DomainError, ExportError
from gtb_cli.files import StagedFiles, replace_file
from gtb_cli.shell.streams import refuse_overwriting


def breaking(error: BaseException):
    """Blocks that end in an error."""
    yield b"the first half"
    raise error


def stage(folder, contents, record=None):
    with StagedFiles(folder, record) as staged:
        for name, blocks in contents.items():
            staged.add(f"{folder}/{name}", blocks)


def contents(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.iterdir()}


FAILURES = [
    (OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), ExportError, "No space left on device"),
    (OSError(errno.EDQUOT, os.strerror(errno.EDQUOT)), ExportError, os.strerror(errno.EDQUOT)),
    (KeyboardInterrupt(), KeyboardInterrupt, None),
    (DomainError("knots"), DomainError, "knots"),
    (MemoryError(), MemoryError, None),
]


@pytest.fixture
def umask():
    old = os.umask(0o027)
    yield 0o027
    os.umask(old)


@pytest.mark.parametrize("mode", [None, 0o600, 0o644, 0o777, 0o660])
def test_a_replaced_file_keeps_its_mode_and_a_new_one_has_the_usual_one(tmp_path, umask, mode):
    path = tmp_path / "mesh.obj"
    if mode is not None:
        path.write_text("old")
        path.chmod(mode)
    replace_file(path, [b"one", b"two"])
    assert contents(tmp_path) == {"mesh.obj": "onetwo"}
    assert stat.S_IMODE(path.stat().st_mode) == (0o666 & ~umask if mode is None else mode)


@pytest.mark.parametrize(("error", "raised", "message"), FAILURES)
@pytest.mark.parametrize("old", [{}, {"mesh.obj": "old"}])
def test_a_failure_leaves_what_was_there(tmp_path, error, raised, message, old):
    path = tmp_path / "mesh.obj"
    for name, text in old.items():
        (tmp_path / name).write_text(text)
    with pytest.raises(raised, match=message) as caught:
        replace_file(path, breaking(error))
    if raised is ExportError:
        assert str(caught.value) == f"cannot write {path}: {message}"
    with pytest.raises(raised, match=message):
        stage(tmp_path, {"mesh.obj": [b"new"], "b.obj": breaking(error)})
    with pytest.raises(raised, match=message):
        stage(tmp_path / "deep" / "out", {"mesh.obj": [b"new"], "b.obj": breaking(error)})
    assert contents(tmp_path) == old


@pytest.mark.parametrize(("step", "number"), [("open", errno.EACCES), ("fsync", errno.ENOSPC), ("replace", errno.EIO)])
def test_a_step_that_the_system_refuses_leaves_nothing(tmp_path, monkeypatch, step, number):
    def refuse(*_):
        raise OSError(number, os.strerror(number))

    with monkeypatch.context() as patch:
        patch.setattr(os, step, refuse)
        with pytest.raises(ExportError, match=rf"a\.obj: {os.strerror(number)}"):
            stage(tmp_path, {"a.obj": [b"new"], "b.obj": [b"new"]})
        with pytest.raises(ExportError, match=rf"c\.obj: {os.strerror(number)}"):
            replace_file(tmp_path / "c.obj", [b"new"])
    assert contents(tmp_path) == {}


def test_the_old_file_is_there_while_the_new_one_is_written(tmp_path):
    path = tmp_path / "mesh.obj"
    path.write_text("old")

    def blocks():
        yield b"new"
        names = sorted(os.listdir(tmp_path))
        assert len(names) == 2
        assert re.fullmatch(r"\.gtb-[0-9a-f]{16}", names[0])
        assert path.read_text() == "old"

    replace_file(path, blocks())
    assert path.read_text() == "new"


def test_the_file_is_flushed_before_it_is_renamed(tmp_path, monkeypatch):
    calls = []
    fsync, rename = os.fsync, os.replace

    def noted_fsync(descriptor):
        calls.append(("fsync", os.fstat(descriptor).st_size))
        fsync(descriptor)

    def noted_rename(source, target):
        calls.append(("replace", os.stat(source).st_size))
        rename(source, target)

    monkeypatch.setattr(os, "fsync", noted_fsync)
    monkeypatch.setattr(os, "replace", noted_rename)
    replace_file(tmp_path / "mesh.obj", [b"new"])
    assert calls == [("fsync", 3), ("replace", 3)]


@pytest.mark.parametrize("exists", [True, False])
def test_a_symbolic_link_is_followed(tmp_path, exists):
    (tmp_path / "far").mkdir()
    real, link = tmp_path / "far" / "real.obj", tmp_path / "link.obj"
    if exists:
        real.write_text("old")
        real.chmod(0o640)
    link.symlink_to("far/real.obj")
    replace_file(link, [b"new"])
    assert link.is_symlink()
    assert real.read_text() == "new"
    assert not exists or stat.S_IMODE(real.stat().st_mode) == 0o640
    assert os.listdir(tmp_path / "far") == ["real.obj"]


@pytest.mark.parametrize("name", ["real", "new", "folder/real"])
def test_nothing_is_written_through_a_link_out_of_its_folder(tmp_path, name):
    (tmp_path / "out").mkdir()
    (tmp_path / "real").write_text("mine")
    (tmp_path / "out" / "folder").symlink_to(tmp_path)
    (tmp_path / "out" / "near").symlink_to(f"../{name}" if name != "folder/real" else name)
    link, told = tmp_path / "out" / "link.html", f"leads out of its folder, to {tmp_path / os.path.basename(name)}"
    link.symlink_to("near")
    with pytest.raises(ExportError, match=re.escape(told)):
        replace_file(link, [b"new"])
    with pytest.raises(ExportError, match=re.escape(told)):
        refuse_overwriting([], [str(link)])
    replace_file(tmp_path / "out" / "folder" / "other", [b"new"])  # a folder that is a link is the user's own
    texts = {path.name: path.read_text() for path in tmp_path.iterdir() if path.is_file()}
    assert texts == {"real": "mine", "other": "new"}


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("missing/mesh.obj", "the folder {0}/missing does not exist"),
        ("folder", "it is a folder"),
        ("folder/", "it is a folder"),
        ("file/mesh.obj", "Not a directory"),
        ("loop", "Too many levels of symbolic links"),
        ("n" * 300, "File name too long"),
        ("missing/", "no file is named"),
    ],
)
def test_a_place_that_cannot_be_written_is_named(tmp_path, name, message):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("file")
    (tmp_path / "loop").symlink_to("loop")
    path = f"{tmp_path}/{name}"
    with pytest.raises(ExportError) as caught:
        replace_file(path, [b"new"])
    assert str(caught.value) == f"cannot write {path}: {message.format(tmp_path)}"
    assert sorted(os.listdir(tmp_path)) == ["file", "folder", "loop"]


@pytest.mark.parametrize("path", ["", "a\0b"])
def test_a_path_that_is_none(path):
    with pytest.raises(ExportError, match="cannot write '"):
        replace_file(path, [b"new"])


def test_a_write_protected_file_is_not_replaced(tmp_path, monkeypatch):
    (tmp_path / "mesh.obj").write_text("old")
    monkeypatch.setattr(os, "access", lambda path, mode: mode != os.W_OK)
    with pytest.raises(ExportError, match="the file is write-protected"):
        replace_file(tmp_path / "mesh.obj", [b"new"])
    assert (tmp_path / "mesh.obj").read_text() == "old"


def test_the_mode_is_set_on_what_was_opened(tmp_path, monkeypatch):
    """A link that is put in the place of the temporary file does not lead the mode elsewhere."""
    (tmp_path / "mesh.obj").write_text("old")
    (tmp_path / "mesh.obj").chmod(0o666)
    (tmp_path / "secret").write_text("secret")
    (tmp_path / "secret").chmod(0o600)
    real = os.open

    def swapped(path, *arguments):
        descriptor = real(path, *arguments)
        os.unlink(path)
        os.symlink(tmp_path / "secret", path)
        return descriptor

    monkeypatch.setattr(os, "open", swapped)
    replace_file(tmp_path / "mesh.obj", [b"new"])
    assert stat.S_IMODE((tmp_path / "secret").stat().st_mode) == 0o600


@pytest.mark.parametrize("may", [True, False])
def test_the_owner_is_kept_where_the_system_allows_it(may, tmp_path, monkeypatch):
    calls = []

    def chown(descriptor, owner, group):
        calls.append((owner, group))
        if not may and owner != -1:
            raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))

    monkeypatch.setattr(os, "fchown", chown)
    mode = stat.S_IFREG | stat.S_ISUID | 0o640
    with open(tmp_path / "new", "wb") as file:
        files._make_like(file.fileno(), file.name, os.stat_result((mode, 0, 0, 1, 4321, 1234, 0, 0, 0, 0)))
        files._make_like(file.fileno(), file.name, os.fstat(file.fileno()))
    assert calls == [(4321, 1234)] if may else [(4321, 1234), (-1, 1234)]
    assert (tmp_path / "new").stat().st_mode == (mode if may else mode & ~stat.S_ISUID)


# --- what is not a regular file --------------------------------------------------------------------------------------


def test_devices_are_written_to_directly():
    replace_file("/dev/null", [b"new"])
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)
    with pytest.raises(ExportError, match="cannot write /dev/full: No space left on device"):
        replace_file("/dev/full", [b"new"])
    assert stat.S_ISCHR(os.stat("/dev/full").st_mode)


def test_a_fifo_is_written_to_directly(tmp_path):
    os.mkfifo(tmp_path / "fifo")
    received = []
    reader = threading.Thread(target=lambda: received.append((tmp_path / "fifo").read_bytes()))
    reader.start()
    replace_file(tmp_path / "fifo", [b"one", b"two"])
    reader.join()
    assert received == [b"onetwo"]
    assert os.listdir(tmp_path) == ["fifo"]


WRITE = "import sys; from gtb_cli.files import replace_file; replace_file(sys.argv[1], [b'new\\n'])"


def run(path: str | Path, **streams):
    root = Path(__file__).parents[1]
    return subprocess.run([sys.executable, "-c", WRITE, str(path)], cwd=root, stderr=subprocess.PIPE, **streams)


@pytest.mark.parametrize("name", ["/dev/stdout", "/dev/fd/1", "/proc/self/fd/1", "link"])
def test_standard_output_by_name(name, tmp_path):
    (tmp_path / "link").symlink_to("/dev/stdout")
    path = tmp_path / name
    assert run(path, stdout=subprocess.PIPE).stdout == b"new\n"
    # Redirected to a file, what was written before stays: no renaming over it, no start from its beginning.
    with open(tmp_path / "out", "wb") as out:
        out.write(b"old\n")
        out.flush()
        assert run(path, stdout=out).returncode == 0
    assert (tmp_path / "out").read_bytes() == b"old\nnew\n"
    assert sorted(os.listdir(tmp_path)) == ["link", "out"]


def test_a_pipe_whose_reader_has_gone():
    reader, writer = os.pipe()
    os.close(reader)
    with pytest.raises(BrokenPipeError):
        replace_file(f"/dev/fd/{writer}", [b"new"])
    os.close(writer)


# --- several files ---------------------------------------------------------------------------------------------------


def test_ctrl_c_during_the_renames_finishes_them(tmp_path, monkeypatch):
    (tmp_path / "a.obj").write_text("old")
    (tmp_path / "b.obj").write_text("old")
    real, calls = os.replace, []

    def interrupted(source, target):
        calls.append(target)
        real(source, target)
        if len(calls) == 1:
            raise KeyboardInterrupt  # after the rename, before it is noted

    monkeypatch.setattr(os, "replace", interrupted)
    names = ("a.obj", "b.obj", "c.obj")
    with pytest.raises(KeyboardInterrupt):
        stage(tmp_path, {name: [b"new"] for name in names})
    assert contents(tmp_path) == dict.fromkeys(names, "new")


@pytest.mark.parametrize("failing", ["a", "b", "c", "record"])
def test_a_rename_that_fails_says_which_files_are_new(failing, tmp_path, monkeypatch):
    """This happens in a folder where only the owner of a file may replace it."""
    for name in ("a", "c", "record"):
        (tmp_path / name).write_text("old")
    real = os.replace

    def sticky(source, target):
        if os.path.basename(target) == failing:
            raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))
        real(source, target)

    monkeypatch.setattr(os, "replace", sticky)
    with pytest.raises(ExportError, match=rf"cannot write {tmp_path}/{failing}: Operation not permitted") as caught:
        stage(tmp_path, {name: [b"new"] for name in ("a", "b", "c", "record")}, "record")
    found = contents(tmp_path)
    new = [name for name in ("a", "b", "c") if name < failing]
    assert found == {name: "new" if name in new else "old" for name in ("a", "c")} | dict.fromkeys(new, "new")
    said = str(caught.value).partition("; new already: ")[2]
    assert said == ", ".join(str(tmp_path / name) for name in new)


def test_a_new_folder_goes_again_when_a_file_elsewhere_cannot_be_renamed(tmp_path, monkeypatch):
    def refuse(*_):
        raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))

    staged = StagedFiles(tmp_path / "deep" / "out")
    staged.__enter__()
    staged.add(f"{tmp_path}/deep/out/a", [b"new"])
    staged.add(f"{tmp_path}/manifest", [b"new"])
    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(ExportError, match="manifest: Operation not permitted"):
        staged.__exit__(None, None, None)
    assert os.listdir(tmp_path) == []


def test_what_is_unfinished_can_be_discarded_from_outside(tmp_path):
    """A process that leaves at once does so."""
    with StagedFiles(tmp_path / "deep" / "out") as staged:
        staged.add(f"{tmp_path}/deep/out/a", [b"new"])
        staged.add(f"{tmp_path}/b", [b"new"])
        files.discard()
        assert os.listdir(tmp_path) == []
    assert os.listdir(tmp_path) == []


KILLED = """
import os, signal, sys
from gtb_cli.files import StagedFiles

def killing(function):
    def killed(*arguments):
        global calls
        calls -= 1
        if calls < 0:
            os.kill(os.getpid(), signal.SIGKILL)
        return function(*arguments)
    return killed

folder, calls = sys.argv[1], int(sys.argv[2])
with StagedFiles(folder, "record") as staged:
    for name in ("a", "b", "record"):
        staged.add(os.path.join(folder, name), [b"new"])
    os.replace, os.rename, os.unlink = killing(os.replace), killing(os.rename), killing(os.unlink)
"""
"""Kills itself before one of the steps by which files get their names."""


@pytest.mark.parametrize("there", [True, False])
@pytest.mark.parametrize("calls", range(5))
def test_killed_between_the_renames_there_is_no_record_of_a_mixture(calls, there, tmp_path):
    folder = tmp_path / "out"
    if there:
        folder.mkdir()
        for name in ("a", "b", "record"):
            (folder / name).write_text("old")
    root = Path(__file__).parents[1]
    done = subprocess.run([sys.executable, "-c", KILLED, str(folder), str(calls)], cwd=root)
    assert done.returncode == -signal.SIGKILL or calls >= 4
    found = {path.name: path.read_text() for path in folder.glob("[!.]*")}
    if not there:  # in one step
        assert found == ({} if calls == 0 else dict.fromkeys(("a", "b", "record"), "new"))
        assert folder.exists() == (calls > 0)
    elif "record" in found:
        assert found == dict.fromkeys(("a", "b", "record"), "new" if calls == 4 else "old")
    else:
        assert 0 < calls < 4


def test_a_folder_that_appears_meanwhile_keeps_its_other_files(tmp_path):
    folder = tmp_path / "deep" / "out"
    with StagedFiles(folder, "record") as staged:
        staged.add(f"{folder}/a", [b"new"])
        staged.add(f"{folder}/record", [b"new"])
        assert not folder.exists()
        folder.mkdir()
        for name in ("a", "other"):
            (folder / name).write_text("old")
    assert contents(folder) == {"a": "new", "record": "new", "other": "old"}
    assert os.listdir(tmp_path / "deep") == ["out"]


def test_staged_files_refuse_what_cannot_be_renamed_over(tmp_path):
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "folder").mkdir()
    (tmp_path / "link").symlink_to("a.obj")
    with StagedFiles(tmp_path) as staged:
        staged.add(f"{tmp_path}/a.obj", [b"new"])
        for name, message in (
            ("fifo", "not a regular file"),
            ("folder", "it is a folder"),
            ("a.obj", "two files of this name"),
            ("link", "two files of this name"),
        ):
            with pytest.raises(ExportError, match=message):
                staged.add(f"{tmp_path}/{name}", [b"new"])
    assert sorted(os.listdir(tmp_path)) == ["a.obj", "fifo", "folder", "link"]


def test_a_folder_that_is_none(tmp_path):
    (tmp_path / "file").write_text("file")
    for folder in (tmp_path / "file", tmp_path / "file" / "below", "a\0b", ""):
        with pytest.raises(ExportError, match="cannot write"), StagedFiles(folder):
            pass
    assert os.listdir(tmp_path) == ["file"]
