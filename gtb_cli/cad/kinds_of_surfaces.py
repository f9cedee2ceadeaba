"""Surfaces instead of triangles: CAD formats, and what they lack; which patches are exact: `bspline_surfaces`."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.cad.bspline_surfaces import CLOSEST, spline_surfaces
from gtb_cli.cad.cad_seams import Seams
from gtb_cli.cad.cad_writing import encode_cad
from gtb_cli.cad.exact_surfaces import SplineSurface
from gtb_cli.errors import RequirementError, ToleranceError
from gtb_cli.importers.cad_files import kernel_faults, moved
from gtb_cli.models.model import Model
from gtb_cli.theory.patch import Patch


@kernel_faults()
def encode_surfaces(
    spec: Patch | Model,
    kind: str,
    unit: str,
    tolerance: float | None,
    angle: float | None = None,
    *,
    closed: bool = False,
    part: Any = None,
    bend_allowed: float | None = None,
) -> tuple[bytes, str, list[str], Seams | None]:
    """Return the bytes of a file of surfaces, with a description of what it holds, warnings, and a part's seams.

    Patches without exact pieces are fitted within the tolerance and angle (without these, see `spline_surfaces`).
    `closed` asks for solids: a `RequirementError` says that there are open shells. See `encode_cad` for a part.
    With `bend_allowed` fitted surfaces also have the curvature of its faces; a `ToleranceError` if it differs by more
    than this share of the part's largest.
    """
    surfaces, curved = list[SplineSurface](), bend_allowed is not None
    if part is None:
        found = spline_surfaces(spec, tolerance, angle)
        surfaces += found.surfaces
    else:  # near the origin, as far away planes at smooth corners are lost in rounding
        points = np.concatenate([patch.control_points for patch in spec.patches])
        origin = points.mean(axis=0)
        near = _with_points(spec, lambda points: points - origin)
        found = spline_surfaces(near, tolerance, angle, *moved(origin, part), curved=curved)
        extents = [np.ptp(each.net[..., :3], axis=(0, 1)).max() for each in found.surfaces]
        digits = 11 - math.floor(math.log10(max(extents)))
        for each in found.surfaces:
            net, first = each.net + np.append(origin, 0), 4 * bool((each.net[0] == each.net[0, 0]).all())
            net[first:, :, :3] = np.round(net[first:, :, :3], digits)  # curvature near smooth corners needs all digits
            surfaces.append(each._replace(net=net))
    data, shells, solids, seams = encode_cad(surfaces, kind, unit, spec.name or "patch", part, curved=curved)
    if closed and shells:
        raise RequirementError(f"not watertight: {shells} of {shells + solids} shells are open")
    warnings = []
    if found.reasons:
        name, reason = found.reasons[0]
        others = f" (one of {len(found.reasons)} such patches)" if len(found.reasons) > 1 else ""
        who = f"{name}{others}: " if isinstance(spec, Model) else ""
        bend = f"tangent planes differ by up to {found.angle:.3g} degrees at edges and {found.bend:.3g} at inner seams"
        if found.lost and found.angle > 90:  # the largest angle is that of planes which no B-spline follows
            bend = f"tangent planes are lost at {100 * found.lost:.2g}% of edges and seams"
        warnings.append(f"fitted within {found.error:.2g}, not exact, {bend}: {who}{shortened(reason)}")
    counts = {"exact": len(found.surfaces) - found.fitted, "fitted": found.fitted}
    how = " and ".join(f"{count} {how}" for how, count in counts.items() if count)
    faces = f"{how} face{'s' if len(found.surfaces) > 1 else ''}"
    bodies = {"solid": solids, "open shell": shells}
    parts = [f"{count} {name}{'s' if count > 1 else ''}" for name, count in bodies.items() if count]
    if seams is not None:  # which say more than the warning
        warnings, curvature = [], seams.curvature
        faces += f" within {found.error:.2g}" if bend_allowed is None else ""
        angles = [f"{turn:.2g} degrees and {gap:.2g}" for turn, gap in (seams[:2], seams[2:4])]
        apart, off = max(seams[0:3:2]), "planes at seams differ by"
        if not apart <= (angle or 90):  # beyond, faces have turned back
            raise ToleranceError(f"{off} {apart:.6g} degrees, more than {angle or 90:g}")
        if angle is None and apart > CLOSEST:
            warnings.append(f"{off} up to {apart:.2g} degrees: `angle` bounds it")
        if tolerance is not None and not (apart := max(seams[1:4:2])) <= tolerance:
            raise ToleranceError(f"seams of the file have gaps of {apart:.6g}, more than {tolerance:g}")
        parts.append(f"seams to the part within {angles[0]}, between new faces {angles[1]}")
        if curvature is not None and bend_allowed is not None:
            share = curvature.difference / curvature.largest
            off = f"{curvature.difference:.2g} ({share:.2%} of {curvature.largest:.3g}) near {curvature.place}"
            if not share <= bend_allowed:
                raise ToleranceError(f"continuity g2: curvatures differ by {off}: `g2_tolerance` bounds it")
            parts.append(f"curvature to the part within {off}")
            if curvature.corners:
                parts.append(f"the part's own jumps by up to {curvature.jump:.2g} at {curvature.corners} corners")
    return data, ", ".join([faces, *parts]), warnings, seams


def with_y_up(spec: Patch | Model) -> Patch | Model:
    """Turn surfaces as `Mesh.with_y_up` turns meshes: the point (x, y, z) becomes (x, z, −y)."""
    return _with_points(spec, lambda points: points[:, [0, 2, 1]] * [1, 1, -1] + 0.0)  # without -0


def _with_points(spec: Patch | Model, move: Callable[[FloatArray], FloatArray]) -> Patch | Model:
    patches = tuple(patch.replace(control_points=move(patch.control_points)) for patch in spec.patches)
    return spec.replace(patches=patches) if isinstance(spec, Model) else patches[0]


def shortened(reason: str) -> str:
    """Shorten the reason why there are no exact pieces by the advice to use other commands."""
    return reason.partition(". A mesh")[0].replace(" (`max_degree`)", "")
