"""`gtb fill`: the curves around a hole, or a model with one → the patch that fills it."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

import click

from gtb_cli.errors import RequirementError
from gtb_cli.shell.gathering import option
from gtb_cli.shell.messages import STANDARD, Console
from gtb_cli.shell.options import INPUT, WholeNumber, json_option, length_of, streams_options, weld_option
from gtb_cli.shell.streams import Streams, about, input_stem, read_bytes, shown_input, write_blocks, write_json
from gtb_cli.shell.surface_files import surface_format
from gtb_cli.values import if_finite
from gtb_cli.vocabulary import CONTINUITIES, percentage

if TYPE_CHECKING:
    from gtb_cli.cad.cad_seams import Seams
    from gtb_cli.fairing.variation import Bending
    from gtb_cli.filling.certificate import Filling


def _kinds(values: tuple[str, ...]) -> dict[str, str]:
    """Read the continuity of all sides, under an empty name, and of sides by their names."""
    kinds = dict(value.rpartition("=")[::2] for value in values)
    if unknown := [kind for kind in kinds.values() if kind not in CONTINUITIES]:
        raise ValueError(f"{unknown[0]!r} is not one of {', '.join(CONTINUITIES)}")
    return kinds


@click.command
@click.argument("loop", metavar="LOOP", type=INPUT)
@option("--hole EDGE", str)(
    help='In a model or part, fill the hole with this edge, such as "wall-0 edge 2", at this patch or face, "face-3", '
    'or near this point, "10,0,2.5".'
)
@option("--holes", bool)(help="List the holes of a model or part, and fill none.")
@option("--continuity [SIDE=]KIND", _kinds, multiple=True)(
    help="With g1, the default, the patch touches the given tangent planes; with g0 it only meets the curves, and is a "
    "plane lid or floor where they lie in a plane; with g2 it also has the curvature of its neighbours. "
    'Of one side: "side 2=g1".'
)
@option("--inner", ("fair", "flat"), default="fair")(
    help="Make the inside fair (curvature varies little), the default, or flat like a soap film."
)
@option("--fullness F", length_of)(help="Continue along the given tangent planes F times as far as is fair.")
@option("--elevate D", WholeNumber(0, 6), into="raises")(
    help="Raise the degree of edges by at least D: more knots, a fairer patch. By default D suits the hole."
)
@option("--tolerance T", length_of)(help="In a CAD file, fit within this distance (1e-4 of the size).")
@option("--angle DEGREES", length_of)(help="In a CAD file, keep tangent planes within this.")
@option("--g2-tolerance PERCENT", lambda text: percentage(text) / 100, default="1%", show_default=True)(
    help="With g2, the largest difference of curvatures, of the neighbours' largest."
)
@option("--long", bool, into="is_long")(help="Say all that was measured, of each side and corner.")
@weld_option
@json_option
@streams_options
def fill(
    loop: str, hole: str | None, holes: bool, weld: float | str | None, as_json: bool, streams: Streams, **asked: Any
) -> None:
    """\b
    Example: gtb boundary specs/nonagon.toml | gtb fill - | gtb mesh - -o filled.obj

    Fill a hole with three or more sides by one patch, or by several if the hole has to be cut, and print the spec.

    LOOP is a model of surfaces, or a STEP, IGES or BREP file (extra gtb-cli[cad]), of which --hole names the hole: an
    open ring of edges. It may also be a spec whose patches are the sides, in any order: rational Bézier curves, each
    with a "ribbon", the second row of control points, if tangent planes are to be touched; or a .gbp or .lop file.

    With -o FILE.step (or .iges, .brep) the patch is B-splines that keep its tangent planes, sewn to the part's faces;
    with --continuity g2 they also continue the curvature of these, and what differs is said.

    Along each side with a ribbon the tangent planes are exact up to rounding. With --continuity g2 so is the curvature:
    that of a neighbour in a model, of a .gbp file of degree 5 or more, or of the strip of a curve, its "ribbon" and its
    "ribbon2", the third row. Where no polynomial rows have it exactly the nearest are taken, within --g2-tolerance.

    At most three lines say how well it fills. --long says all: angles between normals along sides, in a model or with
    g2 also differences of curvature; planes and curvature of corners; ∫ κ₁² + κ₂² (bending), area · ∫ |∇H|² (its
    variation). --json prints it as data, and -o writes the spec. A patch that folds or is turned over is not written;
    where neither --fullness nor --elevate is given, less fullness and one degree more are tried before.

    A hole with concave corners is cut by curves into parts with a patch each, whose tangent planes along them agree.
    """
    from gtb_cli.filling.fill import filled, filled_in_some_way, holes_of
    from gtb_cli.filling.hole_files import read_loop
    from gtb_cli.filling.holes import ring_texts
    from gtb_cli.filling.part_holes import Part
    from gtb_cli.language.writer import check_target
    from gtb_cli.models.model import Model

    source, kind = shown_input(loop), surface_format(None, streams.output)
    if kind is None and (asked["tolerance"] or asked["angle"]):
        raise click.UsageError("--tolerance and --angle are for an output that is a CAD file, such as -o filled.step")
    if kind is None and not holes:
        check_target(streams.output)
    data = read_bytes(loop)
    found, named = read_loop(data, source, streams.reading, weld)
    if holes:
        with about(source):
            rings = holes_of(found)
            if not as_json:
                return streams.write("".join(f"{text}\n" for text in ring_texts(rings)))
            listed = [{"edges": ring.names, "near": ring.corners.mean(axis=0).tolist()} for ring in rings]
            return write_json(streams.output, {"holes": listed})
    # What is written meets curvature, where no patch does
    bends = isinstance(found, Part) and kind is not None and asked["continuity"] == {"": "g2"}
    options = {name: asked[name] for name in ("inner", "raises", "g2_tolerance")}
    options |= {"fullness": asked["fullness"] or 1.0, "continuity": {} if bends else asked["continuity"]}
    fill_hole = filled_in_some_way if asked["fullness"] is asked["raises"] is None else filled
    with about(source), streams.console.clock("fill"):
        filling = fill_hole(found, hole, None if isinstance(found, Model) else named or input_stem(loop), **options)
    size, warnings, seams = "", list[str](), None
    if kind is not None and not filling.fault:
        part, allowed = found.shape if isinstance(found, Part) else None, asked["g2_tolerance"] if bends else None
        with about(source):
            block, size, warnings, seams = _cad_file(filling, part, data, kind, asked, allowed)
        write_blocks(streams.output, [block])
    elif not filling.fault and not (as_json and streams.output == STANDARD):
        # Before its certificate: it may be impossible
        streams.write_spec(filling.model or filling.patch, source)
    if as_json:
        write_json(STANDARD, _certificate(filling, seams, written=not bends))
    if filling.fault:
        raise RequirementError(f"{filling.fault}; it is not written").within(source)
    _report(filling, streams.console, asked["is_long"], written=not bends)
    if kind is not None:
        streams.console.report(streams.output, size, warnings)


def _cad_file(
    filling: Filling, part: Any, data: bytes, kind: str, asked: dict[str, Any], bend_allowed: float | None
) -> tuple[bytes, str, list[str], Seams | None]:
    """Return a CAD file of a filling, sewn to a part that was read from data; its size, warnings, and seams."""
    from gtb_cli.cad.bspline_surfaces import CLOSEST
    from gtb_cli.cad.kinds_of_surfaces import encode_surfaces
    from gtb_cli.filling.certificate import DISAGREEING

    model, fineness = filling.model or filling.patch, (asked["tolerance"], asked["angle"])
    block, size, warnings, seams = encode_surfaces(model, kind, "mm", *fineness, part=part, bend_allowed=bend_allowed)
    has = {"colours": rb"STYLED_ITEM", "names": rb"ADVANCED_FACE\s*\(\s*'(?!NONE')[^']"}
    if part is not None and (lost := [what for what, word in has.items() if re.search(word, data)]):
        warnings.append(f"{' and '.join(lost)} of the part's faces are not kept")
    angles = enumerate(filling.corner_angles.tolist())  # those beyond are doubts
    most, k = max(((angle, k) for k, angle in angles if angle <= DISAGREEING), default=(0.0, 0))
    if seams is not None and most > CLOSEST:
        off = f"disagree by {most:.2g} degrees at {filling.at(filling.sides[k].ends[0])}"
        warnings.append(f"planes and edges of the part {off}: no face can meet all")
    return block, size, warnings, seams


def _certificate(filling: Filling, seams: Seams | None, *, written: bool) -> dict[str, Any]:
    """Return what was measured, of a patch only if it is written, as plain data; None stands for what is not known."""
    sides = [
        {
            "name": side.name,
            "angle": if_finite(contact.angle),
            "place": None if math.isnan(contact.angle) else contact.place.tolist(),
            "curvature_difference": if_finite(contact.bend),
            "curvature_difference_inside": if_finite(contact.bend_inside),
            "curvature_place": None if math.isnan(contact.bend) else contact.bend_place.tolist(),
        }
        for side, contact in zip(filling.sides, filling.contacts, strict=True)
    ]
    found = {
        "name": filling.patch.name,
        "sides": sides,
        "corner_angles": [if_finite(angle) for angle in filling.corner_angles.tolist()],
        "corners": [
            {
                "corner": k,
                "at": side.ends[0].tolist(),
                "angle": if_finite(limits.angle),
                "angle_near": if_finite(part.normals_near(k)),
                "curvature": if_finite(limits.curvature),
                "curvature_exponent": if_finite(limits.curvature_exponent),
                "curvature_near": if_finite(near),
                "curvature_forced": part.corner_forced[k],
                "folds": limits.folds,
            }
            for part in filling.parts or (filling,)
            for k, (side, limits, near) in enumerate(zip(part.sides, part.corners, part.corner_curvatures, strict=True))
        ],
        **_bending(filling.bending, float(filling.bending_errors[0].max())),
        "nearer": _bending(filling.bending_nearer, float(filling.bending_errors[1].max())),
        "folds": filling.folds,
        "sharp_turns": filling.sharp_turns,
        "patches": [patch.name for patch in filling.patches],
        "knots": sum(len(patch.knots) for patch in filling.patches),
        "remarks": list(filling.remarks),
        "fault": filling.fault,
    }
    if not written:
        found = {key: found[key] for key in ("name", "corner_angles", "remarks", "fault")}
    if seams is not None:
        found["seams"] = seams._asdict() | {"curvature": seams.curvature and seams.curvature._asdict()}
    return found


def _bending(bending: Bending, error: float) -> dict[str, float]:
    integrals = {"area": bending.area, "bending": bending.energy, "variation": bending.variation}
    return integrals | {"curvature": bending.curvature, "relative_error": error}


def _report(filling: Filling, console: Console, is_long: bool, *, written: bool) -> None:
    """Say all that was measured or, in up to three lines, what was done differently, what is doubtful, and the size."""
    from gtb_cli.fairing.fair import agreed_text

    plain = [remark for remark in filling.remarks if not remark.startswith("degrees of")][:1]
    for remark in filling.remarks if is_long else plain:
        console.note(remark)
    if filling.doubts:
        console.warn("; ".join(filling.doubts))
    if not written:  # the file's surfaces are not this patch, and its line says what they are
        return
    knots = sum(len(patch.knots) for patch in filling.patches)
    sides = " + ".join(str(len(part.sides)) for part in filling.parts or (filling,))
    angle = "" if math.isnan(filling.angle) else f", largest angle to the given planes {filling.angle:.2g} degrees"
    size = f"{sides} sides, {knots} knots, no folds at corners and some thousand places{angle}"
    if is_long:
        for side, contact in zip(filling.sides, filling.contacts, strict=True):
            if math.isnan(contact.angle):
                continue
            text = (
                f"{side.name}: angle to its planes up to {contact.angle:.2g} degrees near {filling.at(contact.place)}"
            )
            if not math.isnan(contact.bend):
                text += f", curvatures across differ by up to {contact.bend:.2g} near {filling.at(contact.bend_place)}"
            if not math.isnan(contact.bend_inside):
                text += f", at 1% of its length inside by {contact.bend_inside:.2g}"
            console.note(text)
        _report_corners(filling, console)
        console.note(size)
        measured = zip((filling.bending, filling.bending_nearer), filling.bending_errors, strict=True)
        for what, (bending, errors) in zip(("hundredth", "thousandth"), measured, strict=True):
            bent, varied = map(agreed_text, (bending.energy, bending.variation), errors.tolist())
            largest = f"largest curvature {bending.curvature:.2g}"
            console.note(f"to a {what} of the way from the edges: bending {bent}, variation {varied}, {largest}")
    else:
        bend = max((each.bend for each in filling.contacts if not math.isnan(each.bend_inside)), default=0.0)
        more = f", curvatures across sides differ by up to {bend:.2g}" if bend else ""
        console.note(f"{size}{more}; --long says more")


def _report_corners(filling: Filling, console: Console) -> None:
    """Say in a line what curvature the corners have, and of each that has several planes or no bound, what it has."""
    from gtb_cli.theory.corners import PLANE_DEGREES

    most, where, reach, others, parts = 0.0, "", "within a tenth", "", filling.parts or (filling,)
    rounding = 1e-8  # degrees between limits of normals; from planes that differ by more, curvature grows further in
    for number, part in enumerate(parts):
        for corner, (limits, near) in enumerate(zip(part.corners, part.corner_curvatures, strict=True)):
            place = f"{f'part {number}, ' if len(parts) > 1 else ''}corner {corner}"
            if limits.angle <= PLANE_DEGREES and math.isfinite(limits.curvature):
                most, where = max((most, where), (max(limits.curvature, near), f", at {place}"))
                reach = "from a millionth to a tenth" if limits.angle > rounding else reach
                continue
            others, told = "other ", "limits of curvature are not known"
            if limits.angle > PLANE_DEGREES:
                told = f"limits of normals are up to {limits.angle:.3g} degrees apart"
                told += f", and normals at a millionth of an edge {part.normals_near(corner):.3g}"
            elif math.isinf(limits.curvature):
                told = f"one tangent plane, and curvature grows like distance ^ {limits.curvature_exponent:.2g}"
            console.note(f"{place}, of {part.sides[corner - 1].name} and {part.sides[corner].name}: {told}")
    if where:
        size = math.sqrt(filling.bending.area)
        most = round(most * size, 12) / size
        step = 10.0 ** (math.floor(math.log10(most or 1.0)) - 2)  # of the third digit: rounded up
        largest = f"curvature at most {math.ceil(most / step - 1e-6) * step:.3g} {reach} of an edge{where}"
        console.note(f"{others}corners: tangent planes, {largest}")
