"""What `gtb degenerate` and `gtb knot-limit` share: a folder with the meshes of a sequence, whole or not at all."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING

import click

from gtb_cli.commands.console import STANDARD, Console, read_spec, shown_input
from gtb_cli.commands.meshing import BOUNDS_RESOLUTION, FORMATS, MeshOptions, expected_bytes, file_stem, summary
from gtb_cli.errors import SpecError

if TYPE_CHECKING:
    from gtb_cli.patch import Patch
    from gtb_cli.sequence import MeshSequence

RECORD = "sequence.json"

SHORT = 6
"""Digits of numbers in names of files; more where a number has more."""

folder_option = click.option(
    "-o",
    "--output",
    "folder",
    metavar="DIR",
    help="Write the files into this folder, which is made if missing.",
)

animate_option = click.option(
    "--animate",
    is_flag=True,
    help="Write one GLB file more, NAME.glb, that plays through all meshes, which are its morph targets.",
)


def read_patch(path: str, spec_format: str | None) -> Patch:
    """Read a spec of a single patch."""
    from gtb_cli.patch import Patch

    spec = read_spec(path, spec_format)
    if not isinstance(spec, Patch):
        raise SpecError(f"{shown_input(path)}: expected a single patch, this is a model of {len(spec.patches)}")
    return spec


def check_options(options: MeshOptions, folder: str) -> None:
    """Refuse what a sequence cannot be."""
    if folder == STANDARD:
        raise click.UsageError("a sequence is several files and needs a folder: -o DIR")
    if os.path.splitext(folder)[1][1:].lower() in FORMATS and not os.path.isdir(folder):
        raise click.UsageError(f"a sequence is several files and needs a folder, and {folder} names a file")
    if options.parametrization == "toric":
        raise click.UsageError(
            "--parametrization toric: the meshes of a sequence have common faces in the linear one only; "
            "toric parameters would run together"
        )
    for name, given in (
        ("radius", options.radius is not None),
        ("thickness", options.thickness is not None),
        ("attribute", bool(options.attributes)),
        ("require", options.require is not None),
    ):
        if given:
            raise click.UsageError(f"--{name} is for single meshes, of gtb mesh")


def model_tolerance(options: MeshOptions, patch: Patch) -> float | None:
    """Return the tolerance in model units; a percentage is of the patch that the spec describes."""
    if not isinstance(options.tolerance, str):
        return options.tolerance
    import math

    from gtb_cli.tessellation import tessellate

    low, high = tessellate(patch, BOUNDS_RESOLUTION, normals=False).bounds
    return float(options.tolerance.removesuffix("%")) / 100 * math.dist(low, high)


def number_text(value: float) -> str:
    """Shortest text of a number for the name of a file: 5, 0.4, 600, 1e6, 1e-30.

    Six digits, or as many as tell it from all other numbers.
    """
    digits = next(n for n in range(1, 18) if float(f"{value:.{n}g}") == value)
    mantissa, e, exponent = f"{value:.{max(digits, SHORT)}g}".partition("e")
    return mantissa + (f"e{int(exponent)}" if e else "")


def write_sequence(
    sequence: MeshSequence, prefix: str, folder: str, options: MeshOptions, console: Console, *, animate: bool
) -> None:
    """Write the meshes, `sequence.json` and, if asked for, an animation; `prefix` is that of values in file names."""
    from gtb_cli.files import StagedFiles

    kind = options.format or "obj"
    stem = file_stem(sequence.name)
    labels = [f"{prefix}{number_text(value)}" for value in sequence.values[:-1]] + ["limit"]
    names = [f"{stem}-{label}.{kind}" for label in labels]
    warnings: list[str] = []
    with StagedFiles(folder) as files, console.progress(len(names)) as progress:
        for name, mesh in zip(names, sequence.meshes, strict=True):
            progress.label = name
            files.add(name, progress.over(options.encoded(mesh, kind), 1.0, expected_bytes(mesh)))
            warnings += [f"{name}: {warning}" for warning in options.warnings(mesh, kind)]
        if animate:
            from gtb_cli.morph import animated_glb

            data = animated_glb(sequence.meshes, labels, normals=options.normals, uv=options.uv)
            files.add(f"{stem}.glb", [data])
        files.add(RECORD, [(json.dumps(sequence.record(names), indent=2) + "\n").encode("ascii")])
    for value, reason in sequence.doubts:
        console.warn(f"{sequence.key} {value:g}: the distance is between coarse meshes: {reason}")
    for warning in warnings:
        console.warn(os.path.join(folder, warning))
    for index, name in enumerate(names):
        text = f"{summary(sequence.meshes[index])}, {sequence.distances[index]:.3g} from the limit"
        if sequence.film_distances is not None:
            text += f", {sequence.film_distances[index]:.3g} from the limit with its film"
        console.note(f"{os.path.join(folder, name)}: {text}")
