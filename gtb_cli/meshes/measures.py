"""Measures of a mesh: area, volume, length, boundary, and topology; of patches: `distances.areas_and_volumes`."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gtb_cli.arrays import bounds_of, cross, dot
from gtb_cli.meshes.coincident import numbered_places
from gtb_cli.meshes.frame import Frame
from gtb_cli.meshes.mesh import Mesh, vertices_to_measure
from gtb_cli.meshes.topology import are_proper, are_used, components_of, sides_of
from gtb_cli.values import if_finite


def in_unit(value: float, power: int, unit: str | None) -> tuple[float, str]:
    """Return a length, area (`power` 2) or volume (3) with the unit behind it; for mm cm² and cm³ from 1 on."""
    if unit is None:
        return value, ""
    signs = ("", "", "²", "³")[power]
    is_large = unit == "mm" and power > 1 and abs(value) >= 10**power
    return (value / 10**power, f" cm{signs}") if is_large else (value, f" {unit}{signs}")


@dataclass(frozen=True)
class Measures:
    """Measures of a mesh; vertices at exactly the same place count as one."""

    vertices: int
    cells: int
    is_curve: bool
    bounds: tuple[tuple[float, float, float], tuple[float, float, float]]  # lowest and highest of vertices in cells
    area: float | None  # None for a curve
    length: float | None  # None for a surface
    volume: float | None  # negative if the faces look inwards; None if they are not closed and consistently oriented
    boundary_length: float | None  # of the edges with one face; None for a curve
    components: int  # parts that share no vertex
    inward_parts: int | None  # those of them with negative volumes; None without a volume
    euler_characteristic: int  # vertices in use, less edges, plus faces
    open_edges: int  # edges with one face; for a curve, vertices with one segment
    crowded_edges: int  # edges with more than two faces; for a curve, vertices with more than two segments
    turned_edges: int  # edges with two faces that look in opposite directions; 0 for a curve
    collapsed: int  # cells with two corners at the same place; they count nowhere else

    def record(self) -> dict[str, Any]:
        """Plain data, ready for ``json.dumps``; None also for a value that overflows, as an area may."""
        cells, bounds = "segments" if self.is_curve else "faces", [*map(list, self.bounds)]
        record: dict[str, Any] = {"vertices": self.vertices, cells: self.cells, "bounds": bounds}
        record |= {"components": self.components, "euler_characteristic": self.euler_characteristic}
        if self.is_curve:
            return {**record, "length": if_finite(self.length), "open_ends": self.open_edges}
        extents = {name: if_finite(getattr(self, name)) for name in ("area", "volume", "boundary_length")}
        return {**record, **extents, "open_edges": self.open_edges, "crowded_edges": self.crowded_edges}


def labelled(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of a record by the labels that all reports give them; the bounds have two."""
    found: dict[str, Any] = {}
    for key, value in record.items():
        found |= zip(("lowest", "highest"), value, strict=True) if key == "bounds" else {key.replace("_", " "): value}
    return found


def measure(mesh: Mesh) -> Measures:
    """Measure a mesh; raises `DomainError` if it has no cells, or vertices that are not finite."""
    points = vertices_to_measure(mesh, "there is nothing to measure")
    low, high = bounds_of(points)
    frame = Frame.around(points)
    first, labels = numbered_places(points)
    place = np.zeros(len(mesh.vertices), dtype=labels.dtype)
    place[are_used(mesh.cells, len(mesh.vertices))] = labels
    cells = place[mesh.cells]
    proper = are_proper(cells)
    cells = cells[proper]
    vertices = frame.inside(points[first])
    topology = sides_of(cells)
    edges, number = topology.edges, topology.uses
    sides = vertices[edges[:, 1]] - vertices[edges[:, 0]]
    lengths = np.sqrt(dot(sides, sides))
    del sides
    euler = int(are_used(cells, len(vertices)).sum()) - len(edges) + (0 if mesh.is_curve else len(cells))
    parts = components_of(cells, len(vertices))[cells[:, 0]]
    area = length = volume = boundary = inward = None
    if mesh.is_curve:
        number = np.bincount(edges.ravel(), minlength=1)
        length = float(frame.length(lengths.sum()))
    else:
        a = vertices[cells[:, 0]]
        normal = cross(vertices[cells[:, 1]] - a, vertices[cells[:, 2]] - a)
        area = float(frame.length(np.sqrt(dot(normal, normal)).sum() / 2, 2))
        boundary = float(frame.length(lengths[number == 1].sum()))
        if len(cells) and not len(topology.open):
            volume = float(frame.length((cones := dot(a, normal)).sum() / 6, 3))
            inward = int((np.bincount(parts, cones) < -1e-9 * np.bincount(parts, np.abs(cones))).sum())
    return Measures(
        vertices=len(mesh.vertices),
        cells=len(mesh.cells),
        is_curve=mesh.is_curve,
        bounds=(tuple(low.tolist()), tuple(high.tolist())),
        area=area,
        length=length,
        volume=volume,
        boundary_length=boundary,
        components=int(np.count_nonzero(np.bincount(parts))),
        inward_parts=inward,
        euler_characteristic=euler,
        open_edges=int(np.count_nonzero(number == 1)),
        crowded_edges=int(np.count_nonzero(number > 2)),
        turned_edges=0 if mesh.is_curve else int(np.count_nonzero((number == 2) & (topology.balance != 0))),
        collapsed=int(np.count_nonzero(~proper)),
    )


def moments(mesh: Mesh) -> tuple[list[float] | None, list[float] | None]:
    """Return the centroid of all cells, and their mean squares about it: xx, yy, zz, yz, zx, xy; None without extent.

    Every cell has the weight of its area or length, so that a mirrored mesh has other products and the same squares.
    """
    frame = Frame.around(mesh.bounds)
    corners = frame.inside(mesh.vertices)[mesh.cells]
    sides = corners[:, 1:] - corners[:, :1]
    weights = np.linalg.norm(sides[:, 0] if mesh.is_curve else cross(sides[:, 0], sides[:, 1]), axis=1)
    if not weights.sum() > 0:
        return None, None
    weights /= weights.sum()
    centroid = weights @ corners.mean(axis=1)
    corners -= centroid
    both = np.concatenate([corners, corners.sum(axis=1, keepdims=True)], axis=1)
    width = mesh.cells.shape[1]
    spread = np.einsum("k,kci,kcj->ij", weights, both, both) / (width * (width + 1))
    products = [float(frame.length(spread[i, j], 2)) for i, j in ((0, 0), (1, 1), (2, 2), (1, 2), (2, 0), (0, 1))]
    return frame.outside(centroid).tolist(), products if np.isfinite(products).all() else None
