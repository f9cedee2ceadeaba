"""`Joints` of a model: which edges of its patches carry the same curve, and which are open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import TYPE_CHECKING

from gtb_cli.arrays import FloatArray
from gtb_cli.theory.edges import Curve, EdgeRef, edge_curve
from gtb_cli.theory.patch import Patch
from gtb_cli.values import by_value

if TYPE_CHECKING:
    from gtb_cli.models.curve_matches import Match


@by_value
class Joint:
    """Two edges of patches that carry the same curve.

    Attributes
    ----------
    first, second : (int, int)
        The patch, and the edge of this patch.
    opposite : bool
        Whether the edges run along the curve in opposite directions, as where both patches turn the same side outwards.
    distance : float
        Largest measured distance between welded curves, in model units; 0 for equal curves.
    """

    first: EdgeRef
    second: EdgeRef
    opposite: bool
    distance: float = 0.0
    # Corresponding fractions of the first edge and, in its direction, of the second one; None if they are equal
    match: Match | None = field(default=None, repr=False)

    def across(self, patches: Sequence[Patch], fractions: FloatArray) -> FloatArray:
        """Return the (m,) fractions of the second edge at the points of (m,) fractions of the first one."""
        found = fractions if self.match is None else self.match.carried(*self._curves(patches), fractions)
        return 1 - found if self.opposite else found

    def back(self, patches: Sequence[Patch], fractions: FloatArray) -> FloatArray:
        """Return the (m,) fractions of the first edge at the points of (m,) fractions of the second one."""
        found = 1 - fractions if self.opposite else fractions
        return found if self.match is None else self.match.carried(*self._curves(patches), found, back=True)

    def _curves(self, patches: Sequence[Patch]) -> tuple[Curve, Curve]:
        one, other = (edge_curve(patches[p], edge) for p, edge in (self.first, self.second))
        return one, other.reversed() if self.opposite else other


@by_value
class Joints:
    """The edges of a model's patches: which of them are one curve, and which are open.

    Attributes
    ----------
    shared : tuple of Joint
        Each edge that carries the curve of an earlier one, with the first edge that does.
    open : tuple of (int, int)
        The patch and edge of each edge that shares its curve with no other.
    collapsed : tuple of (int, int)
        Edges whose control points all coincide.
    crowded : tuple of tuples of (int, int)
        Edges that are one curve, if more than two are: there the model is no manifold.
    almost : tuple of ((int, int), (int, int), float)
        Two open edges nearer than a fiftieth of the smaller one's size, and their largest measured distance.
    flipped : tuple of bool
        For each patch whether its orientation must be reversed to agree with its neighbours'.
    one_sided : tuple of Joint
        Joints at which orientations disagree for every choice, as in a Möbius strip.
    """

    shared: tuple[Joint, ...]
    open: tuple[EdgeRef, ...]
    collapsed: tuple[EdgeRef, ...]
    crowded: tuple[tuple[EdgeRef, ...], ...]
    almost: tuple[tuple[EdgeRef, EdgeRef, float], ...]
    flipped: tuple[bool, ...]
    one_sided: tuple[Joint, ...]

    @property
    def closed(self) -> bool:
        """True if exactly two patches share every edge, consistently oriented: the model bounds a volume."""
        return not (self.open or self.crowded or self.one_sided)

    @property
    def joins(self) -> bool:
        """True if there is anything to join: edges that share a curve, or that are points."""
        return bool(self.shared or self.collapsed)


def unjoined(patch: Patch) -> Joints:
    """Return the joints of a patch by itself, all of whose edges are open, even two that carry the same curve."""
    return Joints((), tuple((0, edge) for edge in range(len(patch.domain.vertices))), (), (), (), (False,), ())
