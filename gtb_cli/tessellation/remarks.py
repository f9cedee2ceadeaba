"""Remarks on meshes: crowded vertices, offsets that fold, and walls that are too thin."""

import math

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, dot, point_text
from gtb_cli.knots.even_triangulation import cell_count, triangulation
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.models.model import Model
from gtb_cli.solids.solidity import where
from gtb_cli.solids.thickening import folded_faces, surface_of, thinnest_wall
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.curvature import curvatures_at
from gtb_cli.theory.patch import Patch
from gtb_cli.values import grouped


def crowding(spec: Patch | Model, resolution: int) -> list[str]:
    """Say how far the vertices of a uniform toric mesh crowd in linear parameters μ = Σ_i T_i a_i, and what helps."""
    max_side = 0.1  # part of the domain's size that a side may span before vertices are said to crowd
    min_resolution = 16  # from which on even spacing gives no sides as wide as that
    same_place = 1e-9  # of the domain's size: corners of a face that are nearer are one point
    widest, lost, count = 0.0, 0, 0
    for patch in spec.patches:
        flat = patch.replace(control_points=np.pad(patch.knots, ((0, 0), (0, 3 - patch.dimension))))
        mesh = tessellate(flat, resolution, parametrization="toric", normals=False, max_faces=10**12)
        corners = [mesh.vertices[corner] / patch.domain.size for corner in mesh.cells.T]
        lengths = [np.linalg.norm(corners[k] - corners[k - 1], axis=1) for k in range(len(corners))]
        widest, count = max(widest, float(np.max(lengths))), count + len(mesh.cells)
        lost += int((np.min(lengths, axis=0) <= same_place).sum())
    cells, side = ("segments", "segment") if spec.dimension == 1 else ("faces", "side of a face")
    found = [f"{lost} of {count} {cells} have corners at one point"] * bool(lost)
    found += [f"one {side} spans {widest:.0%} of the patch"] * (widest > max_side and resolution >= min_resolution)
    return [f'toric parameters crowd: {" and ".join(found)}; leave out `parametrization="toric"`'] if found else []


def offset_folds(spec: Patch | Model, mesh: Mesh, solid: Mesh, thickness: float) -> str:
    """Say where the offset of a surface folds in its solid with a thickness; nothing if it does not."""
    folded = folded_faces(solid)
    radius, place = sharpest_bend(spec, mesh, thickness)
    facts = [where(surface_of(solid), folded)] if len(folded) else []
    if radius < math.inf:
        near = point_text(place, mesh.bounds)
        facts.append(f"the surface bends to that side with a radius of {radius:.3g} near {near}")
    extents = mesh.bounds[1] - mesh.bounds[0]
    if facts and abs(thickness) > extents.max():
        size = " × ".join(f"{extent:.3g}" for extent in extents)
        facts.append(f"it is more than the whole surface, which is {size}: are these metres?")
    return "; ".join(facts)


def thin_wall(solid: Mesh, thickness: float) -> list[str]:
    """Say where the wall of a solid is thinner than it should be, as normals turn much within a face."""
    share, place = thinnest_wall(solid, thickness)
    if share >= 0.95:  # normals that turn by 36° within a face
        return []
    why = "as normals turn within a face: more faces make it thicker where the surface is smooth"
    return [f"the wall near {point_text(place, solid.bounds)} is {share:.0%} of the thickness or less, {why}"]


def sharpest_bend(spec: Patch | Model, mesh: Mesh, thickness: float) -> tuple[float, FloatArray]:
    """Find the smallest radius of curvature at which the offset of a surface folds, inf without one, and its place.

    Samples are closer together than the cells of the mesh, at most 48 along an edge: a narrower fold
    may be missed. An offset by D is regular if 1 − D κ > 0 for each principal curvature κ towards it. Elsewhere it
    counts if it is nearer than D by 2 %: not if κ is infinite only at an edge.
    """
    sparsest, densest, per_patch = 16, 48, len(mesh.cells) / len(spec.patches)
    radius, place = math.inf, np.full(3, np.nan)
    turned = (False,) * len(spec.patches) if mesh.origin is None else mesh.origin.turned.tolist()
    for own in grouped((id(patch.rational_basis), k) for k, patch in enumerate(spec.patches)).values():  # of copies
        patches = [spec.patches[k] for k in own]
        basis = patches[0].rational_basis
        count = min(max(sparsest, math.ceil(2 * math.sqrt(per_patch / cell_count(basis.domain, 1)))), densest)
        part = triangulation(basis.domain, count)
        u = part.parameters[part.cells].mean(axis=1)  # inside, also in triangles with corners on the boundary
        found = curvatures_at(patches, basis.locations(basis.domain.grid(u)[0], "linear"), len(u))
        for k, patch, gaussian, outward in zip(own, patches, *found, strict=True):
            offset = -thickness if turned[k] else thickness
            mean = -math.copysign(1.0, offset) * outward
            bend = mean + np.sqrt(np.maximum(mean**2 - gaussian, 0.0))  # largest principal curvature towards the offset
            bend = np.where(np.isfinite(bend), bend, 0.0)
            folded = np.flatnonzero(bend * abs(thickness) >= 1)
            if not len(folded):
                continue
            folded = folded[bend[folded].argsort()[:: -max(1, len(folded) // 64)]]  # some with every curvature
            deep = folded[_is_nearer(patch, u[folded], offset, basis.domain.size / count)]
            if len(deep) and 1 / bend[deep[0]] < radius:
                radius, place = float(1 / bend[deep[0]]), patch.evaluate(u[deep[:1]], "linear")[0]
    return radius, place


def _is_nearer(patch: Patch, u: FloatArray, offset: float, step: float) -> BoolArray:
    """Mark parameters, (k,), at which the offset point is nearer by 2 % to another point of the surface."""
    rounds, share = 6, 0.98
    points = patch.evaluate(u, "linear") + offset * patch.normals(u, "linear")
    pattern = np.stack(np.meshgrid([-2, -1, 0, 1, 2], [-2, -1, 0, 1, 2]), axis=-1).reshape(-1, 2)
    best, rows = u, np.arange(len(u))
    least = 1e-6 * patch.domain.size * patch.domain.normal_lengths  # height over each edge of what is clearly inside Δ
    for _ in range(rounds):
        around = best[:, None] + step * pattern
        heights = np.einsum("kprd,rd->kpr", around[:, :, None] - patch.domain.vertices, patch.domain.normals)
        around = np.where((heights > least).all(axis=2)[:, :, None], around, best[:, None])
        found = patch.evaluate(around.reshape(-1, 2), "linear").reshape(len(u), -1, 3) - points[:, None]
        squares = dot(found.reshape(-1, 3), found.reshape(-1, 3)).reshape(len(u), -1)
        chosen = squares.argmin(axis=1)
        best, nearest = around[rows, chosen], squares[rows, chosen]
        step /= 2
    return np.asarray(np.sqrt(nearest) < share * abs(offset))
