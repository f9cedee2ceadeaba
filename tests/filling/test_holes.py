"""Holes of models: their neighbours' curvature and rounding, and bounds of rows at corners that turn."""

import numpy as np
import pytest

from gtb_cli.filling.control_points import Rows
from gtb_cli.filling.fill import filled
from gtb_cli.filling.holes import ring_sides
from gtb_cli.filling.knots_and_weights import net
from gtb_cli.filling.sides import side_normals
from gtb_cli.filling.tangent_rows import edge_rows
from gtb_cli.models.model import Model
from tests.filling.loops import random_sides
from tests.specs import SPECS, load

OPEN = Model(load(SPECS / "rounded-cube.toml").patches[1:])


def test_a_filling_is_measured_beside_its_neighbours():
    filling = filled(OPEN, None, None, raises=0)
    seams = [seam for seam in filling.model.seams if len(OPEN) in (seam.first[0], seam.second[0])]
    assert sorted(contact.bend for contact in filling.contacts) == sorted(seam.bend for seam in seams)
    assert len(seams) == 4


def test_rounding_of_sides_is_relative_to_their_size():
    plain, small = (
        ring_sides(model, model.joints.open)
        for scale in (1, 1e-3)
        for model in [Model(tuple(p.replace(control_points=scale * (p.control_points + 1e7)) for p in OPEN))]
    )
    assert 1e-9 < plain[0].rounding == pytest.approx(small[0].rounding, rel=1e-6)


def test_rows_do_not_meet_at_a_corner_that_turns():
    """Their points are a tenth of the edge's leg away from the middle, or farther, also where energies turn it."""
    sides = random_sides(4, 0, (3, 3), noise=0.0)
    edges = [edge_rows(side, side_normals(side), 1) for side in sides]
    rows, first = Rows(net(edges), edges), net(edges).corners[0, :5]
    table, least = rows._bounds({0}, 0.9)
    bound = rows._at(np.linalg.lstsq(table, least, rcond=None)[0])[0]
    (back := bound.copy())[first[2:4]] = bound[first[[3, 2]]]
    for points in (bound, rows.fairest(np.eye(len(back)), 1.0, origin=back)):
        legs = points[first[1:]] - points[first[0]]
        lengths = np.linalg.norm(legs[[0, 3]], axis=1)
        across = np.cross(legs[0] / lengths[0] + legs[3] / lengths[1], side_normals(sides[0])[0])
        assert legs[1:3] @ across / np.linalg.norm(across) == pytest.approx([0.1, -0.1] * lengths)
