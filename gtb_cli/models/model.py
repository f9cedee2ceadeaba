"""`Model`: several patches that belong together, and how their edges are joined."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from gtb_cli.display import notebook_html, plot
from gtb_cli.errors import DomainError
from gtb_cli.models.joints import Joints, unjoined
from gtb_cli.theory.patch import Patch
from gtb_cli.values import by_value
from gtb_cli.vocabulary import percentage

if TYPE_CHECKING:
    from gtb_cli.models.smoothness import Seam

Shape = TypeVar("Shape", Patch, "Model", "Patch | Model")


@by_value
class Model:
    """Several patches that belong together, such as a closed body or a regular control surface.

    A value, like `Patch`; ``len``, ``model[0]`` and iteration refer to its patches.

    Parameters
    ----------
    patches : sequence of Patch
        All curves or all surfaces.
    name : str, optional
    weld : float, optional
        Edges within this distance of each other, in model units, are joined; None joins only edges with the same curve.

    Raises
    ------
    DomainError
        There are no patches, one of them is not a patch, or curves and surfaces are mixed.
    """

    patches: tuple[Patch, ...]
    name: str | None = None
    weld: float | None = None

    if TYPE_CHECKING:

        def __init__(self, patches: Iterable[Patch], name: str | None = None, weld: float | None = None) -> None: ...

    def __post_init__(self) -> None:
        if isinstance(self.patches, Patch):
            raise DomainError("patches: expected several patches, got one: [patch]")
        object.__setattr__(self, "patches", tuple(self.patches))
        for index, patch in enumerate(self.patches):
            if not isinstance(patch, Patch):
                raise DomainError(f"patches[{index}]: expected a Patch, got {type(patch).__name__}")
        if not self.patches:
            raise DomainError("patches: a model needs at least one")
        if len({patch.dimension for patch in self.patches}) > 1:
            raise DomainError("patches: curves and surfaces cannot be mixed in one model: they make a mesh each")

    def __len__(self) -> int:
        return len(self.patches)

    def __getitem__(self, index: int) -> Patch:
        return self.patches[index]

    def __repr__(self) -> str:
        kind = "curves" if self.dimension == 1 else "surfaces"
        return f"<Model {self.name or 'without a name'}: {len(self)} {kind}>"

    def replace(self, **changes: Any) -> Model:
        """Return a copy with other values in some fields."""
        return dataclasses.replace(self, **changes)

    def __iter__(self) -> Iterator[Patch]:
        return iter(self.patches)

    @property
    def dimension(self) -> int:
        """1 for curves, 2 for surfaces."""
        return self.patches[0].dimension

    @cached_property
    def joints(self) -> Joints:
        """Which edges of the patches carry the same curve, and which are open."""
        from gtb_cli.models.same_edges import find_joints  # not needed to read a model

        return find_joints(self.patches, self.weld)

    @cached_property
    def seams(self) -> tuple[Seam, ...]:
        """The seams, which tell how smoothly patches meet, one for each of `joints.shared`; none between curves."""
        from gtb_cli.models.smoothness import seams_of

        return seams_of(self.patches, self.joints) if self.dimension == 2 else ()

    plot = plot
    _repr_html_ = notebook_html


def joints_of(shape: Patch | Model) -> Joints:
    """Return the joints of a model; a patch by itself is joined with nothing."""
    return shape.joints if isinstance(shape, Model) else unjoined(shape)


def with_weld(shape: Shape, weld: float | str | None) -> Shape:
    """Return a model with another weld, in model units or as a percentage of its size; else the shape as it is."""
    if weld is None or not isinstance(shape, Model):
        return shape
    return shape.replace(weld=percentage(weld) / 100 * diagonal_of(shape.patches) if isinstance(weld, str) else weld)


def diagonal_of(patches: Sequence[Patch]) -> float:
    """Diagonal of the bounding box of all control points, in model units."""
    return float(np.linalg.norm(np.ptp(np.concatenate([patch.control_points for patch in patches]), axis=0)))
