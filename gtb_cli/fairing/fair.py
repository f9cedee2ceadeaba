"""Which inner control points are free, and the patch in which they are fair; `descent` finds it by its energies."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import overload

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray
from gtb_cli.errors import DomainError
from gtb_cli.fairing.descent import FLAT, descended, figures, is_fairer, measured
from gtb_cli.fairing.energy import Samples, energy_matrix, samples
from gtb_cli.fairing.folds import folds
from gtb_cli.fairing.metric import blocks
from gtb_cli.fairing.variation import Bending
from gtb_cli.knots.domain import LAYER_TOLERANCE, Domain, layers
from gtb_cli.language.spec_paths import SpecPath, loaded
from gtb_cli.models.model import Model
from gtb_cli.theory.edges import CURVE_TOLERANCE
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen
from gtb_cli.vocabulary import ENERGIES, KEEPS, Fairness, Keep, check_word

RIDGE_FRACTION = 1e-12  # of the mean energy is added: a control point without influence on it stays where it is

# Outermost parts of the way to the middle without which figures must not rise; those of the first are reported
LEFT_OUT = (1e-2, 1e-3)


@frozen
class Fairing:
    """A fair patch. Made by `fair`.

    Attributes
    ----------
    patch : Patch
        The given one itself if no fairer one is found, or if no control point is free.
    before, after : Bending
        Of the given patch and of this one, without the outermost hundredth: area, ∫ κ₁² + κ₂² (`energy`), area times
        ∫ |∇H|² (`variation`) and the largest curvature. They are not finite if a surface has no tangent plane there.
    error : float
        Largest relative difference of these integrals, and energies, to those by a coarser quadrature.
    free : int
        Number of control points that were free.
    folds : int
        Number of places, among some thousand, at which the surface turns back.
    energies : (float, float), optional
        Energies before and after, in units of length², if these were to be least; see `gtb_cli.fairing.energy`.
    """

    patch: Patch
    before: Bending
    after: Bending
    error: float
    free: int
    folds: int
    energies: tuple[float, float] | None = None


@overload
def fair(spec: Patch, energy: Fairness = "variation", keep: Keep = "boundary") -> Fairing: ...
@overload
def fair(spec: Model, energy: Fairness = "variation", keep: Keep = "boundary") -> tuple[Fairing, ...]: ...
@overload
def fair(spec: SpecPath, energy: Fairness = "variation", keep: Keep = "boundary") -> Fairing | tuple[Fairing, ...]: ...


def fair(
    spec: Patch | Model | SpecPath, energy: Fairness = "variation", keep: Keep = "boundary"
) -> Fairing | tuple[Fairing, ...]:
    """Choose the inner control points of a surface, or of each patch of a model, so that it is fair.

    Parameters
    ----------
    spec : Patch, Model or path
        Surfaces.
    energy : {"variation", "thin-plate", "dirichlet"}
        With "variation", the product of E⁴, E = ∫ κ₁² + κ₂², and of the area times ∫ |∇H|² becomes smaller until no
        step changes it by a tenth. Neither rises, without the outermost hundredth or thousandth. The others are
        integrals in the linear parametrisation, and least: see `gtb_cli.fairing.energy`.
    keep : {"boundary", "tangents", "curvature"}
        What stays along every edge: its curve, also the tangent planes, or also the curvatures. Edges at which patches
        of a model meet smoothly, to a degree, keep their tangent planes in any case.

    Returns
    -------
    Fairing, or a tuple with that of each patch of a model

    Raises
    ------
    DomainError
        The spec is of curves, or an option has an unknown value.

    Notes
    -----
    Knots and weights stay. The limits on an edge of planes, and of curvatures, are determined by the knots up to the
    height of the lowest layer that does not follow the edge's tangents, and up to twice this height. Least energies are
    linear problems, since the patch is linear in its control points; see `gtb_cli.fairing.descent` for the variation. A
    thin plate is a second start where it is fairer, or where the given patch folds. Not in the paper.
    """
    found = loaded(spec, Patch, Model)
    if found.dimension == 1:
        raise DomainError("fair: expected a surface, this is a curve")
    check_word("energy", energy, ENERGIES)
    check_word("keep", keep, KEEPS)
    if isinstance(found, Patch):
        return _faired(found, energy, [keep] * len(found.domain.vertices))
    made: list[Fairing] = []
    alike: dict[object, int] = {}
    # No less than tangents stays at points and at smooth seams.
    kept = [[keep] * len(patch.domain.vertices) for patch in found]
    smooth = [ref for seam in found.seams if not seam.is_crease for ref in (seam.first, seam.second)]
    for index, edge in (*smooth, *found.joints.collapsed):
        kept[index][edge] = max("tangents", keep, key=KEEPS.index)
    for patch, keeps in zip(found, kept, strict=True):
        size = np.linalg.norm(patch.control_points - patch.control_points.mean(axis=0))
        k = alike.setdefault((patch.knots.tobytes(), tuple(keeps), f"{size:.6g}"), len(made))
        made.append((k < len(made) and _copied(found[k], made[k], patch)) or _faired(patch, energy, keeps))
    return tuple(made)


def _copied(patch: Patch, made: Fairing, other: Patch) -> Fairing | None:
    """Return the fairing of another patch if a rigid motion, or a reflection, takes the first patch to it."""
    if patch.domain != other.domain or not np.array_equal(patch.log_products, other.log_products):
        return None
    ours, theirs = (each.control_points - each.control_points.mean(axis=0) for each in (patch, other))
    left, _, right = np.linalg.svd(ours.T @ theirs)
    turn = left @ right
    if np.abs(ours @ turn - theirs).max() > CURVE_TOLERANCE * np.abs(theirs).max():
        return None
    shifts = (made.patch.control_points - patch.control_points) @ turn
    return replace(made, patch=other.replace(control_points=other.control_points + shifts) if shifts.any() else other)


def _faired(patch: Patch, energy: Fairness, keeps: Sequence[Keep]) -> Fairing:
    kept = kept_knots(patch, keeps)
    free = np.flatnonzero(~kept)
    middle = patch.control_points.mean(axis=0)
    size = float(np.abs(patch.control_points - middle).max()) or 1.0
    given = (patch.control_points - middle) / size
    found, energies = given, None
    if energy != "variation":
        matrix = energy_matrix(patch, energy)
        found = _least(matrix, given, free)
        least = [float(np.einsum("ik,ij,jk->", points, matrix, points)) for points in (given, found)]
        energies = least[0] * size * size, least[1] * size * size
    elif len(free):
        found = _least_varied(patch, given, free)
    (before, after), (errors, _), _ = agreed(patch, [given, found])
    if energies is None and (figures(after) > np.maximum(figures(before), FLAT)).any():  # by the finest quadrature
        found, after = given, before
    if found is not given:
        points = found * size + middle
        points[kept] = patch.control_points[kept]
        patch = patch.replace(control_points=points)
    bent = before[0].scaled(size), after[0].scaled(size)
    return Fairing(patch, *bent, float(errors.max()), len(free), len(folds(patch)), energies)


def _least_varied(patch: Patch, given: FloatArray, free: IntArray) -> FloatArray:
    """Return control points with less variation, or the given ones if none are found.

    Descent begins at the given ones, then at a thin plate if that is fairer than what is found, or if the quadratures
    do not agree on what is given: it is as good as folded somewhere.
    """
    quadratures = refined(patch.domain, patch.log_products, (24, 48))
    search, judge = ([(list(blocks(*each[:3])), each.areas) for each in zones] for zones in quadratures)
    plate = _least(energy_matrix(patch, "thin-plate"), given, free)
    coarse, before = (figures(measured(zones, [given])[0]) for zones in (search, judge))
    best, least, fewest = given, before, len(folds(patch))
    is_sound = not fewest and (np.isfinite(before) & np.isclose(coarse, before, 0.1, FLAT)).all()
    for start, most in ((given, before), (plate, np.full(len(before), math.inf))):
        if start is plate and is_sound and not is_fairer(figures(measured(judge, [plate])[0]), least):
            continue
        found = descended(search, judge, start, free, most)
        after, now = figures(measured(judge, [found])[0]), len(folds(patch.replace(control_points=found)))
        is_better = now < fewest or (now == fewest and is_fairer(after, least))
        if is_better and (after <= np.maximum(before, FLAT)).all():
            best, least, fewest = found, after, now
    return best


def refined(domain: Domain, log_weights: FloatArray, resolutions: Sequence[int]) -> Iterator[list[Samples]]:
    """Yield ever finer quadratures of the inside and of a strip around it."""
    for resolution in resolutions:
        yield [samples(domain, log_weights, resolution, *bounds) for bounds in ((LEFT_OUT[0], 1.0), LEFT_OUT[::-1])]


def agreed(
    patch: Patch, surfaces: Sequence[FloatArray], resolutions: Sequence[int] = (32, 48, 64, 96)
) -> tuple[list[list[Bending]], FloatArray, list[Samples]]:
    """Measure surfaces without what is `LEFT_OUT`, by ever finer quadratures until two agree in the first region.

    Also return (2, 2) largest relative differences of bending and variation, a row for each region, and the last
    quadrature. They are summed over the triangles of edges, as the difference in one may be hidden by others.
    """
    enough, r = 3e-3, len(patch.domain.vertices)
    earlier, errors = None, np.full((2, 2), math.inf)
    for zones in refined(patch.domain, patch.log_products, resolutions):
        parts = [(each, part) for each in zones for part in np.split(np.arange(len(each.areas)), r)]
        bent = measured([(blocks(*each[:3], part), each.areas) for each, part in parts], surfaces)
        with np.errstate(all="ignore"):  # where a surface has no tangent plane, integrals are not finite
            area = np.array([[(1.0, b.area) for b in one] for one in bent])
            values = np.array([[(b.energy, b.variation) for b in one] for one in bent])
            now = values / area  # sums over the triangles so far
            if earlier is not None:
                change = np.abs(np.diff(now - earlier, axis=1, prepend=0)).cumsum(axis=1) / now
                errors = np.where(np.isfinite(change) & (values > FLAT), change, 0.0)[:, [r - 1, -1]].max(axis=0)
        if errors[0].max() <= enough:
            break
        earlier = now
    return [[one[r - 1], one[-1]] for one in bent], errors, zones


def agreed_text(value: float, error: float) -> str:
    """Return a figure with digits, at most three, of which the last is a unit off where quadratures differ so much."""
    if not (math.isfinite(value) and error < 0.5):
        return "unknown"
    leading = abs(float(f"{value:e}".partition("e")[0])) or 1.0
    digits = max(1, min(3, math.floor(1 - math.log10(leading * (error or 1e-3)))))
    return f"{round(value, 12) + 0.0:.{digits}g}"


def _least(matrix: FloatArray, given: FloatArray, free: IntArray) -> FloatArray:
    """Return control points of which the free ones make a quadratic form least."""
    points = given.copy()
    ridge = RIDGE_FRACTION * np.trace(matrix) / len(matrix)
    points[free] -= np.linalg.solve(matrix[np.ix_(free, free)] + ridge * np.eye(len(free)), matrix[free] @ points)
    return points


def kept_knots(patch: Patch, keeps: Sequence[Keep]) -> BoolArray:
    """Return (n,) whether a knot is on an edge, or determines what else is kept along one."""
    shape = patch.domain
    kept = np.asarray(shape.incidence.any(axis=1))
    for edge, (keep, heights) in enumerate(zip(keeps, shape.heights.T, strict=True)):
        if keep != "boundary":
            most = _planes_height(patch, edge) * (2 if keep == "curvature" else 1)
            kept |= heights <= most + LAYER_TOLERANCE * heights.max()
    return kept


def _planes_height(patch: Patch, edge: int) -> float:
    """Return the height of the lowest layer of knots over an edge beyond which none changes its tangent planes.

    Mostly it is the first. It is another if control points of the first are on the edge's tangents, or coincide.
    """
    shape = patch.domain
    heights, start = shape.heights[:, edge], shape.vertices[edge]
    places = start + np.linspace(0.05, 0.95, 10)[:, None] * (np.roll(shape.vertices, -1, axis=0)[edge] - start)
    normals = patch.normals(places)
    shifts = np.random.default_rng(0).normal(size=patch.control_points.shape) * np.ptp(patch.control_points)
    for layer in layers(heights):
        height = float(heights[layer].max())
        moved = patch.control_points + shifts * (heights > height)[:, None]
        if np.allclose(patch.replace(control_points=moved).normals(places), normals, atol=1e-9, equal_nan=True):
            break
    return height
