"""Holes that ``--fill`` closes when a spec is read; patches are kept for a next time with the same around them."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

from gtb_cli.errors import DomainError

if TYPE_CHECKING:
    from gtb_cli.models.model import Model
    from gtb_cli.theory.patch import Patch

Tell = Callable[[str], object]
MOST = 8  # fills that are kept: those of two holes for four positions of a slider
_kept: dict[bytes, tuple[Sequence[Patch], list[tuple[int, str]]]] = {}


def with_holes_filled(spec: Patch | Model, fills: Sequence[tuple[str, str]], warn: Tell, note: Tell) -> Patch | Model:
    """Fill holes as `with_fills` does, but each only once while all that its patch depends on is the same, bit for bit.

    `gtb view --watch` reads a spec for each position of its sliders, and a fill takes a second.
    """
    from gtb_cli.filling.fill import with_fills
    from gtb_cli.models.model import Model

    own = len(spec.patches)
    for hole, kind in fills:
        if not isinstance(spec, Model) or spec.dimension != 2:
            return with_fills(spec, fills, warn, note)  # which says that there is no hole
        if (key := _surroundings(spec, hole, kind, own)) not in _kept:
            said = list[tuple[int, str]]()
            tells = [partial(lambda said, way, line: said.append((way, line)), said, way) for way in (0, 1)]
            _kept[key] = with_fills(spec, [(hole, kind)], *tells).patches[len(spec.patches) :], said
            for old in list(_kept)[:-MOST]:
                del _kept[old]
        patches, said = _kept[key]
        for way, line in said:
            (warn, note)[way](line)
        spec = spec.replace(patches=(*spec.patches, *patches))
    return spec


def _surroundings(model: Model, hole: str, kind: str, own: int) -> bytes:
    """Return what a fill depends on: its words, the patches around it, the sides that they show, and names in use."""
    from gtb_cli.filling.holes import model_rings, one_ring

    try:
        check_hole(model, hole, own)
        edges = one_ring(model_rings(model), hole, "model").edges
    except DomainError as error:
        raise DomainError(f"`fills` {hole}: {str(error).removeprefix('hole: ').replace('`hole`', '`fills`')}") from None
    refs = [model.joints.open[edge] for edge in edges]
    around = [(patch, edge, model.patches[patch], model.joints.flipped[patch]) for patch, edge in refs]
    return pickle.dumps((hole, kind, around, [patch.name for patch in model.patches], model.weld))


def check_hole(model: Model, asked: str, own: int) -> None:
    """Raise `DomainError` for a name of no open edge, and say why it is none; patches from `own` on fill holes."""
    from gtb_cli.filling.holes import model_rings, ring_texts
    from gtb_cli.language.keys_and_values import suggestion
    from gtb_cli.theory.edges import edge_name

    edges = [edge_name(model.patches, ref) for ref in model.joints.open]
    owners = {name.rpartition(" edge ")[0] for name in edges}
    if asked in edges or asked in owners or asked.count(",") == 2:  # a point
        return
    known = owners | {name for name in edges if name.rpartition(" ")[2] == asked.rpartition(" ")[2]}
    why, meant = "no open edge has this name", suggestion(asked, known)
    for joint in model.joints.shared:
        pair = [joint.first, joint.second]
        if asked in (names := [edge_name(model.patches, ref) for ref in pair]):
            other = asked == names[0]
            how = "its hole is filled already, and it is" if pair[other][0] >= own else "it is not open, but"
            why, meant = f"{how} joined with {names[other]}", ""
    holes = "; ".join(ring_texts(model_rings(model))) or "none"
    raise DomainError(f"hole: {why}; holes: {holes}{meant}")
