"""The methods `plot` and `_repr_html_` of patches, models and meshes: functions of the package, above all floors."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot(thing: Any, ax: Axes | None = None, what: str | None = None, **options: Any) -> Axes:
    """Draw a patch, a model or a mesh on matplotlib axes, and return these; see `gtb_cli.plot`."""
    return sys.modules[__package__].plot(thing, ax, what, **options)  # type: ignore[no-any-return]


def notebook_html(thing: Any) -> str:
    """Return HTML for notebooks, a frame in which it can be turned."""
    return sys.modules[__package__].notebook_html(thing)  # type: ignore[no-any-return]
