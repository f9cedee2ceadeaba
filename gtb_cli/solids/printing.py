"""What a printer asks of a closed mesh: how large it is, how it stands, what overhangs, how thin its walls are."""

from typing import Any

import numpy as np

from gtb_cli.arrays import cross, dot, unit
from gtb_cli.meshes.frame import Frame
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.topology import are_used
from gtb_cli.solids.wall_depth import wall_of_faces, ways_out
from gtb_cli.vocabulary import UP, Up


def printing(mesh: Mesh, up: Up, max_wall_faces: int) -> dict[str, Any]:
    """Measure a closed mesh of which this axis points up, as plain data in model units.

    Overhangs look down by more than 45 degrees from upright, but for what is flat within 0.2% of the height above the
    bed: it stands there. The wall behind a triangle is that of `wall_of_faces`: the least, the middle of its triangle,
    the angle in degrees at which this meets the other side, if it does, as walls thin out to nothing there, and the
    wall that 90% of the surface has at least; None if there are more triangles.
    """
    frame, axis = Frame.around(mesh.vertices), 2 if up == UP[0] else 1
    corners = frame.inside(mesh.vertices)[mesh.faces]
    normals = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    areas, down, middles = np.sqrt(dot(normals, normals)), -normals[:, axis], corners.mean(axis=1)
    heights, spans = middles[:, axis] - corners[:, :, axis].min(), np.ptp(corners, axis=(0, 1))
    stands = (down > 0.99 * areas) & (heights < 0.002 * spans[axis])
    hangs = (down > (np.sqrt(0.5) + 1e-9) * areas) & ~stands
    walls = wall_of_faces(mesh) if len(mesh.cells) <= max_wall_faces else None
    keys, values = ("least_wall", "least_wall_place", "least_wall_angle", "usual_wall"), list[Any]([None] * 4)
    if walls is not None and np.isfinite(walls).any():
        least = int(np.argmax(walls <= np.nanmin(walls) * (1 + 1e-6)))  # the first of those that rounding tells apart
        order = np.argsort(walls)  # NaN last
        usual = order[np.searchsorted(np.cumsum(areas[order]), 0.1 * areas.sum())]
        beside = np.flatnonzero(are_used(mesh.faces[[least]], len(mesh.vertices))[mesh.faces].any(axis=1))
        inwards, units = -unit(normals[[least]]), unit(normals)
        ways = [float(ways_out(middles[[least]], inwards, corners[[row]], units[[row]])[0]) for row in beside]
        is_other = np.isclose(frame.length(np.array(ways)), walls[least], rtol=1e-6)  # as rays through a side meet two
        angles = np.degrees(np.arccos(np.clip(units[beside[is_other]] @ inwards[0], -1.0, 1.0)))
        place, angle = frame.outside(middles[least]).tolist(), float(angles.min()) if len(angles) else None
        values = [float(walls[least]), place, angle, float(walls[usual])]
    bed, hanging = (float(frame.length(areas[rows].sum(), 2)) for rows in (stands, hangs))
    measured = {"up": up, "size": frame.length(spans).tolist(), "bed_area": bed, "overhang_area": hanging}
    found = dict(zip(keys, values, strict=True))
    return {**measured, "overhang_share": float(areas[hangs].sum() / areas.sum()), **found}
