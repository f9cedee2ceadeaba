"""What a mesh file holds, and how exactly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.errors import GtbError
from gtb_cli.meshes.known import largest_coordinates


@dataclass(frozen=True, eq=False)
class Content:
    """Arrays as a file has them, not looked at yet.

    Attributes
    ----------
    vertices : (m, 3) float
    cells : (k, 2) or (k, 3) int
        Segments or triangles; polygons are cut into triangles around their first corner.
    half_steps : (3,) float
        How far a coordinate along each axis may be from the number that was written: half a unit of the last digit or
        bit, at the size of the largest.
    groups : tuple of (name, start, stop)
        Ranges of cells with a name.
    """

    vertices: FloatArray
    cells: IntArray
    half_steps: FloatArray
    groups: tuple[tuple[str, int, int], ...] = ()


def single_half_steps(vertices: FloatArray) -> FloatArray:
    """Half the distance between neighbouring 32-bit numbers at the largest coordinate along each axis."""
    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.spacing(largest_coordinates(vertices).astype(np.float32)).astype(np.float64) / 2
    return np.asarray(np.where(np.isfinite(steps), steps, 0.0))


def triangles(polygons: IntArray) -> IntArray:
    """Cut (k, c) polygons of c corners each into (k (c − 2), 3) triangles around their first corners."""
    corners = polygons.shape[1]
    fan = np.array([[0, i, i + 1] for i in range(1, corners - 1)])
    return np.ascontiguousarray(polygons[:, fan].reshape(-1, 3))


def joined(parts: list[IntArray], width: int) -> IntArray:
    """Blocks of cells one after another."""
    return np.concatenate([np.empty((0, width), dtype=np.int64), *parts])


def whole(values: NDArray[np.generic], what: str) -> IntArray:
    """Indices of any whole type as int64."""
    if values.dtype.kind not in "iu":
        raise GtbError(f"{what}: expected whole numbers, got {values.dtype}")
    return values.astype(np.int64)
