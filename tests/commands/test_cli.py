"""Commands and options, run in this process; what only real processes show is in test_shell.py."""

import io
import json
import math
import os
import tomllib
from pathlib import Path

import click
import jsonschema
import numpy as np
import pytest
import trimesh
from hypothesis import example, given
from hypothesis import strategies as st

import gtb_cli
from gtb_cli.commands.cli import COMMANDS
from gtb_cli.commands.cli import gtb as group
from gtb_cli.commands.evaluate import BATCH_LINES
from gtb_cli.errors import GtbError
from gtb_cli.formats.meshfiles import read_mesh
from gtb_cli.shell import console, streams
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.vocabulary import FORMATS
from tests.shell import BICUBIC, CURVE, PENTAGON, SPECS, gtb

TRIANGLE = b"knots = [[0, 0], [1, 0], [0, 1]]\ncontrol_points = [[0, 0, 0], [1, 0, 0], [0, 1, 1]]\n"


# --- the group


def test_help_lists_every_command():
    result = gtb("--help")
    assert result.status == 0
    for name, summary in COMMANDS.items():
        assert f"  {name} " in result.text
        assert summary in " ".join(result.text.split())


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_says_what_it_does(name):
    command = group.get_command(click.Context(group), name)
    for parameter in command.params:
        if isinstance(parameter, click.Option):
            assert parameter.help
            assert parameter.help.endswith(".")
            assert any(option.startswith("--") for option in parameter.opts)
    shown = gtb(name, "--help").text
    assert all(option in shown for parameter in command.params for option in parameter.opts if option.startswith("-"))


@pytest.mark.parametrize("name", COMMANDS)
def test_help_opens_with_an_example(name):
    lines = [line for line in gtb(name, "--help").text.splitlines() if line.strip()]
    assert lines[0].startswith(f"Usage: gtb {name}")
    assert lines[1].startswith("  Example: ")
    assert f"gtb {name}" in lines[1]


def test_unexpected_errors_are_reported_without_traceback(monkeypatch):
    def broken(*arguments):
        raise RuntimeError("surprise")

    monkeypatch.setattr("gtb_cli.language.loading.load", broken)
    monkeypatch.delenv("GTB_TRACEBACK", raising=False)
    shown = gtb("elevate", PENTAGON, status=2).err
    assert shown.startswith("gtb: error: internal error, please report it: RuntimeError: surprise")
    assert shown.count("\n") == 1
    monkeypatch.setenv("GTB_TRACEBACK", "1")
    assert "Traceback" in gtb("elevate", PENTAGON, status=2).err


@pytest.mark.parametrize("error", [MemoryError(), SystemError("error return without exception set")])
def test_too_little_memory_is_an_error(error, monkeypatch):
    def hungry(*arguments, **options):
        raise error

    monkeypatch.setattr("gtb_cli.tessellation.tessellate.tessellate", hungry)
    result = gtb("mesh", PENTAGON, status=2)
    assert (result.out, result.err) == (b"", f"gtb: error: {PENTAGON}: not enough memory for this\n")


# --- mesh


def vertices_of(text: str, kind: str = "v") -> np.ndarray:
    return np.array([line.split()[1:] for line in text.splitlines() if line.startswith(f"{kind} ")], dtype=float)


def test_mesh_to_standard_output_is_obj():
    expected = tessellate(gtb_cli.load(PENTAGON), 32).vertices
    np.testing.assert_allclose(vertices_of(gtb("mesh", PENTAGON).text), expected, atol=1e-8)


def test_y_may_be_up(tmp_path):
    """(x, y, z) becomes (x, z, -y), in all formats, with normals, in models and in sequences; areas stay."""
    plain, turned = (gtb("mesh", PENTAGON, "-n", 3, "--normals", *up).text for up in ([], ["--up", "y"]))
    for kind in ("v", "vn"):
        before, after = vertices_of(plain, kind), vertices_of(turned, kind)
        assert np.array_equal(after, np.stack([before[:, 0], before[:, 2], -before[:, 1]], axis=1))
    assert " -0.00000000" not in turned
    assert gtb("mesh", PENTAGON, "-n", 3, "--normals", "--up", "z").text == plain
    sequence = ["degenerate", SPECS / "example-3.4.toml", "-x5", "-n2", "--no-distance", "--up", "y"]
    assert gtb(*sequence, "-o", tmp_path / "folder").status == 0
    first = vertices_of((tmp_path / "folder" / "example-3.4-x5.obj").read_text())
    assert np.ptp(first[:, 2]) > 0 == np.ptp(first[:, 1])  # a plane curve: its y is -z now


@pytest.mark.parametrize("name", ["pentagon", "hebesphenorotunda", "example-3.1"])
def test_y_is_up_in_glb_and_meshes_that_are_read_stand_as_in_the_spec(name, tmp_path):
    """glTF 2.0, section 3.3: +Y is up. So viewers show it, and trimesh gives the numbers of the file."""
    spec, path, lying, manifest = SPECS / f"{name}.toml", tmp_path / "a.glb", tmp_path / "z.glb", tmp_path / "m.json"
    low, high = tessellate(gtb_cli.load(spec), 2).bounds
    upright = [[low[0], low[2], -high[1]], [high[0], high[2], -low[1]]]
    for file, options, up, bounds in ((path, [], "y", upright), (lying, ["--up", "z"], "z", [low, high])):
        assert gtb("mesh", spec, "-n", 2, *options, "-o", file, "--manifest", manifest).status == 0
        found = json.loads(manifest.read_text())
        assert found["options"]["up"] == up
        np.testing.assert_allclose(found["files"][0]["bounds"], bounds, atol=1e-12)
        np.testing.assert_allclose(trimesh.load_scene(file).bounds, bounds, atol=1e-5)
        np.testing.assert_allclose(read_mesh(file).bounds, [low, high], atol=1e-5)
        same = gtb("diff", file, spec, "-n", 2)
        assert (same.status, "the same faces" in same.text) == (0, True)
    assert gtb("diff", path, lying).status == 0


def test_y_is_up_in_an_animation(tmp_path):
    sequence = ["degenerate", SPECS / "example-3.4.toml", "-x5", "-n2", "--no-distance"]
    for name, options in (("folder", []), ("y.glb", []), ("z.glb", ["--up", "z"])):
        assert gtb(*sequence, *options, "-o", tmp_path / name).status == 0
    first = vertices_of((tmp_path / "folder" / "example-3.4-x5.obj").read_text())
    upright, lying = (trimesh.load_scene(tmp_path / name).bounds for name in ("y.glb", "z.glb"))
    np.testing.assert_allclose(lying, [first.min(axis=0), first.max(axis=0)], atol=1e-6)
    np.testing.assert_allclose(upright[:, 2], -lying[::-1, 1], atol=1e-6)
    for name in ("y.glb", "z.glb"):
        np.testing.assert_allclose(read_mesh(tmp_path / name).vertices, first, atol=1e-6)


def test_tolerance_in_percent_is_of_the_diagonal_of_the_surface():
    low, high = tessellate(gtb_cli.load(PENTAGON), 400, parametrization="toric", normals=False).bounds
    diagonal = math.dist(low, high)
    percent = gtb("mesh", PENTAGON, "--tolerance", "1%")
    same = gtb("mesh", PENTAGON, "--tolerance", f"{diagonal / 100 * 0.999}")
    assert percent.status == same.status == 0
    # The diagonal is measured on a coarser mesh: up to 0.1 % less.
    assert abs(len(percent.out) - len(same.out)) < 0.05 * len(same.out)
    assert len(gtb("mesh", PENTAGON, "--tolerance", "0.1%").out) > 4 * len(percent.out)


# --- mesh of several specs


@pytest.fixture
def specs(tmp_path):
    """Three good specs in a folder."""
    folder = tmp_path / "in"
    folder.mkdir()
    for name in ("a.toml", "b c.toml", "d.toml"):
        (folder / name).write_bytes(TRIANGLE)
    return folder


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("kind", FORMATS)
def test_several_specs_in_any_format(specs, tmp_path, kind):
    assert gtb("mesh", *sorted(specs.iterdir()), "-o", tmp_path / "out", "-f", kind, "-q").err == ""
    assert names(tmp_path / "out") == [f"a.{kind}", f"b c.{kind}", f"d.{kind}"]


def test_names_of_files_do_nothing_to_a_terminal(specs, tmp_path):
    path = specs / "a\x1b[2J.toml"
    path.write_bytes(TRIANGLE)
    assert gtb("mesh", path, "-n", 1, "-o", tmp_path / "\x9b2J.obj").err == (
        f"gtb: {tmp_path}/\\x9b2J.obj: 3 vertices, 1 faces\n"
    )
    path = specs / "a\nb.toml"
    path.write_bytes(b"knots = [[0, 0]]")
    err = gtb("info", path, status=2).err
    assert err.count(f"gtb: error: {specs}/a\\nb.toml:") == err.count("\n") == 2


# Its number, but for halves of pairs, which no text has
ANY_CHARACTER = st.integers(0, 0xD7FF) | st.integers(0xE000, 0x10FFFF)


@given(st.lists(ANY_CHARACTER.map(chr)).map("".join) | st.text("aé😀 .-", min_size=100, max_size=300))
@example("a" * (streams.MAX_STEM_BYTES - 1) + " b")
def test_file_stems_stay_in_their_folder(name):
    stem = streams.file_stem(name)
    assert stem
    assert stem[0] not in ".- "
    assert not set(stem) & set('/\\:*?"<>|\0\n\r\t')
    assert len(stem.encode("utf-8")) <= streams.MAX_STEM_BYTES
    assert streams.file_stem(stem) == stem


# --- eval


def rows(text: bytes) -> np.ndarray:
    return np.array([line.split() for line in text.decode().splitlines()], dtype=float)


def test_eval_gives_digits_that_read_back_exactly():
    u = np.array([[0.5, 1.5], [2, 0], [0, 0.1], [1 / 3, 2 / 3]])
    text = "".join(f"{a!r} {b!r}\n" for a, b in u.tolist()).encode()
    patch = gtb_cli.load(PENTAGON)
    assert (rows(gtb("eval", PENTAGON, stdin=text).out) == patch.evaluate(u)).all()
    assert (rows(gtb("eval", PENTAGON, "--basis", stdin=text).out) == patch.basis(u)).all()
    assert gtb("eval", PENTAGON, stdin=b"2 1").out == b"2.0 1.0 2.0\n"


def test_eval_of_a_curve_takes_one_number(tmp_path):
    path = tmp_path / "t.txt"
    path.write_text("0\n1.5\n3\n", encoding="utf-8")
    result = gtb("eval", CURVE, path)
    assert (rows(result.out) == gtb_cli.load(CURVE).evaluate([0, 1.5, 3])).all()


def test_eval_as_json():
    found = json.loads(gtb("eval", PENTAGON, "--json", stdin=b"0.5 1.5\n\n2 0\n").out)
    patch = gtb_cli.load(PENTAGON)
    assert found == {
        "points": patch.evaluate([[0.5, 1.5], [2, 0]]).tolist(),
        "parameters": [[0.5, 1.5], [2.0, 0.0]],
    }
    basis = json.loads(gtb("eval", PENTAGON, "--json", "--basis", stdin=b"0.5 1.5\n").out)
    assert basis["basis"] == patch.basis([[0.5, 1.5]]).tolist()


def test_eval_puts_parameters_in_front_below_a_header():
    result = gtb("eval", PENTAGON, "--basis", "--header", stdin=b"0.5 1.5\n1 1\n")
    header, *lines = result.text.splitlines()
    assert header.split() == ["u", "v", *(f"T{i}" for i in range(8))]
    plain = gtb("eval", PENTAGON, "--basis", stdin=b"0.5 1.5\n1 1\n").text.splitlines()
    assert lines == [f"0.5 1.5 {plain[0]}", f"1.0 1.0 {plain[1]}"]
    assert gtb("eval", CURVE, "--header", stdin=b"0\n").text.startswith("t x y z\n0.0 1.0 0.0 0.0\n")


def test_eval_linearly_has_linear_precision():
    """With the values of the basis at p, the knots sum up to p: mathematics.md, section 2."""
    text = b"0.5 1.5\n0 0.7\n1.9 0.05\n2 1\n"
    patch = gtb_cli.load(PENTAGON)
    basis = rows(gtb("eval", PENTAGON, "--basis", "--parametrization", "linear", stdin=text).out)
    np.testing.assert_allclose(basis @ patch.knots, rows(text), atol=1e-11)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"1 1\n" * (BATCH_LINES + 5) + b"\n0 -1\n", f"<stdin>:{BATCH_LINES + 7}: (0.0, -1.0) is outside the domain"),
        (b"1 " * 100 + b"\n", "<stdin>:1: expected 2 numbers, got 100"),
        (b"1 1\n" + b"1 " * 10_000, "<stdin>:2: a line of more than 10000 characters"),
    ],
)
@pytest.mark.parametrize("parametrization", ["toric", "linear"])
def test_eval_names_the_wrong_line_of_many(text, message, parametrization):
    result = gtb("eval", PENTAGON, "--parametrization", parametrization, stdin=text)
    assert result.status == 2
    assert result.err.startswith(f"gtb: error: {message}")
    assert result.err.count("\n") == 1


def test_eval_of_many_lines():
    u = np.random.default_rng(5).uniform(0, 3, (2 * BATCH_LINES + 3, 2))
    text = b"".join(b"%r %r\n" % tuple(row) for row in u.tolist())
    np.testing.assert_allclose(
        rows(gtb("eval", BICUBIC, stdin=text).out), gtb_cli.load(BICUBIC).evaluate(u), rtol=0, atol=1e-14
    )


# --- info


def test_info_sees_the_scale_of_the_normals():
    text = Path(PENTAGON).read_bytes() + b'\nedge_normals = "unit"\n'
    found = json.loads(gtb("info", "-", "--json", stdin=text).out)
    assert found["edge_normals"] == "unit"
    assert round(found["linear_precision_error"], 2) == 0.22  # mathematics.md, section 7


def test_info_of_a_curve_and_of_repeated_knots():
    found = json.loads(gtb("info", CURVE, "--json").out)
    assert found["dimension"] == 1
    assert found["edges"] == [[0], [3]]
    assert found["edge_normals"] is None
    assert "knots of end 0    0\n" in gtb("info", CURVE).text
    repeated = json.loads(gtb("info", SPECS / "repeated-knot.toml", "--json").out)
    groups = repeated["repeated_knots"]
    knots = gtb_cli.load(SPECS / "repeated-knot.toml").knots
    assert len(groups) == 1
    assert len({tuple(knots[i]) for i in groups[0]}) == 1
    assert len(groups[0]) == 2


def test_info_of_a_bernstein_patch_has_linear_precision():
    text = b'knots = [0, 1, 2, 3]\ncontrol_points = [[0, 0], [1, 1], [2, 2], [3, 3]]\ncoefficients = "binomial"\n'
    assert json.loads(gtb("info", "-", "--json", stdin=text).out)["linear_precision_error"] < 1e-15


# --- schema


def test_schema_is_json_schema():
    schema = json.loads(gtb("schema").out)
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(tomllib.loads(Path(PENTAGON).read_text(encoding="utf-8")), schema)


# --- messages


def test_errors_name_what_they_are_about():
    with pytest.raises(GtbError, match=r"a.toml: one\na.toml: two"), streams.about("a.toml"):
        raise GtbError("one\ntwo")


def test_what_takes_long_is_counted_on_a_terminal(monkeypatch):
    class Terminal(io.StringIO):
        isatty = staticmethod(lambda: True)
        fileno = staticmethod(lambda: 2)

    shown, clock = Terminal(), iter([0.0, 1.0, 3.0, 4.0])
    monkeypatch.setattr(console.sys, "stderr", shown)
    monkeypatch.setattr(console.time, "monotonic", lambda: next(clock))
    monkeypatch.setattr(console.os, "get_terminal_size", lambda descriptor: os.terminal_size((12, 24)))
    with console.Console().counter(3) as begin:
        for label in ("a.toml", "b.toml", "c.toml"):
            begin(label)
    assert shown.getvalue() == "\r\r[2/3] b.tom\r" + " " * 11 + "\r[3/3] c.tom\r" + " " * 11 + "\r"


def test_help_says_what_options_take_and_what_they_are_without():
    """In the words of the project: click's own, such as INTEGER RANGE, name neither the unit nor the number."""
    for name in COMMANDS:
        text = gtb("help", name).text
        assert "INTEGER" not in text
        assert "TEXT" not in text.replace("CONTEXT", "")
    assert "Exit status" in gtb("help", "diff").text
    assert "status is 2; it is 1" in " ".join(gtb("help", "mesh").text.split())
