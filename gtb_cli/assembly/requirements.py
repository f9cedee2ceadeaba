"""Requirements on a model or its mesh: watertight, unfolded, smooth up to an angle."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from gtb_cli.errors import DomainError, RequirementError

if TYPE_CHECKING:
    from gtb_cli.meshes.mesh import Mesh
    from gtb_cli.theory.model import Model
    from gtb_cli.theory.patch import Patch

SMOOTH_PREFIX = "smooth:"  # prefix of a requirement that ends with an angle in degrees, as in ``smooth:1deg``


def requirements(words: Sequence[str]) -> dict[str, float]:
    """Read requirements: the name of each, with the angle of "smooth" in degrees, and 0 for the others.

    Raises
    ------
    DomainError
        A word is neither "watertight" nor "unfolded" nor "smooth:ANGLE".
    """
    found = {}
    for word in words:
        angle = 0.0
        name = word
        if word.startswith(SMOOTH_PREFIX):
            name = "smooth"
            text = word.removeprefix(SMOOTH_PREFIX).removesuffix("deg").strip()
            try:
                angle = math.nan if "_" in text or not text.isascii() else float(text)
            except ValueError:
                angle = math.nan
            if not 0 <= angle <= 180:
                raise DomainError(f"require: expected an angle in degrees, as in smooth:1deg, got {word!r}")
        elif word not in ("watertight", "unfolded"):
            raise DomainError(f"require: expected watertight, unfolded or smooth:1deg, got {word!r}")
        found[name] = angle
    return found


def require(
    words: Sequence[str], spec: Patch | Model, mesh: Mesh, surface: Mesh | None = None, folds: Sequence[str] = ()
) -> None:
    """Refuse a model or mesh without the required properties.

    Parameters
    ----------
    words : sequence of str
        See `requirements`.
    spec : Patch or Model
    mesh : Mesh
        The mesh that must be watertight.
    surface : Mesh, optional
        The mesh that must be unfolded: the one from which a tube or solid was made. Default: `mesh`.
    folds : sequence of str
        Known folds of the tube or solid, one line each.

    Raises
    ------
    RequirementError
        A requirement is not met; the message has a line for each edge or place.
    """
    asked = requirements(words)
    lines = []
    if "watertight" in asked:
        lines += _open_edges(spec, mesh)
    if "unfolded" in asked:
        lines += [f"not unfolded: {line}" for line in (*_folded_places(surface or mesh), *folds)]
    if "smooth" in asked:
        lines += _creases(spec, asked["smooth"])
    if lines:
        raise RequirementError("\n".join(lines))


def _creases(spec: Patch | Model, angle: float) -> list[str]:
    """Say which seams have an angle larger than the given one."""
    from gtb_cli.assembly.seams import joints
    from gtb_cli.theory.model import Model

    if not isinstance(spec, Model):
        return []
    lines = []
    for seam in joints(spec):
        if not seam.angle <= angle:
            place = ", ".join(f"{x:.4g}" for x in seam.place)
            lines.append(f"not smooth: {seam.name(spec)} meet at {seam.angle:.3g} degrees, near ({place})")
    return lines


def _folded_places(mesh: Mesh) -> list[str]:
    """Say in which patches a mesh turns back on itself, and where it first does."""
    from gtb_cli.meshes.folds import folded_pairs

    if mesh.is_curve:
        return []
    lines = []
    for name, start, stop in mesh.groups or ((mesh.name, 0, len(mesh.cells)),):
        cells = folded_pairs(mesh.vertices, mesh.cells[start:stop])[:, 0]
        if len(cells):
            place = ", ".join(f"{x:.4g}" for x in mesh.vertices[mesh.cells[start + cells[0]]].mean(axis=0))
            lines.append(f"{name} turns back on itself at {len(cells)} sides of faces, the first near ({place})")
    return lines


def _open_edges(spec: Patch | Model, mesh: Mesh) -> list[str]:
    """Say, edge by edge, where a mesh is not closed."""
    if mesh.is_curve:
        return ["not watertight: a curve has no inside (--radius R makes a tube)"]
    count = len(mesh.open_sides)
    if not count:
        return []
    from gtb_cli.assembly.openings import obstacles
    from gtb_cli.theory.edges import edge_name
    from gtb_cli.theory.joints import find_joints
    from gtb_cli.theory.model import Model

    patches = spec.patches
    joints = spec.joints if isinstance(spec, Model) else find_joints(patches)
    lines = obstacles(joints, patches)
    if not isinstance(spec, Model):
        lines += [
            f"{edge_name(patches, joint.first)} and edge {joint.second[1]} are the same curve, but only the edges of "
            "models are joined: write the patch as [[patches]]"
            for joint in joints.shared
        ]
    lines = lines or [f"{count} sides of triangles are open"]
    return [f"not watertight: {line}" for line in lines]
