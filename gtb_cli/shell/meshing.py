"""The mesh options of a command, as formats, bytes and messages of files."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import fields, replace
from functools import partial
from typing import TYPE_CHECKING

import click

from gtb_cli.errors import ToleranceError
from gtb_cli.shell.streams import Spec, output_format, refuse_terminal
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.values import frozen
from gtb_cli.vocabulary import CAD_SUFFIXES, CELL_FORMATS, FORMATS, Up

if TYPE_CHECKING:
    from gtb_cli.meshes.mesh import Mesh


@frozen
class MeshOptions:
    """The mesh to make, and the format in which it is written."""

    recipe: Recipe
    format: str | None = None  # given by the name of the output
    uv: bool = False
    ascii: bool = False
    up: Up | None = None  # as the format prescribes
    unit: str | None = None  # mm, where the format names one

    def refuse(self, reason: str, *names: str) -> None:
        """Raise a usage error with a reason if one of these options is given."""
        for name in names:
            if getattr(self if name in ("uv", "ascii") else self.recipe, name):
                raise click.UsageError(f"--{name.replace('attributes', 'attribute')} {reason}")

    @property
    def settings(self) -> dict[str, object]:
        """Return the options on which a file may depend, as plain data."""
        recipe = self.recipe
        taken = {field.name: getattr(recipe, field.name) for field in fields(recipe)}
        taken["resolution"] = recipe.resolution if recipe.tolerance is None else None
        own = {name: getattr(self, name) for name in ("format", "uv", "ascii", "up", "unit")}
        return taken | own | {"up": self.up or FORMATS[self.format or "obj"].up}

    def made(self, spec: Spec, kind: str) -> tuple[Mesh, list[str]]:
        """Make a mesh for a format, and remarks; refuse a tolerance of curves that the file's numbers cannot hold."""
        from gtb_cli.formats.export import held, rounding_in

        tolerance, rounding = self.recipe.tolerance_for(spec), 0.0
        if tolerance is not None and self.recipe.assurance(spec) == "certified":
            rounding = rounding_in(kind, [patch.control_points for patch in spec.patches], self.ascii)
            if rounding >= tolerance:
                way_out = "--ascii keeps" if FORMATS[kind].text == "on request" else "PLY with --ascii keeps"
                why = f"whose numbers move vertices by up to {rounding:.2g}: {way_out} all digits"
                raise ToleranceError(f"tolerance: {tolerance:g} cannot be certified in {kind.upper()}, {why}")
        has_normals = FORMATS[kind].has_normals(self.recipe.normals or None) and spec.dimension == 2
        recipe = replace(self.recipe, normals=self.recipe.normals or has_normals)
        return recipe.mesh(spec, rounding, partial(held, kind=kind, ascii=self.ascii))

    def encoded(self, mesh: Mesh, kind: str) -> Iterable[bytes]:
        """Return the bytes of a mesh in a format, block by block."""
        from gtb_cli.formats.export import encode_mesh

        normals = self.recipe.normals or None  # None: the format decides
        return encode_mesh(mesh, kind, ascii=self.ascii, normals=normals, uv=self.uv, up=self.up, unit=self.unit)

    def warnings(self, mesh: Mesh, kind: str) -> list[str]:
        """Return what the user should know about such a file."""
        from gtb_cli.formats.export import warnings_for

        messages = warnings_for(mesh, kind, ascii=self.ascii, normals=self.recipe.normals, uv=self.uv)
        if self.recipe.attributes and kind != "ply":
            messages.append(f"{kind.upper()} cannot hold attributes, and none are written; PLY can")
        return messages

    def format_for(self, output: str) -> str:
        """Return the format of an output, as `output_format` does; refuse a binary one on a terminal."""
        kind = output_format(output, self.format, FORMATS, (*CAD_SUFFIXES, *CELL_FORMATS))
        if not FORMATS[kind].is_text(self.ascii):
            refuse_terminal(output, kind, "-o FILE" if FORMATS[kind].text == "never" else "-o FILE or --ascii")
        return kind


def summary(mesh: Mesh, stored: Mesh | None = None, remarks: Sequence[str] = (), unit: str | None = None) -> str:
    """Describe the size of a mesh; with extents and volume if it is closed as it is `stored`.

    The volume is marked where it counts places several times: if there are several parts, or faces cross.
    """
    text = f"{len(mesh.vertices)} vertices, {len(mesh.cells)} {'segments' if mesh.is_curve else 'faces'}"
    if stored is None or mesh.is_curve:
        return text
    from gtb_cli.meshes.measures import in_unit, measure
    from gtb_cli.solids.solidity import CROSSES

    measures = measure(stored)
    if measures.volume is None or measures.collapsed:  # a reader that keeps a collapsed face has four at its edges
        return text
    low, high = measures.bounds
    extents = " × ".join(_amount(end - start) for start, end in zip(low, high, strict=True))
    outer = measures.components - (measures.inward_parts or 0)
    parts, counted = (f" {outer} parts,", " together") if outer > 1 else ("", "")
    counted = " counted with crossings" if any(line.startswith(CROSSES) for line in remarks) else counted
    (_, length), (volume, cubic) = in_unit(0.0, 1, unit), in_unit(measures.volume, 3, unit)
    return f"{text}, closed,{parts} {extents}{length}, volume {_amount(volume)}{cubic}{counted}"


def _amount(value: float) -> str:
    """Write four digits of a number, with thousands apart."""
    longest = 1e9  # from which on powers of ten are easier to read
    rounded = float(f"{value:.4g}")
    return f"{value:.4g}" if abs(rounded) < 1e3 or abs(rounded) >= longest else f"{rounded:,.0f}".replace(",", " ")
