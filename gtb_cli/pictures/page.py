"""Pages: one HTML file that shows a surface in a browser, without a network."""

from __future__ import annotations

import base64
import html
import json
import math
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import bounds_of
from gtb_cli.errors import DomainError
from gtb_cli.pictures.colours import scale_of
from gtb_cli.pictures.sight import Sight

FRAME = '<iframe srcdoc="{page}" style="width:100%;height:420px;border:1px solid #8884;border-radius:6px"></iframe>'
"""Frame of a page within another page."""

BOX_DIGITS = 4
"""Digits, relative to a box's size, to which its corners are given."""


def page_of(sight: Sight, **more: Any) -> str:
    """Return the text of a page that shows something.

    Parameters
    ----------
    sight : Sight
    **more
        Further entries of the page's data: ``watch``, the number of this state, makes it ask for newer ones, and
        ``error`` is a text that it shows.

    Returns
    -------
    str
        HTML that contains script and data, always the same for the same sight.
    """
    return page_with({**page_data(sight), **more}, sight.name)


def page_with(data: dict[str, Any], title: str) -> str:
    """Return the text of a page with this data."""
    folder = files("gtb_cli.pictures")
    page = folder.joinpath("page.html").read_text(encoding="utf-8")
    script = folder.joinpath("page.js").read_text(encoding="utf-8")
    # No text of a spec can end the script element that holds it.
    text = json.dumps(data, ensure_ascii=True, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    for place, value in (("@TITLE@", html.escape(title)), ("@SCRIPT@", script), ("@DATA@", text)):
        before, _, after = page.partition(place)
        page = before + value + after
    return page


def frame_of(sight: Sight) -> str:
    """Return HTML of a frame that shows something within another page, such as a notebook."""
    return FRAME.format(page=html.escape(page_of(sight), quote=True))


def page_data(sight: Sight) -> dict[str, Any]:
    """Return the data for the script of a page: coordinates between -1/2 and 1/2, in single precision, as base 64.

    Raises
    ------
    DomainError
        There is nothing to show, or it is too large.
    """
    clouds = [cloud for moment in sight.moments for cloud in (moment.vertices, moment.net_points) if len(cloud)]
    low, high = bounds_of(np.concatenate(clouds))
    size = float(np.linalg.norm((high - low).astype(np.longdouble)))
    if not math.isfinite(size):
        raise DomainError("is too large to be shown")
    size = size or 1.0
    middle = low + (high - low) / 2

    def placed(points: Any) -> str:
        return _text(((points - middle) / size).astype("<f4"))

    frames = []
    for moment in sight.moments:
        frame = {"label": moment.label, "positions": placed(moment.vertices)}
        if len(moment.normals):
            frame["normals"] = _text(moment.normals.astype("<f4"))
        if len(moment.net_points):
            frame["net"] = placed(moment.net_points)
        frames.append(frame)
    scalars = {}
    for name, values in sight.scalars.items():
        ends = scale_of(values, "PuOr")
        with np.errstate(over="ignore"):
            scalars[name] = {"values": _text(values.clip(*ends).astype("<f4")), "low": ends[0], "high": ends[1]}
    start, end = bounds_of(np.concatenate([moment.vertices for moment in sight.moments]))
    lines = {name: _text(getattr(sight, name).astype("<u4")) for name in ("border", "open", "folds", "net")}
    return {
        "name": sight.name,
        "facts": _facts(sight),
        "curve": sight.is_curve,
        "plane": bool(sight.is_curve and low[2] == high[2]),
        "box": {
            "low": ((start - middle) / size).tolist(),
            "high": ((end - middle) / size).tolist(),
            "texts": _corner_texts(start.tolist(), end.tolist(), size),
        },
        "frames": frames,
        "cells": _text(sight.cells.astype("<u4")),
        "groups": [list(group) for group in sight.groups],
        "lines": lines,
        "netNames": list(sight.net_names),
        "knots": {"points": placed(sight.knots), "names": list(sight.knot_names)},
        "scalars": scalars,
    }


def _facts(sight: Sight) -> str:
    count = len(sight.moments[0].vertices)
    if sight.is_curve:
        return f"{count} vertices, {len(sight.cells)} segments"
    normals = "exact at vertices" if sight.exact else "means of the triangles'"
    open_sides = f", {len(sight.open)} open sides" if len(sight.open) else ""
    return f"{count} vertices, {len(sight.cells)} triangles{open_sides}; normals {normals}"


def _corner_texts(low: list[float], high: list[float], size: float) -> list[str]:
    """Return the texts at the ends of the three axes, and at the corner where they start."""
    step = 10.0 ** (math.floor(math.log10(size)) - BOX_DIGITS + 1)

    def text(value: float) -> str:
        return f"{round(value / step) * step:.12g}" if abs(value) < step * 2**52 else f"{value:.6g}"

    ends = [f"{name} {text(b)}" if b > a else "" for name, a, b in zip("xyz", low, high, strict=True)]
    return [*ends, f"({', '.join(map(text, low))})"]


def _text(values: NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")
