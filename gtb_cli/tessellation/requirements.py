"""Requirements on a model or its mesh: watertight, solid, in one piece, unfolded, smooth up to an angle."""

import re
from collections.abc import Sequence

import numpy as np

from gtb_cli.arrays import point_text
from gtb_cli.errors import RequirementError, one_of_alike
from gtb_cli.fairing.folds import folds as folds_of
from gtb_cli.meshes.coincident import numbered_places
from gtb_cli.meshes.measures import measure
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.topology import are_proper, sides_of
from gtb_cli.models.model import Model
from gtb_cli.models.openings import obstacles, parts_of, unjoined_seams
from gtb_cli.models.same_edges import find_joints
from gtb_cli.solids.solidity import AS_IF, folded_places, inward_faces, where
from gtb_cli.tessellation.point_order import likely_order
from gtb_cli.theory.edges import edge_name, patch_name
from gtb_cli.theory.patch import Patch
from gtb_cli.vocabulary import requirements


def require(
    words: Sequence[str], spec: Patch | Model, mesh: Mesh, surface: Mesh, folds: Sequence[str], held: tuple[Mesh, str]
) -> None:
    """Raise `RequirementError`, with a line for each edge or place, unless the required properties are there.

    `mesh` must be watertight or solid; `surface`, from which a tube or solid was made, unfolded; `folds` are known
    folds and crossings, one line each. `held` is the mesh as a file's numbers hold it, which must be watertight or
    solid as well, and a remark for where they are too coarse. Of a model that is not solid, with patches whose points
    are probably out of order or edges that are nearly joined, only these are named: the rest follows from them.
    """
    asked = requirements(words)
    lines = []
    for word, faults in (("watertight", ()), ("solid", folds)):
        if word in asked:
            causes = [*_leaks(spec, mesh, held, word == "solid"), *faults]
            if causes and isinstance(spec, Model):
                loose = _loose_parts(spec) if faults else []
                mistakes = [line for line in faults if AS_IF in line]
                causes = [*mistakes, *unjoined_seams(spec)] or (loose + causes[-1:] if loose else causes)
            elif word == "solid" and isinstance(spec, Model):  # else each part by itself is one
                causes = unjoined_seams(spec, are_touching=True)
            leaks = len(causes) - len(faults)  # from which folds and crossings may follow; the last says what helps
            if len(causes) > max(3, leaks):
                causes = [*causes[: max(2, leaks)], causes[-1]]
            lines += [f"not {word}: {line}" for line in causes]
    if "one-piece" in asked:
        measures = measure(mesh)
        pieces = _loose_parts(spec) if isinstance(spec, Model) else []  # which may touch at vertices
        if (count := measures.components - (measures.inward_parts or 0)) > 1:  # cavities are not pieces
            pieces = [f"{count} pieces", *pieces]
        seams = unjoined_seams(spec) if pieces and isinstance(spec, Model) and not lines else []
        lines += [f"not one-piece: {line}" for line in (*seams, *pieces)]
    if "unfolded" in asked:
        turns = places_of_folds(spec, surface) or _folded_patches(spec)
        lines += [f"not unfolded: {line}" for line in dict.fromkeys((*turns, *folds))]
    if isinstance(spec, Model) and (angle := asked.get("smooth")) is not None:
        points = np.concatenate([patch.control_points for patch in spec])
        sharp = [(f"meet at {seam.angle:.3g} degrees", seam) for seam in spec.seams if not seam.angle <= angle]
        told = [(meet, f"{seam.name(spec)} {meet}, near {point_text(seam.place, points)}") for meet, seam in sharp]
        lines += [f"not smooth: {line}" for line in one_of_alike(told)]
    if lines:
        raise RequirementError(*lines)


def _leaks(spec: Patch | Model, mesh: Mesh, held: tuple[Mesh, str], is_solid: bool) -> list[str]:
    """Say where a mesh leaks or, as a solid, looks inwards; else, with its remark, where the held one does."""
    if lines := _open_edges(spec, mesh):
        if is_solid and "is open" in lines[0]:
            lines[0] = re.sub("(?=; `fills`|$)", "; `thickness` makes a solid of a surface", lines[0], count=1)
        return lines
    lines, (stored, remark) = (_inward_faces(mesh) if is_solid else []) or _merged_faces(mesh), held
    if lines or stored is mesh:
        return lines
    lines = _merged_faces(stored) or (_inward_faces(stored) if is_solid else [])
    return [f"{line}: {remark}" for line in lines]


def places_of_folds(spec: Patch | Model, surface: Mesh) -> list[str]:
    """Say in which patches a surface turns back on itself, where it first does, and what is probably wrong there."""
    return folded_places(surface, lambda number, is_certain: likely_order(spec.patches[number], is_certain))


def _folded_patches(spec: Patch | Model) -> list[str]:
    """Say which patches turn back on themselves, also where the mesh is too coarse to show it."""
    lines = []
    for number, patch in enumerate(spec.patches if spec.dimension == 2 else ()):
        for place in folds_of(patch)[:1]:
            name = patch_name(patch, number) if isinstance(spec, Model) else patch.name or "patch"
            lines.append(f"{name} turns back on itself, near {point_text(place, patch.control_points)}")
    return lines


def _loose_parts(model: Model) -> list[str]:
    """Name the parts of a model that share no edge; nothing if it is one."""
    patches = model.patches
    firsts, counts = np.unique(parts_of(model.joints, len(patches)), return_counts=True)
    if len(counts) < 2 or patches[0].dimension == 1:
        return []
    sizes, most = sorted(zip(firsts.tolist(), counts.tolist(), strict=True)), 8
    names = [patch_name(patches[k], k) + f" and {count - 1} more" * (count > 1) for k, count in sizes[:most]]
    return [f"{len(counts)} parts share no edge: {'; '.join(names)}{'; ...' * (len(counts) > most)}"]


def _open_edges(spec: Patch | Model, mesh: Mesh) -> list[str]:
    """Say, edge by edge, where a mesh is not closed."""
    if mesh.is_curve:
        return ["a curve has no inside (`radius` makes a tube)"]
    if not (count := len(mesh.open_sides)):
        return []
    patches = spec.patches
    joints = spec.joints if isinstance(spec, Model) else find_joints(patches)
    lines = obstacles(joints, patches)
    if not isinstance(spec, Model):
        why = "are the same curve, but only the edges of models are joined: write the patch as [[patches]]"
        pairs = [f"{edge_name(patches, joint.first)} and edge {joint.second[1]}" for joint in joints.shared]
        lines += [f"{pair} {why}" for pair in pairs]
    return lines or [f"{count} sides of triangles are open"]


def _inward_faces(mesh: Mesh) -> list[str]:
    """Say where faces of a closed mesh do not look out of the solid."""
    return [f"faces look into the solid, {where(mesh, inward)}"] if len(inward := inward_faces(mesh)) else []


def _merged_faces(mesh: Mesh) -> list[str]:
    """Say which faces of a closed mesh collapse, or fall upon others, once readers merge vertices at one place."""
    cells = numbered_places(mesh.vertices)[1][mesh.faces]
    if len(collapsed := np.flatnonzero(~are_proper(cells))):
        return [f"faces collapse, {where(mesh, collapsed)}"]
    return [f"{crowded} sides of faces fall upon others"] if (crowded := len(sides_of(cells).open)) else []
