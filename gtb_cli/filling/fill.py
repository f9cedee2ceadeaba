"""`fill` for Python: a hole from a file, from curves, or in a model; `one_patch` makes the patch."""

import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import chain, count, islice
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import FloatArray, bounds_of, finite
from gtb_cli.errors import DomainError, RequirementError
from gtb_cli.files import read_file
from gtb_cli.filling.certificate import Filling
from gtb_cli.filling.cutting import fill_parts
from gtb_cli.filling.hole_corners import corners
from gtb_cli.filling.hole_files import read_loop
from gtb_cli.filling.holes import Ring, hole_edges, model_rings, one_ring, ring_sides
from gtb_cli.filling.one_patch import closed, fill_loop, met_with
from gtb_cli.filling.part_holes import Part
from gtb_cli.filling.sides import HoleSide, points_and_tangents, stations
from gtb_cli.filling.strips import curve_sides
from gtb_cli.knots.even_triangulation import central_triangulation
from gtb_cli.language.document import MAX_BYTES
from gtb_cli.models.model import Model
from gtb_cli.models.openings import other_grids
from gtb_cli.theory.edges import EdgeRef, edge_name, patch_name
from gtb_cli.theory.patch import Patch
from gtb_cli.vocabulary import CONTINUITIES


def fill(
    loop: Model | str | os.PathLike[str],
    ribbons: Sequence[ArrayLike | None] | None = None,
    ribbons2: Sequence[ArrayLike | None] | None = None,
    *,
    hole: str | None = None,
    continuity: str | Mapping[str, str] = "g1",
    inner: str = "fair",
    fullness: float = 1.0,
    raises: int | None = None,
    g2_tolerance: float = 0.01,
    name: str | None = None,
) -> Filling:
    """Fill a hole with one patch.

    Parameters
    ----------
    loop : Model or path
        A model of curves, which are the sides in any order; a model of surfaces with an open ring of edges; or a file
        with one of these, with a `.gbp` or `.lop` loop, or with a CAD part (STEP, IGES or BREP).
    ribbons : sequence of (n, 3) float or None, optional
        For each curve of a model of curves, the second row of control points: ribbon − curve is the cross field.
    ribbons2 : sequence of (n, 3) float or None, optional
        The third row. All three are those of a strip (1 − u)² curve + 2 u (1 − u) ribbon + u² ribbon2.
    hole : str, optional
        An edge of the ring in a model of surfaces, such as ``"wall-0 edge 2"``, or a point near the hole of a CAD part,
        such as ``"10,0,2.5"``; not needed if there is one ring.
    continuity : {"g1", "g0", "g2"} or mapping
        With "g1" the patch touches the tangent planes that are given; with "g0" it only meets the curves, and is plane
        where they lie in a plane; with "g2" it also has the neighbour's curvature along each side, which must be known.
        A mapping has the names of sides that differ, and "" for all others.
    inner : {"fair", "flat"}
        Curvature varies little, or least Dirichlet energy.
    fullness : float
        Factor, up to 1000, of the distance for which the patch continues along the given planes; 1 is the fairest.
    raises : int, optional
        Smallest number of times that the degree of edges is raised. Default: 2 for a side with a ribbon and 1 for
        others, or one less if the patch folds then, and 4 if edges are not many; with 0, edges stay as they are if an
        exact field is found.
    g2_tolerance : float
        Largest difference of curvatures with "g2", of the neighbours' largest; beside rational neighbours the nearest
        row of knots is taken where none has theirs exactly.
    name : str, optional
        Name of the patch; that of the loop's spec by default.

    Returns
    -------
    Filling
        The `patch`, the `model` with it if one was given, the measurements, and the `fault` if it folds.

    Raises
    ------
    SpecError, DomainError
        A file, loop or option is not valid.

    References
    ----------
    Not in the paper; the rows of knots and the tangent planes that they give are in `gtb_cli.filling.one_patch`.
    """
    found: Sequence[HoleSide] | Model | Part
    if isinstance(loop, Model):
        found = loop if loop.dimension == 2 else _sides(loop, ribbons, ribbons2)
    else:
        source = os.fspath(loop)
        found, named = read_loop(read_file(source, MAX_BYTES + 1), source)
        name = name or named
    options = {"continuity": continuity, "inner": inner, "fullness": fullness, "raises": raises}
    return filled(found, hole, name, **options, g2_tolerance=g2_tolerance)


def filled(found: Sequence[HoleSide] | Model | Part, hole: str | None, name: str | None, **options: Any) -> Filling:
    """Fill a loop of sides, or a hole of a model or a part, with a patch that meets its neighbours as `fill` says.

    Options are those of `fill_loop`. The `model` of the filling has the patch, under a name that no other has. Raises
    `DomainError` as `fill` does.
    """
    if isinstance(found, Part):
        sides, remarks = found.sides(one_ring(found.rings, hole, "part"))
        filling = filled(sides, None, name, **options)
        wild, rounding = 1e4, 1e-7  # variation beyond all that is fair; angles that curves and planes of files are off
        if filling.fault or filling.bending_nearer.variation > wild:
            other = filled([replace(side, rounding=rounding) for side in sides], None, name, **options)
            varied = [each.bending_nearer.variation for each in (filling, other)]
            filling = other if not other.fault and (filling.fault or varied[1] < varied[0]) else filling
        return replace(filling, remarks=(*remarks, *filling.remarks))
    if not isinstance(found, Model):
        if hole is not None:
            raise DomainError("hole: names an edge of a model of surfaces, and this is a loop of curves")
        filling = _in_parts(found, name, (), **options)
        return _beside((), filling) if filling.parts else filling
    refs = hole_edges(found, hole)
    taken = [patch.name for patch in found]
    filling = _in_parts(ring_sides(found, refs), next(_free(name or "hole", taken)), taken, **options)
    whole = found.replace(patches=(*found.patches, *filling.patches))
    remarks = filling.remarks
    if loose := [edge_name(whole.patches, ref) for ref in whole.joints.open if ref[0] >= len(found)]:
        remarks += (f"{', '.join(loose)}: the neighbour's curve at other parameters, so that they are not joined",)
    beside = [found.patches[k] for k in sorted({ref[0] for ref in refs})]
    return replace(_beside(beside, filling), remarks=remarks, model=whole)


def filled_in_some_way(
    found: Sequence[HoleSide] | Model | Part, hole: str | None, name: str | None, **options: Any
) -> Filling:
    """Fill as `filled` does and, where that has a fault, with less fullness or one degree more, if that has none.

    A remark says with which, and why; a patch that keeps its fault has what was `tried`.
    """
    first, tried = filled(found, hole, name, **options), list[str]()
    more = 1 + max(first.raises, default=0)
    fault, _, way_out = (first.fault or "").partition(":")
    ways = {"fullness 0.8": {"fullness": 0.8}, "fullness 0.5": {"fullness": 0.5}}
    ways |= {f"degrees raised by {more}": {"raises": more}}
    for words, change in ways.items() if "fullness" in way_out or "degrees" in way_out else ():
        with suppress(DomainError):  # no side has planes along which it could go on
            other = filled(found, hole, name, **options | change)
            if not other.fault:
                remarks = (f"filled with {words}, as otherwise {fault}", *other.remarks)
                return replace(other, remarks=remarks, tried=("fullness 1", *tried))
            tried.append(words)
    return replace(first, tried=tuple(tried))


def with_fills(
    spec: Patch | Model, fills: Sequence[tuple[str, str]], warn: Callable[[str], object], note: Callable[[str], object]
) -> Patch | Model:
    """Fill holes of a model, one after the other, each named by an edge and with the continuity of its patch.

    What is doubtful is a warning; that a patch rises above its hole, as a dome is meant to, is a note. Raises
    `RequirementError` where a patch folds with any fullness that is tried.
    """
    own = len(spec.patches)
    for hole, kind in fills:
        if not isinstance(spec, Model) or spec.dimension != 2:
            raise DomainError("`fills`: fills holes of a model of surfaces, [[patches]], and this is none")
        try:
            end = _loose_end(spec, hole_edges(spec, hole, own))
            if end and (grids := other_grids(spec)):
                raise DomainError(grids[0])
            filling = filled_in_some_way(spec, hole, None, continuity=kind)
        except DomainError as error:
            words = str(error).removeprefix("hole: ").replace("`hole`", "`fills`")
            raise DomainError(f"`fills` {hole}: {words}") from None
        if filling.fault:
            without = f'`fills` "{hole}=g0"'
            fault = filling.fault.replace('`continuity="g0"`', without)
            other = f", or {without}" * (kind != "g0" and without not in fault)
            raise RequirementError(f"`fills` {hole}: {'; '.join(filter(None, (end, fault + other)))}")
        doubts = "; ".join([*filling.doubts, "`fill` says all"]) if filling.doubts else ""
        tried = filling.remarks[0] if filling.tried else ""
        for tell, words in ((warn, end), (warn, tried), (warn, doubts), (note, _rise(filling))):
            tell(f"`fills` {hole}: {words}") if words else None
        spec = filling.model or spec
    return spec


def _rise(filling: Filling) -> str:
    """Say how far patches rise above the sides of their hole, or sink below, if by a tenth of the size of the hole."""
    edges = np.concatenate([points_and_tangents(side.curve, stations())[0] for side in filling.sides])
    grids = [(patch, central_triangulation(patch.domain, 24).parameters) for patch in filling.patches]
    heights = np.concatenate([patch.evaluate(grid, "linear")[:, 2] for patch, grid in grids])
    high, low, (bottom, top) = heights.max(), heights.min(), bounds_of(edges)[:, 2]
    ways = ("rises", high, high - top), ("sinks", low, bottom - low)
    found = [f"{word} to z = {z:.4g}, by {beyond:.3g} beyond the edges of its hole" for word, z, beyond in ways
             if beyond > np.ptp(edges, axis=0).max() / 10]  # fmt: skip
    return f"the fill {' and '.join(found)}" if found else ""


def _loose_end(model: Model, refs: Sequence[EdgeRef]) -> str:
    """Say which of several patches has all edges but one in the ring of a hole, as where copies do not close."""
    for k, edges in Counter(patch for patch, _ in refs).items():
        if 3 <= edges >= len(model.patches[k].domain.vertices) - 1 and len(model.patches) > 1:
            name = patch_name(model.patches[k], k)
            return f"the hole has {edges} edges of {name}: a copy may be missing, or not turned as far as it has to be"
    return ""


def holes_of(found: Sequence[HoleSide] | Model | Part) -> Sequence[Ring]:
    """Return the holes of a model or a part."""
    if isinstance(found, Part):
        return found.rings
    if isinstance(found, Model):
        return model_rings(found)
    raise DomainError("holes: a loop of curves is itself the hole")


def _in_parts(sides: Sequence[HoleSide], name: str | None, taken: Sequence[str | None], **options: Any) -> Filling:
    """Fill a hole with one patch, or cut it if that has a fault; a loop beside no patches may be cut inside a side."""
    ordered, remarks = closed(met_with(options.get("continuity", CONTINUITIES[0]), sides))

    def fill_part(part: Sequence[HoleSide]) -> Filling:
        kinds = {side.name: "g1" if side.bend is None else "g2" for side in part}
        return fill_loop(part, name, **{**options, "continuity": kinds})

    concave = any(corner.concave for corner in corners(ordered))
    found = fill_parts(ordered, fill_part, cut_sides=not taken) if concave else None
    if found is None:
        return fill_loop(sides, name, **options)
    if not found.parts:
        return replace(found, remarks=(*remarks, *found.remarks))
    names = islice(_free(f"{name or 'hole'}-0", taken), len(found.parts))
    patches = [part.patch.replace(name=unique) for part, unique in zip(found.parts, names, strict=True)]
    parts = tuple(replace(part, patch=patch) for part, patch in zip(found.parts, patches, strict=True))
    return replace(found, patch=patches[0], parts=parts, model=Model(patches, name), remarks=(*remarks, *found.remarks))


def _free(name: str, taken: Sequence[str | None]) -> Iterator[str]:
    """Name patches as none of a model's is: the name, or with numbers from 1 after it."""
    stem = name.removesuffix("-0")
    return (each for each in chain([name], (f"{stem}-{k}" for k in count(1))) if each not in taken)


def _beside(neighbours: Sequence[Patch], filling: Filling) -> Filling:
    """Measure the differences of curvature across the edges that a filling shares with neighbours, and its cuts."""
    model = Model((*neighbours, *filling.patches))
    seams = {ref: seam for seam in model.seams for ref in (seam.first, seam.second)}
    parts = enumerate(filling.parts or (filling,), len(neighbours))
    edges = [seams.get((p, k)) for p, part in parts for k in range(len(part.sides))]
    contacts = tuple(
        contact if seam is None else replace(contact, bend=seam.bend, bend_place=seam.bend_place)
        for contact, seam in zip(filling.contacts, edges, strict=True)
    )
    return replace(filling, contacts=contacts)


def _sides(
    loop: Model, ribbons: Sequence[ArrayLike | None] | None, ribbons2: Sequence[ArrayLike | None] | None
) -> list[HoleSide]:
    found: list[list[FloatArray]] = [[] for _ in loop]
    for number, (key, given) in enumerate((("ribbons", ribbons), ("ribbons2", ribbons2))):
        given = [None] * len(loop) if given is None else given
        if len(given) != len(loop):
            raise DomainError(f"{key}: expected {len(loop)}, one for each curve or None, got {len(given)}")
        for index, (curve, row, rows) in enumerate(zip(loop, given, found, strict=True)):
            if row is None:
                continue
            points = finite(f"{key}[{index}]", row)
            if points.shape != curve.control_points.shape:
                raise DomainError(f"{key}[{index}]: expected shape {curve.control_points.shape}, got {points.shape}")
            if len(rows) < number:
                raise DomainError(f"{key}[{index}]: is the row after a ribbon, and there is none")
            rows.append(points)
    return curve_sides(loop, found)
