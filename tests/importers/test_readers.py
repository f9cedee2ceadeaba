"""Files of other programs: their points against the formats' own formulas in fractions, and what is refused."""

import re
from collections.abc import Iterator, Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from gtb_cli.errors import SpecError
from gtb_cli.importers.readers import READERS, import_data
from gtb_cli.language.loading import parse
from gtb_cli.language.patch_reader import MAX_PATCHES
from gtb_cli.models.model import Model
from gtb_cli.theory.patch import Patch
from gtb_cli.vocabulary import IMPORTS
from tests import foreign
from tests.foreign import FILES
from tests.marks import mostly_long
from tests.shell import gtb

pytestmark = pytest.mark.usefixtures("probed_here")

PLACES = [(Fraction(1, 3), Fraction(1, 7)), (Fraction(4, 5), Fraction(2, 3)), (Fraction(1, 9), Fraction(8, 9))]


def patches_of(name: str) -> tuple[Patch, ...]:
    return import_data(name, FILES[name]).shape.patches


def assert_near(found: np.ndarray, expected: Sequence[Fraction]) -> None:
    agreement = 1e-13  # a few dozen roundings
    assert np.abs(found[0] - [float(x) for x in expected]).max() <= agreement


def test_toric_patches() -> None:
    (patch,) = patches_of("toric.trp")
    assert patch.edge_normals == "primitive"
    for u, v in [(Fraction(1), Fraction(1, 2)), (Fraction(3, 2), Fraction(1)), (Fraction(1, 3), Fraction(5, 3))]:
        assert_near(patch.evaluate([[float(u), float(v)]]), foreign.toric_point(u, v))


def test_bezierview() -> None:
    patches = patches_of("shapes.bv")
    assert [patch.name for patch in patches] == ["bowl"] * 2 + ["dome"] * 5 + ["house"] * 2
    assert [len(patch.knots) for patch in patches] == [9, 6, 4, 6, 3, 4, 3, 5, 3]
    for u, v in PLACES:
        terms = [foreign.bernstein(1, i, u) * foreign.bernstein(2, j, v) for i in range(2) for j in range(3)]
        points = [[Fraction(x) for x in row] for row in patches[1].control_points.tolist()]
        assert_near(patches[1].evaluate([[float(u), float(2 * v)]]), foreign.weighted(terms, points))
        weights = [1, 2, 3, 1]
        terms = [w * foreign.bernstein(1, i, u) * foreign.bernstein(1, j, v)
                 for w, (i, j) in zip(weights, [(0, 0), (0, 1), (1, 0), (1, 1)], strict=True)]  # fmt: skip
        points = [[Fraction(x) for x in row] for row in ([0, 0, 0], [0, 2, 1], [1, 0, 0], [1, 1, 1])]
        assert_near(patches[2].evaluate([[float(u), float(v)]]), foreign.weighted(terms, points))
    np.testing.assert_array_equal(patches[3].evaluate([[0, 0], [2, 0], [0, 2]]), [[0, 0, 0], [2, 0, 0], [0, 2, 0]])
    np.testing.assert_array_equal(patches[6].control_points[1], [1, 0, 0])
    assert not patches[7].evaluate(patches[7].domain.vertices.mean(axis=0)[None])[:, 2].any()


def test_bezier_nets_run_as_their_formats_say() -> None:
    first, _ = patches_of("two.bpt")
    np.testing.assert_array_equal(first.evaluate([[2, 0], [0, 1]]), [[2, 0, 0], [0, 1, 0]])
    (only,) = patches_of("one.bzr")
    np.testing.assert_array_equal(only.evaluate([[1, 0], [0, 2]]), [[3, 0, 0], [0, 2, 0]])


def test_nurbs_surfaces_are_their_spans() -> None:
    patches = patches_of("part.igs")
    assert len(patches) == 4
    ends = [Fraction(0), Fraction(2, 5), Fraction(1)], [Fraction(0), Fraction(1, 2), Fraction(1)]
    for index, patch in enumerate(patches):
        i, j = divmod(index, 2)
        for a, b in PLACES:
            u = ends[0][i] + a * (ends[0][i + 1] - ends[0][i])
            v = ends[1][j] + b * (ends[1][j + 1] - ends[1][j])
            x, y, z = foreign.nurbs_point(u, v)
            found = patch.evaluate([[2 * float(a), float(b)]])[0]
            assert np.abs(found - [float(x) for x in (10 - y, 20 + x, 30 + z)]).max() <= 4e-13
    model = Model(patches)
    assert len(model.joints.shared) == 4
    assert [patch.name for patch in patches] == [f"face-0-{k}" for k in range(4)]


def test_iges_says_what_is_left_out() -> None:
    found = import_data("part.igs", FILES["part.igs"])
    assert found.remarks == ("lengths are millimetres", "5 curves beside the surfaces are left out")


@pytest.mark.parametrize("name", mostly_long(FILES, 4))
def test_a_format_is_known_by_its_suffix_and_its_spec_is_read_back(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(FILES[name])
    result = gtb("import", path, status=0)
    for first, second in zip(parse(result.text).patches, patches_of(name), strict=True):
        np.testing.assert_array_equal(first.control_points, second.control_points)
        np.testing.assert_array_equal(first.coefficients, second.coefficients)


def wrong_files() -> Iterator[tuple[str, bytes, bytes, str]]:
    """Yield the name of a file, a part of it, what is there instead, and a part of the message, for each case."""
    for section in (Path(__file__).parent / "faults.txt").read_text(encoding="utf-8").split("\n=== ")[1:]:
        name, *cases = section.rstrip().split("\n--- ")
        for edit, message in (case.split("\n") for case in cases):
            old, new = (part.encode().decode("unicode_escape").encode() for part in edit.split(" -> "))
            yield name, old, new, message


@pytest.mark.parametrize(("name", "old", "new", "message"), [*wrong_files()])
def test_what_is_wrong_is_said(name: str, old: bytes, new: bytes, message: str) -> None:
    assert old in FILES[name]
    with pytest.raises(SpecError, match=re.escape(message)):
        import_data(name, FILES[name].replace(old, new, 1))


@pytest.mark.parametrize(
    ("path", "data", "message"),
    [
        ("x.bzr", b"", "x.bzr: is empty"),
        ("<stdin>", b"hello", "<stdin>: is in no format that is known by its content or suffix; name one of trp, bv"),
        *mostly_long([(f"x.{kind}", b"hello", f"x.{kind}: Open CASCADE .*: is it") for kind in ("igs", "brep")], 0),
        ("x.3dm", b"3D Geometry File Format", r"x\.3dm: is in no format that is known"),
        ("x.json", b'{"shape": {"type": "curve"}}', r"x\.json: is in no format that is known by its content or suffix"),
        ("x.bpt", b"1 " * 6_000_000, "x.bpt: is too large, at most 10 MB are read"),
        ("x.bpt", b"%d" % (MAX_PATCHES + 1), f"a whole number from 1 to {MAX_PATCHES}, got"),
    ],
)
def test_what_is_not_such_a_file(path: str, data: bytes, message: str) -> None:
    with pytest.raises(SpecError, match=message):
        import_data(path, data)


def test_the_table_of_formats_is_one() -> None:
    assert tuple(READERS) == IMPORTS
