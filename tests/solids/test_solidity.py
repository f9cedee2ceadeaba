"""Closed meshes that bound a solid, and those whose faces look inwards."""

import numpy as np
import pytest

from gtb_cli.meshes.mesh import Mesh
from gtb_cli.solids.solidity import crossing_remarks, folded_places, inward_faces
from gtb_cli.tessellation.tessellate import tessellate
from tests.surfaces import box

CUBE = tessellate(box(), 1)


def cubes(*parts) -> Mesh:
    """Cubes (low, size, outwards), one after the other."""
    vertices = [np.array(low) + size * CUBE.vertices for low, size, _ in parts]
    cells = [CUBE.cells[:, :: 1 if outwards else -1] + 8 * k for k, (_, _, outwards) in enumerate(parts)]
    return Mesh(np.concatenate(vertices), np.concatenate(cells))


BIG, INSIDE, INNERMOST, BESIDE = ([0, 0, 0], 9), ([1, 2, 3], 5), ([3, 4, 5], 1), ([20, 0, 0], 3)


@pytest.mark.parametrize(
    ("parts", "inward"),
    [
        ([(*BIG, True)], []),
        ([(*BIG, False)], [0]),
        ([(*BIG, True), (*BESIDE, True)], []),
        ([(*BIG, True), (*BESIDE, False)], [1]),
        ([(*BIG, True), (*INSIDE, False)], []),
        ([(*BIG, True), (*INSIDE, True)], [1]),
        ([(*BIG, False), (*INSIDE, False)], [0, 1]),
        ([(*BIG, False), (*INSIDE, True)], [0, 1]),
        ([(*INNERMOST, True), (*INSIDE, False), (*BIG, True)], []),
        ([(*INNERMOST, False), (*INSIDE, False), (*BIG, True)], [0]),
        ([(*BIG, True), ([9, 9, 9], 1, False)], [1]),  # which meet in a corner
    ],
)
@pytest.mark.parametrize(("scale", "shift"), [(1.0, 0.0), (1e-200, 0.0), (1e150, 0.0), (1.0, 1e6)])
def test_faces_that_look_inwards_are_found(parts, inward, scale, shift):
    mesh = cubes(*parts)
    mesh = Mesh(scale * mesh.vertices + shift, mesh.cells)
    assert sorted(set((inward_faces(mesh) // 12).tolist())) == inward
    assert (np.bincount(inward_faces(mesh) // 12) % 12 == 0).all()


def test_solids_that_touch_in_a_face_or_overlap_cross():
    assert crossing_remarks(cubes((*BIG, True), (*BESIDE, True), (*INSIDE, False))) == []
    passes, lies = "the solid passes through itself: ", "the solid lies upon itself, to 1e-09 of its size: "
    for other, what in ((([9, 2, 3], 5), lies), (([8, 2, 3], 5), passes), (BIG, lies)):
        (line,) = crossing_remarks(cubes((*BIG, True), (*other, True)))
        assert line.startswith(what)
    for height in (2e-9, 5e-10):  # of a tetrahedron
        thin = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.2, 0.2, height]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
        assert [line.startswith(lies) for line in crossing_remarks(thin)] == [True] * (height < 1e-9)


def test_the_order_of_control_points_is_doubted_where_many_sides_fold():
    folded = cubes((*BIG, True))
    folded = Mesh(folded.vertices * [1, 1, 0], folded.cells)
    assert [line[-17:] for line in folded_places(folded, "{} is {}".format)] == [", as if 0 is True"]
