"""`gtb info`: what a spec describes, and what a mesh or a part measures."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from gtb_cli.errors import GtbError, ToleranceError
from gtb_cli.language.reading import AS_SEEN, Reading
from gtb_cli.shell.faults import in_options
from gtb_cli.shell.gathering import option
from gtb_cli.shell.options import solid_option
from gtb_cli.shell.several import ReportRequest, report_options
from gtb_cli.shell.streams import Spec, about, shown_input, spec_of
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.verdicts.mesh_reports import corners, mesh_line, mesh_text, printing_rows, row, spec_or_report
from gtb_cli.vocabulary import SPEC_FORMATS, UP, Up, suffix_of

if TYPE_CHECKING:
    from gtb_cli.meshes.mesh import Mesh
    from gtb_cli.models.model import Model

MAX_PATCHES_SHOWN = 4  # largest number of patches of a model that are all described without --long


@click.command
@report_options(metavar="SPEC|MESH...")
@option("--up", UP, default=UP[0])(help="Axis that points up where it is printed; z by default.")
@solid_option
def info(request: ReportRequest, up: Up, solid: Recipe | None) -> None:
    """\b
    Example: gtb info specs/pentagon.toml

    Say what specs describe, or what meshes and parts measure.

    Of a spec: the kind, knots and edges numbered from 0, the bounding box of the surface, how far the parametrisation
    is from linear, and length, area or volume (of closed models), with an estimate of their accuracy. Several specs and
    meshes, or those in a folder, get a line each, unless --long or --json asks for everything.

    Of an OBJ, PLY, STL, GLB or 3MF file: faces, bounds, parts, area, volume (negative if it looks inwards), edges that
    are open, crowded (with more than two faces) or turned, digests and groups, in digits that are the same on all
    processors: the page of commands has the lines by which git diff shows them. Of a STEP, IGES or BREP file: faces,
    solids, holes, sizes.

    Of what is closed, also what a printer asks, in the units of the model: size, footprint, overhangs by more than 45
    degrees, and the least wall (of up to 50 000 faces, with --long or --json 200 000) with its place. With --thickness
    or --radius they are those of the solid that gtb mesh makes with the same options, and so is the printed volume.
    """
    in_full = request.in_full
    found = partial(_found, in_full=request.as_json or in_full, up=None if request.in_lines else up, solid=solid)
    request.report(found, meshes=True, record=dict, line=_line, text=partial(_text, in_full=in_full), gap="\n")


def _line(name: str, found: dict[str, Any]) -> str:
    if found["kind"] in ("mesh", "part"):
        return mesh_line(name, found)
    if "patches" in found:
        state = "closed" if found["closed"] else f"{len(found['open_edges'])} open edges"
        kind = "surfaces" if found["dimension"] == 2 else "curves"
        return f"{name}: model of {len(found['patches'])} {kind}, {state}"
    return f"{name}: {_kind(found)}, {found['knots']} knots"


def _kind(found: dict[str, Any]) -> str:
    degree = found.get("degree")
    return str(found["kind"]) + (" of degree " + " × ".join(map(str, degree)) if degree else "")


def _found(
    spec: str, reading: Reading, weld: float | str | None, in_full: bool, up: Up | None, solid: Recipe | None
) -> dict[str, Any]:
    """Return all that is reported about a spec, or a mesh; unless in full, only the joints that are listed.

    Sizes are measured if an axis is `up`; what a printer asks, of the solid.
    """
    from gtb_cli.distances.areas_and_volumes import extents
    from gtb_cli.meshes.measures import measure
    from gtb_cli.models.model import with_weld

    if reading != AS_SEEN or suffix_of(spec) in SPEC_FORMATS:
        with spec_of(spec, reading) as read:
            found: Spec | dict[str, Any] = read
    else:
        found = spec_or_report(spec, partial(_printing, up=up, in_full=in_full))
    if isinstance(found, dict):
        name = "weld" if solid is None else "radius" if solid.thickness is None else "thickness"
        if weld is not None or solid is not None:
            raise GtbError(f"{shown_input(spec)}: --{name} is for specs, and this is a {found['kind']}")
        return found
    with about(shown_input(spec)):
        shape = with_weld(found, weld)
        report = _report_of(shape, in_full)
        for name, extent in extents(shape).items() if up is not None else ():
            report |= {name: extent.value, f"{name}_error": extent.error}
        if up is not None and (solid is not None or (report.get("closed") and "volume" in report)):
            report["printing"] = None
            with suppress(ToleranceError):
                mesh, remarks = replace(solid or Recipe(), tolerance="0.1%", max_faces=50_000).mesh(shape)
                report["printing"] = _printing(mesh, up, in_full)
                if solid is not None:
                    report["printing"] |= {"volume": measure(mesh).volume, "remarks": [*map(in_options, remarks)]}
    return report


def _printing(mesh: Mesh, up: Up | None, in_full: bool) -> dict[str, Any]:
    from gtb_cli.solids.printability import printability
    from gtb_cli.solids.wall_depth import MAX_WALL_FACES

    return {} if up is None else printability(mesh, up, MAX_WALL_FACES if in_full else MAX_WALL_FACES // 4)


def _report_of(loaded: Spec, in_full: bool) -> dict[str, Any]:
    import numpy as np

    from gtb_cli.arrays import bounds_of
    from gtb_cli.checks.bounding_boxes import bounds
    from gtb_cli.checks.description import description
    from gtb_cli.models.model import Model

    if isinstance(loaded, Model):
        all_shown = in_full or len(loaded.patches) <= MAX_PATCHES_SHOWN
        return {
            "name": loaded.name,
            "kind": "model",
            "dimension": loaded.dimension,
            "bounding_box": bounds(loaded.patches).tolist(),
            "control_box": bounds_of(np.concatenate([patch.control_points for patch in loaded.patches])).tolist(),
            **_joints(loaded, all_shown),
            "patches": [*map(description, loaded.patches)] if all_shown else [{}] * len(loaded.patches),
        }
    return description(loaded)


def _joints(model: Model, in_full: bool) -> dict[str, Any]:
    from gtb_cli.models.openings import near_misses
    from gtb_cli.models.rings_of_copies import wrong_rings
    from gtb_cli.models.smoothness import bends
    from gtb_cli.theory.edges import edge_name

    joints, seams, name = model.joints, model.seams, partial(edge_name, model.patches)
    if not in_full:
        seams = tuple(sorted(seams, key=lambda seam: -(seam.angle if math.isfinite(seam.angle) else 0.0))[:6])
    return {
        "closed": joints.closed,
        "shared_edges": len(joints.shared),
        "open_edges": [*map(name, joints.open)],
        "collapsed_edges": [*map(name, joints.collapsed)],
        "almost_shared_edges": [
            {"edges": [name(first), name(second)], "distance": distance} for first, second, distance in joints.almost
        ],
        "not_joined": wrong_rings(model.patches, model.weld)
        or [
            f"{name(first)}: {in_options(reason).format(name(second))}"
            for first, second, reason in near_misses(joints, model.patches)
        ],
        "welded_edges": sum(joint.distance > 0 for joint in joints.shared),
        "welded_distance": max((joint.distance for joint in joints.shared), default=0.0),
        "crowded_edges": [[*map(name, refs)] for refs in joints.crowded],
        "one_sided": bool(joints.one_sided),
        "joints": [
            {
                "edges": [name(seam.first), name(seam.second)],
                "angle": seam.angle if math.isfinite(seam.angle) else None,
                "place": seam.place.tolist(),
                "curvature_difference": bend if math.isfinite(bend) else None,
            }
            for seam, (bend, _) in zip(seams, bends(seams), strict=True)
        ],
    }


def _text(found: dict[str, Any], indent: str = "", *, in_full: bool = False) -> str:
    """Write a report as a table of two columns; unless in full, only as many patches and joints as fit on a screen."""
    if found["kind"] in ("mesh", "part"):
        return mesh_text(found)
    patches = found.get("patches", [])
    patches = patches if in_full or len(patches) <= MAX_PATCHES_SHOWN else []
    lines = [("name", found["name"] or "(none)"), ("kind", _kind(found))]
    if "patches" in found:
        lines += [
            ("patches", str(len(found["patches"]))),
            ("closed", "yes" if found["closed"] else "no" + ", and one-sided" * found["one_sided"]),
            ("shared edges", str(found["shared_edges"])),
            ("open edges", _listed(found["open_edges"], in_full) or "none"),
        ]
        lines += [("collapsed edges", listed)] if (listed := _listed(found["collapsed_edges"], in_full)) else []
        lines += [("not joined", reason) for reason in found["not_joined"]]
        welded = f"{found['welded_edges']}, up to {found['welded_distance']:.3g} apart"
        lines += [("welded edges", welded)] if found["welded_edges"] else []
        lines += [("crowded edge", "; ".join(crowded)) for crowded in found["crowded_edges"]]
        lines += _size_rows(found)
        lines += [("joint", _joint_text(joint, found["control_box"])) for joint in found["joints"]]
        count = found["shared_edges"] if found["dimension"] == 2 else 0
        lines += [("and more", f"{count} joints in all, and each patch: with --long")] if not patches else []
    else:
        what = "edge" if found["dimension"] == 2 else "end"
        lines += [
            ("dimension", str(found["dimension"])),
            ("knots", str(found["knots"])),
            ("repeated knots", "; ".join(row(group) for group in found["repeated_knots"]) or "none"),
            ("hull vertices", "; ".join(row(corner) for corner in found["hull_vertices"])),
            *((f"knots of {what} {index}", row(edge)) for index, edge in enumerate(found["edges"])),
        ]
        lines += [("edge normals", found["edge_normals"])] if found["edge_normals"] else []
        lines += [("linear precision", f"off by up to {found['linear_precision_error']:.3g}"), *_size_rows(found)]
    text = "".join(f"{indent}{label:17} {value}\n" for label, value in lines)
    return text + "".join("\n" + _text(patch, indent + "  ") for patch in patches)


def _size_rows(found: dict[str, Any]) -> list[tuple[str, str]]:
    lines = [*zip(("lowest", "highest"), corners(found["bounding_box"]), strict=True)]
    lines.append(("control points", "from {} to {}".format(*corners(found["control_box"]))))
    names = ("length", "area", "volume")
    turned = " where normals look inwards, which gtb mesh turns" * (found.get("volume", 0.0) < 0)
    lines += [(name, _within(found[name], found[f"{name}_error"])) for name in names if name in found]
    lines[-1] = (lines[-1][0], lines[-1][1] + turned)
    return lines + printing_rows(found.get("printing", {}))


def _within(value: float, error: float) -> str:
    """Write a number with the digits that an estimate of its error leaves, and the step of the last."""
    if not error:
        return row([value])
    digits = -math.ceil(math.log10(2 * error))  # half a step is for the rounding here
    return f"{round(value, digits) + 0.0:.{max(digits, 0)}f} ± {10.0**-digits:g} (estimated)"


def _listed(names: list[str], in_full: bool) -> str:
    """List names in a row; unless in full, only some of very many."""
    max_edges_shown = 24  # largest number of open or collapsed edges that are listed without --long
    more = 0 if in_full else max(0, len(names) - max_edges_shown)
    return "; ".join(names[: len(names) - more]) + (f" and {more} more, with --long" if more else "")


def _joint_text(joint: dict[str, Any], box: list[list[float]]) -> str:
    text = " and ".join(joint["edges"])
    if joint["angle"] is None:
        return f"{text}: without normals"
    import numpy as np

    from gtb_cli.arrays import point_text

    text += f": {joint['angle']:.2g} degrees near {point_text(np.array(joint['place']), np.array(box))}"
    bend = joint["curvature_difference"]
    return text if bend is None else f"{text}, curvatures across differ by {bend:.3g}"
