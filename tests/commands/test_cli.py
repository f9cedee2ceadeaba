"""Commands and options, run in this process; what only real processes show is in test_shell.py."""

import io
import json
import math
import os
from pathlib import Path

import click
import numpy as np
import pytest
import trimesh
from hypothesis import example, given
from hypothesis import strategies as st

import gtb_cli
from gtb_cli.commands.cli import COMMANDS
from gtb_cli.commands.cli import gtb as group
from gtb_cli.commands.evaluate import BATCH_LINES, MAX_LINE_BYTES, READ_BYTES
from gtb_cli.errors import GtbError
from gtb_cli.formats.meshfiles import read_mesh
from gtb_cli.shell import console, streams
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.vocabulary import FORMATS
from tests.shell import BICUBIC, CURVE, PENTAGON, SPECS, gtb

TWO = b"""
name = "two"
[[patches]]
knots = [[0, 0], [1, 0], [0, 1]]
control_points = [[0, 0, 0], [1, 0, 0], [0, 1, 1]]
lifting = [0, 0, 1]
[[patches]]
knots = [[0, 0], [1, 0], [1, 1], [0, 1]]
control_points = [[5, 0, 0], [6, 0, 0], [6, 1, 0], [5, 1, 0]]
lifting = [0, 1, 0, 0]
"""
TRIANGLE = b"knots = [[0, 0], [1, 0], [0, 1]]\ncontrol_points = [[0, 0, 0], [1, 0, 0], [0, 1, 1]]\n"
BROKEN = b"knots = [[0, 0], [1, 0], [0, 1]]\nweights = [1, -1, 1]\n"


def failure(result) -> list[str]:
    """Lines of a run that failed as it should: nothing on standard output, and each line an error."""
    assert result.status == 2
    assert result.out == b""
    lines = result.err.splitlines()
    assert lines
    assert all(line.startswith("gtb: error: ") for line in lines)
    return [line.removeprefix("gtb: error: ") for line in lines]


def one_line(result) -> str:
    lines = failure(result)
    assert len(lines) == 1
    return lines[0]


def vertices(text: bytes) -> np.ndarray:
    return np.array([line.split()[1:] for line in text.decode().splitlines() if line.startswith("v ")], dtype=float)


# --- the group


def test_help_lists_every_command():
    result = gtb("--help")
    assert result.status == 0
    for name, (_, summary) in COMMANDS.items():
        assert f"  {name} " in result.text
        assert summary in " ".join(result.text.split())


def test_version():
    assert gtb("--version").text == f"gtb {gtb_cli.__version__}\n"


def test_no_arguments_show_the_help_as_an_error():
    result = gtb()
    assert result.status == 2
    assert result.out == b""
    assert result.err.startswith("Usage: gtb ")


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


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["mehs"], "No such command: mehs. Did you mean mesh?"),
        (["qqq"], "No such command: qqq. Try 'gtb --help'."),
        ([""], "No such command: ''."),
        (["--frob"], "No such option"),
        (["mesh", "--nrmals"], "No such option '--nrmals'. Did you mean --normals?"),
        (["mesh"], "Missing argument 'SPEC...'. Try 'gtb mesh --help'."),
        (["mesh", PENTAGON, "--normal"], "--normals"),
        (["mesh", PENTAGON, "-f", "fbx"], "'fbx' is not one of 'obj', 'ply', 'stl', 'glb'"),
        (["mesh", PENTAGON, "-n"], "requires an argument"),
        (["mesh", PENTAGON, "-n", "0"], "0 is not in the range"),
        (["mesh", PENTAGON, "-n", "-3"], "-3 is not in the range"),
        (["mesh", PENTAGON, "-n", "1.5"], "expected a whole number from 1 to 100000000, got '1.5'"),
        (["mesh", PENTAGON, "-n", "9" * 5000], "expected a whole number from 1 to 100000000, got '999"),
        (["mesh", PENTAGON, "-j", "-1"], "-1 is not in the range"),
        (["mesh", PENTAGON, "--max-faces", "0"], "0 is not in the range"),
        (["mesh", PENTAGON, "-n", "3", "--tolerance", "1"], "-n and --tolerance exclude each other"),
        (["mesh", PENTAGON, "--parametrization", "cubic"], "'cubic' is not one of 'linear', 'toric'"),
        (["mesh", PENTAGON, "--spec-format", "yaml"], "'yaml' is not one of 'toml', 'json'"),
        (["mesh", "-", "-"], "standard input can be read only once"),
        (["mesh", PENTAGON, BICUBIC], "2 specs need a folder"),
        (["mesh", PENTAGON, BICUBIC, "-o", "x.obj"], "2 specs need a folder for their meshes, and x.obj names a file"),
        (["mesh", PENTAGON, "-o", PENTAGON], "is read by this command, and would be overwritten"),
        (["mesh", PENTAGON, "-o", "x.fbx"], "cannot tell the format of x.fbx"),
        (["mesh", PENTAGON, "-o", "x"], "cannot tell the format of x:"),
        (["mesh", PENTAGON, "-o", ""], "cannot tell the format of '':"),
        (["mesh", CURVE, "-f", "stl"], "cubic-bezier.toml: STL holds triangles, and a curve has none"),
        (["mesh", PENTAGON, "-f", "glb", "--ascii"], "pentagon.toml: GLB has no text form"),
        (["mesh", "/nothing/there.toml"], "/nothing/there.toml: No such file or directory"),
        (["elevate", str(SPECS)], "specs: Is a directory"),
        (["mesh", ""], "'': No such file or directory"),
        (["eval", PENTAGON, ""], "'': No such file or directory"),
        (["mesh", "\x1b[2J\u2028.toml"], "\\x1b[2J\\u2028.toml: No such file or directory"),
        (["elevate", PENTAGON, PENTAGON], "unexpected extra argument"),
        (["eval", "-", "-"], "cannot both be standard input"),
        (["eval", PENTAGON, "/nothing/there"], "/nothing/there: No such file or directory"),
        (["eval", PENTAGON, str(SPECS)], "specs: Is a directory"),
        (["decompose", BICUBIC], "bicubic.toml: has no lifting"),
        (["decompose", BICUBIC, "--lifting", "1,2"], "bicubic.toml: lifting: expected 16"),
        (["decompose", BICUBIC, "--lifting", "1,frog"], "unknown name 'frog'"),
        (["decompose", BICUBIC, "--lifting", ""], "--lifting"),
    ],
)
def test_usage_errors_are_one_line(arguments, message):
    assert message in one_line(gtb(*arguments))


@pytest.mark.parametrize("text", ["0", "-1", "nan", "inf", "1e999", "", "%", "abc", "1%%", "1 2", "1_0", "٣"])
def test_bad_tolerances(text):
    assert "is not a positive number or percentage" in one_line(gtb("mesh", PENTAGON, "--tolerance", text))


def test_all_errors_of_a_spec_are_lines():
    lines = failure(gtb("info", "-", stdin=BROKEN))
    assert len(lines) == 2
    assert lines[0].startswith("<stdin>: control_points: is missing")
    assert lines[1].startswith("<stdin>:2: weights[1]: must be positive, got -1")


def test_unexpected_errors_are_reported_without_traceback(monkeypatch):
    def broken(*arguments):
        raise RuntimeError("surprise")

    monkeypatch.setattr("gtb_cli.language.loading.load", broken)
    monkeypatch.delenv("GTB_TRACEBACK", raising=False)
    assert one_line(gtb("elevate", PENTAGON)).startswith("internal error, please report it: RuntimeError: surprise")
    monkeypatch.setenv("GTB_TRACEBACK", "1")
    assert "Traceback" in gtb("elevate", PENTAGON, status=2).err


@pytest.mark.parametrize("error", [MemoryError(), SystemError("error return without exception set")])
def test_too_little_memory_is_an_error(error, monkeypatch):
    def hungry(*arguments, **options):
        raise error

    monkeypatch.setattr("gtb_cli.tessellation.tessellate.tessellate", hungry)
    assert one_line(gtb("mesh", PENTAGON)) == "not enough memory for this"


# --- mesh


def test_mesh_to_standard_output_is_obj():
    result = gtb("mesh", PENTAGON)
    assert result.status == 0
    assert result.err == ""
    found = vertices(result.out)
    expected = tessellate(gtb_cli.load(PENTAGON), 32).vertices
    np.testing.assert_allclose(found, expected, atol=1e-8)


@pytest.mark.parametrize("options", [["-n", "32"], ["-o", "-"], ["-f", "obj"], ["-f", "OBJ"]])
def test_defaults(options):
    assert gtb("mesh", PENTAGON, *options).out == gtb("mesh", PENTAGON).out


@pytest.mark.parametrize(
    ("name", "options", "start"),
    [
        ("x.obj", [], b"v "),
        ("x.OBJ", [], b"v "),
        ("x.ply", [], b"ply\nformat binary_little_endian"),
        ("x.ply", ["--ascii"], b"ply\nformat ascii"),
        ("x.stl", ["--ascii"], b"solid pentagon"),
        ("x.glb", [], b"glTF"),
        ("x.obj", ["-f", "glb"], b"glTF"),
        ("no suffix", ["-f", "ply"], b"ply"),
    ],
)
def test_format_is_that_of_the_option_or_the_suffix(tmp_path, name, options, start):
    result = gtb("mesh", PENTAGON, "-n", 4, "-o", tmp_path / name, *options)
    assert result.status == 0
    assert (tmp_path / name).read_bytes().startswith(start)


def test_binary_formats_go_to_standard_output_too(tmp_path):
    for kind in ("ply", "stl", "glb"):
        gtb("mesh", PENTAGON, "-n", 4, "-o", tmp_path / f"x.{kind}")
        assert gtb("mesh", PENTAGON, "-n", 4, "-f", kind).out == (tmp_path / f"x.{kind}").read_bytes()


def test_a_written_file_is_reported_unless_quiet(tmp_path):
    path = tmp_path / "x.obj"
    result = gtb("mesh", PENTAGON, "-n", 4, "-o", path)
    assert result.out == b""
    assert result.err == f"gtb: {path}: 51 vertices, 80 faces\n"  # 1 + 5 (1 + 2 + 3 + 4), and 5 · 4²
    assert gtb("mesh", PENTAGON, "-n", 4, "-o", path, "--quiet").err == ""
    assert gtb("mesh", CURVE, "-n", 4, "-o", path).err == f"gtb: {path}: 5 vertices, 4 segments\n"


def test_warnings_can_be_silenced(tmp_path):
    options = ["mesh", CURVE, "-n", 4, "-o", tmp_path / "x.ply"]
    assert "gtb: warning: " in gtb(*options).err
    assert gtb(*options, "-q").err == ""


def test_normals_and_uv_are_written_when_asked_for():
    text = gtb("mesh", PENTAGON, "-n", 4, "--normals", "--uv").text
    assert len([line for line in text.splitlines() if line.startswith("vn ")]) == 51
    assert len([line for line in text.splitlines() if line.startswith("vt ")]) == 51
    assert "vn" not in gtb("mesh", PENTAGON, "-n", 4).text


def vertices_of(text: str, kind: str = "v") -> np.ndarray:
    return np.array([line.split()[1:] for line in text.splitlines() if line.startswith(f"{kind} ")], dtype=float)


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


def test_parametrization_moves_vertices_only():
    toric, linear, default = (
        gtb("mesh", PENTAGON, *options).out
        for options in (["--parametrization", "toric"], ["--parametrization", "linear"], [])
    )
    assert linear == default
    assert toric != linear
    assert [line for line in toric.splitlines() if line[:1] == b"f"] == [
        line for line in linear.splitlines() if line[:1] == b"f"
    ]


def test_tolerance_in_percent_is_of_the_diagonal_of_the_surface():
    low, high = tessellate(gtb_cli.load(PENTAGON), 400, parametrization="toric", normals=False).bounds
    diagonal = math.dist(low, high)
    percent = gtb("mesh", PENTAGON, "--tolerance", "1%")
    same = gtb("mesh", PENTAGON, "--tolerance", f"{diagonal / 100 * 0.999}")
    assert percent.status == same.status == 0
    # The diagonal is measured on a coarser mesh: up to 0.1 % less.
    assert abs(len(percent.out) - len(same.out)) < 0.05 * len(same.out)
    assert len(gtb("mesh", PENTAGON, "--tolerance", "0.1%").out) > 4 * len(percent.out)


def test_a_percentage_of_a_point_is_refused(tmp_path):
    spec = tmp_path / "point.toml"
    spec.write_text("knots = [[0, 0], [1, 0], [0, 1]]\ncontrol_points = [[1, 1, 1], [1, 1, 1], [1, 1, 1]]\n")
    message = one_line(gtb("mesh", spec, "--tolerance", "5%"))
    assert message == f"{spec}: tolerance: 5% of the size of a single point is nothing"


def test_too_many_faces_are_refused_with_their_number():
    message = one_line(gtb("mesh", PENTAGON, "-n", 2000))
    assert message == (
        f"{PENTAGON}: -n 2000 makes 20000000 faces, more than 5000000: "
        "take a smaller -n, or allow them with --max-faces 20000000"
    )
    assert "-n 10 makes 500 faces, more than 499" in one_line(gtb("mesh", PENTAGON, "-n", 10, "--max-faces", 499))
    assert gtb("mesh", PENTAGON, "-n", 10, "--max-faces", 500).status == 0
    assert one_line(gtb("mesh", "-", "-n", 10, "--max-faces", 299, stdin=TWO)).startswith("<stdin>: ")  # 100 + 2 · 100
    assert gtb("mesh", "-", "-n", 10, "--max-faces", 300, stdin=TWO).status == 0


def test_more_faces_than_memory_are_refused():
    message = one_line(gtb("mesh", PENTAGON, "-n", 10**8, "--max-faces", 10**30))
    assert "GB of memory, this machine has" in message


def test_a_model_is_one_mesh_with_groups():
    text = gtb("mesh", "-", "-n", 3, stdin=TWO).text
    assert [line for line in text.splitlines() if line.startswith("g ")] == ["g patch0", "g patch1"]
    assert len(vertices(text.encode())) == 10 + 16


@pytest.mark.parametrize("options", [[], ["--spec-format", "toml"]])
def test_a_spec_may_come_from_standard_input(options):
    assert gtb("mesh", "-", *options, stdin=Path(PENTAGON).read_bytes()).out == gtb("mesh", PENTAGON).out


def test_spec_format_beats_the_suffix(tmp_path):
    path = tmp_path / "spec.toml"
    path.write_text('{"knots": [0, 1], "control_points": [[0, 0], [1, 1]]}', encoding="utf-8")
    assert "is not valid TOML" in one_line(gtb("info", path))
    assert json.loads(gtb("info", path, "--json", "--spec-format", "json").out)["name"] == "spec"


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


def test_several_specs_become_files_of_a_new_folder(specs, tmp_path):
    out = tmp_path / "deep" / "out"
    result = gtb("mesh", *sorted(specs.iterdir()), "-o", out, "-n", 2)
    assert result.status == 0
    assert names(out) == ["a.obj", "b c.obj", "d.obj"]
    assert result.err == "".join(f"gtb: {out / name}: 6 vertices, 4 faces\n" for name in names(out))
    single = gtb("mesh", specs / "a.toml", "-n", 2).out
    assert (out / "a.obj").read_bytes() == single


@pytest.mark.parametrize("kind", FORMATS)
def test_several_specs_in_any_format(specs, tmp_path, kind):
    assert gtb("mesh", *sorted(specs.iterdir()), "-o", tmp_path / "out", "-f", kind, "-q").err == ""
    assert names(tmp_path / "out") == [f"a.{kind}", f"b c.{kind}", f"d.{kind}"]


def test_one_spec_goes_into_a_folder_too(specs, tmp_path):
    (tmp_path / "there").mkdir()
    assert gtb("mesh", specs / "a.toml", "-o", tmp_path / "there").status == 0
    assert gtb("mesh", specs / "a.toml", "-o", f"{tmp_path}/new/", "-f", "ply").status == 0
    assert names(tmp_path / "there") == ["a.obj"]
    assert names(tmp_path / "new") == ["a.ply"]


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


@pytest.mark.parametrize(("name", "file"), [("../../up", "_._.._up.obj"), ("a/b", "a_b.obj"), ("", "patch.obj")])
def test_a_name_from_standard_input_stays_in_the_folder(specs, tmp_path, name, file):
    text = (f'name = "{name}"\n'.encode() if name else b"") + TRIANGLE
    assert gtb("mesh", "-", specs / "a.toml", "-o", tmp_path / "out", stdin=text).status == 0
    assert names(tmp_path / "out") == sorted(["a.obj", file])


def test_two_specs_of_one_name_are_refused(specs, tmp_path):
    other = tmp_path / "a.json"
    other.write_text('{"knots": [0, 1], "control_points": [[0, 0], [1, 1]]}', encoding="utf-8")
    message = one_line(gtb("mesh", specs / "a.toml", other, "-o", tmp_path / "out"))
    assert message.startswith(f"{specs / 'a.toml'} and {other} would both be written to a.obj")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_bad_spec_among_several_is_left_out(specs, tmp_path, jobs):
    (specs / "b c.toml").write_bytes(BROKEN)
    (specs / "e.toml").write_bytes(b"knots = [0, 1]\ncontrol_points = [[0, 0], [1, 1]]\n")
    paths = [*sorted(specs.iterdir()), specs / "z.toml"]
    result = gtb("mesh", *paths, "-o", tmp_path / "out", "-f", "stl", "-q", "-j", jobs)
    lines = failure(result)
    assert [line.partition(":")[0] for line in lines] == [
        str(specs / name) for name in ("b c.toml", "b c.toml", "z.toml", "e.toml")
    ]
    assert names(tmp_path / "out") == ["a.stl", "d.stl"]


def test_where_every_spec_is_bad_no_folder_appears(specs, tmp_path):
    (specs / "a.toml").write_bytes(BROKEN)
    failure(gtb("mesh", specs / "a.toml", specs / "nothing.toml", "-o", tmp_path / "out"))
    failure(gtb("mesh", CURVE, CURVE.replace("cubic-bezier", "example-3.1"), "-f", "stl", "-o", tmp_path / "out"))
    failure(gtb("mesh", specs / "d.toml", specs / "b c.toml", "-n", 9999, "-o", tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_a_file_is_not_a_folder(specs, tmp_path):
    (tmp_path / "out").write_text("mine", encoding="utf-8")
    assert "out" in one_line(gtb("mesh", specs / "a.toml", specs / "d.toml", "-o", tmp_path / "out"))
    assert (tmp_path / "out").read_text(encoding="utf-8") == "mine"


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


def test_eval_reads_lines_as_people_write_them():
    plain = gtb("eval", PENTAGON, stdin=b"0.5 1.5\n1 1\n0 0\n").out
    odd = b"\xef\xbb\xbf# parameters\r\n\r\n 0.5,1.5 \r\n\t1\t1e0 # the middle\n\n+0,\t-0."
    assert gtb("eval", PENTAGON, stdin=odd).out == plain
    assert plain.count(b"\n") == 3


def test_eval_of_a_curve_takes_one_number(tmp_path):
    path = tmp_path / "t.txt"
    path.write_text("0\n1.5\n3\n", encoding="utf-8")
    result = gtb("eval", CURVE, path)
    assert (rows(result.out) == gtb_cli.load(CURVE).evaluate([0, 1.5, 3])).all()


def test_eval_of_nothing_is_nothing():
    assert gtb("eval", PENTAGON, stdin=b"").out == b""
    assert gtb("eval", PENTAGON, stdin=b"# nothing\n\n").out == b""
    assert json.loads(gtb("eval", PENTAGON, "--json").out) == {"points": [], "parameters": []}


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
        (b"0.5", "<stdin>:1: expected two numbers, u v, got '0.5'"),
        (b"1 1\n\n# x\n1 2 3\n", "<stdin>:4: expected two numbers, u v, got '1 2 3'"),
        (b"1 1\n1 one\n", "<stdin>:2: 'one' is not a number"),
        (b"1 1\n1 \xff\n", "<stdin>:2: '\\\\xff' is not a number"),
        (b"1 1\n1 nan\n", "<stdin>:2: must be finite, got (1.0, nan)"),
        (b"1 1\n\n5 5\n6 6\n", "<stdin>:3: (5.0, 5.0) is outside the domain, by up to "),
        (b"1 1\n" * (BATCH_LINES + 5) + b"\n0 -1\n", f"<stdin>:{BATCH_LINES + 7}: (0.0, -1.0) is outside the domain"),
        (b"1 " * MAX_LINE_BYTES + b"\n", "<stdin>:1: expected two numbers"),
        (b"1 1\n" + b"1 " * READ_BYTES, f"<stdin>:2: a line of more than {MAX_LINE_BYTES} characters"),
    ],
)
@pytest.mark.parametrize("parametrization", ["toric", "linear"])
def test_eval_names_the_wrong_line(text, message, parametrization):
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


def test_eval_writes_a_file_whole_or_not_at_all(tmp_path):
    path = tmp_path / "points.txt"
    path.write_text("old", encoding="utf-8")
    text = b"1 1\n" * BATCH_LINES
    assert gtb("eval", PENTAGON, "-o", path, stdin=text + b"9 9\n").status == 2
    assert path.read_text(encoding="utf-8") == "old"
    assert names(tmp_path) == ["points.txt"]
    assert gtb("eval", PENTAGON, "-o", path, stdin=text).status == 0
    assert path.read_bytes().count(b"\n") == BATCH_LINES


def test_eval_is_for_one_patch():
    assert "expected a single patch, this is a model of 2" in one_line(gtb("eval", "-", PENTAGON, stdin=TWO))


# --- info


@pytest.mark.parametrize(
    ("name", "kind", "degree"),
    [
        ("pentagon", "GT", None),
        ("hexagon", "GT", None),
        ("example-4.1-integer", "toric", None),
        ("trapezoid", "toric", None),
        ("cubic-bezier", "rational Bézier curve", [3]),
        ("bezier-triangle", "rational Bézier triangle", [3]),
        ("bicubic", "rational Bézier tensor product", [3, 3]),
        ("example-3.1", "GT", None),
    ],
)
def test_info_names_the_kind(name, kind, degree):
    path = SPECS / f"{name}.toml"
    found = json.loads(gtb("info", path, "--json").out)
    assert found["kind"] == kind
    assert found["degree"] == degree
    assert f"kind              {kind}" in gtb("info", path).text


def test_info_of_the_pentagon():
    found = json.loads(gtb("info", PENTAGON, "--json").out)
    assert found["name"] == "pentagon"
    assert found["dimension"] == 2
    assert found["knots"] == 8
    assert found["hull_vertices"] == [[0, 0], [2, 0], [2, 1], [1, 2], [0, 2]]
    assert found["edges"] == [[5, 6, 7], [7, 4], [4, 1], [1, 0], [0, 2, 5]]
    assert found["bounding_box"] == [[0, 0, 0], [2, 2, 5]]
    assert found["edge_normals"] == "primitive"
    assert found["repeated_knots"] == []
    assert round(found["linear_precision_error"], 2) == 0.40  # mathematics.md, section 7
    text = gtb("info", PENTAGON).text
    assert "hull vertices     0 0; 2 0; 2 1; 1 2; 0 2\n" in text
    assert "knots of edge 4   0 2 5\n" in text


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


def test_info_of_a_model():
    found = json.loads(gtb("info", "-", "--json", stdin=TWO).out)
    assert found["kind"] == "model"
    assert found["name"] == "two"
    assert [patch["kind"] for patch in found["patches"]] == [
        "rational Bézier triangle",
        "rational Bézier tensor product",
    ]
    assert found["bounding_box"] == [[0, 0, 0], [6, 1, 1]]
    assert gtb("info", "-", stdin=TWO).text.startswith("name              two\nkind              model\npatches ")


# --- decompose


def test_decompose_example_4_4():
    """Mathematics.md, section 7: three triangles and two quadrilaterals."""
    cells = [[0, 1, 2, 3], [1, 3, 4], [2, 3, 6], [2, 5, 6], [3, 4, 6, 7]]
    polygons = [[3, 1, 0, 2], [4, 1, 3], [6, 3, 2], [5, 6, 2], [6, 7, 4, 3]]
    assert json.loads(gtb("decompose", PENTAGON, "--json").out) == {"cells": cells, "polygons": polygons, "absent": []}
    lines = [f"cell {index}: {' '.join(map(str, cell))}\n" for index, cell in enumerate(cells)]
    assert gtb("decompose", PENTAGON).text == "".join([*lines, "absent: none\n"])


def test_decompose_with_another_lifting():
    found = json.loads(gtb("decompose", CURVE, "--lifting", "0, sqrt(2), -1, 0", "--json").out)
    assert found == {"cells": [[0, 1], [1, 3]], "polygons": [[0, 1], [1, 3]], "absent": [2]}
    assert gtb("decompose", CURVE, "--lifting", "-1,-1,-1,-1").text == "cell 0: 0 1 2 3\nabsent: none\n"


def test_decompose_a_model():
    found = json.loads(gtb("decompose", "-", "--json", stdin=TWO).out)
    # The square is folded along its diagonal from knot 1, the raised one, to its neighbours' far corner.
    assert [part["cells"] for part in found["patches"]] == [[[0, 1, 2]], [[0, 1, 3], [1, 2, 3]]]
    assert [part["absent"] for part in found["patches"]] == [[], []]
    assert "single patch" in one_line(gtb("decompose", "-", "--lifting", "1,2,3", stdin=TWO))
    bare = TWO.replace(b"lifting = [0, 1, 0, 0]", b"")
    assert one_line(gtb("decompose", "-", stdin=bare)).startswith("<stdin>: patches[1]: has no lifting")


# --- schema


def test_schema_is_json_schema(tmp_path):
    import tomllib

    import jsonschema

    schema = json.loads(gtb("schema").out)
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(tomllib.loads(Path(PENTAGON).read_text(encoding="utf-8")), schema)
    gtb("schema", "-o", tmp_path / "schema.json")
    assert json.loads((tmp_path / "schema.json").read_bytes()) == schema


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
