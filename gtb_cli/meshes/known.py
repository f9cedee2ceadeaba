"""Meshes with the accuracy of their coordinates."""

from __future__ import annotations

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.values import frozen


@frozen
class KnownMesh:
    """A mesh, and how accurately its coordinates are known.

    Attributes
    ----------
    mesh : Mesh
    half_steps : (3,) float
        Largest error of a coordinate along each axis: half a unit in the last digit or bit of the file, at the size of
        the largest coordinate, plus a few roundings.
    format : str
        One of `FORMATS`, or ``"spec"``.
    """

    mesh: Mesh
    half_steps: FloatArray
    format: str


def known_exactly(mesh: Mesh) -> KnownMesh:
    """A mesh that was computed here."""
    return KnownMesh(mesh, rounding(mesh.vertices), "spec")


def rounding(vertices: FloatArray) -> FloatArray:
    """(3,) error of computed coordinates along each axis."""
    # Rounding of a few double-precision operations, as a fraction of the largest coordinate
    coordinate_rounding = 2.0**-50
    return largest_coordinates(vertices) * coordinate_rounding


def largest_coordinates(vertices: FloatArray) -> FloatArray:
    """(3,) largest absolute values of the coordinates of (m, 3) vertices."""
    return np.array([np.maximum(x.max(initial=0.0), -x.min(initial=0.0)) for x in vertices.T])
