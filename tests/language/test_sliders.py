"""Sliders for the numbers of a spec: their ranges, and what comments say."""

import pytest

from gtb_cli.language.sliders import sliders

SPEC = """let = {a = 1, "b" = 2} # of both
"""
TABLE = """[let]
width = 60   # of the rim, 10 … 80
height = 25  # 20..40 "#" mm
count = 5    # (2 ... 9)
more = "2*count"
angle = "2*pi/5"
down = -3 # 5 … 5
none = 0
far = 7 # 8 … 9
c = "cos(1)"
wrong = "1+"
flag = true
[[patches]]
copy = "x"
repeat = "more-1"
"""


def test_comments_label_them_and_give_their_ranges():
    found = {each.name: each for each in sliders(TABLE, "x.toml")}
    assert list(found) == ["width", "height", "count", "angle", "down", "none", "far"]
    assert found["width"][1:] == (60, 10, 80, 0.1, "of the rim", 2, "width = 60   # of the rim, 10 … 80")
    assert found["height"][2:6] == (20, 40, 0.1, '"#" mm')
    assert found["count"][2:6] == (2, 9, 1, "")  # a repeat depends on it, by way of more
    assert found["angle"].value == pytest.approx(1.2566370614)
    assert found["down"][2:6] == (-6, 0, 0.01, "5 … 5")
    assert found["none"][2:4] == (-1, 1)
    assert found["far"][2:4] == (7, 9)  # the value is within


def test_a_line_with_several_numbers_labels_none():
    assert [(each.name, each.label, each.line) for each in sliders(SPEC, "x.toml")] == [("a", "", 1), ("b", "", 1)]
    assert [each.name for each in sliders('{"let": {"n": 3}}', "x.json")] == ["n"]
    for text in ("let = 3", "[1]", "let = {a = ", ""):
        assert sliders(text, "x") == ()
