"""Files that a mesh file names: which are found, and what changes their digests."""

import pytest

from gtb_cli.distances.diff_and_distance import diff

POINTS = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


@pytest.mark.parametrize(
    ("library", "materials"),
    [
        ("mtllib m.mtl", b"newmtl a\rKd 1 0 0\rmap_Kd p.png\r"),
        ("mtllib m.mtl", b"newmtl a\nmap_Kd \\\n p.png\n"),
        ("maplib m.mtl", b"map_Kd p.png\n"),
        ("shadow_obj p.png", b""),
    ],
)
def test_each_byte_of_pictures_counts(tmp_path, library, materials):
    for name, picture in (("a", b"old"), ("b", b"new"), ("c", b"old")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "m.mtl").write_bytes(materials if name != "c" else materials.replace(b"\r", b"\r\n"))
        (tmp_path / name / "p.png").write_bytes(picture)
        (tmp_path / name / "x.obj").write_text(f"{library}\n{POINTS}usemap q\nf 1 2 3\n")
    a, b, c = (tmp_path / name / "x.obj" for name in "abc")
    assert diff(a, b).values == ("other data: libraries and pictures: not the same",)
    assert diff(a, c).same
