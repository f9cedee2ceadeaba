"""A hole with three or more sides, filled with one patch that touches the given planes exactly along its edges.

Inside an edge with Bézier points q_0 … q_m is a row of m knots, half a step on: control points ``(q_j + q_{j+1})/2 +
v_j``, on tangent lines but for a polynomial field v in the given planes, from the null space of ``v ↦ <normal, v>``.
Linear least squares choose v and the inner control points for the least variation of curvature: in the metric of the
domain, then in that of the surface.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, angles_between
from gtb_cli.errors import DomainError
from gtb_cli.fairing.energy import energy_at, energy_samples, samples
from gtb_cli.fairing.fair import agreed
from gtb_cli.fairing.folds import folds as fold_places, most_curved, sharp_turns
from gtb_cli.fairing.variation import Bending
from gtb_cli.filling.certificate import DISAGREEING, SPIKE, Filling, angles_to, contact, corner_bends, curvature_near
from gtb_cli.filling.control_points import Rows
from gtb_cli.filling.corner_equations import POINT
from gtb_cli.filling.fairest import NEARER, VISIBLE, FairSearch
from gtb_cli.filling.hole_corners import corners, end_normals, forced_curvatures
from gtb_cli.filling.knots_and_weights import net
from gtb_cli.filling.sides import HoleSide, loop, side_normals
from gtb_cli.filling.spline_sides import single_curves
from gtb_cli.filling.tangent_rows import EdgeRows, edge_rows
from gtb_cli.knots.domain import domain
from gtb_cli.theory.corners import corner_limits, limits_of_normals
from gtb_cli.theory.patch import Patch
from gtb_cli.vocabulary import CONTINUITIES, check_word

FLAT_BEND = 1e-9  # curvature of a flat neighbour, by rounding, of 1 / size


class _Attempt(NamedTuple):
    """A patch in units of the loop's size; its faults, its score, and whether a much fairer one has some."""

    faults: int
    score: float
    after_others: bool
    folds: int
    sharp_turns: int
    raises: tuple[int, ...]
    patch: Patch
    # Bending in both zones, their errors and, where planes are given, the sharpness of a `Filling`: asked for if needed
    measured: Callable[[], tuple[Sequence[Bending], FloatArray, float]] = lambda: ((), np.zeros((2, 2)), 0.0)

    @property
    def sharpness(self) -> float:
        return self.measured()[2]


def fill_loop(
    sides: Sequence[HoleSide],
    name: str | None = None,
    *,
    continuity: str | Mapping[str, str] = "g1",
    inner: str = "fair",
    fullness: float = 1.0,
    raises: int | None = None,
    g2_tolerance: float = 0.01,
) -> Filling:
    """Fill a hole whose sides are given in any order, with ends that meet; see `gtb_cli.fill` for the options.

    Raises `DomainError`: an option has no such value, or the sides do not close, are too few or too many, or have no
    tangent planes or curvatures.
    """
    sides = met_with(continuity, sides)
    check_word("inner", inner, ("fair", "flat"))
    if not 0 < fullness <= 1000:
        raise DomainError(f"fullness: must be positive and at most 1000, got {fullness!r}")
    if fullness != 1 and all(side.across is None for side in sides):
        raise DomainError("fullness: continues along tangent planes, and no side has any")
    if not g2_tolerance > 0:
        raise DomainError(f"g2_tolerance: must be positive, got {g2_tolerance!r}")
    if raises is not None and (isinstance(raises, bool) or raises < 0):
        raise DomainError(f"raises: expected a whole number, at least 0, got {raises!r}")
    max_sides = 24  # with more, there are too few inner knots for the corners
    ordered, remarks = closed(sides)
    if len(ordered) > max_sides:
        raise DomainError(f"loop: has {len(ordered)} sides, at most {max_sides} are filled with one patch")
    points = np.concatenate([side.points for side in ordered])
    middle, size = (points.min(axis=0) + points.max(axis=0)) / 2, float(np.ptp(points, axis=0).max())
    unit = [side.in_units(middle, size) for side in ordered]
    normals = [None if side.across is None else side_normals(side) for side in unit]
    starts, ends = np.stack([end_normals(side) for side in unit], axis=1)
    corner_angles = angles_between(np.roll(ends, 1, axis=0), starts)
    legs = np.array([np.linalg.norm(np.diff(side.points, axis=0)[[0, -1]], axis=1) for side in unit])
    # The corners at which a patch has one plane: those with two directions of edges and no two planes
    sound = (legs[:, 0] > POINT) & (np.roll(legs[:, 1], 1) > POINT) & ~(corner_angles > DISAGREEING)
    far = 30 * EPS * float(np.abs(points).max() / size)  # what points are off there
    met = [None] * len(unit) if fullness == 1 and _is_flat(unit, normals, far) else normals
    attempt = partial(_attempt, unit, normals, met, np.flatnonzero(sound).tolist(), inner, fullness)
    best = _best(attempt, _plans(unit, raises))
    patch, ((bending, nearer), errors, _) = best.patch, best.measured()
    points = patch.control_points * size + middle
    points[: len(ordered)] = [side.ends[0] for side in ordered]
    patch = Patch(patch.knots, points, log_weights=patch.log_weights - patch.log_weights[0], name=name)
    largest = max((np.abs(side.bend).max() for side in unit if side.bend is not None), default=0.0)
    remarks += _remarks(unit, normals, size, largest, best)
    contacts = tuple(contact(patch, k, side, n) for k, (side, n) in enumerate(zip(ordered, normals, strict=True)))
    for side, found in zip(ordered, contacts, strict=True):
        if found.bend * size > g2_tolerance * largest + FLAT_BEND and side.bend is not None:
            share = found.bend * size / max(largest, FLAT_BEND)
            raise DomainError(
                f"{side.name}: the nearest row of knots has curvatures {found.bend:.2g} off its neighbour's, "
                f"{share:.1%} of the largest: `g2_tolerance` bounds it, and g1 asks for none"
            )
    limits, turned = tuple(corner_limits(patch, k) for k in range(len(ordered))), 0 if best.folds else best.sharp_turns
    measured = bending.scaled(size), nearer.scaled(size), errors, contacts, corner_angles, limits
    curved = tuple(np.array([curvature_near(best.patch, k) for k in range(len(ordered))]) / size)
    forced = tuple((forced_curvatures([side.curve for side in unit], normals)[0] / size).tolist())
    return Filling(patch, ordered, *measured, curved, forced, best.raises, best.folds, turned, tuple(remarks))


def _is_flat(sides: Sequence[HoleSide], normals: Sequence[FloatArray | None], rounding: float) -> bool:
    """Tell whether sides and their planes lie in one plane: a patch that meets the curves meets the planes, too."""
    given = [n for n in normals if n is not None]
    if not given or any(side.bend is not None for side in sides):
        return False
    points, n = np.concatenate([side.points for side in sides]), given[0][0]
    turned = np.linalg.norm(np.cross(np.concatenate(given), n), axis=1)
    rounding = max(rounding, *(side.rounding for side in sides))
    return bool(turned.max() <= rounding and np.abs((points - points[0]) @ n).max() <= rounding)


def _remarks(
    sides: Sequence[HoleSide], normals: Sequence[FloatArray | None], size: float, largest: float, best: _Attempt
) -> list[str]:
    """Say where neighbours' curvatures disagree, how degrees are raised, and along which sides planes turn over."""
    bends, alike = corner_bends(sides, normals), 1e-6 * largest + FLAT_BEND  # of what is extrapolated
    remarks = [
        f"{sides[k - 1].name} and {sides[k].name}: mean curvatures of their neighbours differ by "
        f"{bend / size:.2g} at their corner"
        for k, bend in enumerate(bends.tolist())
        if bend > alike
    ]
    if any(best.raises):
        remarks.append(f"degrees of the sides are raised by {', '.join(map(str, best.raises))}")
    for side, n in zip(sides, normals, strict=True):
        turn = 0.0 if n is None else math.degrees(math.acos(np.clip(n @ n.T, -1, 1).min()))
        if best.sharp_turns and turn > 90:  # a patch that follows such planes faces the other way, and then back
            planes = f"its tangent planes turn by {turn:.0f} degrees along it"
            remarks.append(f"{side.name}: {planes}, so that the patch turns sharply there")
    return remarks


def met_with(continuity: str | Mapping[str, str], sides: Sequence[HoleSide]) -> list[HoleSide]:
    """Return sides with what is to be met along each."""
    kinds = {"": continuity} if isinstance(continuity, str) else continuity
    names = [side.name for side in sides]
    for name, met in kinds.items():
        check_word("continuity", met, CONTINUITIES)
        if name and name not in names:
            raise DomainError(f"continuity: no side is called {name!r}: they are {', '.join(names)}")
    return [side.met_with(kinds.get(side.name, kinds.get("", CONTINUITIES[0]))) for side in sides]


def closed(sides: Sequence[HoleSide]) -> tuple[tuple[HoleSide, ...], list[str]]:
    """Return the sides of a hole in order, each B-spline in one, and remarks, as `single_curves` and `loop` do."""
    whole, remarks = single_curves(sides)
    ordered, said = loop(whole)
    return ordered, remarks + said


def _plans(sides: Sequence[HoleSide], raises: int | None) -> list[tuple[int, bool]]:
    """Return how often edges are raised at least, and whether each has a single field, in the order of trial."""
    planes, least = any(side.across is not None for side in sides), raises
    angles = [corner.angle for corner in corners(sides)]
    if least is None:
        # Of all edges together: with more, inner knots would be too few, and where planes alone are given they are free
        bends = any(side.bend is not None for side in sides)
        least = 4 if planes and sum(side.degree + 4 for side in sides) <= (45 if bends else 36) else 1 + planes
        if 150 < min(angles) <= max(angles) < 181 and len({side.degree for side in sides}) == 1 and not bends:
            least = min(least, len(sides) - 1)  # rows with more fields follow a round side of few by huge points
    plans = [(least, False), (least, True), (least + 1, False), (least + 2, True)]
    if raises is None:
        # Some loops of twelve sides turn over if there are more fields to choose from, and do not if there are fewer.
        plans.insert(0 if len(sides) > 12 else 1, (least - 1, False))
        if max(angles) > 150:  # rows that cross smooth corners need more knots
            plans.insert(1, (5, False))
    return plans


def _best(attempt: Callable[[int, bool], _Attempt], plans: Sequence[tuple[int, bool]]) -> _Attempt:
    """Carry out plans until a patch has no fault, and none that is much fairer has some; or two are hopeless."""
    rank = itemgetter(slice(2))
    best = attempt(*plans[0])
    if not (best.faults or best.after_others) and best.sharpness > SPIKE:  # mostly far less so with single fields
        for plan in sorted(plans[1:], key=lambda plan: (not plan[1], plan[0]))[:4]:
            best = min(best, tried := attempt(*plan), key=lambda each: (each.sharpness > Filling.refused, *rank(each)))
            if not tried.faults and tried.sharpness <= SPIKE:
                break
        return best
    for plan in plans[1:]:
        if not (best.faults or best.after_others):
            break
        tried = attempt(*plan)
        if min(best.folds, tried.folds, len(best.raises)) >= Filling.hopeless:
            break
        best = min(best, tried, key=rank)
    return best


def _attempt(
    sides: Sequence[HoleSide],
    normals: Sequence[FloatArray | None],
    met: Sequence[FloatArray | None],
    sound: Sequence[int],
    inner: str,
    fullness: float,
    least: int,
    single: bool,
) -> _Attempt:
    """Fill with edges raised at least so often, and all fields or the nearest to the given."""
    edges = [edge_rows(side, n, least) for side, n in zip(sides, met, strict=True)]
    if single:
        edges = [each.with_nearest(side) for each, side in zip(edges, sides, strict=True)]
    raises = tuple(len(each.curve) - len(side.curve) for each, side in zip(edges, sides, strict=True))
    # By which the certificate is measured: digits on which they agree are said; no more places with many sides
    quadratures = [math.ceil(each * math.sqrt(min(1.0, 12 / len(sides)))) for each in (20, 36)]
    much = math.log(100)  # beyond the score of the fairest: with less, other plans have little to win
    found = list[_Attempt]()
    for patch, score in _solved(edges, inner, fullness):
        turned = sum(angles_to(patch, k, n).max() > 90 for k, n in enumerate(normals) if n is not None)
        folds = len(fold_places(patch)) + sum(limits_of_normals(patch, k).folds for k in sound)
        faults = (turns := len(sharp_turns(patch))) + 1000 * (folds + turned)
        worse = bool(found) and score > found[0].score + much
        found.append(_Attempt(faults, score, worse, folds, turns, raises, patch))
        if not found[-1].faults:
            break
    best = min(found, key=lambda each: each[:2])
    has_planes = any(normal is not None for normal in normals)
    return best._replace(measured=cache(partial(_measured, best.patch, quadratures, has_planes)))


def _measured(patch: Patch, quadratures: Sequence[int], planes: bool) -> tuple[list[Bending], FloatArray, float]:
    (bent,), errors, zones = agreed(patch, [patch.control_points], quadratures)
    most_bent = np.maximum.accumulate([most_curved(patch, at, quadratures[-1])[0] for at in zones]).tolist()
    bending = [replace(b, curvature=max(b.curvature, most)) for b, most in zip(bent, most_bent, strict=True)]
    return bending, errors, bending[0].curvature * math.sqrt(bending[0].area / (4 * math.pi)) * planes


def _solved(edges: Sequence[EdgeRows], inner: str, fullness: float) -> Iterator[tuple[Patch, float]]:
    """Yield patches in units of the loop's size, with their scores: the fairest, and others if that folds."""
    shape = net(edges)
    # Variation is right to some hundredths with 32; with 4 samples for each knot, no control point is left free.
    resolution = math.ceil(math.sqrt(max(32**2 * min(len(edges), 8), 4 * len(shape.knots)) / len(edges)))
    region = domain(shape.knots, "unit")
    places = samples(region, shape.log_weights, resolution, NEARER)
    least = partial(Rows(shape, edges).fairest, fullness=fullness)
    patch = partial(Patch, shape.knots, log_weights=shape.log_weights)
    if inner == "flat":  # a membrane is what was asked for
        yield patch(least(energy_at(*places, "dirichlet"))), 0.0
        return
    depths = np.minimum(energy_samples(region, resolution, NEARER)[2] / VISIBLE, 1)
    search = FairSearch(region, places, depths, least, edges, fullness == 1)
    yield from ((patch(points), score) for score, points, *_ in search.fairest())
