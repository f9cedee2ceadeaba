"""Holes that ``--fill`` closes when a spec is read; patches are kept for a next time with the same around them."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from gtb_cli.errors import DomainError

if TYPE_CHECKING:
    from gtb_cli.models.model import Model
    from gtb_cli.theory.patch import Patch

MOST = 8  # fills that are kept: those of two holes for four positions of a slider
_kept: dict[bytes, tuple[Sequence[Patch], list[str], list[str]]] = {}


def with_holes_filled(
    spec: Patch | Model, fills: Sequence[tuple[str, str]], warn: Callable[[str], object], note: Callable[[str], object]
) -> Patch | Model:
    """Fill holes as `with_fills` does, but each only once while all that its patch depends on is the same, bit for bit.

    `gtb view --watch` reads a spec for each position of its sliders, and a fill takes a second.
    """
    from gtb_cli.filling.fill import with_fills

    own = len(spec.patches)
    for fill in fills:
        before, key = spec.patches, _surroundings(spec, *fill, own)
        if key not in _kept:
            doubts, notes = list[str](), list[str]()
            _kept[key] = with_fills(spec, [fill], doubts.append, notes.append).patches[len(before) :], doubts, notes
            if len(_kept) > MOST:
                del _kept[next(iter(_kept))]
        added, doubts, notes = _kept[key]
        for line in doubts:
            warn(line)
        for line in notes:
            note(line)
        spec = spec.replace(patches=(*before, *added))
    return spec


def _surroundings(spec: Patch | Model, hole: str, kind: str, own: int) -> bytes:
    """Return what a fill depends on: its words, the patches around it, the sides that they show, and names in use."""
    from gtb_cli.filling.holes import model_rings, one_ring
    from gtb_cli.models.model import Model

    if not isinstance(spec, Model) or spec.dimension != 2:
        return b""  # it has no hole to fill, which `with_fills` says
    try:
        check_hole(spec, hole, own)
        edges = one_ring(model_rings(spec), hole, "model").edges
    except DomainError as error:
        raise DomainError(f"`fills` {hole}: {str(error).removeprefix('hole: ').replace('`hole`', '`fills`')}") from None
    refs = [spec.joints.open[edge] for edge in edges]
    around = [(patch, edge, spec.patches[patch], spec.joints.flipped[patch]) for patch, edge in refs]
    return pickle.dumps((hole, kind, around, [patch.name for patch in spec.patches], spec.weld))


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
    for pair in ([joint.first, joint.second] for joint in model.joints.shared):
        if asked in (names := [edge_name(model.patches, ref) for ref in pair]):
            other = asked == names[0]
            how = "its hole is filled already, and it is" if pair[other][0] >= own else "it is not open, but"
            why, meant = f"{how} joined with {names[other]}", ""
    holes = "; ".join(ring_texts(model_rings(model))) or "none"
    raise DomainError(f"hole: {why}; holes: {holes}{meant}")
