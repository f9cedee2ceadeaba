"""`let`, `copy`, `include` and `weld`: what they make, what their errors say, and that they stay bounded."""

import math
import os
import re
from pathlib import Path

import numpy as np
import pytest

from gtb_cli.errors import SpecError
from gtb_cli.language.copies import reflected, rotation_matrix
from gtb_cli.language.includes import sources
from gtb_cli.language.loading import load, parse
from gtb_cli.language.patch_reader import MAX_PATCHES
from gtb_cli.language.writer import dump
from gtb_cli.models.model import Model
from gtb_cli.models.same_edges import find_joints
from gtb_cli.theory.patch import Patch
from tests.patches import pentagon
from tests.specs import TRIANGLE, arrays, quickly

PATCH = f'[[patches]]\nname = "wall"\n{TRIANGLE}'


def model(text: str) -> Model:
    found = parse(text, "x.toml")
    assert isinstance(found, Model)
    return found


def faults(text: str, source: str = "x.toml") -> list[str]:
    with quickly(), pytest.raises(SpecError) as caught:
        parse(text, source)
    return str(caught.value).splitlines()


def table(name: str) -> list[str]:
    return (Path(__file__).parent / name).read_text(encoding="utf-8").split("\n\n")[1:]


@pytest.mark.parametrize("case", table("faults.txt"))
def test_wrong_names_copies_and_models(case):
    text, message = case.rstrip("\n").split("\n> ")
    first, *others = faults(f"{text}\n".replace("WALL\n", PATCH).replace("TRIANGLE\n", TRIANGLE))
    assert first.startswith(f"x.toml:{message}"), first
    assert all(line.endswith(": is missing") for line in others)


# let


def test_names_are_numbers_for_all_expressions_and_for_later_names():
    patch = parse('let = {R = 20, a_1 = "2*R", turn = "90*deg"}\nknots = [0, "R/20", "a_1"]\n'
                  'control_points = [["R", "sin(turn)"], ["e*deg*0", 1], [2, 0]]\nweights = [1, "R", 1]\n')  # fmt: skip
    assert isinstance(patch, Patch)
    assert patch.knots.ravel().tolist() == [0, 1, 40]
    assert patch.control_points[0].tolist() == [20, 1, 0]
    assert patch.weights.tolist() == [1, 20, 1]
    assert dump(patch) == dump(parse(dump(patch)))


def test_a_table_of_names_may_stand_anywhere():
    assert model(f"{PATCH}[let]\nR = 1\n") is not None
    assert isinstance(parse(f"{TRIANGLE}[let]\nR = 1\n"), Patch)


def test_long_chains_of_names_are_judged_quickly():
    chain = "".join(f'a{i} = "a{i + 1}"\n' for i in range(999))
    assert len(faults(f"{TRIANGLE}[let]\n{chain}")) == 21
    assert "let: must have at most 1000 names" in faults(f"{TRIANGLE}[let]\n{chain}x = 1\ny = 1\n")[0]


# copy


def test_copies_are_mirrored_scaled_rotated_and_translated_in_this_order():
    moves = 'mirror = "x"\nscale = 2\nrotate = {axis = "z", degrees = 90, about = [1, 0]}\ntranslate = [0, 0, 5]\n'
    found = model(f'{PATCH}[[patches]]\ncopy = "wall"\n{moves}').patches[1]
    # (1, 0, 0) → (−1, 0, 0) → (−2, 0, 0) → about (1, 0): (1, −3, 0) → (1, −3, 5)
    assert found.control_points.tolist() == [[1, -1, 5], [1, -3, 5], [-1, -1, 7]]
    assert found.name == "wall-1"


def test_mirrors_keep_the_orientation():
    for mirror, factor in (("x", (-1, 1, 1)), ("y", (1, -1, 1)), ("z", (1, 1, -1))):
        patch, mirrored = model(f'{PATCH}[[patches]]\ncopy = "wall"\nmirror = "{mirror}"\n').patches
        normal = patch.normals([[0.3, 0.3]])[0]
        u = mirrored.domain.vertices.mean(axis=0)[None]
        np.testing.assert_allclose(mirrored.normals(u)[0], -normal * factor * -1, atol=1e-15)


def test_a_reflected_patch_is_the_same_surface():
    patch = pentagon()
    patch = patch.replace(edge_scale=np.array([1.0, 2.0, 3.0, 4.0, 5.0]))
    turned = reflected(patch)
    u = np.random.default_rng(1).dirichlet(np.ones(5), 20) @ patch.domain.vertices
    low, high = patch.knots[:, 0].min(), patch.knots[:, 0].max()
    assert sorted(turned.knots[:, 0]) == pytest.approx(sorted(low + high - patch.knots[:, 0]))
    mirrored = np.column_stack([low + high - u[:, 0], u[:, 1]])
    np.testing.assert_allclose(turned.evaluate(mirrored), patch.evaluate(u), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(turned.normals(mirrored), -patch.normals(u), atol=1e-9)


def test_repeated_copies_have_numbers():
    found = model(f'{PATCH}[[patches]]\ncopy = "wall"\nname = "leaf"\nrepeat = "2 + 1"\ntranslate = ["k", 0, "k**2"]\n')
    assert [patch.name for patch in found] == ["wall", "leaf-1", "leaf-2", "leaf-3"]
    assert [patch.control_points[0].tolist() for patch in found] == [[0, 0, 0], [1, 0, 1], [2, 0, 4], [3, 0, 9]]
    assert len({id(patch.rational_basis) for patch in found}) == 1
    assert arrays(parse(dump(found))) == arrays(found)


def test_copies_of_copies_in_any_order():
    last = '[[patches]]\ncopy = "b-2"\nname = "c"\ntranslate = [0, 1]\n'
    middle = '[[patches]]\ncopy = "wall"\nname = "b"\nrepeat = 2\ntranslate = ["k", 0]\n'
    found = model(last + middle + PATCH)
    assert [patch.name for patch in found] == ["c", "b-1", "b-2", "wall"]
    assert found.patches[0].control_points[0].tolist() == [2, 1, 0]


def test_copies_rotated_by_72_degrees_close_to_rounding():
    sector = (
        '[[patches]]\nname = "sector"\nknots = [[0, 0], [1, 0], [0, 1], [1, 1]]\ncontrol_points = [[3, 0, 0],'
        '[5, 0, 1], ["3*cos(72*deg)", "3*sin(72*deg)", 0], ["5*cos(72*deg)", "5*sin(72*deg)", 1]]\n'
    )
    ring = model(f'{sector}[[patches]]\ncopy = "sector"\nrepeat = 4\nrotate = {{axis = "z", degrees = "72*k"}}\n')
    joints = find_joints(ring.patches)
    assert len(joints.shared) == 5
    for joint in joints.shared:
        one, other = (ring.patches[p].domain.edge_knots(e) for p, e in (joint.first, joint.second))
        a = ring.patches[joint.first[0]].control_points[one]
        b = ring.patches[joint.second[0]].control_points[other][:: -1 if joint.opposite else 1]
        np.testing.assert_allclose(a, b, atol=4e-15)


@pytest.mark.parametrize("degrees", [90, 180, 270, 360, -90, 450])
def test_right_angles_are_exact(degrees):
    matrix = rotation_matrix(np.array([0.0, 0, 1]), degrees)
    assert set(np.abs(matrix).ravel()) == {0, 1}
    assert matrix[0, 0] == round(math.cos(math.radians(degrees)))
    np.testing.assert_allclose(rotation_matrix(np.array([1.0, 1, 1]), 120) @ [1, 2, 3], [3, 1, 2], atol=1e-15)


def test_deep_chains_of_copies_are_quick():
    count = 1500
    chain = "".join(f'[[patches]]\ncopy = "c{i + 1}"\nname = "c{i}"\ntranslate = [1, 0]\n' for i in range(count))
    found = model(chain + PATCH.replace("wall", f"c{count}"))
    assert found.patches[0].control_points[0].tolist() == [count, 0, 0]


def test_what_copies_hold_together_is_bounded():
    knots = "".join(f"[{i}, 0], [{i}, 1]," for i in range(500))
    large = f'[[patches]]\nname = "a"\nknots = [{knots}]\ncontrol_points = [{"[0, 0]," * 1000}]\n'
    (line,) = faults(f'{large}[[patches]]\ncopy = "a"\nrepeat = {MAX_PATCHES - 1}\n')
    assert "makes more than 2000000 control points" in line


# include


def folder(tmp_path: Path, **texts: str) -> str:
    for name, text in texts.items():
        (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
    return str(tmp_path / "main.toml")


def refusal(path: str) -> list[str]:
    with pytest.raises(SpecError) as caught:
        load(path)
    return str(caught.value).replace(os.path.dirname(path) + os.sep, "").splitlines()


def test_included_patches_come_first_and_can_be_copied(tmp_path):
    text = f'name = "cup"\ninclude = ["handle.toml"]\n{PATCH}[[patches]]\ncopy = "handle"\nmirror = "x"\n'
    path = folder(tmp_path, main=text, handle=TRIANGLE.replace("1", '"R"') + "[let]\nR = 3\n")
    found = load(path)
    assert isinstance(found, Model)
    assert [patch.name for patch in found] == ["handle", "wall", "handle-1"]
    assert found.name == "cup"
    assert found.patches[2].control_points[1].tolist() == [-3, 0, 0]
    assert arrays(parse(dump(found))) == arrays(found)


@pytest.mark.parametrize("case", table("includes.txt"))
def test_what_cannot_be_included(tmp_path, case):
    """Errors of included files have their own lines; what clashes or goes round in circles is named."""
    text, *faults = case.rstrip("\n").split("\n> ")
    (tmp_path / "parts").mkdir()
    _, *files = re.split(r"^(\S+)\.toml\n", text, flags=re.MULTILINE)
    texts = [f"{file.rstrip()}\n".replace("WALL\n", PATCH) for file in files[1::2]]
    assert refusal(folder(tmp_path, **dict(zip(files[::2], texts, strict=True)))) == faults


def test_at_most_a_hundred_files_can_be_included(tmp_path):
    files = {f"f{i}": f'include = ["f{i + 1}.toml"]\n' for i in range(150)}
    expected = "f99.toml:1: include[0]: f100.toml: at most 100 files can be included (included by f98.toml)"
    assert refusal(folder(tmp_path, main='include = ["f0.toml"]\n', **files)) == [expected]


def test_nothing_outside_of_the_folder_is_read(tmp_path):
    inner = tmp_path / "inner"
    inner.mkdir()
    folder(tmp_path, secret=PATCH)
    (inner / "link.toml").symlink_to(tmp_path / "secret.toml")
    (inner / "up").symlink_to(tmp_path)
    (inner / "own.toml").write_text(PATCH, encoding="utf-8")
    (inner / "good.toml").symlink_to(inner / "own.toml")
    for name in ("../secret.toml", str(tmp_path / "secret.toml"), "link.toml", "up/secret.toml", "/dev/zero", "up/.."):
        path = folder(inner, main=f'include = ["{name}"]\n')
        assert refusal(path)[0].endswith("outside the spec's folder, below which included files must be"), name
    assert len(load(folder(inner, main='include = ["good.toml"]\n'))) == 1
    os.mkfifo(inner / "pipe.toml")
    for name, message in (("pipe.toml", "is not a file"), (".", "Is a directory|is not a file"), ("a\\u0000b", "null")):
        path = folder(inner, main=f'include = ["{name}"]\n')
        with pytest.raises(SpecError, match=message):
            load(path)
        assert path in sources(path)


def test_whole_files_are_copied(tmp_path):
    """All patches of a file are moved as those of a copy, k by k, and have the number in their names."""
    leg = PATCH + PATCH.replace("wall", "foot").replace("[0, 0, 0]", "[0, 0, 5]")
    moves = ['mirror = "x"', "scale = 2", 'rotate = {axis = "z", degrees = "90*k"}']
    moves += ['translate = [0, 0, "k"]', "repeat = 2"]
    path = folder(tmp_path, main=f'include = [{{file = "leg.toml", {", ".join(moves)}}}, "leg.toml"]\n', leg=leg)
    found = load(path)
    assert isinstance(found, Model)
    assert [patch.name for patch in found] == ["wall-1", "foot-1", "wall-2", "foot-2", "wall", "foot"]
    lines = "\n".join(moves)
    copies = model(f'{leg}[[patches]]\ncopy = ["wall", "foot"]\n{lines}\n')
    assert [arrays(found.patches[i]) for i in (0, 2, 1, 3)] == [arrays(copy) for copy in copies.patches[2:]]
    # Once more under other names, without numbers
    path = folder(tmp_path, main='include = ["leg.toml", {file = "leg.toml", name = "left", translate = [1, 0]}]\n')
    found = load(path)
    assert sources(path) == (path, str(tmp_path / "leg.toml"))
    assert [patch.name for patch in found] == ["wall", "foot", "left-wall", "left-foot"]
    assert found.patches[3].control_points[0].tolist() == [1, 0, 5]
    assert arrays(parse(dump(found))) == arrays(found)


def test_copies_of_copied_files_are_bounded(tmp_path, monkeypatch):
    """A file that doubles another, a hundred times over, is refused at once."""
    monkeypatch.setattr("gtb_cli.language.model_reader.MAX_PATCHES", 500)
    doubles = {f"f{i}": f'include = [{{file = "f{i + 1}.toml", repeat = 2}}]\n' for i in range(98)}
    twice = {f"f{i}": f'include = ["f{i + 1}.toml", {{file = "f{i + 1}.toml", name = "b"}}]\n' for i in range(98)}
    for files, words in ((doubles, "repeat: must be a whole number from 1 to 1,"), (twice, "at most 100 files")):
        with quickly():
            lines = refusal(folder(tmp_path, main='include = ["f0.toml"]\n', f98=PATCH, **files))
        assert words in "\n".join(lines)


def test_large_includes_are_bounded_together(tmp_path):
    """Each file is below what one may have, two are within what all may have, and three are not."""
    parts = {f"f{i}": f"{PATCH.replace('wall', f'wall-{i}')}#{'x' * 4_000_000}\n" for i in range(3)}
    assert len(load(folder(tmp_path, main='include = ["f0.toml", "f1.toml"]\n', **parts))) == 2
    assert refusal(folder(tmp_path, main='include = ["f0.toml", "f1.toml", "f2.toml"]\n')) == [
        "main.toml:1: include[2]: f2.toml: is too large, files of a spec have at most 10 MB together"
    ]


# weld


@pytest.mark.parametrize(("weld", "distance"), [("1e-6", 1e-6), ('"2e-6/2"', 1e-6), ('"1%"', 0.01 * 3**0.5)])
def test_weld_is_a_length_or_a_percentage_of_the_size(weld, distance):
    found = model(f"weld = {weld}\n{PATCH}")
    assert found.weld == pytest.approx(distance, rel=1e-15)
    assert model(dump(found)).weld == found.weld
