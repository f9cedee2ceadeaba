"""`Model`: several patches that belong together, and how their edges are joined."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from gtb_cli.errors import DomainError
from gtb_cli.theory.patch import Patch

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from gtb_cli.theory.joints import Joints


@dataclass(frozen=True, eq=False)
class Model:
    """Several patches that belong together, such as a closed body or a regular control surface.

    Parameters
    ----------
    patches : tuple of Patch
    name : str, optional
    """

    patches: tuple[Patch, ...]
    name: str | None = None

    def __post_init__(self) -> None:
        if not self.patches:
            raise DomainError("patches: a model needs at least one")
        if len({patch.dimension for patch in self.patches}) > 1:
            raise DomainError("patches: curves and surfaces cannot be mixed in one model")

    def __len__(self) -> int:
        return len(self.patches)

    def __iter__(self) -> Iterator[Patch]:
        return iter(self.patches)

    @property
    def dimension(self) -> int:
        """1 for curves, 2 for surfaces."""
        return self.patches[0].dimension

    @cached_property
    def joints(self) -> Joints:
        """How the edges of the patches are joined."""
        from gtb_cli.theory.joints import find_joints  # its rules of likeness are not needed to read a model

        return find_joints(self.patches)

    def plot(self, ax: Axes | None = None, what: str | None = None, **options: Any) -> Axes:
        """Draw the model on axes of matplotlib, and return them; see `gtb_cli.plot`."""
        import gtb_cli

        return gtb_cli.plot(self, ax, what, **options)

    def _repr_html_(self) -> str:
        """A frame for notebooks, in which the model can be turned."""
        import gtb_cli

        return gtb_cli.frame(self)
