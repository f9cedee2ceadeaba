"""Meshes with what their numbers are good for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.meshes.mesh import Mesh

COORDINATE_ROUNDING = 2.0**-50
"""Rounding, as a fraction of the largest coordinate: some operations of double precision."""


@dataclass(frozen=True, eq=False)
class KnownMesh:
    """A mesh, and how exactly its numbers are known.

    Attributes
    ----------
    mesh : Mesh
    half_steps : (3,) float
        How far a coordinate along each axis may be from the number that was meant: half a unit of the last digit or bit
        that the file has at the size of the largest coordinate, and some roundings.
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
    return largest_coordinates(vertices) * COORDINATE_ROUNDING


def largest_coordinates(vertices: FloatArray) -> FloatArray:
    """(3,) largest absolute values of the coordinates of (m, 3) vertices."""
    return np.asarray(np.maximum(vertices.max(axis=0, initial=0.0), -vertices.min(axis=0, initial=0.0)))
