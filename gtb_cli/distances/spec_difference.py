"""Two patches, models or curves compared themselves: surfaces, sides, names, open edges, and what is there twice."""

from collections.abc import Collection, Sequence
from typing import TypeAlias

import numpy as np

from gtb_cli.distances.areas_and_volumes import coverage
from gtb_cli.distances.between_shapes import shape_distance
from gtb_cli.distances.operands import Spec
from gtb_cli.distances.patch_equality import Pair, partners
from gtb_cli.meshes.correspondence import nearest_cells
from gtb_cli.meshes.difference import Difference, allowed_for, are
from gtb_cli.meshes.frame import Frame
from gtb_cli.meshes.hausdorff import Distance, Farthest
from gtb_cli.meshes.mesh import Mesh, rounding
from gtb_cli.models.model import Model
from gtb_cli.models.openings import parts_of
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.theory.edges import edge_curve
from gtb_cli.theory.patch import Patch
from gtb_cli.vocabulary import Aspect

Paired: TypeAlias = tuple[Sequence[Pair], Sequence[list[int]]]  # patches of two specs, as `partners` returns them


def spec_difference(a: Spec, b: Spec, tolerance: float | str | None, aspects: Collection[Aspect]) -> Difference:
    """Compare two specs as the points that they describe, whatever their parameters; see `diff`.

    Patches that are another one in other words are proved to be by `partners`; if there are others, `shape_distance`
    searches for the farthest points. `aspects` are ignored.
    """
    models = [Model(spec.patches, weld=getattr(spec, "weld", None)) for spec in (a, b)]
    once, meshes = _once(models)
    bounds = [mesh.bounds for mesh in meshes]
    resolution = float(np.linalg.norm(np.sum([rounding(np.abs(each).max(axis=0)) for each in bounds], axis=0)))
    diagonal = min(float(np.linalg.norm(np.ptp(each, axis=0))) for each in bounds)
    asked, allowed = allowed_for(tolerance, diagonal, resolution)
    pairs, lone, copies = partners(a.patches, b.patches, allowed)
    paired = pairs, lone
    if any(copies):  # they would be joined to what they repeat
        for k, (each, of) in enumerate(zip((a.patches, b.patches), copies, strict=True)):
            exact = [each[of.get(row, row)].replace(name=patch.name) for row, patch in enumerate(each)]
            models[k] = models[k].replace(patches=exact)
        once, meshes = _once(models)
    most, place = max(((pair.distance, pair.first) for pair in pairs), default=(0.0, 0))
    at = Farthest(most, tuple(a.patches[place].evaluate(a.patches[place].domain.vertices)[0].tolist()))
    found = Distance(at, at, most, is_proved=True)
    if any(lone) or most > min(allowed, allowed_for(None, diagonal, resolution)[1]):
        found = shape_distance(a, b)
    dimensions = {each.dimension for each in once}
    is_same = found.distance <= allowed and len(dimensions) == 1
    turned, values, left_out = _sides_and_names(models, once, meshes, paired, allowed) if is_same else (0, (), ())
    spans = [mesh.vertices[mesh.cells[i:k]].reshape(-1, 3) for mesh in meshes for _, i, k in mesh.groups]
    least = min(float(np.linalg.norm(np.ptp(points, axis=0))) for points in spans)
    share = 1e-3 if tolerance is None else 1.0 if isinstance(tolerance, str) else np.inf
    wide = f"tolerance {allowed:.3g}, as all patches together are {diagonal:.3g} long, and one only {least:.3g}"
    repeated, doubts = _repeated(a, b, paired, Frame.around(*bounds), allowed) if is_same else ((), ())
    return Difference(
        method="patches",
        distance=found.distance,
        bound=found.bound,
        tolerance=allowed,
        asked=asked,
        resolution=resolution,
        diagonal=diagonal,
        forward=found.forward,
        backward=found.backward,
        same_kind=len(dimensions) == 1,
        is_curve=dimensions == {1},
        turned=turned,
        remarks=(*repeated, *_open_edges(once if repeated else models, allowed)) if is_same else (),
        ignored=tuple(sorted(aspects)),
        values=() if "attributes" in aspects else values,
        uncompared=left_out + doubts + (wide,) * (is_same and 0 < share * least < allowed),
        is_searched=not found.is_proved,
    )


def _sides_and_names(
    models: Sequence[Model], once: Sequence[Model], meshes: Sequence[Mesh], paired: Paired, allowed: float
) -> tuple[int, tuple[str, ...], tuple[str, ...]]:
    """Compare two specs of one surface: how many patches are turned over, remarks on names, and what is left out."""
    (a, b), (found, lone) = models, paired
    numbers = [{patch: k for k, patch in enumerate(model.patches)} for model in once]
    rows = [[of[patch.replace(name=None)] for patch in each.patches] for of, each in zip(numbers, models, strict=True)]
    here, there = (mesh.origin.turned[row] for mesh, row in zip(meshes, rows, strict=True) if mesh.origin is not None)
    pairs, left_out = [(p, q, here[p] ^ there[q] ^ mirrored) for p, q, _, mirrored in found], tuple[str, ...]()
    is_cut = False
    if any(lone):  # most of their faces tell
        one, other = (0, 1) if len(lone[0]) >= len(lone[1]) else (1, 0)
        nearest, away = nearest_cells(meshes[one], meshes[other], allowed)
        back, others_away = nearest_cells(meshes[other], meshes[one], allowed)
        groups = [slice(*meshes[one].groups[row][1:]) for row in rows[one]]
        over = [(away & others_away[nearest])[group].mean() > 0.5 for group in groups]
        ends = [stop for _, _, stop in meshes[other].groups]
        at = np.searchsorted(ends, nearest, "right")
        counts = [np.bincount(at[groups[k]], minlength=len(ends)) for k in lone[one]]
        home = [rows[other].index(int(each.argmax())) for each in counts]
        homes = zip(*((lone[0], home) if one == 0 else (home, lone[1])), strict=True)
        pairs = [(p, q, turned and over[(p, q)[one]]) for p, q, turned in (*pairs, *((*both, True) for both in homes))]
        is_cut = sorted(home) != lone[other] or any(each.max() < 0.9 * each.sum() for each in counts)
        are_unsure = (away > others_away[nearest]).any() or (others_away > away[back]).any()
        left_out += ("names of patches are not compared where they are cut otherwise",) * is_cut
        left_out += ("sides of patches are not compared where others lie on them",) * bool(are_unsure)
    ours, theirs = (_one_sided(each, row) for each, row in zip(once, rows, strict=True))
    turned = sum(over for p, q, over in pairs if not (ours[p] and theirs[q]))
    named = sorted(pairs[: len(found)] if is_cut else pairs)
    refs = [((first, a.patches[first].name), (second, b.patches[second].name)) for first, second, _ in named]
    names = [[name or f"patch{k}" for k, name in pair] for pair in refs if any(name for _, name in pair)]  # as meshes
    others = [pair for pair in names if pair[0] != pair[1] and max(map(len, (a.patches, b.patches))) > 1]
    old, new = (" ".join(pair[way] for pair in others) for way in (0, 1))
    left_out += ("sides of patches are not compared where a surface has only one",) * (any(ours) and any(theirs))
    return int(turned), (f"groups: {old} against {new}",) * bool(others), left_out


def _repeated(
    a: Spec, b: Spec, paired: Paired, frame: Frame, allowed: float
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Remark on parts of one surface, or curve, that are there more often in one of two specs; and on what is left out.

    Patches in no pair are counted if they are others in other words; else areas tell, and where they lie.
    """
    pairs, lone = paired
    sides = [(spec.patches, {pair[way] for pair in pairs}) for way, spec in enumerate((a, b))]
    rest = [[patch for k, patch in enumerate(patches) if k not in paired] for patches, paired in sides]
    numbers = [*zip(map(len, rest), ("first", "second"), strict=True)]
    if not any(lone):
        return tuple(f"{are(n, 'patch', 'patches')} there more often in the {name}" for n, name in numbers if n), ()
    patches = [*rest[0], *rest[1]]
    values, errors = coverage(patches, frame)
    one, other = values[: len(rest[0])].sum(axis=0), values[len(rest[0]) :].sum(axis=0)
    nets = [frame.inside(patch.control_points).clip(-1, 1) for patch in patches]
    sizes = [np.linalg.norm(np.ptp(net, axis=0)) if a.dimension == 2 else 1.0 for net in nets]
    strips = 8 * float(frame.length(allowed, -1)) * sum(sizes)  # edges, four of this length, may move by the tolerance
    # Errors are estimates, too small by up to 1e-4 of all with weights from 1e-4 to 1e4
    limits = errors.sum(axis=0) + 1e-3 * (one + other) + strips * np.array([1, np.e])
    what = "area" if a.dimension == 2 else "length"
    if (np.abs(one - other) <= limits).all():
        doubt = "where patches are cut otherwise, a small one that is there twice may go unseen"
        return (), (doubt,) * bool(limits[0] >= values[:, 0].min())
    if not all(rest):
        n, name = max(numbers)
        return (f"{n} {'patch lies' if n == 1 else 'patches lie'} on others in the {name}",), ()
    amounts = [f"{float(frame.length(each[0], a.dimension)):.9g}" for each in (one, other)]
    if amounts[0] == amounts[1]:
        return (f"in the same place, but other patches, with the same {what}, are there more often",), ()
    return (f"in the same place, but patches that are cut otherwise have {' against '.join(amounts)} in {what}",), ()


def _one_sided(model: Model, rows: Sequence[int]) -> list[bool]:
    """Tell for each of some patches whether it is part of a surface with one side."""
    part = parts_of(model.joints, len(model.patches))
    return list(np.isin(part, part[[joint.first[0] for joint in model.joints.one_sided]])[rows].tolist())


def _once(models: Sequence[Model]) -> tuple[list[Model], list[Mesh]]:
    """Return the patches without names, and without those that are there again; and meshes of them."""
    once = [each.replace(patches=dict.fromkeys(patch.replace(name=None) for patch in each.patches)) for each in models]
    return once, [Recipe(8).mesh(each)[0] for each in once]


def _open_edges(models: Sequence[Model], allowed: float) -> tuple[str, ...]:
    """Remark on open edges of patches, or ends of curves, in other places, and not on edges cut otherwise."""
    one, other = (
        [Patch([0, 1], edge_curve(m[k], e).ends) if m.dimension == 1 else m[k].boundary(e) for k, e in m.joints.open]
        for m in models
    )
    both = bool(one and other)
    are_other = shape_distance(Model(one), Model(other)).distance > allowed if both else bool(one or other)
    what = "edges of patches, which no other whole edge meets," if models[0].dimension == 2 else "ends of curves"
    return (f"{len(one)} open {what} against {len(other)}" + ", in other places" * both,) * are_other
