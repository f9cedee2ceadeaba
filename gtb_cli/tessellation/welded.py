"""Vertices of welded seams, on the mean of the curves that become one."""

from collections.abc import Sequence

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.meshes.welding import merged
from gtb_cli.tessellation.complex import Complex
from gtb_cli.theory.edges import EdgeRef, edge_points_at
from gtb_cli.theory.joints import Joints
from gtb_cli.theory.patch import Patch


def welded_points(mosaic: Complex, points: FloatArray, patches: Sequence[Patch], joints: Joints) -> FloatArray:
    """Move vertices of welded seams to the mean of their curves, and corners to the mean of all corners there.

    Parameters
    ----------
    mosaic : Complex
    points : (v, 3) float
        Points of its vertices, each on its own patch.
    patches : sequence of Patch
        Surfaces.
    joints : Joints

    Returns
    -------
    (v, 3) float
        The same array where no joint is welded.
    """
    welded = {joint.first for joint in joints.shared if joint.distance}
    if not welded:
        return points
    points = points.copy()
    for index, edge in sorted(welded):
        shape = patches[index].domain
        rows = np.flatnonzero((mosaic.patch == index) & (mosaic.face == shape.faces.edge(edge).number))
        side = shape.along(
            edge, np.concatenate([mosaic.parameters[rows], shape.vertices[[(edge + 1) % len(shape.vertices)]]])
        )
        share = side[:-1] / side[-1]
        curves = [edge_points_at(patches[index], edge, share)]
        for joint in joints.shared:
            if joint.first == (index, edge):
                p, e = joint.second
                curves.append(edge_points_at(patches[p], e, joint.across(patches, share)))
        points[rows] = np.mean(curves, axis=0)
    _move_corners(mosaic, points, patches, joints)
    return points


def _move_corners(mosaic: Complex, points: FloatArray, patches: Sequence[Patch], joints: Joints) -> None:
    """Move vertices at corners that become one, and those of edges that are points, to their mean."""
    counts = [len(patch.domain.vertices) for patch in patches]
    offsets = np.cumsum([0, *counts])

    def ends(ref: EdgeRef) -> list[int]:
        index, edge = ref
        return [int(offsets[index]) + edge, int(offsets[index]) + (edge + 1) % counts[index]]

    pairs = [ends(ref) for ref in joints.collapsed]
    for joint in joints.shared:
        second = ends(joint.second)
        pairs += [
            list(pair) for pair in zip(ends(joint.first), second[::-1] if joint.opposite else second, strict=True)
        ]
    label = merged(int(offsets[-1]), np.array(pairs))
    corners = np.concatenate([patch.evaluate(patch.domain.vertices) for patch in patches])
    total = np.bincount(label, minlength=len(label))
    sums = np.column_stack([np.bincount(label, column, minlength=len(label)) for column in corners.T])
    means = sums / np.maximum(total, 1)[:, None]
    for index, patch in enumerate(patches):
        places = {int(number): int(offsets[index]) + k for k, number in enumerate(patch.domain.faces.corners)}
        for p, edge in joints.collapsed:
            if p == index:
                places[int(patch.domain.faces.edge(edge).number)] = int(offsets[index]) + edge
        own = np.flatnonzero(mosaic.patch == index)
        for number, corner in places.items():
            points[own[mosaic.face[own] == number]] = means[label[corner]]
