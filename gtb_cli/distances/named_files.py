"""Files that a mesh file names: libraries of materials, and the pictures that it or they name."""

import hashlib
import os
import re
from collections.abc import Iterable
from functools import cache, partial

from gtb_cli.errors import GtbError
from gtb_cli.files import read_file, sha256_of
from gtb_cli.formats.meshfiles import MAX_STREAM_BYTES
from gtb_cli.meshes.mesh import KnownMesh


def named_files(known: KnownMesh, path: str) -> dict[str, bytes | str]:
    """Return digests of what a mesh from a file names, by their names; the names of those that are not there.

    Names are relative to the folder of the file that has them. Raises `GtbError` if one cannot be read.
    """
    held, beside = dict[str, bytes | str](), partial(os.path.join, os.path.dirname(path))
    digest = cache(_digest)  # a file may be named in many ways

    def hold(lines: Iterable[str], place: str = "") -> None:
        """Hold what lines name, perhaps in quotes, each several files, or one with blanks after options."""
        if len(distinct := dict.fromkeys(lines)) > (most := 10_000):
            raise GtbError(f"{path}: it, or a library of it, names more than {most} files")
        for line in (each.replace("\\", "/").replace('"', "").strip() for each in distinct):
            ends = (end for k in range(20) for end in line.split(None, k)[-1:] if " " in end)
            names = next(([end] for end in ends if os.path.isfile(beside(place, end))), line.split())
            for name in (os.path.join(place, name) for name in names):
                held[name] = digest(os.path.realpath(beside(name))) if os.path.isfile(beside(name)) else name

    hold(known.libraries)
    there = {os.path.realpath(beside(name)): name for name, found in held.items() if isinstance(found, bytes)}
    for library, name in there.items() if known.format == "obj" else ():  # materials name pictures
        keys = rb"(?im)^[ \t]*(?:map_\w+|bump|disp|decal|norm|refl)[ \t]+(\S.*)"
        hold(map(os.fsdecode, re.findall(keys, _text(library))), os.path.dirname(name))
    return held


def _text(path: str) -> bytes:
    """Read a library; a backslash continues its lines, which may end in any way."""
    found = read_file(path, min(MAX_STREAM_BYTES, os.path.getsize(path)))
    return found.replace(b"\r\n", b"\n").replace(b"\r", b"\n").replace(b"\\\n", b" ")


def _digest(path: str) -> bytes:
    try:
        if path.lower().endswith(".mtl"):
            return hashlib.sha256(_text(path)).digest()
        return sha256_of(path)
    except OSError as error:
        raise GtbError(f"{path}: {error.strerror or error}") from None
