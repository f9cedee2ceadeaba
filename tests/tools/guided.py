"""`python -m tests.tools.guided`: inputs that reach new lines of the readers, found by atheris, and what they do there.

Reads specs, expressions and mesh files. What comes out must be a patch, a number or a mesh that is sound, or one clear
error, within a second and a gigabyte, and without a warning. Finds are written to a folder; those that were mended are
kept in `corpus/`, which the tests read.
"""

import argparse
import hashlib
import importlib
import math
import os
import re
import resource
import subprocess
import sys
import time
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path

# Nothing of gtb_cli is imported here: atheris watches only modules that are imported after it was asked to.

CORPUS = Path(__file__).parent / "corpus"  # folders with finds of earlier runs, and a list of expressions


LONGEST = {"spec": 6000, "expression": 280, "mesh": 4000}  # longest inputs that are made, in bytes


# Words that are put in, beside what atheris sees the readers compare with
WORDS = {
    "spec": """knots weights control_points coefficients lifting edge_normals edge_scale name patches [[patches]] [a.b]
        = , [ ] { } : " ' \"\"\" ''' # \\n \\r\\n \\u0000 \\ud800 nan inf -inf true false null 1e400 1e-320 -0.0 0x1f
        1_000 auto unit primitive binomial partition-of-unity sqrt( 1979-05-27 1979-05-27T07:32:00Z [[0,0],[1,0],[0,1]]
        [0,1,2] .""",
    "expression": """sqrt( sin( cos( tan( exp( log( ) ( ** // + - * / pi e 1e308 1e-308 .5 5. 1e 0x1 1_0 2j if or e5
        9**9**9""",
    "mesh": """ply format ascii binary_little_endian binary_big_endian 1.0 element vertex face edge property list uchar
        int float double short vertex_indices vertex1 vertex2 end_header comment solid endsolid facet normal outer loop
        endloop endfacet v f l vn vt g o p s mtllib usemtl -1 1/1/1 1//1 \\ nan inf 1e999 9999999999 nodes meshes mesh
        primitives attributes POSITION mode indices accessors bufferViews bufferView buffers buffer byteLength
        byteOffset byteStride componentType 5126 5123 5125 count type VEC3 SCALAR scenes scene children matrix rotation
        translation scale sparse uri extensionsRequired { } [ ] , : \" """,
}


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


def fuzz(kind: str, seconds: float, folder: Path, seed: int) -> None:
    """Make inputs of one kind until so much processor time has gone; this does not return."""
    import atheris

    with atheris.instrument_imports(include=["gtb_cli", "tomllib", "json"]):
        for module in ("gtb_cli.language.loading", "gtb_cli.formats.meshfiles", "tomllib"):
            importlib.import_module(module)

    inputs, finds = folder / kind, folder / "finds"
    inputs.mkdir(parents=True, exist_ok=True)
    finds.mkdir(exist_ok=True)
    for data in seeds(kind):
        (inputs / hashlib.sha1(data).hexdigest()).write_bytes(data)
    words = folder / f"{kind}.words"
    quoted = ("".join(f"\\x{byte:02x}" for byte in word.encode()) for word in WORDS[kind].split())
    words.write_text("".join(f'"{word}"\n' for word in quoted))
    count = 0

    def one(data: bytes) -> None:
        nonlocal count
        count += 1
        complaint = judge(kind, data)
        if complaint:
            find = finds / f"{kind}-{complaint[0]}"
            if not find.exists() or find.stat().st_size > len(data):
                find.write_bytes(data)
                find.with_name(f"{find.name}.txt").write_text(complaint[1])
        if time.process_time() > seconds:
            print(f"{kind}: {count} inputs, {len(list(inputs.iterdir()))} of them kept for new lines", flush=True)
            os._exit(0)

    options = [
        f"-max_len={LONGEST[kind]}", f"-dict={words}", f"-seed={seed}", "-timeout=20", "-report_slow_units=99",
        "-rss_limit_mb=3000",  # atheris itself keeps more and more
        f"-artifact_prefix={finds}/{kind}-", "-verbosity=0", "-print_final_stats=0", "-close_fd_mask=0",
    ]  # fmt: skip
    atheris.Setup([sys.argv[0], *options, str(inputs)], one)
    atheris.Fuzz()


def main() -> None:
    """Fuzz each kind in a process of its own, and list the finds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60, help="of processor time, for all kinds together")
    parser.add_argument("--folder", type=Path, default=Path("build/guided"), help="where inputs and finds are kept")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", choices=READERS, help="this kind only, in this process")
    options = parser.parse_args()
    if options.kind:
        fuzz(options.kind, 60 * options.minutes, options.folder, options.seed)
    for kind in READERS:
        command = [sys.executable, "-m", "tests.tools.guided", *sys.argv[1:], "--kind", kind]
        subprocess.run([*command, "--minutes", str(options.minutes / len(READERS))], check=False)
    finds = sorted(path.name for path in (options.folder / "finds").iterdir() if path.suffix != ".txt")
    finds = [name for name in finds if "-oom-" not in name]  # memory is judged for each input
    print(f"{len(finds)} finds in {options.folder}/finds {' '.join(finds)}")
    sys.exit(bool(finds))


if __name__ == "__main__":
    main()
