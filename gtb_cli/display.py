"""The methods `plot` and `_repr_html_` of patches, models and meshes; the package says which functions draw."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# The functions that draw for `plot` and for `frame`, each asked for when it is first needed; the package fills this in
draws: dict[str, Callable[[], Callable[..., Any]]] = {}


def plot(thing: Any, ax: Axes | None = None, what: str | None = None, **options: Any) -> Axes:
    """Draw a patch, a model or a mesh on matplotlib axes, and return these; see `gtb_cli.plot`."""
    return draws["plot"]()(thing, ax, what, **options)  # type: ignore[no-any-return]


def frame(thing: Any) -> str:
    """Return HTML of a frame for notebooks in which it can be turned."""
    return draws["frame"]()(thing)  # type: ignore[no-any-return]
