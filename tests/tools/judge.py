"""What the readers of specs, expressions and mesh files do with an input, judged: for fuzzing, and for the tests.

What comes out must be a patch, a number or a mesh that is sound, or one clear error, within a second and a gigabyte,
and without a warning. Inputs that once failed, found by atheris, are kept in `corpus/`.
"""

import math
import os
import re
import resource
import time
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path

CORPUS = Path(__file__).parent / "corpus"  # folders with finds of earlier runs, and a list of expressions
LONGEST = {"spec": 6000, "expression": 280, "mesh": 4000}  # of inputs that are judged, in bytes


def check_message(text: str, pattern: str) -> None:
    """A message is a line that names its place, and does nothing to a terminal."""
    assert text.isprintable(), text
    assert re.fullmatch(pattern, text), text


def read_spec(data: bytes) -> None:
    """Read a spec; what is read must be written and read again as the same."""
    from gtb_cli.errors import SpecError
    from gtb_cli.language.loading import parse
    from gtb_cli.language.writer import dump
    from tests.specs import arrays

    for format in (None, "json") if data[:1] == b"[" else (None,):
        try:
            spec = parse(data, "x", format)
        except SpecError as error:
            for line in str(error).split("\n"):
                check_message(line, r"x(:\d+){0,2}: .+")
        else:
            assert arrays(parse(dump(spec))) == arrays(spec)


def read_expression(data: bytes) -> None:
    """Evaluate an expression; a value must be that which Python has for the same text with floats for all numbers."""
    from gtb_cli.errors import SpecError
    from gtb_cli.language.expression import CONSTANTS, FUNCTIONS, evaluate_expression

    text = data.decode("utf-8", "replace")
    try:
        value = evaluate_expression(text)
    except SpecError as error:
        check_message(str(error), "expression ['\"].*")
        return
    assert math.isfinite(value)
    assert re.fullmatch(r"(?:[0-9.eE+\-*/() \t]|sqrt|sin|cos|tan|exp|log|pi)+", text), text
    floats = re.sub(r"(?<![A-Za-z])(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", r'F("\g<0>")', text.strip(" \t"))
    expected = eval(floats, {"__builtins__": {}, "F": float, **FUNCTIONS, **CONSTANTS})
    assert value == expected, f"{value!r}, and Python has {expected!r}"


def read_mesh(data: bytes) -> None:
    """Read a mesh file; what begins with a brace is the description of a GLB file, and after a NUL its numbers."""
    import numpy as np

    from gtb_cli.errors import GtbError
    from gtb_cli.formats.meshfiles import decode_mesh, format_of
    from tests.tiny_meshes import glb_file

    if data[:1] == b"{":
        text, _, binary = data.partition(b"\0")
        data = glb_file(text, binary)
    try:
        known = decode_mesh(data, "x", format_of(data) or "obj")
    except GtbError as error:
        check_message(str(error), "x: .+")
        return
    mesh = known.mesh
    assert len(mesh.vertices)
    assert len(mesh.cells)
    assert np.isfinite(mesh.vertices).all()
    assert np.isfinite(known.half_steps).all()
    assert mesh.cells.min() >= 0
    assert mesh.cells.max() < len(mesh.vertices)
    assert all(0 <= start < stop <= len(mesh.cells) for _, start, stop in mesh.groups)


READERS: dict[str, Callable[[bytes], None]] = {"spec": read_spec, "expression": read_expression, "mesh": read_mesh}


def judge(kind: str, data: bytes) -> tuple[str, str] | None:
    """What is wrong with how an input is read, if anything: in a word for this kind of fault, and at length."""
    limit = 1.0  # longest that an input may take, in processor time
    megabytes = 1024  # most memory that an input may need, beyond the most that was needed before
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.process_time()
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        try:
            READERS[kind](data)
        except Exception as error:  # noqa: BLE001 -- any exception is a find
            frames = [frame for frame in traceback.extract_tb(error.__traceback__) if "gtb_cli" in frame.filename]
            place = f"{os.path.basename(frames[-1].filename)}-{frames[-1].lineno}" if frames else "wrong"
            return f"{type(error).__name__}-{place}", traceback.format_exc()
    seconds = time.process_time() - start
    if warned:
        return f"{warned[0].category.__name__}-{warned[0].lineno}", str(warned[0])
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    if grown > megabytes:
        return "large", f"{grown:.0f} MB"
    return ("slow", f"{seconds:.1f} s") if seconds > limit else None


def seeds(kind: str) -> list[bytes]:
    """Inputs to begin with: what the project has, the corpus, and files that it writes."""
    found = [path.read_bytes() for path in sorted((CORPUS / kind).glob("*"))]
    if kind == "expression":
        found += (CORPUS / "expression.txt").read_bytes().splitlines()
    elif kind == "spec":
        from tests.specs import BAD_SPECS, GOOD_SPECS

        found += [path.read_bytes() for path in [*GOOD_SPECS, *sorted(BAD_SPECS.iterdir())]]
    elif kind == "mesh":
        from tests.tiny_meshes import curve, encoded, surface

        for mesh in (surface(1), curve(2)):
            for format in ("obj", "ply", "glb") if mesh.is_curve else ("obj", "ply", "glb", "stl", "3mf"):
                found.append(encoded(mesh, format))
                if format in ("ply", "stl"):
                    found.append(encoded(mesh, format, ascii=True))
    for data in found[:]:
        if data[:4] == b"glTF":
            length = int.from_bytes(data[12:16], "little")
            found.append(data[20 : 20 + length] + b"\0" + data[28 + length :])
    return [data for data in found if len(data) <= LONGEST[kind]]
