"""Changes: what is shown of two versions of a mesh is small, and its distances are those that were found."""

import base64
import json
import os
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import gtb_cli
import gtb_cli.review.changes as room
from gtb_cli import Mesh, Recipe, diff, load
from gtb_cli.errors import Fault
from gtb_cli.review import reports
from gtb_cli.review.changes import Change, review
from gtb_cli.review.reports import page
from gtb_cli.review.shown_meshes import simplified
from gtb_cli.verdicts.comparing import Comparing
from gtb_cli.verdicts.verdict import Verdict, Word
from tests.specs import SPECS


def change(name: str, word: Word, old: Mesh = None, new: Mesh = None, found=None, reasons=(), most=20_000) -> Change:
    """What is shown of a verdict on two meshes."""
    errors = tuple(map(Fault, reasons))
    return room.change(Verdict(name, (name, name), word, found, errors=errors, meshes=(old, new)), most)


def mesh_of(name: str, resolution: int) -> Mesh:
    return Recipe(resolution).mesh(load(SPECS / f"{name}.toml"))[0]


def moved(mesh: Mesh, by: float) -> Mesh:
    """The mesh with its highest vertex moved up."""
    vertices = mesh.vertices.copy()
    vertices[vertices[:, 2].argmax(), 2] += by
    return Mesh(vertices, mesh.cells)


@pytest.mark.parametrize("name", ["pentagon", "teapot", "cubic-bezier"])
@pytest.mark.parametrize("factor", [1e-9, 1.0, 1e9])
def test_a_simplified_mesh_has_few_faces_and_vertices_of_the_given_one(name, factor):
    mesh = mesh_of(name, 200 if name != "teapot" else 12)
    mesh = Mesh(factor * (mesh.vertices + np.array([1e7 if factor == 1 else 0, 0, 0])), mesh.cells)
    small, kept = simplified(mesh, 100)
    assert 20 < len(small.cells) <= 100
    assert (mesh.vertices[kept] == small.vertices).all()
    size = np.ptp(mesh.bounds, axis=0)
    assert (np.abs(small.bounds - mesh.bounds) <= 0.3 * size.max()).all()
    whole, kept = simplified(mesh, len(mesh.cells))
    assert whole.vertices.shape == mesh.vertices.shape
    assert (whole.cells == mesh.cells).all()


def test_distances_are_on_the_side_that_has_the_farthest_point():
    old = mesh_of("pentagon", 8)
    new = moved(old, 0.5)
    for first, second in ((old, new), (new, old)):
        found = diff(first, second, kind="surface")
        made = change("x", "different", first, second, found)
        side = made.old if made.coloured == "old" else made.new
        assert made.largest == (found.forward if made.coloured == "old" else found.backward).at
        assert side.distances.max() == pytest.approx(found.distance, rel=1e-3)
    coloured = [
        change("x", "different", *pair, diff(*pair, kind="surface")).coloured for pair in ((old, new), (new, old))
    ]
    assert sorted(coloured) == ["new", "old"]


def test_vertices_that_were_compared_are_coloured_by_how_far_they_moved():
    old = mesh_of("pentagon", 8)
    new = Mesh(old.vertices + np.array([0.25, 0, 0]), old.cells)
    made = change("x", "different", old, new, diff(old, new))
    assert made.new.distances == pytest.approx(np.full(len(new.vertices), 0.25))


def test_many_changes_share_a_budget_of_faces(monkeypatch):
    monkeypatch.setattr(reports, "MAX_ALL_FACES", 20_000)
    old = mesh_of("pentagon", 12)
    new = moved(old, 0.5)
    verdicts = [Verdict(f"{k}", ("a", "b"), "different", diff(old, new), meshes=(old, new)) for k in range(50)]
    made = reports.reviewed(("a", "b"), verdicts, Comparing())
    shown = [len(each.old.mesh.cells) for each in sorted(made.changes, key=lambda each: int(each.verdict.name))]
    assert 40 < min(shown) <= max(shown[-10:]) <= 120 < 250 < shown[0] <= 400
    assert all(len(each.new.distances) == len(each.new.mesh.vertices) for each in made.changes)
    assert {each.new.faces for each in made.changes} == {len(old.cells)}
    assert "simplified from" in page(made)


def test_the_largest_change_comes_first_and_errors_before_it():
    old = mesh_of("pentagon", 4)
    changes = [
        change("missing", "missing", old),
        change("little", "different", old, moved(old, 1e-3), diff(old, moved(old, 1e-3))),
        change("much", "different", old, moved(old, 1.0), diff(old, moved(old, 1.0))),
        change("unreadable", "unreadable", reasons=["x.obj: is empty"]),
        None,
    ]
    made = review(("a", "b"), iter(changes))
    assert [each.verdict.name for each in made.changes] == ["unreadable", "much", "little", "missing"]
    assert made.counts == {"same": 1, "different": 2, "missing": 1, "unreadable": 1}


def test_a_mesh_that_cannot_be_shown_has_its_count_of_faces():
    empty = Mesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=int))
    broken = Mesh([[0, 0, np.nan], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    made = change("x", "unreadable", empty, broken)
    assert (made.old.mesh, made.new.mesh, made.old.faces, made.new.faces) == (None, None, 0, 1)
    assert '"old":null' in page(review(("a", "b"), iter([made])))


def test_no_name_becomes_part_of_the_page():
    hostile = "</script><script>alert(1)</script>\n|`$(rm)`<img src=x onerror=alert(1)>"
    text = page(review((hostile, "b"), iter([change(hostile, "unreadable", reasons=[hostile])])))
    assert text.count("<script") == 2
    assert "<img" not in text
    assert page(review(("a", "b"), iter([]))) == page(review(("a", "b"), iter([])))


@pytest.mark.parametrize("factor", [1e-200, 1.0, 1e200])
def test_a_hole_without_a_vertex_in_it_is_coloured(factor):
    old = mesh_of("pentagon", 8)
    middle = np.linalg.norm(old.vertices[old.cells].mean(axis=1) - old.vertices.mean(axis=0), axis=1).argmin()
    old = Mesh(factor * old.vertices, old.cells)
    around = np.isin(old.cells, old.cells[middle]).sum(axis=1) >= 2
    new = Mesh(old.vertices, old.cells[~around])
    found = diff(old, new)
    made = change("x", "different", old, new, found)
    assert (made.coloured, made.old.faces) == ("old", len(old.cells))
    assert found.distance / 2 < made.old.distances.max() <= found.distance * (1 + 1e-9)
    corners = (mesh.vertices[mesh.cells] / factor for mesh in (old, made.old.mesh))
    normals = (np.cross(each[:, 1] - each[:, 0], each[:, 2] - each[:, 0]) for each in corners)
    first, second = (np.linalg.norm(each, axis=1).sum() for each in normals)
    assert first == pytest.approx(second, rel=1e-12)


def test_colours_end_at_the_distance_that_was_found():
    old, new = mesh_of("pentagon", 16), mesh_of("pentagon", 20)
    found = diff(old, new)
    made = change("x", "different", old, new, found, most=60)
    side = made.old if made.coloured == "old" else made.new
    assert side.distances.max() > found.distance  # in faces that are larger than those that were compared
    text = page(review(("a", "b"), iter([made])))
    assert f'"top":"{found.distance:.3g}"' in text
    values = base64.b64decode(re.search('"values":"(.*?)"', text)[1])
    assert (len(values), max(values)) == (len(side.mesh.vertices), 255)


def test_a_segment_that_is_missing_is_coloured():
    old = mesh_of("cubic-bezier", 8)
    new = Mesh(old.vertices, np.delete(old.cells, 4, axis=0))
    found = diff(old, new)
    made = change("x", "different", old, new, found)
    assert made.old.distances.max() == pytest.approx(found.distance, rel=1e-6)
    sides = [np.diff(mesh.vertices[mesh.cells], axis=1) for mesh in (old, made.old.mesh)]
    assert np.linalg.norm(sides[0], axis=2).sum() == pytest.approx(np.linalg.norm(sides[1], axis=2).sum(), rel=1e-12)


@pytest.mark.parametrize("order", [1, -1])
def test_faces_that_are_turned_over_are_marked_and_nothing_else_is_coloured(order):
    old = mesh_of("rounded-cube", 4)
    cells = old.cells.copy()
    cells[:20] = cells[:20, ::-1]
    new = Mesh(old.vertices, cells[::order])
    made = change("x", "different", old, new, diff(old, new))
    assert (made.coloured, made.largest, made.old.turned) == ("", None, None)
    assert (np.flatnonzero(made.new.turned) == np.unique(cells[:20])).all()
    text = page(review(("a", "b"), iter([made])))
    assert '"turned":true' in text
    assert '"top"' not in text


def test_a_mesh_that_would_be_a_dot_is_drawn_at_its_own_scale():
    old = mesh_of("pentagon", 4)
    for vertices in (1000 * old.vertices, old.vertices / 50, old.vertices + 1e4, 0 * old.vertices + 1):
        new = Mesh(vertices, old.cells)
        made = change("x", "different", old, new, diff(old, new, kind="vertices"))
        assert made.reasons[-1].endswith("each is drawn at its own scale")
        for side, frame in zip((made.old, made.new), made.frames, strict=True):
            assert np.abs(frame.inside(side.mesh.vertices)).max() >= 0.5 or not np.ptp(vertices)
        assert '"alone":true' in page(review(("a", "b"), iter([made])))
    dots = [Mesh(0 * old.vertices + place, old.cells) for place in (0, 1)]
    assert change("x", "different", *dots, diff(*dots)).reasons[-1].startswith("old and new have other")
    made = change("x", "extra", old, Mesh(5 * old.vertices, old.cells))
    assert made.reasons == ()
    assert made.frames[0] is made.frames[1]


def test_a_curve_and_a_surface_have_no_distances():
    old, new = mesh_of("cubic-bezier", 4), mesh_of("pentagon", 4)
    made = change("x", "different", old, new, diff(old, new))
    assert made.coloured == ""
    assert "no distances" in page(review(("a", "b"), iter([made])))


@pytest.mark.skipif(not shutil.which("node"), reason="needs node")
def test_the_page_quotes_names_for_a_shell():
    script = (Path(gtb_cli.__file__).parent / "review" / "page.js").read_text("utf-8")
    (line,) = [line for line in script.splitlines() if line.startswith("const quoted")]
    names = ["a.obj", "a b.obj", "it's.obj", "-x.obj", "$(rm x).obj", "- y"]
    code = f"{line}\nconsole.log(JSON.stringify({json.dumps(names)}.map(quoted)))"
    quoted = json.loads(subprocess.run(["node", "-e", code], capture_output=True, check=True, text=True).stdout)
    words = shlex.split(" ".join(quoted))
    assert [os.path.normpath(word) for word in words] == names
    assert not [word for word in words if word.startswith("-")]
    approval = script[script.index("const approval") : script.index("\n\nfunction choose")]
    changes = [{"name": "a.obj", "verdict": "different", "approvable": is_mesh} for is_mesh in (True, False)]
    code = (
        f"const data = {{names: ['golden', 'out']}};{line}{approval}\nconsole.log({json.dumps(changes)}.map(approval))"
    )
    told = subprocess.run(["node", "-e", code], capture_output=True, check=True, text=True).stdout
    assert told.split("'")[1::2] == ["gtb approve golden out a.obj", ""]
