"""`.3dm` files: what they hold, and files that Rhino's own library does not get over."""

import json
from pathlib import Path

import numpy as np
import pytest

from gtb_cli.errors import SpecError
from gtb_cli.importers import rhino, rhino_process
from gtb_cli.importers.nurbs import MAX_CONTROL_POINTS
from gtb_cli.importers.readers import import_data
from gtb_cli.models.model import Model
from tests.foreign import rhino as small_file


def test_rhino_files() -> None:
    found = import_data("ball.3dm", small_file())
    assert isinstance(found.shape, Model)
    assert [patch.name for patch in found.shape] == [f"ball-{k}" for k in range(8)]
    points = np.concatenate([patch.evaluate([[0.3, 1.7], [2, 2], [1, 0.5]]) for patch in found.shape])
    np.testing.assert_allclose(np.linalg.norm(points - [1, 2, 3], axis=1), 2, rtol=1e-14)
    assert found.remarks == (
        "its unit of length is millimeters",
        "1 objects that are neither curves nor surfaces are left out",
        "3 curves beside the surfaces are left out",
    )


@pytest.mark.parametrize("data", [b"3D Geometry File Format        7", b"3D Geometry File Format" + bytes(500)])
def test_damaged_files(data: bytes) -> None:
    with pytest.raises(SpecError, match=r"x\.3dm: "):
        import_data("x.3dm", data)


def process(folder: Path, monkeypatch: pytest.MonkeyPatch, **changes: str) -> None:
    """Let the process be another one: the same with changes, or a text of its own."""
    # Lines of the process that tests change
    old = {
        "read": "library.File3dm.FromByteArray(data)",
        "library": '"rhino3dm"',
        "run": "raise SystemExit(main())",
    }
    text = Path(rhino_process.__file__).read_text(encoding="utf-8")
    for name, line in changes.items():
        assert old[name] in text
        text = text.replace(old[name], line)
    path = folder / "process.py"
    path.write_text(text, encoding="utf-8")
    monkeypatch.setattr(rhino_process, "__file__", str(path))


@pytest.mark.parametrize("read", ["any(iter(int, 1))", "bytes(200_000_000)", "sys.getrecursionlimit.oh", "print(data)"])
def test_a_process_that_needs_too_much_or_fails_is_a_damaged_file(
    read: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    process(tmp_path, monkeypatch, read=read)
    with pytest.raises(SpecError, match=r"^x\.3dm: is not a \.3dm file, or is damaged"):
        import_data("x.3dm", small_file())


def test_without_the_extra_there_is_a_message(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    process(tmp_path, monkeypatch, library='"rhino3dm_that_is_not_there"')
    with pytest.raises(SpecError, match=r"x\.3dm: \.3dm files need the extra gtb-cli\[rhino\]: pip install"):
        import_data("x.3dm", small_file())


def test_a_process_that_only_waits_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    process(tmp_path, monkeypatch, run='__import__("time").sleep(60)')
    monkeypatch.setattr(rhino, "PATIENCE_SECONDS", 0.1)
    with pytest.raises(SpecError, match=r"it is not read within 0\.1 s"):
        import_data("x.3dm", small_file())


@pytest.mark.parametrize(
    ("form", "message"),
    [
        ({"rows": [[0, 0, 0, 1], [1, float("nan"), 0, 1]]}, "control points: expected numbers up to"),
        ({"knots": [[0, float("inf")]]}, "knots: expected numbers up to"),
        ({"knots": [[]]}, "knots: expected 4, control points plus order, got 0"),
        ({"rows": [], "counts": [MAX_CONTROL_POINTS + 1]}, "control points: expected 1 to 100000, got 100001"),
        ({"degrees": [-1]}, "degree: expected 1 to 60, got -1"),
        ({"rows": [[0, 0, 0, 0], [1, 0, 0, 1]]}, r"weights\[0\]: must be positive, got 0"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_form_is_said(
    form: dict[str, object], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    line: dict[str, object] = {"degrees": [1], "counts": [2], "knots": [[0, 1]], "rows": [[0, 0, 0, 1], [1, 0, 0, 1]]}
    entry = {"name": "", "trimmed": False, "forms": [line | form]}
    process(tmp_path, monkeypatch, run=f"print({json.dumps(entry)!r}); print('{{}}')")
    with pytest.raises(SpecError, match=rf"^x\.3dm: objects\[0\]: {message}"):
        import_data("x.3dm", small_file())


def test_the_limits_of_both_processes_are_one() -> None:
    assert rhino_process.MAX_CONTROL_POINTS == MAX_CONTROL_POINTS


def test_a_curve_of_many_control_points_is_read(tmp_path: Path) -> None:
    """Their number was squared, and 317 were too many."""
    rhino3dm = pytest.importorskip("rhino3dm")
    file, path = rhino3dm.File3dm(), tmp_path / "x.3dm"
    places = [rhino3dm.Point3d(k, k * k % 3, 0) for k in range(400)]
    file.Objects.Add(rhino3dm.NurbsCurve.Create(False, 3, places))
    file.Write(str(path), 7)
    assert len(import_data("x.3dm", path.read_bytes()).shape) == 397
