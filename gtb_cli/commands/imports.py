"""`gtb import`: a file of another program → a spec."""

import click

from gtb_cli.errors import RequirementError
from gtb_cli.shell.gathering import option
from gtb_cli.shell.messages import STANDARD
from gtb_cli.shell.options import INPUT, output_options
from gtb_cli.shell.streams import Streams, about, input_stem, read_bytes, shown_input
from gtb_cli.vocabulary import IMPORTS, suffix_of


@click.command("import")
@click.argument("file", metavar="FILE", default=STANDARD, type=INPUT)
@option("--from", IMPORTS, into="format")(
    help="Read FILE in this format. By default the content or the suffix of the file decides."
)
@output_options
def import_(file: str, format: str | None, streams: Streams) -> None:
    """\b
    Example: printf '1 1  0 0 0  0 1 0  1 0 0  1 1 1' | gtb import --from bzr

    Print a file of another program as a spec: a patch, or a model of several.

    Formats: .trp (toric patches), .bv (BezierView), .bpt, .bzr (Bézier nets); with gtb-cli[cad] STEP, IGES and BREP,
    whose untrimmed faces are exact. Boundaries of holes (.gbp, .lop) are filled as gtb fill does.
    """
    from gtb_cli.filling.hole_files import SUFFIXES, loop_from_text
    from gtb_cli.filling.one_patch import fill_loop
    from gtb_cli.importers.readers import import_data

    source = shown_input(file)
    data = read_bytes(file)
    if format is not None or suffix_of(source) not in SUFFIXES:
        shape, remarks = import_data(source, data, format)
    else:
        sides = loop_from_text(data, source)
        with about(source):
            filling = fill_loop(sides, name=input_stem(file))
            if filling.fault:
                raise RequirementError(f"{filling.fault}; it is not written")
        shape, remarks = filling.patch, filling.remarks
        remarks += ("the inside is made fair and is not that of the file's scheme",)
    streams.write_spec(shape, source)
    for remark in remarks:
        streams.console.note(f"{source}: {remark}")
