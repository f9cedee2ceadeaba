"""Reports on meshes and CAD parts: as plain data, as lines whose order and digits are stable, and as one line."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from gtb_cli.errors import MeshError, SpecError
from gtb_cli.shell.streams import Spec, shown_input
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.verdicts.comparing import mesh_or_spec
from gtb_cli.vocabulary import printable

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from gtb_cli.meshes.mesh import KnownMesh, Mesh


def spec_or_report(path: str, printed: Callable[[Mesh], dict[str, Any]]) -> Spec | dict[str, Any]:
    """Return the spec in a file, or a report on the mesh or the CAD part in it, as the content says.

    What `printed` says of a closed mesh is a part of its report. The report on a mesh with nothing to measure has its
    fault, and a hash, by which versions of it differ.
    """
    import hashlib

    from gtb_cli.distances.operands import decoded
    from gtb_cli.importers.cad_files import cad_kind

    data = mesh_or_spec(path)
    if (kind := cad_kind(data, path)) is not None:
        return _part_report(data, kind, shown_input(path))
    try:
        found = decoded(data, shown_input(path), Recipe())
    except MeshError as error:
        fault = str(error).removeprefix(f"{shown_input(path)}: ")
        return {"kind": "mesh", "fault": fault, "bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}
    if found.spec is not None:
        return found.spec
    return _report(found.known, printed)


def _report(known: KnownMesh, printed: Callable[[Mesh], dict[str, Any]]) -> dict[str, Any]:
    from gtb_cli.meshes.measures import measure, moments

    mesh, measures = known.mesh, measure(known.mesh)
    cells = "segments" if mesh.is_curve else "faces"
    groups = [{"name": name, cells: stop - start} for name, start, stop in mesh.groups]
    space = {"space": known.space} if known.space else {}
    sides = {} if mesh.is_curve else {"turned_edges": measures.turned_edges, "inward_parts": measures.inward_parts}
    report = {"kind": "mesh", "format": known.format, **space, **measures.record(), **sides}
    centroid, spread = moments(mesh)
    report |= {"centroid": centroid, "second_moments": spread}
    held = {name: _digest(rows[of]) for name, (rows, of) in sorted(known.values().items())}
    digests = {"digests": {"positions": _digest(mesh.vertices), cells: _digest(mesh.cells), **held}}
    closed = {"printing": printed(mesh)} if measures.volume is not None and measures.volume > 0 else {}
    folded = {"polygons_that_may_overlap_themselves": known.fans} if known.fans else {}
    return {**report, f"collapsed_{cells}": measures.collapsed, **folded, **closed, **digests, "groups": groups}


def printing_rows(found: dict[str, Any] | None) -> list[tuple[str, str]]:
    """Write what a printer asks, in the units of the model, in labelled lines; None stands for what took too many."""
    if not found:
        why = "not measured: within 0.1% there are too many faces; gtb info of a coarser mesh says it"
        return [("least wall", why)] if found is None else []
    import numpy as np

    from gtb_cli.arrays import point_text
    from gtb_cli.solids.wall_depth import MAX_WALL_FACES

    size = [f"{length:.4g}" for length in found["size"]]
    sides = " × ".join(length for axis, length in zip("xyz", size, strict=True) if axis != found["up"])
    share = f"area {found['overhang_area']:.4g}, {100 * found['overhang_share']:.3g}% of the surface"
    many = f"more than {MAX_WALL_FACES} faces, a quarter without --long, or too many long ones across each other"
    wall, usual = f"not measured: {many}", found["usual_wall"]
    if usual is not None:
        wall = f"none, as no two sides are within 45 degrees of parallel; behind 90% of the surface {usual:.4g} or more"
    if found["least_wall"] is not None:
        place = np.array(found["least_wall_place"])
        near = point_text(place, np.array([place, place + found["size"]]))
        angle = found["least_wall_angle"]
        near += "" if angle is None else f", where faces meet at {angle:.0f} degrees"
        wall = f"{found['least_wall']:.4g} near {near}; behind 90% of the surface {usual:.4g} or more"
    volume = found.get("volume")
    cubic = f", {volume / 1000:.4g} cm³ where lengths are mm" if volume and abs(volume) >= 1000 else ""
    return [
        ("size", " × ".join(size)),
        ("footprint", f"{sides}, area {found['bed_area']:.4g} on the bed"),
        ("overhangs", f"{share}, by more than 45 degrees from upright"),
        ("least wall", wall),
        *([("printed volume", f"{volume:.6g}{cubic}")] if volume else []),
        *(("remark", remark) for remark in found.get("remarks", [])),
    ]


def _part_report(data: bytes, kind: str, source: str) -> dict[str, Any]:
    """Report on a part, in millimetres; faces whose edges agree count as sewn, and the volume is that of solids.

    The hash of its bytes tells it from other versions, such as mirror images.
    """
    import hashlib

    from gtb_cli.filling.holes import ring_texts
    from gtb_cli.filling.part_holes import part_of
    from gtb_cli.importers.cad_files import box_of, extent_of, face_pieces, kernel_faults, parts, read_shape

    with kernel_faults(source):
        shape = read_shape(data, kind, source)
        part, faces, solids = part_of(shape), [*parts(shape, "FACE")], [*parts(shape, "SOLID")]
        if not faces:
            raise SpecError(f"{source}: has no faces")
        return {
            "kind": "part",
            "format": kind,
            "faces": len(faces),
            "trimmed_faces": sum(face_pieces(face) is None for face in faces),
            "solids": len(solids),
            "open_edges": len(part.edges),
            "holes": [*ring_texts(part.rings)],
            "bounds": box_of(shape).tolist(),
            "area": extent_of(shape, "Surface"),
            "volume": sum(extent_of(solid, "Volume") for solid in solids) if solids else None,
            "sha256": hashlib.sha256(data).hexdigest(),
        }


def _digest(array: NDArray[Any]) -> str:
    """Return sixteen characters that change with the numbers of an array, and with nothing else."""
    import hashlib

    import numpy as np

    numbers = np.ascontiguousarray(array + 0.0, dtype="<f8")  # not -0
    return hashlib.sha256(numbers.data).hexdigest()[:16]


def mesh_line(name: str, report: dict[str, Any]) -> str:
    """Describe a mesh or a part in a few words."""
    if report["kind"] == "part":
        counts = [("solid", report["solids"]), ("open edge", report["open_edges"]), ("hole", len(report["holes"]))]
        state = ", ".join(f"{count} {what}{'s' * (count > 1)}" for what, count in counts if count)
        return f"{name}: part of {report['faces']} faces{state and f', {state}'}"
    if "fault" in report:
        return f"{name}: {report['fault']}"
    cells = "segments" if "segments" in report else "faces"
    faults = ("open_ends", "open_edges", "crowded_edges", "turned_edges")
    words = [f"{n} {key[:-1].replace('_', ' ')}{'s' * (n > 1)}" for key in faults if (n := report.get(key))]
    state = ", ".join(words) or ("closed" if report["components"] else "without extent")
    return f"{name}: mesh of {report[cells]} {cells if report[cells] > 1 else cells[:-1]}, {state}"


def mesh_text(report: dict[str, Any]) -> str:
    """Write a report on a mesh or a part, with as many digits as other processors find, too."""
    from gtb_cli.meshes.measures import labelled

    max_groups_shown = 20
    shown = dict(report)
    groups, holes = shown.pop("groups", []), shown.pop("holes", [])
    digests, printed = shown.pop("digests", {}), shown.pop("printing", {})
    if box := shown.get("bounds"):
        size = max(map(operator.sub, *reversed(box)))
        shown["bounds"] = corners(box)
        for power, name in enumerate(("centroid", "second_moments"), 1):
            if shown.get(name) is not None:
                shown[name] = row(_rounded(shown[name], size, power))
        if shown.get("volume") is not None and abs(shown["volume"]) / size / size / size < 1e-12:
            shown["volume"] = 0.0  # digits of what cancels are those of rounding
    if 0 < (inward := shown.pop("inward_parts", None) or 0) < (parts := shown.get("components", 0)):
        shown["volume"] = f"{shown['volume']:.6g}, a signed sum: {inward} of {parts} parts inwards, as cavities are"
    rows = labelled(shown)
    first = [(name, rows.pop(name)) for name in ("kind", "format", "space", "volume") if printed and name in rows]
    lines = [*first, *printing_rows(printed), *rows.items(), *(("hole", text) for text in holes)]
    lines += [(f"digest of {name}", digest) for name, digest in digests.items()]
    lines += [("group", ": ".join(map(str, group.values()))) for group in groups[:max_groups_shown]]
    more = len(groups) - max_groups_shown
    lines += [("and more", f"{more} groups")] if more > 0 else []
    return "".join(f"{label:21} {_text(value)}\n" for label, value in lines)


def _text(value: str | float | None) -> str:
    return "–" if value is None else f"{value:.6g}" if isinstance(value, float) else printable(str(value))


def corners(box: list[list[float]]) -> list[str]:
    """Write the lowest and highest coordinates of a box to eight digits of its size."""
    size = max(map(operator.sub, *reversed(box)))
    return [row(_rounded(corner, size)) for corner in box]


def _rounded(values: list[float], size: float, power: int = 1) -> list[float]:
    """Round numbers to eight digits of a power of a size."""
    digits = 8 - math.ceil(power * math.log10(size or 1.0))
    return [round(x, digits) + 0.0 for x in values]


def row(values: list[float]) -> str:
    """Write numbers with the shortest digits that read back exactly, whole ones without a point."""
    return " ".join(repr(int(x)) if float(x).is_integer() and abs(x) < 1e15 else repr(x) for x in values)
