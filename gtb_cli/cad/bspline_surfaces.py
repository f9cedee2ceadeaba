"""Patches as rational B-spline surfaces: Bézier rectangles, or fitted pieces; sewn and written: `cad_writing`."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from gtb_cli.arrays import angles_between
from gtb_cli.cad.edge_halves import half_edges
from gtb_cli.cad.exact_surfaces import SplineSurface, balanced, exact_surfaces
from gtb_cli.cad.fitted_pieces import fitted_pieces
from gtb_cli.cad.part_borders import part_borders
from gtb_cli.cad.polar_pieces import polar_pieces
from gtb_cli.cad.spline_pieces import FittedPieces
from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.models.model import Model
from gtb_cli.theory.patch import Patch

SPANS: tuple[int, ...] = (4, 8, 12, 16, 24, 32)  # in each direction of a fitted piece, tried in turn
POLAR_SPANS: tuple[int, ...] = (3, 4, 5, 6, 8, 12, 16)  # of pieces where corners are smooth
CURVED_SPANS: tuple[int, ...] = (4, 5, 6)  # of those that meet curvature
CLOSEST = 1e-3  # degrees between tangent planes that more spans are tried for, where none is given
_Trial: TypeAlias = tuple[dict[int, FittedPieces], FittedPieces]  # of patches by number; the largest figures of all


class SplineSurfaces(NamedTuple):
    """Surfaces for CAD, in the order of the patches, and how good the `fitted` ones are, at sample points.

    `error` is their largest distance from the patches, of polar pieces along normals; `angle` the largest angle in
    degrees to the tangent planes of a patch along its edges, and `bend` that between two pieces of one patch along
    their common edge; `lost` is as in `FittedPieces`. `reasons` are the names of fitted patches, and why they are.
    """

    surfaces: tuple[SplineSurface, ...]
    fitted: int
    error: float
    bend: float
    angle: float
    lost: float
    reasons: tuple[tuple[str, str], ...]


def spline_surfaces(
    spec: Patch | Model, tolerance: float | None, angle: float | None = None, part: Any = None, *, curved: bool = False
) -> SplineSurfaces:
    """Return the surfaces of a patch or model as rational B-splines.

    A patch with Bézier pieces becomes these: one for a tensor product patch, r for a patch with r corners. Any other
    patch is fitted by r pieces between the corners, places inside the edges and the centroid of Δ, or by 2 r where two
    edges run on into each other; they keep its tangent planes along its edges and their seams. An edge that has Bézier
    pieces is that curve to 1e-8 of the size; any other is the same spline in all fitted patches that share it. Edges
    along open ones of a part, a shape of the kernel, follow these and the planes of its faces; `curved` pieces also
    their curvature, which no patch is exact for: their `error` is the share of it that is missed.

    A `DomainError` refuses curves; a `ToleranceError` says that even 32 spans in each direction do not reach the
    tolerance, in model units, or the angle in degrees. Without a tolerance it is 1e-4 of the largest extent of the
    points at knots; without an angle more spans are taken as long as planes come nearer, down to a thousandth.
    """
    patches = spec.patches
    if patches[0].dimension == 1:
        raise DomainError("is a curve, and CAD files are made of surfaces")
    exact: dict[int, list[SplineSurface]] = {}
    reasons: dict[int, str] = {}
    for index, patch in enumerate(patches):
        try:
            if curved:
                raise DomainError("meets the curvature of a part")
            exact[index] = [balanced(surface) for surface in exact_surfaces(patch, index)]
        except DomainError as fault:
            reasons[index] = str(fault)
    if not reasons:
        return SplineSurfaces(tuple(chain.from_iterable(exact.values())), 0, 0.0, 0.0, 0.0, 0.0, ())
    names = {index: patches[index].name or f"patch-{index}" for index in reasons}
    edges = {} if curved else half_edges(spec, reasons)
    halves = {i: [edges.get((i, k)) for k in range(len(patches[i].domain.vertices))] for i in reasons}
    borders = {index: part_borders(patches[index], part, curved=curved) for index in reasons}

    def trials(fit: Callable[..., FittedPieces], counts: Sequence[int]) -> Iterator[_Trial]:
        """Fit all patches by more and more spans, as long as polar pieces have normals at corners and seams."""
        for spans in counts:
            try:
                found = {i: fit(patches[i], names[i], spans, halves[i], borders[i]) for i in reasons}
            except DomainError:
                if curved or fit is fitted_pieces:
                    raise
                return
            yield found, FittedPieces((), *map(max, zip(*(one[1:] for one in found.values()), strict=True)))

    # Of points, as control points inside may be far away
    size = float(np.ptp(np.concatenate([patch.evaluate(patch.knots) for patch in patches]), axis=0).max())
    allowed, best = 1e-4 * size if tolerance is None else tolerance, None
    most = FittedPieces((), np.inf if curved else allowed, 1e-8 * size, np.inf, 90.0, np.inf)  # edges are exact
    if curved or any(_has_smooth_corner(patches[index]) for index in reasons):
        best, last = _best_of(trials(polar_pieces, CURVED_SPANS if curved else POLAR_SPANS), most, angle, curved)
    if not (best or curved):
        best, last = _best_of(trials(fitted_pieces, SPANS), most._replace(angle=np.inf), angle, curved)
    if best is None:
        off = f"{last.gap:.3g} off along edges"
        off = f"{last.error:.3g} off, more than {allowed:.3g}" if last.error > most.error else off
        spans = (CURVED_SPANS if curved else SPANS)[-1]
        raise ToleranceError(f"fitted surfaces of {spans} × {spans} spans are still {off}")
    pieces, reached = best
    if angle is not None and (apart := max(reached.bend, reached.angle)) > angle:
        raise ToleranceError(f"planes of fitted faces still differ by {apart:.6g} degrees, more than {angle:g}")
    return SplineSurfaces(
        tuple(chain.from_iterable(exact[i] if i in exact else pieces[i].surfaces for i in range(len(patches)))),
        sum(len(one.surfaces) for one in pieces.values()),
        *(reached.error, reached.bend, reached.angle, reached.lost),
        tuple((name, reasons[index]) for index, name in names.items()),
    )


def _best_of(
    trials: Iterable[_Trial], most: FittedPieces, angle: float | None, curved: bool
) -> tuple[_Trial | None, FittedPieces]:
    """Return the trial with the nearest planes of those that are within `most`, and the figures of the last one.

    The last meets planes or, without a given angle, does not come to half the angles of two trials before.
    """
    missed = 0.005  # of curvature: with more, more spans are tried
    much, enough = 0.1, 0.1  # a share of places with planes that no B-spline follows, and degrees that suffice then
    best, found, least, before = None, most, np.inf, [(np.inf, np.inf)] * 2
    for pieces, found in trials:
        # Files are measured at more places
        wanted = 0.9 * angle if angle is not None else CLOSEST if found.lost < much else enough
        planes = found.bend, found.angle
        is_met = max(planes) <= wanted and (not curved or found.error <= missed)
        is_sound = found.error <= most.error and found.gap <= most.gap and found.angle < most.angle
        if is_sound and (is_met or sum(planes) <= least):
            best, least = (pieces, found), sum(planes)
        is_better = curved or any(now > wanted and now <= then / 2 for now, then in zip(planes, before[0], strict=True))
        if best and (is_met or (angle is None and not is_better)):
            break
        before = [before[1], planes]
    return best, found


def _has_smooth_corner(patch: Patch) -> bool:
    """Return whether two edges of a patch run on into each other, nearly."""
    nearly = 30  # degrees
    curves = [patch.boundary(k) for k in range(len(patch.domain.vertices))]
    ways = np.array([curve.tangents([0.0, curve.knots.max()]) for curve in curves])
    return bool((angles_between(ways[:, 0], np.roll(ways[:, 1], 1, axis=0)) < nearly).any())
