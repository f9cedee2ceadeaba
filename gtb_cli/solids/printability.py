"""What a printer asks of a closed mesh: size, stand, overhangs, walls. Closed or not: `tessellation.requirements`."""

from typing import Any

import numpy as np

from gtb_cli.arrays import cross, dot, unit
from gtb_cli.meshes.frame import Frame
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.solids.wall_depth import wall_of_faces
from gtb_cli.vocabulary import UP, Up


def printability(mesh: Mesh, up: Up, max_wall_faces: int) -> dict[str, Any]:
    """Measure a closed mesh of which this axis points up, as plain data in model units.

    Overhangs look down by more than 45 degrees from upright, but for what is flat within 0.2% of the height above the
    bed: it stands there. The wall behind a triangle is that of `wall_of_faces`. The least is of those whose sides are
    within 45 degrees of parallel: so it does not hang on how near blunter edges triangles are. It is 0 where the two
    sides meet, at a knife edge, whose angle in degrees is told. Its place is the middle of the triangle. The usual wall
    is what 90% of the surface has at least. None if there are more triangles, or no such wall.
    """
    frame, axis = Frame.around(mesh.vertices), 2 if up == UP[0] else 1
    corners = frame.inside(mesh.vertices)[mesh.faces]
    normals = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    areas, down, middles = np.sqrt(dot(normals, normals)), -normals[:, axis], corners.mean(axis=1)
    heights, spans = middles[:, axis] - corners[:, :, axis].min(), np.ptp(corners, axis=(0, 1))
    stands = (down > 0.99 * areas) & (heights < 0.002 * spans[axis])
    hangs = (down > (np.sqrt(0.5) + 1e-9) * areas) & ~stands
    found = wall_of_faces(mesh) if len(mesh.cells) <= max_wall_faces else None
    wall: dict[str, Any] = dict.fromkeys(("least_wall", "least_wall_place", "least_wall_angle", "usual_wall"))
    if found is not None and (found[1] >= 0).any():
        walls, others = found
        facing = -dot(unit(normals), unit(normals)[others])
        order = np.argsort(walls)  # NaN last
        wall["usual_wall"] = float(walls[order[np.searchsorted(np.cumsum(areas[order]), 0.1 * areas.sum())]])
        walls = np.where((others >= 0) & (facing > np.sqrt(0.5) - 1e-9), walls, np.inf)
        least = int(np.argmax(walls <= walls.min() * (1 + 1e-6)))  # the first of those that rounding tells apart
        if np.isfinite(walls[least]):
            wall |= {"least_wall": float(walls[least]), "least_wall_place": frame.outside(middles[least]).tolist()}
            if (corners[least, :, None] == corners[others[least]]).all(axis=2).any():  # they have a corner in common
                wall |= {"least_wall": 0.0, "least_wall_angle": float(np.degrees(np.arccos(min(facing[least], 1.0))))}
    bed, hanging = (float(frame.length(areas[rows].sum(), 2)) for rows in (stands, hangs))
    measured = {"up": up, "size": frame.length(spans).tolist(), "bed_area": bed, "overhang_area": hanging}
    return {**measured, "overhang_share": float(areas[hangs].sum() / areas.sum()), **wall}
