"""What the mesh options of a command mean: which mesh is made, in which format, and what is refused."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from gtb_cli.commands.console import STANDARD, Console, is_terminal, write_blocks
from gtb_cli.errors import DomainError, ExportError, GtbError, RequirementError, ToleranceError
from gtb_cli.vocabulary import MAX_FACES

if TYPE_CHECKING:
    from gtb_cli.arrays import IntArray
    from gtb_cli.commands.manifests import Manifest
    from gtb_cli.meshes.mesh import Mesh
    from gtb_cli.theory.parametrization import Parametrization
    from gtb_cli.theory.patch import Model, Patch

FORMATS = ("obj", "ply", "stl", "glb")
"""As `gtb_cli.formats.export.FORMATS`, which costs an import of numpy."""

ATTRIBUTES = ("u", "v", "gaussian_curvature", "mean_curvature")
"""As `gtb_cli.theory.curvature.ATTRIBUTES`, likewise."""

RESOLUTION = 32

BYTES_PER_FACE = 230
"""Memory for a large mesh: measured, 1.17 GB for five million faces."""

BOUNDS_RESOLUTION = 16
"""Segments of each edge of the mesh whose bounding box a percentage is of."""

UNSAFE = '/\\:*?"<>|'
"""Characters that some file system does not take in a name."""

TUBE_SHARE = 1 / 3
"""How near the middle line of a tube, and the polygon of its rings, must be, as a fraction of the tolerance: on the
outside of a bend as sharp as the tube allows, what the middle line misses counts twice."""

MAX_STEM = 200
"""Longest stem of a file name, in bytes: with a suffix every file system takes it."""


@dataclass(frozen=True)
class MeshOptions:
    """How to make a mesh, and in which format to write it.

    Attributes
    ----------
    resolution : int
        Segments of each hull edge.
    tolerance : float, str or None
        Largest distance between mesh and surface, in model units or as ``"1%"`` of the bounding box's diagonal; where
        it is given, `resolution` does not count.
    parametrization : "toric", "linear" or None
        None: the one that suits.
    format : str or None
        None: what the name of the output says.
    normals, uv, ascii : bool
    max_faces : int
        More are refused.
    radius : float or None
        That of a tube around a curve.
    thickness : float or None
        That of a solid beside a surface.
    attributes : tuple of str
        Of `ATTRIBUTES`.
    """

    resolution: int = RESOLUTION
    tolerance: float | str | None = None
    parametrization: Parametrization | None = None
    format: str | None = None
    normals: bool = False
    uv: bool = False
    ascii: bool = False
    max_faces: int = MAX_FACES
    radius: float | None = None
    thickness: float | None = None
    attributes: tuple[str, ...] = ()
    require: str | None = None

    def mesh(self, spec: Patch | Model) -> Mesh:
        """Make the mesh of a spec."""
        return self.mesh_with_remarks(spec)[0]

    def mesh_with_remarks(self, spec: Patch | Model) -> tuple[Mesh, list[str]]:
        """Make the mesh of a spec, and say what is unusual about its shape."""
        from gtb_cli.tessellation.tessellate import tessellate
        from gtb_cli.theory.patch import Model

        tolerance = self.tolerance_for(spec)
        if tolerance is not None and self.radius is not None:
            tolerance *= TUBE_SHARE
        normals = self.normals or self.thickness is not None
        mesh = tessellate(
            spec, self.resolution, tolerance, self.parametrization, normals=normals, max_faces=self.max_faces
        )
        remarks = []
        if isinstance(spec, Model) and tolerance is None and self.resolution < 3 and not mesh.is_curve:
            crowded = len(mesh.crowded_sides)
            if crowded:
                remarks.append(
                    f"with -n {self.resolution} edges of patches that have the same ends are one: {crowded} sides have "
                    f"more than two faces; -n {self.resolution + 1} keeps them apart"
                )
        parametrization = self.parametrization_for(spec)
        if self.attributes:
            from gtb_cli.tessellation.attributes import with_attributes

            mesh, replaced = with_attributes(spec, mesh, self.attributes, parametrization)
            if replaced:
                remarks.append(
                    f"the curvature has no finite limit at {replaced} of {len(mesh.vertices)} vertices, "
                    "which get the mean of their neighbours'"
                )
        if self.radius is not None:
            from gtb_cli.meshes.tube import folded_segments, tube
            from gtb_cli.tessellation.attributes import curve_tangents

            tangents = None
            if mesh.is_curve and not isinstance(spec, Model):
                tangents = curve_tangents(spec, mesh, parametrization)
            folded = folded_segments(mesh, self.radius, tangents=tangents)
            if len(folded):
                remarks.append(
                    f"a radius of {self.radius:g} is more than that of the curve's bends: {_where(mesh, folded)}"
                )
            mesh = tube(mesh, self.radius, tolerance=tolerance, tangents=tangents, max_faces=self.max_faces)
        elif self.thickness is not None:
            from gtb_cli.meshes.solid import folded_faces, thicken

            folded = folded_faces(mesh, self.thickness)
            if len(folded):
                remarks.append(f"with a thickness of {self.thickness:g} the offset folds: {_where(mesh, folded)}")
            mesh = thicken(mesh, self.thickness)
        if self.require == "watertight":
            require_watertight(spec, mesh)
        return mesh, remarks

    def tolerance_for(self, spec: Patch | Model) -> float | None:
        """Return the tolerance in model units; a percentage is of the spec's own size."""
        if not isinstance(self.tolerance, str):
            return self.tolerance
        from gtb_cli.tessellation.tessellate import tessellate

        low, high = tessellate(spec, BOUNDS_RESOLUTION, normals=False).bounds
        diagonal = math.dist(low, high)
        if diagonal == 0:
            raise DomainError(f"tolerance: {self.tolerance} of the size of a single point is nothing")
        return float(self.tolerance.removesuffix("%")) / 100 * diagonal

    def parametrization_for(self, spec: Patch | Model) -> Parametrization:
        """Return the parametrization that was asked for, or else the one that suits."""
        from gtb_cli.theory.patch import Model

        suitable: Parametrization = "linear" if isinstance(spec, Model) or self.tolerance is not None else "toric"
        return self.parametrization or suitable

    @property
    def settings(self) -> dict[str, object]:
        """The options that bytes depend on, as plain data."""
        names = ("tolerance", "parametrization", "format", "normals", "uv", "ascii", "radius", "thickness")
        resolution = self.resolution if self.tolerance is None else None
        values = {name: getattr(self, name) for name in names}
        return {"resolution": resolution, **values, "attributes": list(self.attributes)}

    def settings_for(self, spec: Patch | Model) -> dict[str, object]:
        """What options mean for a spec, where that differs from spec to spec."""
        settings: dict[str, object] = {"parametrization": self.parametrization_for(spec)}
        return settings if self.tolerance is None else settings | {"tolerance": self.tolerance_for(spec)}

    def encoded(self, mesh: Mesh, kind: str) -> Iterable[bytes]:
        """Bytes of a mesh in a format, block by block."""
        from gtb_cli.formats.export import encode_mesh

        return encode_mesh(mesh, kind, ascii=self.ascii, normals=self.normals, uv=self.uv)

    def warnings(self, mesh: Mesh, kind: str) -> list[str]:
        """What the user should know of such a file."""
        from gtb_cli.formats.export import warnings_for

        messages = warnings_for(mesh, kind, ascii=self.ascii, normals=self.normals, uv=self.uv)
        if self.attributes and kind != "ply":
            messages.append(f"{kind.upper()}: holds no attributes, none are written; PLY does")
        return messages

    def format_for(self, output: str) -> str:
        """Format for an output: what -f says, or the suffix of a file; OBJ for a folder or a stream.

        Raises
        ------
        ExportError
            The suffix is not that of a format, or the output is a terminal and the format binary.
        """
        kind = self.format
        if kind is None:
            kind = os.path.splitext(output)[1][1:].lower()
            if kind not in FORMATS:
                if output != STANDARD and not is_folder(output) and not is_device(output):
                    known = ", ".join(f".{name}" for name in FORMATS)
                    name = output or repr(output)
                    raise ExportError(f"cannot tell the format of {name}: it does not end in {known}; -f FORMAT says")
                kind = "obj"
        if is_terminal(output) and (kind == "glb" or (kind in ("ply", "stl") and not self.ascii)):
            way_out = "-o FILE" if kind == "glb" else "-o FILE or --ascii"
            raise ExportError(f"{kind.upper()} is binary, and standard output a terminal: give {way_out}")
        return kind

    def faces(self, spec: Patch | Model) -> int:
        """Count the faces (of a curve: segments) of a mesh of this resolution, without making it."""
        from gtb_cli.tessellation.triangulation import cell_count
        from gtb_cli.theory.patch import Model

        patches = spec.patches if isinstance(spec, Model) else (spec,)
        cells = sum(cell_count(patch.domain, self.resolution) for patch in patches)
        if self.radius is not None:
            from gtb_cli.meshes.tube import SIDES

            return 2 * SIDES * cells
        if self.thickness is not None:
            rim = sum(len(patch.domain.vertices) for patch in patches) * self.resolution
            return 2 * (cells + rim)
        return cells

    def check_size(self, spec: Patch | Model) -> None:
        """Refuse more faces than are allowed.

        Raises
        ------
        ToleranceError
            With the number of faces, before anything is made.
        """
        if self.tolerance is not None:
            return
        faces = self.faces(spec)
        estimate = f"-n {self.resolution} makes {faces} faces"
        if faces > self.max_faces:
            raise ToleranceError(
                f"{estimate}, more than {self.max_faces}: take a smaller -n, or allow them with --max-faces {faces}"
            )
        needed, there = faces * BYTES_PER_FACE, physical_memory()
        if needed > there:
            raise ToleranceError(
                f"{estimate} and needs about {needed / 1e9:.0f} GB of memory, this machine has {there / 1e9:.0f}: "
                "take a smaller -n"
            )

    def write(
        self, spec: Patch | Model, source: str, output: str, console: Console, manifest: Manifest | None = None
    ) -> None:
        """Make the mesh of a spec, which was read from `source`, and write it to a file or to standard output."""
        kind = self.format_for(output)
        faces = self.faces(spec)
        with console.progress(2 * faces) as progress:
            progress.label = source
            with about(source):
                self.check_size(spec)
                mesh, remarks = self.mesh_with_remarks(spec)
                blocks = self.encoded(mesh, kind)
            progress.advance(faces)
            blocks = progress.over(blocks, faces, expected_bytes(mesh))
            if manifest is None:
                write_blocks(output, blocks)
            else:
                from gtb_cli.meshes.measures import measure

                blocks = manifest.recorded(output, measure(mesh), self.settings_for(spec), blocks)
                manifest.write_with(output, blocks)
        report(console, output, summary(mesh), [*remarks, *self.warnings(mesh, kind)])


def require_watertight(spec: Patch | Model, mesh: Mesh) -> None:
    """Raise `RequirementError`, with the open edges, for a mesh that is not closed."""
    if mesh.is_curve:
        raise RequirementError("not watertight: a curve has no inside (--radius R makes a tube)")
    count = len(mesh.open_sides)
    if not count:
        return
    from gtb_cli.theory.joints import edge_name, find_joints, obstacles
    from gtb_cli.theory.patch import Model

    patches = spec.patches if isinstance(spec, Model) else (spec,)
    joints = find_joints(patches)
    lines = obstacles(joints, patches)
    if not isinstance(spec, Model):
        lines += [
            f"{edge_name(patches, joint.first)} and edge {joint.second[1]} are the same curve, but only the edges of "
            "models are joined: write the patch as [[patches]]"
            for joint in joints.shared
        ]
    lines = lines or [f"{count} sides of triangles are open"]
    raise RequirementError("\n".join(f"not watertight: {line}" for line in lines))


@contextmanager
def about(source: str) -> Iterator[None]:
    """Name the spec in errors that are about what it describes."""
    try:
        yield
    except GtbError as error:
        raise type(error)("\n".join(f"{source}: {line}" for line in str(error).split("\n"))) from error


def _where(mesh: Mesh, cells: IntArray) -> str:
    """How many cells, and where the first of them is."""
    what = "segments" if mesh.is_curve else "faces"
    place = ", ".join(f"{x:.4g}" for x in mesh.vertices[mesh.cells[cells[0]]].mean(axis=0))
    return f"{len(cells)} of {len(mesh.cells)} {what}, the first near ({place})"


def summary(mesh: Mesh) -> str:
    """Size of a mesh, for messages."""
    return f"{len(mesh.vertices)} vertices, {len(mesh.cells)} {'segments' if mesh.is_curve else 'faces'}"


def expected_bytes(mesh: Mesh) -> float:
    """Roughly the size of a file, for progress."""
    return 60.0 * max(len(mesh.cells), 1)


def report(console: Console, output: str, size: str, warnings: Iterable[str]) -> None:
    """Say what was written to a file, and what was unusual."""
    prefix = "" if output == STANDARD else f"{output}: "
    for warning in warnings:
        console.warn(f"{prefix}{warning}")
    if output != STANDARD:
        console.note(f"{prefix}{size}")


def physical_memory() -> float:
    """Bytes of memory that the machine has, or infinity where the system does not say."""
    try:
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):
        return math.inf


def is_folder(output: str) -> bool:
    """Whether the name of an output means a folder."""
    return os.path.isdir(output) or output.endswith(("/", os.sep))


def is_device(output: str) -> bool:
    """Whether an output exists and is neither file nor folder: a pipe, ``/dev/stdout``."""
    return os.path.exists(output) and not os.path.isfile(output) and not os.path.isdir(output)


def file_stem(name: str | None) -> str:
    """Turn any name into that of a file, without suffix: one that stays in its folder and is not hidden."""
    kept = "".join(c if c.isprintable() and c not in UNSAFE else "_" for c in name or "").strip()
    if kept.startswith((".", "-")):
        kept = "_" + kept[1:]
    return kept.encode("utf-8")[:MAX_STEM].decode("utf-8", "ignore") or "patch"
