"""`gtb_cli.fill` in Python, and readers of loops against damaged files."""

import random
import time
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import gtb_cli
from gtb_cli.errors import DomainError, GtbError, RequirementError, SpecError
from gtb_cli.filling import fill as room
from gtb_cli.filling.certificate import Filling
from gtb_cli.filling.hole_files import read_loop
from gtb_cli.filling.holes import hole_edges
from gtb_cli.filling.sides import loop
from gtb_cli.models.model import Model
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.theory.patch import Patch
from tests.filling.loops import random_sides
from tests.filling.test_one_patch import CUP, PLANES, TRIANGLE
from tests.marks import long, mostly_long
from tests.shell import SPECS, gtb
from tests.solids.test_flat_rims import walls
from tests.specs import SECONDS
from tests.surfaces import box
from tests.tools.mutations import mutated


def triangle() -> Model:
    corners = np.eye(3)
    return Model(tuple(Patch([0, 1], corners[[k, (k + 1) % 3]], name=f"side-{k}") for k in range(3)))


@cache
def without_ribbons() -> Filling:
    return gtb_cli.fill(triangle(), raises=0)


def with_ribbons() -> Filling:
    """Planes that rise in the middles of sides only: where they disagree at corners, a fill takes longer."""
    curves = [gtb_cli.elevate(curve) for curve in triangle()]
    ribbons = [0.7 * curve.control_points + 0.1 + [[0], [0.1], [0]] for curve in curves]
    return gtb_cli.fill(Model(curves), ribbons, name="lid", raises=0)


def test_fill_takes_curves_and_ribbons():
    filling = with_ribbons()
    assert filling.patch.name == "lid"
    assert filling.angle < 1e-9
    assert filling.model is None
    patch = without_ribbons().patch
    points = patch.evaluate(patch.domain.center[None])
    assert points.sum() == pytest.approx(1, abs=1e-6)


@long
def test_fill_takes_files_and_models(tmp_path):
    assert len(gtb_cli.fill(CUP, raises=0).sides) == 5
    path = tmp_path / "loop.toml"
    path.write_text(TRIANGLE, encoding="utf-8")
    assert len(gtb_cli.fill(path, raises=0).sides) == 3
    with pytest.raises(SpecError, match="No such file"):
        gtb_cli.fill(tmp_path / "none.toml")
    with pytest.raises(DomainError, match="hole: names an edge"):
        gtb_cli.fill(triangle(), hole="x")
    with pytest.raises(DomainError, match="hole: the model has 2, `hole` names one of"):
        gtb_cli.fill(walls([(1, 0), (1, 1), (1, 2)], 3))
    with pytest.raises(DomainError, match="ribbons: expected 3"):
        gtb_cli.fill(triangle(), [None])
    with pytest.raises(DomainError, match=r"ribbons\[1\]: expected shape \(2, 3\), got \(3, 3\)"):
        gtb_cli.fill(triangle(), [None, np.eye(3), None])


@long
def test_a_weld_closes_a_hole_between_patches_that_are_apart():
    # Three walls of a pyramid without its tip, each moved by itself
    moved = [
        wall.replace(control_points=wall.control_points + shift)
        for wall, shift in zip(walls([(3, 0), (2, 0), (2, 1)], 3), 1e-3 * np.eye(3), strict=True)
    ]
    with pytest.raises(DomainError, match="hole: the model has 3"):  # each wall by itself
        gtb_cli.fill(Model(moved))
    assert {patch for patch, _ in hole_edges(Model(moved), "patches[1]")} == {1}
    filling = gtb_cli.fill(Model(moved, weld=0.01), hole="patches[0] edge 2", raises=1)
    (said,) = (remark for remark in filling.remarks if "are moved" in remark)
    turned = float(said.rpartition("by up to ")[2].removesuffix("°"))
    assert filling.model is not None
    model = filling.model
    assert all(ref[0] < 3 for ref in model.joints.open)
    seams = [seam.angle for seam in model.seams if 3 in (seam.first[0], seam.second[0])]
    assert len(seams) == 3
    assert max(seams) == pytest.approx(turned, rel=0.1)


def test_points_of_a_side_go_with_its_ends():
    apart = [
        replace(side, weld=0.1, curve=side.curve + np.append(shift, 0))
        for side, shift in zip(random_sides(4, 0), 0.01 * np.eye(4)[:, :3], strict=True)
    ]
    met, _ = loop(apart)
    for old, new in zip(apart, met, strict=True):
        moves = new.points - old.points
        share = np.linspace(0, 1, len(moves))[:, None]
        assert moves == pytest.approx((1 - share) * moves[0] + share * moves[-1], abs=1e-12)
        assert np.linalg.norm(moves[[0, -1]], axis=1).min() > 1e-3


@pytest.mark.parametrize(
    ("profile", "sides"),
    mostly_long([([(2, 0), (3, 1), (5, 4)], 3), ([(5, 0), (5, 1), (2, 2)], 5), ([(1, 0)] * 3, 7)], 0),
)
def test_plane_rims_are_closed_by_plane_lids_and_floors(profile, sides):
    """Whatever way the walls lean, and none is turned over: the solid is inside."""
    profile = [(radius, height + 7 * k) for k, (radius, height) in enumerate(profile)]
    model = walls(profile, sides)
    for name, edge in (("floor", 0), ("lid", 2)):
        filling = gtb_cli.fill(model, hole=f"patches[0] edge {edge}", continuity="g0", name=name)
        assert filling.fault is None
        model = filling.model
        heights = filling.patch.control_points[:, 2]
        np.testing.assert_allclose(heights, profile[-1 if edge else 0][1], atol=1e-12)
    assert model.joints.closed
    solid, remarks = Recipe(4, require=("solid",)).mesh(model)
    assert remarks == []
    assert solid.to_trimesh().volume > 0


@long
def test_a_dome_closes_a_pipe():
    """Its planes stand upright, and differ at the corners of a pipe of three walls."""
    dome = gtb_cli.fill(walls([(1, 0), (1, 1), (1, 2)], 3), hole="patches[0] edge 2", raises=1)
    assert dome.fault is None
    assert dome.angle < PLANES
    np.testing.assert_allclose(dome.corner_angles, 120)
    assert gtb_cli.tessellate(dome.patch, 16).vertices[:, 2].max() > 2.1
    with pytest.raises(DomainError, match="continuity: expected g1, g0 or g2, got 'g7'"):
        gtb_cli.fill(triangle(), continuity="g7")


@pytest.mark.parametrize("seed", mostly_long(range(10)))
@pytest.mark.parametrize("name", ["cagd86.gbp", "pocket3sided.lop", "loop.toml"])
def test_damaged_files_are_refused_or_read(name, seed):
    """500 for each kind of file, 50 of a seed."""
    source = TRIANGLE.encode() if name == "loop.toml" else (CUP.parent / name).read_bytes()
    for number in range(50):
        message = name
        start = time.process_time()
        try:
            found, _ = read_loop(mutated(random.Random(f"{name} {seed} {number}"), source), name)
            if isinstance(found, list):
                loop(found)
        except SpecError as error:
            message = str(error)
        except GtbError:
            pass
        assert name in message
        assert time.process_time() - start < SECONDS


@pytest.mark.parametrize("cure", mostly_long([{"fullness": 0.8}, {"fullness": 0.5}, {"raises": 1}, None], 3))
def test_a_refused_fill_tries_less_fullness_and_then_one_degree_more(cure, monkeypatch, tmp_path):
    good, path, said = replace(without_ribbons(), raises=(0, 0, 0)), tmp_path / "loop.toml", []
    words, model = ["fullness 0.8", "fullness 0.5", "degrees raised by 1"], gtb_cli.load(SPECS / "box-corner.toml")
    gtb_cli.save(triangle(), path)
    assert "places: try curves that" in replace(good, folds=12, sides=good.sides * 4).fault
    beside_planes = cure or with_ribbons()

    def stand_in(*_: object, **options: object) -> object:
        return good if cure and cure.items() <= options.items() else replace(good, folds=3)

    monkeypatch.setattr(room, "filled", stand_in)
    monkeypatch.setattr(room, "_loose_end", lambda *_: "")
    if cure:
        (word,) = (word for word in words if word.endswith(str(*cure.values())))
        text = f"filled with {word}, as otherwise the patch folds at 3 of some thousand places"
        room.with_fills(model, [("0,0,0", "g1")], said.append, said.append)
        assert said == [f"`fills` 0,0,0: {text}"]
        assert f"gtb: {text}\n" in gtb("fill", path, status=0).err
        ((option, value),) = cure.items()
        given = {"fullness": "--fullness", "raises": "--elevate"}[option], value
        assert text not in gtb("fill", path, *given, status=0).err
        return
    assert "places: raise degrees more, or try curves that" in gtb("fill", path, "--fullness=1", status=1).err
    for kind, end in (("g1", 'smaller ones, or `fills` "0,0,0=g0"'), ("g0", "too: try curves that cut .*smaller ones")):
        with pytest.raises(RequirementError, match=f"{', '.join(words)} were tried, .*{end}$"):
            room.with_fills(model, [("0,0,0", kind)], said.append, said.append)
    good = beside_planes
    assert "try a fullness of 0.8 or 0.5, other ribbons" in gtb("fill", path, "--elevate=0", status=1).err
    with pytest.raises(RequirementError, match="too: try other ribbons, or curves"):
        room.with_fills(model, [("0,0,0", "g1")], said.append, said.append)


def test_a_fill_says_in_one_line_in_how_many_parts_it_is_and_where_planes_differ_most(monkeypatch):
    good, model, said = without_ribbons(), gtb_cli.load(SPECS / "box-corner.toml"), []
    monkeypatch.setattr(room, "_loose_end", lambda *_: "")
    for parts, angle in (((), 0.9), ((good, good), 0.9), ((), 26.66)):
        found = replace(good, parts=parts, corner_angles=np.array([np.nan, angle / 2, angle]))
        monkeypatch.setattr(room, "filled", lambda *_, found=found, **__: found)
        room.with_fills(model, [("0,0,0", "g1")], said.append, said.append)
    planes = "neighbours' planes differ by up to 26.7 degrees at their corner (0, 0, 1)"
    parted = "filled in 2 parts, as corners point into the hole"
    assert said == [f"`fills` 0,0,0: {text}; `fill` says all" for text in (parted, planes)]


def test_the_last_of_copies_that_do_not_close_is_named_before_a_fill_is_blamed(monkeypatch):
    """Of three of four walls, two have all edges but one in the ring; of one wall by itself any ring has all."""
    good, walls, said = without_ribbons(), box().patches[:4], []
    monkeypatch.setattr(room, "filled", lambda *_, **__: good)
    for count in (1, 4, 3):
        room.with_fills(Model(walls[:count]), [("0,1,0", "g1")], said.append, said.append)
    end = "the hole has 3 edges of box-00: a copy may be missing, or not turned as far as it has to be"
    assert said == [f"`fills` 0,1,0: {end}"]
    good = replace(good, folds=3)
    with pytest.raises(RequirementError, match=f"`fills` 0,1,0: {end}; the patch folds"):
        room.with_fills(Model(walls[:3]), [("0,1,0", "g1")], said.append, said.append)
