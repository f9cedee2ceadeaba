"""A cell complex over the domains of one or several patches, which have the same vertices along shared edges."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, distinct, index_type, merged, shifted, taken
from gtb_cli.knots.domain import Domain
from gtb_cli.knots.even_triangulation import Triangulation, central_triangulation, triangulation
from gtb_cli.knots.face import INTERIOR
from gtb_cli.meshes.topology import are_proper, sides_of
from gtb_cli.models.joints import Joints
from gtb_cli.theory.edges import EdgeRef
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen


@frozen
class Complex:
    """Vertices and cells, without positions in space."""

    patch: IntArray  # (v,) the patch of each vertex: of several that share it, the first
    parameters: FloatArray  # (v, d) in the domain of that patch
    face: IntArray  # (v,) the number of the domain's face that holds the vertex
    cells: IntArray  # (k, d + 1)
    cell_patch: IntArray  # (k,)
    # `corners`; or, behind their places among all, the few that differ from the parameters of the cells' vertices
    own_corners: FloatArray | tuple[IntArray, FloatArray]
    collapsed: IntArray  # (c, 2) pairs of neighbouring vertices on edges of patches that are one point
    sides: int = 0  # how many sides the cells of a uniform complex have; two that a joint makes one count once
    uneven: frozenset[EdgeRef] = frozenset()  # shared edges whose points are at different fractions in their patches

    @cached_property
    def corners(self) -> FloatArray:
        """Parameters of the corners of each cell in the domain of the cell's own patch, (k, d + 1, d)."""
        if not isinstance(self.own_corners, tuple):
            return self.own_corners
        corners, (places, moved) = self.parameters[self.cells], self.own_corners
        corners.reshape(-1, corners.shape[2])[places] = moved
        return corners

    @property
    def is_simplicial(self) -> bool:
        """Tell whether all cells of a uniform complex, and all of their sides, differ in their vertices."""
        differ = are_proper(self.cells).all() and not _repeated(self.cells).any()
        return bool(differ and (self.cells.shape[1] == 2 or len(sides_of(self.cells).edges) == self.sides))

    @property
    def without_collapsed(self) -> tuple[IntArray, BoolArray | slice]:
        """The cells that are left when the ends of each collapsed edge become one, and which of all cells they are."""
        if not len(self.collapsed):
            return self.cells, slice(None)
        cells = taken(merged(len(self.patch), self.collapsed), self.cells)
        proper = are_proper(cells)
        return cells[proper], proper

    @property
    def further_places(self) -> tuple[IntArray, FloatArray, IntArray, IntArray]:
        """Find the places that vertices of `without_collapsed` have beside their own: on shared and on collapsed edges.

        Return (q, 2) vertices and patches, (q, d) parameters, the (c,) corners of cells there, counted through all
        cells, and the place of each corner.
        """
        cells, rows = self.without_collapsed
        row, k = np.nonzero(self.face[cells] != INTERIOR)
        vertex, patch, places = cells[row, k], self.cell_patch[rows][row], self.corners[rows][row, k]
        others = (patch != self.patch[vertex]) | (places != self.parameters[vertex]).any(axis=1)
        found, number = np.unique(np.column_stack([vertex, patch, places])[others], axis=0, return_inverse=True)
        corners = (cells.shape[1] * row + k)[others]
        return found[:, :2].astype(np.int64), found[:, 2:], corners, number.ravel()

    @property
    def is_whole(self) -> bool:
        """Tell whether `without_collapsed` leaves each patch a cell, and no two cells with the same vertices."""
        if not len(self.collapsed):
            return True
        cells, rows = self.without_collapsed
        return bool(np.isin(self.cell_patch, self.cell_patch[rows]).all()) and not _repeated(cells).any()


def kinds_of(domains: Sequence[Domain]) -> IntArray:
    """Return for each domain the number of the first that equals it, so that what depends on Δ alone is found once."""
    first: dict[tuple[bytes, bytes], int] = {}
    keys = ((domain.knots.tobytes(), domain.normals.tobytes()) for domain in domains)
    return np.array([first.setdefault(key, number) for number, key in enumerate(keys)])


def joined_complex(patches: Sequence[Patch], joints: Joints, resolution: int) -> Complex:
    """Triangulate each domain with `resolution` cells along an edge, and join them.

    Patches are cut around their centres if several would have a side inside between the same two vertices, as at the
    corner between two edges that they share. So are patches with a tip, where one more side is halved, and patches
    with triangles turned over when vertices move along an edge to the fractions at which it has another patch's points.
    """
    kinds = kinds_of([patch.domain for patch in patches]).tolist()
    made = {kind: triangulation(patches[kind].domain, resolution) for kind in dict.fromkeys(kinds)}
    parts = [made[kind] for kind in kinds]
    even = np.arange(resolution + 1) / resolution
    # The fractions of edges, ascending, at the vertices of edges with which they are joined unevenly
    moves = {joint.second: np.sort(joint.across(patches, even)) for joint in joints.shared if joint.match}
    _move(parts, patches, moves)
    mosaic, confused = join(patches, joints, parts)
    tips = _tips(patches, joints)
    again = {*confused.tolist(), *(index for index, _ in tips)}
    again |= {index for index, _ in moves if parts[index].is_turned_over()}
    if again:
        for index in again:
            parts[index] = central_triangulation(patches[index].domain, resolution)
        for index, corner in tips:
            parts[index] = parts[index].with_cut_beside(corner)
        _move(parts, patches, {ref: fractions for ref, fractions in moves.items() if ref[0] in again})
        mosaic, _ = join(patches, joints, parts)
    return mosaic


def coarse_complexes(patches: Sequence[Patch], joints: Joints) -> Iterator[Complex]:
    """Yield complexes from which refinement may start, the coarsest first; the last even if it is not simplicial."""
    resolutions = (1, 2, 3, 4)
    for resolution in resolutions:
        mosaic = joined_complex(patches, joints, resolution)
        if mosaic.is_simplicial or resolution == resolutions[-1]:
            yield mosaic


def _move(parts: list[Triangulation], patches: Sequence[Patch], moves: Mapping[EdgeRef, FloatArray]) -> None:
    for (index, edge), fractions in moves.items():
        parts[index] = parts[index].moved(patches[index].domain.vertices, edge, fractions)


def _tips(patches: Sequence[Patch], joints: Joints) -> list[tuple[int, int]]:
    """Return the patches, and their corners, between two edges that are the same curve, as at the tip of a cone."""
    tips = []
    for joint in joints.shared:
        (index, edge), (other, following) = joint.first, joint.second
        if index == other and joint.opposite and patches[index].dimension == 2:
            count = len(patches[index].domain.vertices)
            tips += [(index, b) for a, b in ((edge, following), (following, edge)) if b == (a + 1) % count]
    return tips


def join(patches: Sequence[Patch], joints: Joints, parts: Sequence[Triangulation]) -> tuple[Complex, IntArray]:
    """Join triangulated domains; also return the patches with cells or sides that share all their vertices."""
    is_surface = patches[0].dimension == 2
    offsets = np.cumsum([0, *(len(part.parameters) for part in parts)])
    owner = np.repeat(np.arange(len(parts), dtype=index_type(len(parts))), np.diff(offsets))
    parameters = np.concatenate([part.parameters for part in parts])
    face = np.concatenate([part.faces(patch.domain.faces) for patch, part in zip(patches, parts, strict=True)])
    flips = [is_surface and flipped for flipped in joints.flipped]
    turned = (part.cells[:, [0, 2, 1]] if flip else part.cells for part, flip in zip(parts, flips, strict=True))
    kind = index_type(len(owner))
    cells = np.concatenate([shifted(own, n).astype(kind) for own, n in zip(turned, offsets[:-1], strict=True)])
    shared, collapsed = _pairs(joints, parts, offsets)
    label = merged(len(owner), shared)
    is_kept = label == np.arange(len(owner))
    number = (np.cumsum(is_kept, dtype=kind) - 1)[label]
    places = np.flatnonzero(~taken(is_kept, cells))
    uneven = {joint.first for joint in joints.shared if joint.match}
    of_uneven = [ref for joint in joints.shared if joint.first in uneven for ref in (joint.first, joint.second)]
    mosaic = Complex(
        patch=owner[is_kept],
        parameters=parameters[is_kept],
        face=face[is_kept],
        cells=taken(number, cells),
        cell_patch=owner[cells[:, 0]],
        own_corners=(places, parameters[cells.ravel()[places]]),
        collapsed=number[collapsed],
        # Each patch is a disc, on which Euler counts the sides; a joint makes its sides one each.
        sides=len(owner) + len(cells) - len(parts) - (len(shared) - len(joints.shared)),
        uneven=frozenset(of_uneven),
    )
    if not (is_surface and joints.joins):
        return mosaic, owner[:0]
    label = merged(len(owner), np.concatenate([shared, collapsed]))
    return mosaic, distinct(owner[_confused(cells, face != INTERIOR, label)])


def _pairs(joints: Joints, parts: Sequence[Triangulation], offsets: IntArray) -> tuple[IntArray, IntArray]:
    """Return the pairs of vertices that joints make one, (c, 2), and of neighbours on edges that are points, (q, 2)."""

    def side(ref: EdgeRef, step: int = 1) -> IntArray:
        patch, edge = ref
        return np.asarray(offsets[patch] + parts[patch].side(edge)[::step])

    none = np.empty((0, 2), dtype=np.int64)
    shared = [(side(joint.first), side(joint.second, -1 if joint.opposite else 1)) for joint in joints.shared]
    collapsed = [(side(ref)[:-1], side(ref)[1:]) for ref in joints.collapsed]
    one, other = (np.concatenate([none, *map(np.column_stack, pairs)]) for pairs in (shared, collapsed))
    return one, other


def _confused(cells: IntArray, on_boundary: BoolArray, label: IntArray) -> IntArray:
    """Return a vertex of each cell, and of each side inside a patch, that shares all its vertices with another one."""
    a, b, c = (on_boundary[corner] for corner in cells.T)
    cells = cells[(a & b) | (b & c) | (c & a)]
    cells = cells[are_proper(label[cells])]
    flat = cells[on_boundary[cells].all(axis=1)]
    ends = np.concatenate([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [2, 0]]])
    ends = np.sort(ends[on_boundary[ends].all(axis=1)], axis=1)
    ends, uses = np.unique(ends, axis=0, return_counts=True)
    twice = [_repeated(label[flat]), _repeated(label[ends]) & (uses == 2)]
    return np.concatenate([flat[twice[0], 0], ends[twice[1], 0]])


def _repeated(rows: IntArray) -> BoolArray:
    """Mark the rows, (m,), that have the same entries as another row, in any order."""
    _, kind, count = np.unique(np.sort(rows, axis=1), axis=0, return_inverse=True, return_counts=True)
    return np.asarray(count[kind] > 1)
