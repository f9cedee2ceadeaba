"""Files of other programs as patches: their formats, and how to tell them apart."""

import os
from importlib import import_module
from typing import NamedTuple

from gtb_cli.errors import Fault, SpecError
from gtb_cli.files import read_file
from gtb_cli.importers.cad_files import cad_kind
from gtb_cli.language.document import MAX_BYTES, kind_of
from gtb_cli.language.loading import stem_of
from gtb_cli.models.model import Model
from gtb_cli.theory.patch import Patch
from gtb_cli.vocabulary import CAD_FORMATS, suffix_of


class Imported(NamedTuple):
    """The content of a file, and what it has that a patch cannot hold, such as units and trimming."""

    shape: Patch | Model
    remarks: tuple[str, ...]


# Formats and the modules of their readers, imported when they are needed: each gives patches and remarks on what is
# left out; its `SpecError` says what a file has wrong, and where
READERS = {"trp": "trp", **dict.fromkeys(("bv", "bpt", "bzr"), "bv_bpt_bzr"), **dict.fromkeys(CAD_FORMATS, "cad_files")}


def import_file(path: str | os.PathLike[str], format: str | None = None) -> Imported:
    """Read a file of another program as a patch or a model.

    Parameters
    ----------
    path : path
    format : {"trp", "bv", "bpt", "bzr", "step", "iges", "brep"}, optional
        By default it is found from the content or the suffix.

    Returns
    -------
    Imported
        ``found.shape``, and ``found.remarks`` on what the file has that a patch cannot hold, such as trimming.

    Raises
    ------
    SpecError
        The file cannot be read: file, line and what was found.
    """
    if format is not None and format not in READERS:
        raise SpecError(f"format: expected one of {', '.join(READERS)}, got {format!r}")
    source = os.fspath(path)
    return import_data(source, read_file(source, MAX_BYTES + 1), format)


def import_data(path: str, data: bytes, format: str | None = None) -> Imported:
    """Read the content of a file of another program, as `import_file` does.

    Curves and surfaces cannot be mixed in a model: if a file has both, only the surfaces are read. A `SpecError` names
    the file, the line and what was found.
    """
    if len(data) > MAX_BYTES:
        raise SpecError(f"{path}: is too large, at most {MAX_BYTES // 10**6} MB are read")
    format = format or cad_kind(data, path) or suffix_of(path)
    if format not in READERS:
        if kind := kind_of(data):
            why = ": triangles cannot become patches" if kind.endswith("mesh") else ""
            raise SpecError(f"{path}: is {kind}, and holds no patches{why}")
        known = f"by its content or suffix; name one of {', '.join(READERS)}"
        raise SpecError(f"{path}: is in no format that is known {known}")
    room = import_module(f"gtb_cli.importers.{READERS[format]}")
    patches, remarks = getattr(room, f"read_{format}")(data, path)
    surfaces = [patch for patch in patches if patch.dimension == 2]
    if surfaces and len(surfaces) < len(patches):
        remarks.append(f"{len(patches) - len(surfaces)} curves beside the surfaces are left out")
        patches = surfaces
    if not patches:
        raise SpecError(*(Fault(line, path) for line in ["has no patches", *remarks]))
    name = stem_of(path)
    named = patches[0].replace(name=patches[0].name or name)
    return Imported(named if len(patches) == 1 else Model(tuple(patches), name), tuple(remarks))
