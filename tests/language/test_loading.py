"""Spec files: what they say, what their errors say, and that they are written as they are read."""

import copy
import json
import os
import tomllib
import unicodedata
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st

from gtb_cli.errors import DomainError, SpecError
from gtb_cli.language.document import Faults
from gtb_cli.language.keys_and_values import MAX_SIZE
from gtb_cli.language.loading import load, parse
from gtb_cli.language.writer import dump
from gtb_cli.models.model import Model
from gtb_cli.theory.patch import Patch
from tests.specs import ARC, GOOD_SPECS, SPECS, TRIANGLE, arrays

# What specs say

CURVE = Patch([0, 1, 2], [[0, 0, 0], [1, 1, 0], [2, 0, 0]], [1, 1, 1], [1, 1, 1], edge_normals="auto")

SAID = {
    """
    name = "sail"
    knots = [[0, 0], ["sqrt(2)", 0], [0, "6/5"], ["1/4", 0.25]]
    weights = [1, 2, "exp(1)", 1e-3]
    control_points = [[0, 0, 0], [1, 0, -1], ["pi", 0, 0], [0, 1, 2]]
    coefficients = [1, 1, "1/2", 4]
    lifting = [0, -1, "9 - 4*sqrt(2)", 0]
    edge_normals = "unit"
    edge_scale = [1, 2, "1/2"]
    """: Patch(
        [[0, 0], [2**0.5, 0], [0, 1.2], [0.25, 0.25]],
        [[0, 0, 0], [1, 0, -1], [np.pi, 0, 0], [0, 1, 2]],
        [1, 2, np.e, 0.001],
        [1, 1, 0.5, 4],
        lifting=[0, -1, 9 - 4 * 2**0.5, 0],
        edge_normals="unit",
        edge_scale=[1, 2, 0.5],
        name="sail",
    ),
    ARC: CURVE,
    'coefficients = [1, 1, 1, 1, 1, 1]\nknots = "grid 2x3"\n'
    "control_points = [[0, 0], [0, 1], [0, 2], [3, 0], [3, 1], [3, 9]]\n": Patch(
        [[0, 0], [0, 1], [0, 2], [1, 0], [1, 1], [1, 2]], [[0, 0], [0, 1], [0, 2], [3, 0], [3, 1], [3, 9]]
    ),
    'coefficients = "binomial"\n' + ARC: CURVE.replace(coefficients=[1, 2, 1]),
    ARC + 'coefficients = "binomial"\n': CURVE.replace(coefficients=[1, 2, 1]),
    "knots = [2, 0, 1, 0]\ncontrol_points = [[0, 0], [1, 1], [2, 0], [3, 0]]\n": Patch(
        [2, 0, 1, 0], [[0, 0], [1, 1], [2, 0], [3, 0]]
    ),
}


@pytest.mark.parametrize(("text", "patch"), SAID.items())
def test_what_specs_say(text: str, patch: Patch) -> None:
    assert parse(text) == patch


def test_an_arc_stands_for_four_control_points() -> None:
    """A quarter of a circle, with the known factor of a cubic; a side of a polygon; and points, in one list."""
    q, y = 4 * (2**0.5 - 1), -(27**0.5)
    rows = '"arc(R, 1, 90*deg)", " arc( 2*R, -1, -60*deg, 0, -pi)", [5, 0, 2], [5, 1, 2], [5, 2, 2], [5, "R", 2]'
    spec = f'knots = "grid 3x4"\nlet = {{R = 3}}\ncontrol_points = [{rows}]\ncoefficients = "binomial"'
    points = parse(spec).patches[0].control_points
    expected = [[3, 0, 1], [3, q, 1], [q, 3, 1], [0, 3, 1], *[[-6, 0, -1]] * 2, *[[-3, -y, -1]] * 2]
    np.testing.assert_allclose(points, [*expected, [5, 0, 2], [5, 1, 2], [5, 2, 2], [5, 3, 2]], rtol=0, atol=1e-14)
    with pytest.raises(SpecError, match="got 1: an arc stands without brackets of its own"):
        parse('knots = "grid 2x4"\ncontrol_points = [["arc(3, 0, 1)", "arc(4, 0, 1)"]]')


def test_models() -> None:
    model = parse(f'name = "pair"\n[[patches]]\n{ARC}[[patches]]\nname = "second"\nweights = [1, 2, 3]\n{ARC}')
    assert isinstance(model, Model)
    assert model.name == "pair"
    assert [patch.name for patch in model.patches] == [None, "second"]
    assert [patch.weights.tolist() for patch in model.patches] == [[1, 1, 1], [1, 2, 3]]
    assert isinstance(parse(f"[[patches]]\n{ARC}"), Model)


def test_json_says_the_same() -> None:
    for path in GOOD_SPECS:
        text = json.dumps(tomllib.loads(path.read_text(encoding="utf-8")))
        assert arrays(parse(text, path.name)) == arrays(load(path))


@pytest.mark.parametrize(
    ("source", "name"),
    [
        *(("shell.toml", "shell"), ("a/b/shell.v2.json", "shell.v2"), ("shell", "shell")),
        *((source, None) for source in ("-", "<stdin>", "a\nb.toml", "x" * 300 + ".toml")),
    ],
)
@pytest.mark.parametrize("text", [ARC, f"[[patches]]\n{ARC}"])
def test_the_file_stem_is_the_name_where_there_is_none(source: str, name: str | None, text: str) -> None:
    assert parse(text, source, "toml").name == name
    assert parse(f'name = "given"\n{text}', source, "toml").name == "given"


@pytest.mark.parametrize("name", ["a/b", "..", "Ω ½ 😀", 'say "hi"', "back\\slash", " padded ", "x" * 200])
def test_names_may_be_any_printable_text(name: str) -> None:
    patch = parse(json.dumps({"name": name, "knots": [0, 1], "control_points": [[0, 0], [1, 1]]}))
    assert patch.name == name
    assert parse(dump(patch)).name == name


@pytest.mark.parametrize("prefix", ["", "\ufeff", "\n\n", "# comment\n"])
@pytest.mark.parametrize("line_end", ["\n", "\r\n"])
def test_byte_order_mark_line_ends_and_comments(prefix: str, line_end: str) -> None:
    text = (prefix + ARC).replace("\n", line_end)
    assert arrays(parse(text)) == arrays(parse(text.encode())) == arrays(parse(ARC))


def test_partition_of_unity_coefficients() -> None:
    patch = parse(ARC + 'coefficients = "partition-of-unity"\n')
    assert isinstance(patch, Patch)
    # (t + (2 - t))² = 4, so that C(2, i) / 4 are the coefficients; a 3 × 3 system's roundings.
    np.testing.assert_allclose(patch.coefficients, [1 / 4, 1 / 2, 1 / 4], rtol=1e-12)


# How they are refused


def test_many_errors_are_counted() -> None:
    with pytest.raises(SpecError) as caught:
        parse(ARC + "weights = [" + "0, " * 1000 + "]\n", "x.toml")
    lines = str(caught.value).splitlines()
    assert len(lines) == Faults.SHOWN + 1
    assert lines[-1] == "x.toml: ... and 981 more"  # one for the length, 1000 for the entries


@pytest.mark.parametrize(
    "text",
    [
        f"knots = [0, {MAX_SIZE}]\ncontrol_points = [[0, 0], [-{MAX_SIZE}, {MAX_SIZE}]]\nlifting = [0, -{MAX_SIZE}]\n",
        "knots = [0, 1e-100]\ncontrol_points = [[0, 0], [5e-324, 0]]\nweights = [1.7e308, 5e-324]\n",
        f"edge_scale = {MAX_SIZE}\n{TRIANGLE}",
        f"edge_scale = [{1 / MAX_SIZE}, 1, {MAX_SIZE}]\n{TRIANGLE}",
        f"knots = [[0, 0], [{MAX_SIZE}, 0], [0, {MAX_SIZE}]]\ncontrol_points = [[0, 0], [1, 0], [0, 1]]\n",
        "knots = [0, 1e5, 2e5]\ncoefficients = 'partition-of-unity'\ncontrol_points = [[0, 0], [1, 0], [2, 0]]\n",
    ],
)
def test_extreme_numbers_give_a_patch_or_an_error_and_no_warning(text: str) -> None:
    try:
        patch = parse(text, "x")
    except SpecError as error:
        patch = None
        message = str(error)
    assert isinstance(patch, Patch) or message.startswith("x:2: coefficients: ")


def test_files_that_cannot_be_read() -> None:
    with pytest.raises(SpecError, match=r"\A/dev/zero: is too large, a spec has at most 10 MB\Z"):
        load("/dev/zero")
    with pytest.raises(SpecError, match="null"):
        load("a\0b.toml")


def test_the_suffix_decides(tmp_path: Path) -> None:
    for name, text, good in (
        ("a.toml", ARC, True),
        ("a.TOML", ARC, True),
        ("a.json", ARC, False),
        ("a.spec", ARC, True),
        ("b.json", '{"knots": [0, 1], "control_points": [[0, 0], [1, 1]]}', True),
        ("b.JSON", '{"knots": [0, 1], "control_points": [[0, 0], [1, 1]]}', True),
        ("b.toml", '{"knots": [0, 1], "control_points": [[0, 0], [1, 1]]}', False),
        ("b", ' \n{"knots": [0, 1], "control_points": [[0, 0], [1, 1]]}', True),
    ):
        (tmp_path / name).write_text(text)
        if good:
            assert load(os.fspath(tmp_path / name)).name == name[0]
        else:
            with pytest.raises(SpecError, match="is not valid"):
                load(tmp_path / name)


# How they are written


def is_of_a_name(character: str) -> bool:
    return unicodedata.category(character) not in ("Cc", "Cs", "Zl", "Zp")


@st.composite
def patches(draw: st.DrawFn) -> Patch:
    number = st.one_of(
        st.integers(-9, 9).map(float),
        st.floats(-1e9, 1e9),
        st.floats(-MAX_SIZE, MAX_SIZE),
        st.sampled_from([-0.0, 0.1, 1 / 3, 1e15, 1e16, -1e22, 5e-324, 123456789.123456789]),
    )
    positive = st.one_of(st.just(1.0), st.floats(5e-324, 1.7e308))
    scale = st.one_of(st.just(1.0), st.floats(1e-9, 1e9))
    dimension = draw(st.sampled_from([1, 2]))
    n = draw(st.integers(dimension + 1, 8))

    def rows(values: st.SearchStrategy[float], width: int) -> list[list[float]]:
        return draw(st.lists(st.lists(values, min_size=width, max_size=width), min_size=n, max_size=n))

    knots = rows(number, dimension)
    name = st.text(st.integers(32, 0x10FFFF).map(chr).filter(is_of_a_name), min_size=1, max_size=20)
    try:
        patch = Patch(
            knots,
            rows(number, draw(st.sampled_from([2, 3]))),
            np.ravel(rows(positive, 1)),
            np.ravel(rows(positive, 1)),
            edge_normals=draw(st.sampled_from(["auto", "unit"])),
            edge_scale=draw(scale),
            lifting=draw(st.sampled_from([None, np.ravel(rows(number, 1))])),
            name=draw(st.none() | name.filter(str.strip)),
        )
        edges = len(patch.domain.vertices)
        if draw(st.booleans()):
            factors = draw(st.lists(scale, min_size=edges, max_size=edges))
            patch = Patch(knots, patch.control_points, edge_scale=factors, name=patch.name)
    except DomainError:
        assume(False)
    return patch


@given(patches())
def test_written_specs_are_read_exactly(patch: Patch) -> None:
    text = dump(patch)
    again = parse(text)
    assert arrays(again) == arrays(patch)
    assert np.signbit(again.knots).tolist() == np.signbit(patch.knots).tolist()  # type: ignore[union-attr]
    assert dump(again) == text
    assert all(len(line) <= 120 for line in text.splitlines())


@given(st.lists(patches(), min_size=1, max_size=3), st.none() | st.just("body"))
def test_written_models_are_read_exactly(parts: list[Patch], name: str | None) -> None:
    model = Model(tuple(part for part in parts if part.dimension == parts[0].dimension), name)
    again = parse(dump(model))
    assert isinstance(again, Model)
    assert again.name == name
    assert arrays(again) == arrays(model)


def test_what_is_written_is_short_and_long_lists_are_in_lines() -> None:
    assert dump(parse(ARC)) == ARC
    text = f'name = "arc"\nknots = [0, 0.1, 2]\nweights = [1, 1e-20, 1e+17]\n{ARC.splitlines()[1]}\n'
    assert dump(parse(text)) == text
    text = dump(load(SPECS / "hexagon.toml"))
    assert text.startswith('name = "hexagon"\nknots = [\n    [4, 0], [2, 3.4641016151377544],')
    assert max(map(len, text.splitlines())) <= 100


@pytest.mark.parametrize(("name", "fault"), [("a\nb", "must not have control characters"), (" ", "must not be empty")])
def test_what_cannot_be_written(name: str, fault: str) -> None:
    with pytest.raises(SpecError, match=f"name: {fault}"):
        dump(Patch([0, 1], [[0, 0], [1, 1]], name=name))


def test_weights_beyond_floats_are_written_as_logarithms() -> None:
    patch = Patch([0, 1, 2], [[0, 0], [1, 1], [2, 0]], log_weights=[0, 1000, -1000])
    text = dump(patch)
    assert "log_weights = [0, 1000, -1000]" in text
    assert "\nweights" not in text
    assert parse(text) == patch


@pytest.mark.parametrize("reach", [np.nextafter(MAX_SIZE, np.inf), np.inf, np.nan])
def test_what_no_spec_may_have_is_not_written(reach: float) -> None:
    """`gtb fill --fullness 1e101` printed what every other command refused."""
    kept = Patch([0, 1], [[0, 0], [MAX_SIZE, 0]])
    assert parse(dump(kept)) == kept
    points = kept.control_points.copy()
    points[1, 2] = reach
    beyond = copy.copy(kept)
    object.__setattr__(beyond, "control_points", points)  # whether a patch may have them is not asked here
    for spec in (beyond, Model((kept, beyond))):
        with pytest.raises(SpecError, match=r"control_points: the result has numbers beyond 1e\+100 in size"):
            dump(spec)
