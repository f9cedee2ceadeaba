"""The methods `plot` and `_repr_html_` of patches, models and meshes: floors far above these classes draw them."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from matplotlib.axes import Axes

_registered: dict[str, Callable[[str], Any]] = {}


def register(function_of: Callable[[str], Any]) -> None:
    """Let this function return what has a public name, when it is first needed."""
    _registered["function_of"] = function_of


def registered(name: str) -> Any:
    """Return what has a public name, of any floor."""
    return _registered["function_of"](name)


def plot(thing: Any, ax: Axes | None = None, what: str | None = None, **options: Any) -> Axes:
    """Draw it on matplotlib axes, and return these; see `gtb_cli.plot`."""
    return registered("plot")(thing, ax, what, **options)  # type: ignore[no-any-return]


def frame(thing: Any) -> str:
    """Return HTML of a frame for notebooks in which it can be turned."""
    return registered("frame")(thing)  # type: ignore[no-any-return]
