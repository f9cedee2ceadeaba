"""Pages: one HTML file that shows a surface in a browser, without a network."""

import base64
import html
import json
import math
import re
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import bounds_of, point_text
from gtb_cli.errors import DomainError
from gtb_cli.language.spec_paths import SpecPath, loaded
from gtb_cli.meshes.measures import Measures, in_unit, measure
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.models.model import Model
from gtb_cli.pages.page_scene import Content, content_of, content_of_mesh
from gtb_cli.plots.palette import scale_of
from gtb_cli.solids.solidity import CROSSES
from gtb_cli.solids.wall_depth import MAX_WALL_FACES
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.theory.patch import Patch

COMMON = "common.js"  # the script that pages of all packages share


def page(thing: Patch | Model | Mesh | SpecPath, recipe: Recipe | None = None) -> str:
    """Return HTML of a page that shows a patch, a model or a mesh in a browser, without a network: see `gtb view`.

    With a recipe, it shows the mesh that this makes of a patch or model, such as a solid.
    """
    found: Patch | Model | Mesh = loaded(thing, Patch, Model, Mesh)
    return page_of(content_of_mesh(found, found.name) if isinstance(found, Mesh) else content_of(found, recipe))


def page_of(content: Content) -> str:
    """Return the HTML of a page that shows something, with script and data: always the same for the same content."""
    return page_with(page_data(content), content.name)


def page_with(data: dict[str, Any], title: str, package: str = "gtb_cli.pages") -> str:
    """Return the text of a page with this data, by the template and the scripts of a package."""
    folder = files(package)
    page = folder.joinpath("page.html").read_text(encoding="utf-8")
    left_out = {COMMON} if "watch" in data else {COMMON, "watch.js"}
    own = sorted(each.name for each in folder.iterdir() if each.name.endswith(".js") and each.name not in left_out)
    scripts = [files("gtb_cli.pages").joinpath(COMMON), *map(folder.joinpath, own)]
    script = "\n".join(each.read_text(encoding="utf-8") for each in scripts)
    # No text of a spec can end the script element that holds it.
    text = json.dumps(data, ensure_ascii=True, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    values = {"@TITLE@": html.escape(title), "@SCRIPT@": script, "@DATA@": text}
    return re.sub("|".join(values), lambda place: values[place[0]], page)  # at once: a title may look like a place


def page_data(content: Content) -> dict[str, Any]:
    """Return the data for the script of a page: coordinates within 1/2, far nets aside, in 32-bit floats, as base 64.

    Raises a `DomainError` if there is nothing to show, or it is too large.
    """
    vertices = [keyframe.vertices for keyframe in content.keyframes]
    points = [keyframe.net_points for keyframe in content.keyframes]
    start, end = corners = bounds_of(np.concatenate(vertices))
    low, high = bounds_of(np.concatenate([*vertices, *points]))
    if 0 < 3 * np.hypot.reduce(end / 3 - start / 3) < np.hypot.reduce(high / 3 - low / 3):
        low, high = start, end  # a control point of small weight may be very far, and is no reason to look from there
    size = float(np.linalg.norm((high - low).astype(np.longdouble))) or 1.0
    if not math.isfinite(size):
        raise DomainError("is too large to be shown")
    middle = low + (high - low) / 2

    def placed(points: Any) -> str:
        return encoded((points - middle) / size, "<f4")

    frames = []
    for label, keyframe in zip(content.labels, content.keyframes, strict=True):
        frame = {"label": label, "positions": placed(keyframe.vertices)}
        frame |= {"normals": encoded(keyframe.normals, "<f4")} if len(keyframe.normals) else {}
        frames.append(frame | ({"net": placed(keyframe.net_points)} if len(keyframe.net_points) else {}))
    scalars = {}
    for name, values in content.scalars.items():
        if values is None:
            continue
        # Walls from nothing to what prints well: three times the thickness, or twice the median where none was given.
        thick = 2 * float(np.median(values)) if content.thickness is None else 3 * content.thickness
        ends = (0.0, thick) if name == "wall" else scale_of(values, "PuOr")
        with np.errstate(over="ignore"):
            shown = values if name == "wall" else values.clip(*ends)
            scalars[name] = {"values": encoded(shown, "<f4"), "low": ends[0], "high": ends[1]}
    measures = measure(Mesh(vertices[0], content.cells)) if len(vertices) == 1 else None
    open_sides = f", {count} open sides" if (count := len(content.lines["open"])) else ""
    cells = "segments" if content.is_curve else f"triangles{open_sides}"
    is_wide = len(vertices[0]) >= 1 << 16
    return {
        "name": content.name,
        "facts": f"{len(content.cells)} {cells}",
        "curve": content.is_curve,
        "plane": bool(content.is_curve and low[2] == high[2]),
        "box": {
            "low": ((start - middle) / size).tolist(),
            "high": ((end - middle) / size).tolist(),
            "texts": [*zip(*(point_text(x, corners)[1:-1].split(", ") for x in corners), strict=True)],
        },
        "size": size,
        "middle": middle.tolist(),
        "unit": content.unit or "",
        "absent": _absent(content, measures),
        "measures": _measures(measures, content.unit, any(remark.startswith(CROSSES) for remark in content.remarks)),
        "closed": measures is not None and measures.volume is not None,
        "remarks": content.remarks,
        "frames": frames,
        "cells": encoded(content.cells, "<u4" if is_wide else "<u2"),
        "wide": is_wide,
        "groups": [list(group) for group in content.groups],
        "lines": {name: encoded(pairs, "<u4") for name, pairs in content.lines.items()},
        "netNames": list(content.net_names),
        "knots": {"points": placed(content.knots), "names": list(content.knot_names)},
        "edges": {"points": placed(content.edges), "names": list(content.edge_names)},
        "scalars": scalars,
    }


def _absent(content: Content, measures: Measures | None) -> dict[str, str]:
    """Say why modes that other pages have are absent from this one."""
    found = {} if "mean" in content.scalars else dict.fromkeys(("mean", "gaussian"), "of a spec's surface alone")
    if measures is None or measures.volume is None:
        return found | dict.fromkeys(("wall", "overhangs"), "of a closed mesh, and this is none")
    if content.scalars.get("wall") is None:
        found["wall"] = f"of up to {MAX_WALL_FACES // 1000} 000 triangles, if few long ones lie across each other"
    return found


def _measures(measures: Measures | None, unit: str | None, crosses: bool) -> list[tuple[str, str]]:
    """Return names and texts of what a mesh measures; the volume is marked if it crosses itself."""
    if measures is None:
        return []
    low, high = measures.bounds
    found = [("size", " × ".join(f"{b - a:.5g}" for a, b in zip(low, high, strict=True)) + in_unit(0.0, 1, unit)[1])]
    named = {"length": measures.length, "surface": measures.area, "volume": measures.volume}
    for power, (name, value) in enumerate(named.items(), 1):
        if value is not None and math.isfinite(value):
            amount, sign = in_unit(value, power, unit)
            found.append((name, f"{amount:.6g}{sign}" + " counted with crossings" * (crosses and name == "volume")))
    if measures.volume is not None and measures.volume < 0:
        found.append(("", "Its faces look inwards."))
    return found


def encoded(values: ArrayLike, kind: str) -> str:
    """Return numbers of this kind as base 64, in the order of rows."""
    return base64.b64encode(np.ascontiguousarray(values).astype(kind).tobytes()).decode("ascii")
