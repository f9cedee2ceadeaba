"""`gtb expand`, `elevate`, `boundary`, `bezier`, `coefficients` and `fair`: a spec in, another one out."""

import click

from gtb_cli.errors import SpecError
from gtb_cli.shell.gathering import option
from gtb_cli.shell.options import WholeNumber, numbers_of, spec_argument, spec_from_spec, streams_options
from gtb_cli.shell.streams import Spec, Streams, shown_input, single
from gtb_cli.vocabulary import ENERGIES, KEEPS, Fairness, Keep


@click.command
@spec_argument
@spec_from_spec
def expand(spec: Spec) -> Spec:
    """\b
    Example: gtb expand specs/teapot.toml -o flat.toml

    Print a spec with everything carried out: numbers instead of names and expressions, patches instead of copies and
    included files. It describes the same patch or model, bit for bit.
    """
    return spec


@click.command
@spec_argument
@option("--by D", WholeNumber(0, 1000), default=1)(
    help="Number of elevations, which for a Bézier patch is the number of degrees; 1 without this option."
)
@spec_from_spec
def elevate(spec: Spec, by: int) -> Spec:
    """\b
    Example: gtb elevate specs/cubic-bezier.toml | gtb info -

    Print the spec of the same curve or surface with more knots, weights and control points to work with.

    For Bézier patches this is classical degree elevation. A lifting is left out.
    """
    from gtb_cli.bezier.elevation import elevate as elevated
    from gtb_cli.models.model import Model

    if isinstance(spec, Model):
        return spec.replace(patches=tuple(elevated(patch, by) for patch in spec))
    return elevated(spec, by)


@click.command
@spec_argument
@click.argument("edge", metavar="[EDGE]", type=WholeNumber(), required=False)
@spec_from_spec
def boundary(spec: Spec, edge: int | None) -> Spec:
    """\b
    Example: gtb boundary specs/pentagon.toml 0

    Print the spec of the curve along an edge of a surface, or a model of all these curves.

    Edges are counted from 0, counter-clockwise from the lowest, then leftmost, corner of the domain; gtb info lists
    their knots. The curve's knots are measured along the edge, from its first corner.
    """
    from gtb_cli.models.model import Model

    patch = single(spec)
    if patch.dimension == 1:
        raise SpecError("is a curve, and has no boundary curves")
    if edge is not None:
        return patch.boundary(edge)
    return Model(tuple(map(patch.boundary, range(len(patch.domain.vertices)))), patch.name)


@click.command
@spec_argument
@option("--split T", numbers_of)(
    help="Split a curve at this parameter. By default where each T_i is the share of c_i ω_i in their sum."
)
@streams_options
def bezier(spec: str, split: tuple[float, ...] | None, streams: Streams) -> None:
    """\b
    Example: gtb bezier specs/example-4.1-integer.toml | gtb info -

    Print the exact rational Bézier pieces as a model: a rectangle for each corner of a surface, two curves for a curve.

    Such pieces exist if the distances of the knots from each edge are multiples of a common step, as they are for
    integers; otherwise the error says why not. The image is the same, and all weights are positive.
    """
    from gtb_cli.bezier.pieces import bezier_pieces, split_curve
    from gtb_cli.models.model import Model

    if split is not None and len(split) != 1:
        raise click.UsageError(f"--split: expected one parameter, got {len(split)}")
    with streams.spec_of(spec) as loaded:
        if split is None:
            pieces = bezier_pieces(loaded)
        elif isinstance(loaded, Model):
            raise SpecError(f"is a model of {len(loaded.patches)} patches, and --split is for one curve")
        else:
            pieces = split_curve(loaded, split[0])
    streams.write_spec(pieces, shown_input(spec))
    surfaces = loaded if isinstance(loaded, Model) and loaded.dimension == 2 else None
    if surfaces and (opened := len(pieces.joints.open) - 2 * len(surfaces.joints.open)) > 0:
        streams.console.warn(f"{opened} edges of pieces are open where patches are joined: they are divided elsewhere")


@click.command
@spec_argument
@option("--at T,…", numbers_of)(
    help="As many parameters as knots; for a surface u,v,u,v,… By default they are spread over the domain."
)
@spec_from_spec
def coefficients(spec: Spec, at: tuple[float, ...] | None) -> Spec:
    """\b
    Example: gtb coefficients specs/bicubic.toml

    Print the spec with coefficients for which the GT-Bernstein basis adds up to 1 at some parameters.

    Such coefficients exist for distinct knots, but they need not be positive: then the error gives the values. For
    Bézier curves, triangles and rectangles they are those of the Bernstein basis, and the sum is 1 everywhere.
    """
    import numpy as np

    from gtb_cli.theory.basis import unity_coefficients

    patch = single(spec)
    if at is not None and len(at) != patch.knots.size:
        raise SpecError(f"--at: expected {patch.knots.size} numbers, {len(patch.knots)} parameters, got {len(at)}")
    places = None if at is None else np.array(at).reshape(patch.knots.shape)
    with np.errstate(over="ignore", invalid="ignore"):  # the solution is judged afterwards
        return patch.replace(coefficients=unity_coefficients(patch.domain, places))


@click.command
@spec_argument
@option("--energy", ENERGIES, default=ENERGIES[0])(
    help="What is made small: bending and its variation, the default, or the bending of a thin plate, or stretching."
)
@option("--keep", KEEPS, default=KEEPS[0])(
    help="What stays along edges: the curve, the default, or also tangent planes, or also curvatures."
)
@streams_options
def fair(spec: str, energy: Fairness, keep: Keep, streams: Streams) -> None:
    """\b
    Example: gtb fair specs/hexagon.toml --keep tangents | gtb mesh - -o fair.obj

    Print the spec of the same patch, or model, with inner control points that make it fair.

    Knots and weights stay, and edges where patches of a model meet smoothly stay smooth. By default neither bending nor
    its variation becomes larger; thin-plate and Dirichlet energy are least, and the surface may vary more.
    """
    from gtb_cli.fairing.fair import fair as made_fair
    from gtb_cli.models.model import Model
    from gtb_cli.theory.edges import patch_name

    with streams.spec_of(spec) as loaded:
        model = loaded if isinstance(loaded, Model) else None
        with streams.console.clock("fair"):
            found = made_fair(model, energy, keep) if model else (made_fair(single(loaded), energy, keep),)
        whole = model.replace(patches=tuple(part.patch for part in found)) if model else found[0].patch
    streams.write_spec(whole, shown_input(spec))
    names = [f"{patch_name(part.patch, index)}: " if model else "" for index, part in enumerate(found)]
    for name, part, given in zip(names, found, loaded.patches, strict=True):
        if part.folds:
            streams.console.warn(f"{name}the patch folds at {part.folds} of some thousand places")
        if part.free:
            free = f"{part.free} free control point{'s' if part.free > 1 else ''}"
            text = "no fairer one is found; " if part.patch is given else f"{free}; "
            if part.energies:
                text += f"{_change('energy', *part.energies, part.error)} but for the outermost thousandth; "
            before, after = part.before, part.after
            changes = [
                _change("bending", before.energy, after.energy, part.error),
                _change("variation", before.variation, after.variation, part.error),
                _change("largest curvature", before.curvature, after.curvature, 0.05),  # where it was looked at
            ]
            streams.console.note(f"{name}{text}but for the outermost hundredth: {', '.join(changes)}")
    if stiff := [name[:-2] for name, part in zip(names, found, strict=True) if not part.free]:
        where = "" if len(stiff) == len(found) else f" in {', '.join(stiff)}"
        streams.console.warn(f"no control point is free{where}: all stay")


def _change(what: str, before: float, after: float, error: float) -> str:
    """Say what was measured before and after, with the digits on which two quadratures agree."""
    from gtb_cli.fairing.fair import agreed_text

    one, other = agreed_text(before, error), agreed_text(after, error)
    return f"{what} {one}" if one == other else f"{what} from {one} to {other}"
