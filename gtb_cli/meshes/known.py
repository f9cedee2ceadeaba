"""Meshes with the accuracy of their coordinates."""

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
        the largest coordinate of a vertex that cells use, plus a few roundings.
    format : str
        One of `FORMATS`, or ``"spec"``.
    """

    mesh: Mesh
    half_steps: FloatArray
    format: str

    @property
    def has_indices(self) -> bool:
        """Whether its faces tell which vertices they share: an STL file has none, a GLB file has those of each node."""
        return self.format not in ("stl", "glb")


def known_exactly(mesh: Mesh) -> KnownMesh:
    """A mesh that was computed here."""
    return KnownMesh(mesh, rounding(largest_coordinates(mesh.used)), "spec")


def rounding(largest: FloatArray) -> FloatArray:
    """(3,) error of computed coordinates along each axis, from the largest absolute values."""
    # Rounding of a few double-precision operations, as a fraction of the largest coordinate
    coordinate_rounding = 2.0**-50
    return largest * coordinate_rounding


def largest_coordinates(vertices: FloatArray) -> FloatArray:
    """(3,) largest absolute values of the coordinates of (m, 3) vertices."""
    return np.array([np.maximum(x.max(initial=0.0), -x.min(initial=0.0)) for x in vertices.T])
