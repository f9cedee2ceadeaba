"""What a weld moves: vertices, to means of curves and corners; which edges: `models.same_edges`, how: `complexes`."""

from functools import cached_property

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, merged
from gtb_cli.models.joints import Joints
from gtb_cli.models.model import Model
from gtb_cli.tessellation.complexes import Complex
from gtb_cli.theory.edges import EdgeRef, edge_curves, edge_points_at
from gtb_cli.theory.patch import Patch


class Weld:
    """The moves of the vertices of a mesh by the weld of a model of surfaces; there are none for any other shape."""

    def __init__(self, shape: Patch | Model, joints: Joints) -> None:
        self.patches, self.joints = shape.patches, joints
        self.is_needed = isinstance(shape, Model) and shape.dimension == 2 and bool(shape.weld)

    @cached_property
    def farthest(self) -> float:
        """Largest distance by which a vertex moves, in model units, with rounding; 0 if none does."""
        if not self.is_needed:
            return 0.0
        corners, means = self._corners
        places = [own - mean for own, mean in zip(corners, means, strict=True)]
        edges = zip(edge_curves(self.patches, self.joints.collapsed), self.joints.collapsed, strict=True)
        places += [curve.points - means[index][edge] for curve, (index, edge) in edges]
        moves = [float(np.linalg.norm(place, axis=1).max()) for place in places]
        farthest = max([*moves, *(joint.distance for joint in self.joints.shared)])
        # Points computed in two ways differ by rounding, too.
        size = max(float(np.abs(patch.control_points).max()) for patch in self.patches)
        return farthest and farthest + 16 * EPS * size

    def moved(self, mosaic: Complex, points: FloatArray) -> FloatArray:
        """Return the (v, 3) points of a complex after welding: vertices on seams, corners and collapsed edges move."""
        if not self.farthest:
            return points
        points = points.copy()
        for index, edge in sorted({joint.first for joint in self.joints.shared if joint.distance}):
            domain = self.patches[index].domain
            rows = np.flatnonzero((mosaic.patch == index) & (mosaic.face == domain.faces.edge(edge).number))
            ends = domain.vertices[[(edge + 1) % len(domain.vertices)]]
            along = domain.along(edge, np.concatenate([mosaic.parameters[rows], ends]))
            share = along[:-1] / along[-1]
            curves = [edge_points_at(self.patches[index], edge, share)]
            for joint in self.joints.shared:
                if joint.first == (index, edge):
                    other, side = joint.second
                    curves.append(edge_points_at(self.patches[other], side, joint.across(self.patches, share)))
            points[rows] = np.mean(curves, axis=0)
        _, means = self._corners
        for index, patch in enumerate(self.patches):
            faces = patch.domain.faces
            places = dict(zip(faces.corners.tolist(), means[index], strict=True))
            places |= {faces.edge(edge).number: means[index][edge] for p, edge in self.joints.collapsed if p == index}
            own = np.flatnonzero(mosaic.patch == index)
            for number, place in places.items():
                points[own[mosaic.face[own] == number]] = place
        return points

    @cached_property
    def _corners(self) -> tuple[list[FloatArray], list[FloatArray]]:
        """The corners of each patch, and for each corner the mean of all corners that become one with it."""
        counts = [len(patch.domain.vertices) for patch in self.patches]
        offsets = np.cumsum([0, *counts]).tolist()

        def ends(ref: EdgeRef) -> list[int]:
            index, edge = ref
            return [offsets[index] + edge, offsets[index] + (edge + 1) % counts[index]]

        pairs = [ends(ref) for ref in self.joints.collapsed]
        for joint in self.joints.shared:
            first, second = ends(joint.first), ends(joint.second)[:: -1 if joint.opposite else 1]
            pairs += [[first[0], second[0]], [first[1], second[1]]]
        label = merged(offsets[-1], np.array(pairs, dtype=np.int64).reshape(-1, 2))
        corners = [patch.evaluate(patch.domain.vertices) for patch in self.patches]
        sums = np.column_stack([np.bincount(label, column) for column in np.concatenate(corners).T])
        return corners, np.split(sums[label] / np.bincount(label)[label, None], offsets[1:-1])
