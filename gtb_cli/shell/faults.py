"""Exceptions of any kind as faults: a message in the words of the command line, with its file, line and key."""

import errno
import os
import re
import sys
from collections.abc import Collection

from gtb_cli.errors import Fault, GtbError
from gtb_cli.files import place_outside
from gtb_cli.process.memory import shortage


def faults_about(error: Exception) -> list[Fault]:
    """Return the faults of any error; GTB_TRACEBACK=1 shows where an internal error comes from."""
    system_limits = {
        errno.EMFILE: "too many open files: the system allows this process no more",
        errno.ENFILE: "too many open files: the system allows no more",
        errno.EAGAIN: "no more processes or threads: the system allows no more",
        errno.ENOMEM: shortage(),
        errno.ENOENT: "the working folder is gone",
    }
    match error:
        case GtbError():
            return [discreet(fault._replace(message=in_options(fault.message))) for fault in error.faults]
        case MemoryError() | SystemError():  # the second, from C code that had no memory left to say so
            return [Fault(shortage())]
        case ImportError(msg=str() as text) if "failed to map segment" in text:  # of a library too large for the memory
            return [Fault(shortage())]
        case ImportError(name=str() as name) if not name.startswith("gtb_cli"):
            return [Fault(f"this needs {name.partition('.')[0].strip('_')}, which is missing here")]
        case OSError(filename=str() | bytes() as name):
            return [Fault(str(error.strerror), os.fsdecode(name))]
        case OSError(errno=number) if number in system_limits:
            return [Fault(system_limits[number])]
        case OSError():
            return [Fault(f"cannot write standard output: {error.strerror or error}")]
    if os.environ.get("GTB_TRACEBACK") and sys.stderr is not None:
        import traceback

        traceback.print_exception(error)
    text = f"internal error, please report it: {type(error).__name__}: {error} (GTB_TRACEBACK=1 shows where)"
    return [Fault(text)]


def in_options(message: str) -> str:
    """Return a message of the library with options in place of the arguments that it names in backticks."""
    named = "ascii g2-tolerance index lifted lifting max-faces merge patch size steps thickness tolerance"
    options = {name.replace("-", "_"): f"--{name}" for name in f"{named} unnormalised vary weld what".split()} | {
        'continuity="g0"': "--continuity g0",
        "distances=False": "--no-distance",
        "fill": "gtb fill",
        "fills": "--fill",
        "fit": "gtb fit",
        "hole": "--hole EDGE",
        "let": "--set",
        "max_degree": "max_degree in Python",
        'parametrization="toric"': "--parametrization toric",
        "radius": "--radius R",
        "resolution": "-n",
        'rim="normal"': "--rim normal",
        "x": "-x",
    }
    return re.sub("`([^`\n]+)`", lambda found: options.get(found[1], found[0]), message)


def located(fault: Fault, names: Collection[str] = ()) -> Fault:
    """Return a fault with the file, line, column and key with which its message begins, if it lacks them.

    A file is one of `names`, which stand on the command line, standard input, or a file that exists; its name may have
    colons in it, so the longest such beginning counts. A key has no blanks in it and begins with a small letter.
    """
    file, message = fault.file, fault.message
    if file is None:
        ending = re.compile(r"(?::(\d+))?(?::(\d+))?: (?:line (\d+): )?")
        starts = {message[:i]: found for i, c in enumerate(message) if c == ":" and (found := ending.match(message, i))}
        named = [start for start in starts if start in names or start == "<stdin>"]
        if not (known := named or [start for start in starts if os.path.lexists(start)]):
            return fault
        file = known[-1]
        found = starts[file]
        line, column = found[1] or found[3], found[2]
        message = message[found.end() :]
        fault = Fault(message, file, int(line) if line else None, int(column) if column else None)
    if fault.key is None and (key := re.match(r"([a-z_]\w*(?:\[\d+\]|\.\w+)*): ", message)):
        fault = fault._replace(key=key[1], message=message[key.end() :])
    return fault


def discreet(fault: Fault) -> Fault:
    """Return a fault without what it quotes, if the file with which it begins is a link out of its folder.

    So a job on a stranger's files puts no line of another file into its log.
    """
    quotations = r"""'(?:[^'\\]|\\.)*'|"(?:[^"\\]|\\.)*\""""
    text = str(fault)
    path = next((text[:i] for i, c in enumerate(text) if c == ":" and leads_out(text[:i])), None)
    if path is None:
        return fault
    rest = fault.message if fault.file else fault.message.removeprefix(path)
    start = fault.message.removesuffix(rest)
    message, count = re.subn(quotations, "…", rest)
    key, keys = re.subn(quotations, "…", fault.key or "")
    note = " (not quoted: a link leads out of its folder)" if count + keys else ""
    return fault._replace(message=f"{start}{message}{note}", key=key or None)


def leads_out(path: str) -> bool:
    """Tell whether one of the links in a path leads out of the folder in which it stands."""
    while path.strip(os.sep):
        if place_outside(path):
            return True
        path = os.path.dirname(path)
    return False
