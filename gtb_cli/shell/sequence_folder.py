"""The folder of meshes that `gtb degenerate` and `gtb knot-limit` write, and the options for it."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import click

from gtb_cli.errors import ExportError
from gtb_cli.language.reading import Reading
from gtb_cli.shell.gathering import Option, gathered, option
from gtb_cli.shell.meshing import MeshOptions, summary
from gtb_cli.shell.messages import STANDARD, Console
from gtb_cli.shell.options import check_outputs, console_option, mesh_options, output_to, reading_option
from gtb_cli.shell.streams import Streams, about, file_stem, is_device, is_folder, shown_input, write_text
from gtb_cli.vocabulary import FORMATS, SCHEMA, SEQUENCE_RECORD, suffix_of

if TYPE_CHECKING:
    from gtb_cli.sequences.sequence import Member, MeshSequence
    from gtb_cli.theory.patch import Patch


@dataclass(frozen=True)
class SequenceOutput:
    """The output that the options of a sequence ask for: its meshes, a spec on standard output, or both."""

    streams: Streams  # with a folder, or standard output
    meshes: bool
    emits_spec: bool
    distances: bool
    options: MeshOptions

    def made(self, maker: Callable[..., MeshSequence], patch: Patch, *arguments: object) -> MeshSequence | None:
        """Return the sequence that `maker` makes, or None if no meshes are wanted."""
        if not self.meshes:
            return None
        kind = self.options.format or "obj"
        if not FORMATS[kind].curves and patch.dimension == 1:
            why = "holds triangles, and a curve has none: the meshes of its sequence are OBJ, PLY or GLB"
            raise ExportError(f"{kind.upper()} {why}")
        recipe = self.options.recipe
        fineness = {"resolution": recipe.resolution, "tolerance": recipe.tolerance_for(patch)}
        more = {"normals": recipe.normals, "max_faces": recipe.max_faces, "distances": self.distances}
        return maker(patch, *arguments, **fineness, **more)

    def write(self, sequence: MeshSequence | None, spec: str, spec_text: str) -> None:
        """Make, write and report the meshes, and print the text of a spec; errors name `spec`."""
        if sequence is not None:
            self._write_folder(sequence, spec)
        if self.emits_spec:
            write_text(STANDARD, spec_text)

    def _write_folder(self, sequence: MeshSequence, spec: str) -> None:
        stem, kind = file_stem(sequence.name), self.options.format or "obj"
        labels = [*(f"{sequence.key}{number_text(value)}" for value in sequence.values[:-1]), "limit"]
        names = [f"{stem}-{label}.{kind}" for label in labels]
        folder, console = self.streams.output, self.streams.console
        *places, record = [os.path.join(folder, name) for name in [*names, SEQUENCE_RECORD]]
        check_outputs(*places, record)
        from gtb_cli.files import StagedFiles

        entries, members = [], iter(sequence)
        with StagedFiles(folder, SEQUENCE_RECORD) as files:
            with console.counter(len(names)) as begin:
                for place, name in zip(places, names, strict=True):
                    begin(name)
                    with about(shown_input(spec)):
                        member = next(members)
                    files.add(place, self.options.encoded(member.mesh, kind))
                    entries.append(sequence.entry(member, name))
                    self._report(place, sequence, member, self.options.warnings(member.mesh, kind))
            content = sequence.record(entries)
            files.add(record, [(json.dumps({"schema": SCHEMA, **content}, indent=2) + "\n").encode("ascii")])
        if rate := content["rate"]["predicted"]:
            power = "(1 − step)^" if sequence.key == "step" else "x^" if sequence.values[-1] == 0 else "x^-"
            console.note(f"{stem}: distances from the limit fall as {power}{rate:.3g} or faster in theory")

    def _report(self, place: str, sequence: MeshSequence, member: Member, warnings: Iterable[str]) -> None:
        if member.doubt:
            doubt = f"the distance is between coarse meshes: {member.doubt}"
            self.streams.console.warn(f"{sequence.key} {member.value:g}: {doubt}")
        text, filmed = "", member.film_distance
        if member.value != sequence.values[-1]:
            text += f", {member.distance:.3g} from the limit" if member.distance is not None else ""
            text += f", {filmed:.3g} from the limit with its film" if filmed is not None else ""
        elif filmed is not None:
            text = f", its film reaches {filmed:.3g} from it"
        self.streams.console.report(place, f"{summary(member.mesh)}{text}", warnings)


def _output(
    emit_spec: bool, no_distance: bool, output: str | None, options: MeshOptions, reading: Reading, console: Console
) -> SequenceOutput:
    if output == STANDARD and emit_spec:
        raise click.UsageError("--emit-spec prints to standard output: give another -o, or none")
    meshes, place = output is not None or not emit_spec, output or STANDARD
    if meshes:
        if not is_folder(place) and (place == STANDARD or is_device(place) or suffix_of(place) in FORMATS):
            raise click.UsageError(f"a sequence is several files: give a folder, -o DIR, in place of {place}")
        if options.ascii and options.format == "glb":
            raise click.UsageError("--ascii: GLB has no text form")
        if options.recipe.parametrization == "toric":
            same = "the meshes of a sequence have the same faces only in the linear one"
            raise click.UsageError(f"--parametrization toric: {same}; toric parameters would run together")
        options.refuse("is for single meshes, of gtb mesh", "radius", "thickness", "attributes", "require")
    return SequenceOutput(Streams(console, place, reading), meshes, emit_spec, not no_distance, options)


def sequence_options(spec_help: str) -> Option:
    """Add the options of a sequence, with this help for ``--emit-spec``; the command gets a `SequenceOutput`."""
    return gathered(
        "out",
        _output,
        option("--emit-spec", bool)(help=spec_help),
        option("--no-distance", bool)(
            help="Do not measure how far the meshes are from the limit, which may take longer than making them."
        ),
        output_to("-o, --output DIR")(help="Write the files into this folder, which is made if missing."),
        mesh_options(),
        reading_option,
        console_option,
    )


def number_text(value: float) -> str:
    """Return a number for a file name, such as 0.4 or 1e6: six digits, or as many as tell it from all others."""
    value += 0.0  # not -0
    digits = next(n for n in range(6, 18) if float(f"{value:.{n}g}") == value)
    mantissa, e, exponent = f"{value:.{digits}g}".partition("e")
    return mantissa + (f"e{int(exponent)}" if e else "")
