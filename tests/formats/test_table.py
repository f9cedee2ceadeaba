"""The table of what each format holds, against the files that are written."""

from dataclasses import replace

import numpy as np
import pytest

from gtb_cli.errors import ExportError
from gtb_cli.formats.export import encode_mesh
from gtb_cli.formats.meshfiles import decode_mesh
from gtb_cli.vocabulary import FORMATS
from tests.tiny_meshes import curve, encoded, model, surface


@pytest.mark.parametrize("format", FORMATS)
def test_a_format_has_curves_or_refuses_them(format):
    if FORMATS[format].curves:
        assert decode_mesh(encoded(curve(), format), "file").mesh.is_curve
    else:
        with pytest.raises(ExportError, match=r"a curve has none: .*`radius`"):
            encode_mesh(curve(), format)


@pytest.mark.parametrize("format", FORMATS)
@pytest.mark.parametrize("values", ["normals", "uv"])
def test_values_at_vertices_are_written_where_the_format_has_them(format, values):
    lengths = [len(encoded(surface(), format, **{values: asked})) for asked in (False, True)]
    assert (lengths[1] > lengths[0]) == (getattr(FORMATS[format], values) not in (False, "never"))
    if values == "normals":  # without a word about them
        assert len(encoded(surface(), format)) == lengths[FORMATS[format].normals == "always"]


@pytest.mark.parametrize("format", FORMATS)
def test_attributes_are_written_where_the_format_has_them(format):
    mesh = replace(surface(), attributes={"height": surface().vertices[:, 2]})
    assert (encoded(mesh, format) != encoded(surface(), format)) == FORMATS[format].attributes


@pytest.mark.parametrize("format", FORMATS)
def test_groups_are_written_where_the_format_has_them(format):
    groups = decode_mesh(encoded(model(), format), "file").mesh.groups
    assert len(groups) == (len(model().groups) if FORMATS[format].groups else 0)


@pytest.mark.parametrize("format", FORMATS)
@pytest.mark.parametrize("ascii", [False, True])
def test_text_holds_digits_that_32_bits_do_not(format, ascii):
    far = 1e4 + 1 / 3  # a coordinate that neither 32 bits nor 9 digits hold
    holds, mesh = FORMATS[format], replace(surface(), vertices=surface().vertices + far)
    if ascii and holds.text == "never":
        with pytest.raises(ExportError, match="no text form"):
            encode_mesh(mesh, format, ascii=True)
        return
    data = encoded(mesh, format, ascii=ascii)
    assert (b"\0" not in data) == holds.is_text(ascii)
    moved = np.abs(decode_mesh(data, "file").mesh.bounds - mesh.bounds).max()
    assert (moved > 1e-5) == holds.is_single(ascii)
