"""The certificate of a filling: what was measured where it meets its neighbours, at its corners and inside."""

import math
from collections.abc import Sequence
from dataclasses import field, replace
from typing import ClassVar

import numpy as np

from gtb_cli.arrays import FloatArray, angles_between, point_text, unit
from gtb_cli.fairing.energy import samples
from gtb_cli.fairing.fair import LEFT_OUT
from gtb_cli.fairing.folds import highest, most_curved, sharp_turns as turns
from gtb_cli.fairing.variation import Bending
from gtb_cli.filling.hole_corners import at_ends, corners
from gtb_cli.filling.osculation import Rim, patch_bend
from gtb_cli.filling.sides import HoleSide, edge_normals, points_and_tangents, stations
from gtb_cli.models.model import Model
from gtb_cli.theory.corners import PLANE_DEGREES, CornerLayer, CornerLimits, corner_layer
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen

BOUND = 150.0  # largest curvature at a corner, times its shorter edge, of one that is not told in short words
SPIKE = 30.0  # largest curvature, relative to a sphere's with the same area, of a patch that does not turn sharply
DISAGREEING = 1.0  # degrees between planes at a corner from which on normals have several limits, whatever is done


@frozen
class Contact:
    """The largest differences between a patch and what it meets along one side of its hole.

    Attributes
    ----------
    angle : float
        In degrees, between its normals and the given ones; NaN without planes.
    place : (3,) float
        The point with this angle; NaN without planes.
    bend : float
        Between normal curvatures across the side, the patch's and its neighbour's (1 / length); NaN where not known.
    bend_place : (3,) float
        The point with this difference, or NaN.
    bend_inside : float
        Where curvature is met: twice the largest difference of mean curvatures at the side and at a hundredth of its
        length from it, without a twentieth at each end; NaN elsewhere.
    """

    angle: float
    place: FloatArray
    bend: float = math.nan
    bend_place: FloatArray = field(default_factory=lambda: np.full(3, math.nan))
    bend_inside: float = math.nan


@frozen
class Filling:
    """A patch that fills a hole. Made by `gtb_cli.fill`.

    Attributes
    ----------
    patch : Patch
    sides : tuple of HoleSide
        In the order of the patch's edges.
    bending, bending_nearer : Bending
        Integrals over the patch without the outermost hundredth, and thousandth, of the way from edges to the middle.
    bending_errors : (2, 2) float
        Relative differences of each, and of its variation, to those by a coarser quadrature, summed over edges.
    contacts : tuple of Contact
        What was measured along each side.
    corner_angles : (r,) float
        Angle in degrees between the planes of sides k − 1 and k at corner k; NaN if a side has no planes.
    corners : tuple of CornerLimits
        The limits of the patch's own normals and curvatures at each corner, in closed form.
    corner_curvatures : tuple of float
        The largest curvature from a tenth to a millionth of the shorter edge from each corner; NaN where it has none.
    corner_forced : tuple of float
        What every surface with the given planes has there at least: how fast they turn along the sides; 0 without any.
    raises : tuple of int
        Number of times that the degree of each side was raised.
    folds : int
        Number of places, among some thousand and the corners, at which the patch turns back.
    sharp_turns : int
        Number of sides in a mesh of some thousand triangles at which it turns by a right angle; 0 if it folds.
    remarks : tuple of str
    model : Model or None
        The model with its hole filled, or the patches of a loop that is cut.
    parts : tuple of Filling
        Of a hole that is cut at its concave corners: `patch` is the first one's, other attributes list or add up all.
    tried : tuple of str
        Options with which the patch has a fault, too, or had one before it was made with others.
    """

    refused: ClassVar[float] = 2000.0  # sharpness of a patch that is as good as folded
    hopeless: ClassVar[int] = 12  # folds of a patch that no other degree or fullness mends if it has as many sides

    patch: Patch
    sides: tuple[HoleSide, ...]
    bending: Bending
    bending_nearer: Bending
    bending_errors: FloatArray
    contacts: tuple[Contact, ...]
    corner_angles: FloatArray
    corners: tuple[CornerLimits, ...]
    corner_curvatures: tuple[float, ...]
    corner_forced: tuple[float, ...]
    raises: tuple[int, ...]
    folds: int
    sharp_turns: int
    remarks: tuple[str, ...]
    model: Model | None = None
    parts: tuple["Filling", ...] = ()
    tried: tuple[str, ...] = ()

    @property
    def patches(self) -> tuple[Patch, ...]:
        """The patch, or those of all parts."""
        return tuple(part.patch for part in self.parts) or (self.patch,)

    @property
    def angle(self) -> float:
        """Largest angle in degrees between the patch's normals and the given ones along sides; NaN if none."""
        return max((each.angle for each in self.contacts if not math.isnan(each.angle)), default=math.nan)

    @property
    def sharpness(self) -> float:
        """Largest curvature, relative to that of a sphere with the same area."""
        return self.bending.curvature * math.sqrt(self.bending.area / (4 * math.pi))

    @property
    def sharp(self) -> list[str]:
        """Sentences that say where the patch turns sharply, and where it is curved most; none if it is smooth."""
        said, ends = [], np.array([side.ends[0] for side in self.sides])
        if self.sharp_turns:
            corner = int(np.linalg.norm(ends - np.concatenate([*map(turns, self.patches)])[0], axis=1).argmin())
            where = f"{self.sharp_turns} of some thousand places, the first nearest to corner {corner}"
            said = [f"the patch turns sharply at {where}, {self.at(ends[corner])}: coarse meshes fold there"]
        if self.sharpness > SPIKE:
            part = max(self.parts or (self,), key=lambda part: part.bending.curvature)
            much = f"{self.sharpness:.2g} times as much as a sphere of its area"
            along, (shape, logs) = 24, (part.patch.domain, part.patch.log_products)
            _, place = most_curved(part.patch, samples(shape, logs, along, LEFT_OUT[0]), along)
            said.append(f"the patch is curved {much} near {self.at(place)}")
        for part in self.parts or (self,):
            ends = np.array([side.ends[0] for side in part.sides])
            edges = np.linalg.norm(np.roll(ends, -1, axis=0) - ends, axis=1)
            # Where a corner has no plane, what differs is told
            near = np.nan_to_num(part.corner_curvatures) * [each.angle <= PLANE_DEGREES for each in part.corners]
            curved, forced = np.array([near, part.corner_forced]) * np.minimum(edges, np.roll(edges, 1))
            if (most := curved[k := int(curved.argmax())]) > BOUND:
                where = f"corner {k}, {self.at(ends[k])}"
                why = f", where the given planes' turning forces {forced[k]:.2g}" * bool(forced[k] > BOUND / 2)
                said.append(f"the patch's curvature times the shorter edge is up to {most:.2g} at {where}{why}")
        return said

    @property
    def doubts(self) -> list[str]:
        """What is to be seen: a hole in parts, the corner where planes differ most, and what is `sharp`."""
        angles, why = np.nan_to_num(self.corner_angles), "as corners point into the hole"
        said = [f"filled in {len(self.parts)} parts, {why}"] * bool(self.parts)
        if (most := float(angles.max())) > DISAGREEING:
            at = self.at(self.sides[int(angles.argmax())].ends[0])
            said.append(f"neighbours' planes differ by up to {most:.3g} degrees at their corner {at}")
        return said + self.sharp

    def at(self, place: FloatArray) -> str:
        """Return a place for messages, with digits that suit the size of the patch."""
        return point_text(place, np.concatenate([patch.control_points for patch in self.patches]))

    @property
    def fault(self) -> str | None:
        """The sentence that says why the patch does not fill the hole, and what to try; None if it is one."""
        concave = [f"{each.between} at {self.at(each.place)}" for each in corners(self.sides) if each.concave]
        planes = any(side.across is not None for side in self.sides)
        others = "other ribbons, or " * planes + "curves that cut the hole into smaller ones"
        if self.angle > 45:  # where fields follow the planes at all, it is below a degree
            far = "is turned over" if self.angle > 90 else f"leaves the given planes by {self.angle:.0f} degrees"
            side = self.sides[int(np.nanargmax([each.angle for each in self.contacts]))]
            other = "give it another ribbon, which points into the hole"
            what, way_out = f"{far} along {side.name}", f'{other}, or take `continuity="g0"`'
        elif self.folds:
            what = f"folds at {self.folds} of some thousand places"
            mending = "try a fullness of 0.8 or 0.5," if planes else "raise degrees more, or try"
            way_out = f"{'try' if min(self.folds, len(self.sides)) >= self.hopeless else mending} {others}"
        elif self.sharpness > self.refused or (concave and (self.sharp_turns or self.sharpness > SPIKE)):
            what = f"turns sharply: its curvature is up to {self.sharpness:.2g} times that of a sphere of its area"
            way_out = f"raise degrees more, or try {others}"
        else:
            return None
        if self.tried:
            way_out = f"{', '.join(self.tried)} were tried, too: try {others}"
        if concave and (not planes or len(concave) < len(self.sides) - 2):  # else the ribbons point out of the hole
            places = "; ".join(concave)
            way_out = f"cut the hole with curves from its concave corners (gtb fill tries at most six): {places}"
        return f"the patch {what}: {way_out}"

    def normals_near(self, corner: int) -> float:
        """Return the largest angle in degrees between normals at a millionth of the shorter edge from a corner.

        Limits are reached slowly where knots nearly share their order: those of all distances that are seen may differ.
        """
        distance, surface = 1e-6, (self.patch.domain, self.patch.log_products, self.patch.control_points)
        rates = np.linspace(-6, 6, 241)  # to where the edges are, at such a distance
        far = np.full(len(rates), math.log(distance))
        for _ in range(4):
            near = corner_layer(*surface, corner, np.stack([rates, far]))
            far += np.nan_to_num(np.log(distance / near.distances))
        return CornerLimits(near.normals[np.isfinite(near.distances)]).angle

    def __repr__(self) -> str:
        return f"<Filling: {len(self.sides)} sides, planes met within {self.angle:.2g} degrees, {self.folds} folds>"


def contact(patch: Patch, side: int, given: HoleSide, normals: FloatArray | None) -> Contact:
    """Measure a patch along a side with (96, 3) normals, or none."""
    if normals is None:
        return Contact(math.nan, np.full(3, math.nan))
    k = int((angles := angles_to(patch, side, normals)).argmax())
    points = points_and_tangents(given.curve, stations())[0]
    found = Contact(float(angles[k]), points[k])
    if given.bend is None:
        return found
    bend = np.abs(patch_bend(patch, side, given.curve, normals) - given.bend)
    k = int(bend.argmax())
    inside, there = patch.curvature(hundredth_inside(patch, side, given.curve), "linear").mean
    return replace(found, bend=float(bend[k]), bend_place=points[k], bend_inside=2 * float(abs(inside - there).max()))


def angles_to(patch: Patch, side: int, normals: FloatArray) -> FloatArray:
    """Return the angles in degrees between the patch's and the given normals at the `stations` of a side."""
    return angles_between(edge_normals(patch, side, stations()), normals)


def hundredth_inside(patch: Patch, edge: int, curve: FloatArray, count: int = 31) -> FloatArray:
    """Return (2, count, 2) linear parameters: a hundredth of an edge's length inside, and at the edge.

    Places near the ends are left out, a twentieth of the edge at each, as they are no farther from other edges.
    """
    distance, tries = 0.01, 4  # of its length; the distance is nearly linear in the place
    shape = patch.domain
    start, end = shape.vertices[edge], shape.vertices[(edge + 1) % len(shape.vertices)]
    on_edge = start + np.linspace(0.05, 0.95, count)[:, None] * (end - start)
    inward = np.array([start[1] - end[1], end[0] - start[0]])
    points, _ = points_and_tangents(curve, np.linspace(0, 1, 101))
    length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    depth, given = np.full((len(on_edge), 1), distance), patch.evaluate(on_edge, "linear")
    along = unit(np.gradient(given, axis=0))
    for _ in range(tries):
        way = patch.evaluate(on_edge + depth * inward, "linear") - given
        way -= (way * along).sum(axis=1, keepdims=True) * along
        depth = np.minimum(depth * distance * length / np.linalg.norm(way, axis=1, keepdims=True), 3 * distance)
    return np.stack([on_edge + depth * inward, on_edge])


def curvature_near(patch: Patch, corner: int) -> float:
    """Return the largest curvature from a tenth to a millionth of the shorter edge from a corner of Δ, or NaN."""
    surface = patch.domain, patch.rational_basis.log_weights, patch.control_points
    steepest = 600.0  # rate of a way that runs in an edge
    closest, farthest, apart = 1e-6, 0.1, 8  # of the edge; how far terms of P − V are from that, at most
    ways, top = np.linspace(-1, 1, 41), np.full(41, math.log(farthest * apart))

    def layer(u: FloatArray, depth: FloatArray) -> CornerLayer:
        """Return places at shares of the steepest way's rate, and logarithms of distances below the farthest."""
        far = np.interp(u, ways, top) - depth
        return corner_layer(*surface, corner, np.stack([u * np.log(steepest / -np.minimum(far, -1)), far]))

    def curvatures(at: FloatArray) -> FloatArray:
        near = layer(at[0], np.maximum(at[1], 0))
        reached = (near.distances >= closest) & (near.distances <= 1.002 * farthest)  # 0 elsewhere, and beyond floats
        return np.where(reached & np.isfinite(near.curvatures), near.curvatures, 0.0).reshape(at.shape[1:])

    for most in (1, 1, 1, 1, 0, 0):  # many a largest curvature is at the farthest distance, and none beyond counts
        top += np.minimum(np.nan_to_num(np.log(farthest / layer(ways, 0 * ways).distances) - 1e-6), most)
    depths = math.log(apart * farthest / closest * apart) * np.linspace(0, 1, 13) ** 1.5
    return highest(curvatures, np.stack(np.meshgrid(ways, depths))[:, None], 1)[0] or math.nan


def corner_bends(sides: Sequence[HoleSide], normals: Sequence[FloatArray | None]) -> FloatArray:
    """Return (r,) differences of mean curvatures that sides k − 1 and k give at corner k; NaN if one has none."""
    starts, ends = np.full((2, len(sides)), math.nan)
    for k, (side, n) in enumerate(zip(sides, normals, strict=True)):
        if side.bend is not None and n is not None:
            rim = Rim(side.curve, n)
            starts[k], ends[k] = at_ends((side.bend + rim.bend / (rim.rates**2).sum(axis=1)) / 2)
    return np.asarray(np.abs(np.roll(ends, 1) - starts))
