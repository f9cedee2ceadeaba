"""The light readers of `make readers`, and what that finds; the others take minutes to install."""

import copy

import pytest

from tests.tools.readers import libraries
from tests.tools.readers.kinds import KINDS, Different, Kind, agreement
from tests.tools.readers.roster import LIBRARIES, PROGRAMS, WEB

LIGHT = [reader for reader in LIBRARIES if reader.key in ("trimesh", "meshio", "plyfile", "numpy_stl")]

# meshio multiplies four bytes of any ASCII STL by 50, as 32-bit numbers, to see whether it is a binary one.
pytestmark = pytest.mark.filterwarnings("ignore:overflow encountered in scalar multiply:RuntimeWarning:meshio")


def asked(kind: Kind, name: str) -> object:
    """An option of the recipe for a mesh, or of the file that it is written to."""
    return getattr(kind.options.recipe if hasattr(kind.options.recipe, name) else kind.options, name)


def kind(name: str) -> Kind:
    return next(kind for kind in KINDS if kind.name == name)


@pytest.mark.parametrize(
    ("reader", "kind"),
    [(reader, kind) for reader in LIGHT for kind in KINDS if kind.format in reader.formats.split()],
    ids=lambda value: value.name,
)
def test_light_readers_find_what_is_in_the_file(reader, kind, tmp_path):
    path = tmp_path / kind.file
    path.write_bytes(kind.encoded())
    read = getattr(libraries, f"read_{reader.key}")
    if kind.name in reader.limits:
        with pytest.raises(
            (Different, SystemExit, KeyError)
        ):  # meshio prints why, and exits, or looks for what it lacks
            agreement(kind, read(str(path)))
        return
    kept = agreement(kind, read(str(path)))
    for name in ("normals", "uv"):
        if asked(kind, name):
            assert name in kept
    if asked(kind, "attributes") and reader.key != "trimesh":  # trimesh has them among what it does not interpret
        count = len(kind.options.recipe.attributes) + 1  # and the first again, as quality
        assert f"{count} of {count} attributes" in kept


def test_limits_are_of_kinds_that_there_are():
    for reader in (*LIBRARIES, *PROGRAMS, *WEB):
        known = {kind.name for kind in KINDS if kind.format in reader.formats.split()}
        assert reader.limits.keys() <= known, reader.name


FULL = kind("PLY attributes ascii")


@pytest.fixture
def found(tmp_path):
    path = tmp_path / FULL.file
    path.write_bytes(FULL.encoded())
    return libraries.read_plyfile(str(path))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda found: found["points"][7].__setitem__(0, found["points"][7][0] + 1e-4), "a vertex is 0.0001 away"),
        (lambda found: found["points"][7].__setitem__(slice(None), found["points"][8]), "48 of 49 vertices"),
        (lambda found: found["points"].clear(), "no vertices"),
        (lambda found: found["points"][7].__setitem__(0, float("nan")), "a vertex is not finite"),
        (lambda found: found["cells"][7].__setitem__(0, 49), "a cell has a corner that is not a vertex"),
        (lambda found: found["cells"].pop(), "71 of 72 cells, 71 the same"),
        (lambda found: found["cells"][0].reverse(), "72 of 72 cells, 71 the same"),
        (lambda found: found["normals"][3].reverse(), "normals: one is .* away"),
        (lambda found: found["uv"][3].__setitem__(0, 0.123), "uv: one is .* away"),
        (lambda found: found["attributes"]["quality"].__setitem__(3, 100.0), "quality: one is .* away"),
        (lambda found: found["attributes"]["quality"].pop(), "quality: 48 of 49"),
    ],
)
def test_a_reader_that_finds_something_else_is_noticed(change, message, found):
    agreement(FULL, copy.deepcopy(found))
    change(found)
    with pytest.raises(Different, match=message):
        agreement(FULL, found)


def test_corners_may_be_in_any_order_and_vertices_several_times(found):
    found["cells"] = [[*cell[1:], cell[0]] for cell in reversed(found["cells"])]
    rows = range(len(found["points"]) - 1, -1, -1)
    for name in ("points", "normals", "uv"):
        found[name] += [found[name][row] for row in rows]
    for values in found["attributes"].values():
        values += values[::-1]
    found["cells"][0] = [2 * len(rows) - 1 - corner for corner in found["cells"][0]]
    assert agreement(FULL, found) == ["normals", "uv", "3 of 3 attributes"]


@pytest.mark.parametrize(
    ("counts", "message"),
    [
        ({"cells": 179}, "179 of 180 cells"),
        ({"cells": 180, "vertices": 105}, "105 of 106 vertices"),
        ({"bounds": [[0, 0, 0], [2, 2, 4.001]]}, "bounds are 0.001 away"),
    ],
)
def test_a_program_that_counts_otherwise_is_noticed(counts, message):
    assert agreement(kind("STL"), {"cells": 180, "vertices": 540, "bounds": [[0, 0, 0], [2, 2, 4]]}) == []
    with pytest.raises(Different, match=message):
        agreement(kind("STL"), counts)
