"""The pytest plugin, in runs of pytest of their own; runs that follow each other share a process."""

import re
import sys
import tomllib
from pathlib import Path

import pytest

from tests.marks import long
from tests.shell import PENTAGON, REPOSITORY, gtb, run_process

PREAMBLE = """
import os, pathlib, pytest, shutil, sys

os.environ.pop("CI", None)
os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"  # of hypothesis and others, in every run

def run(*options):  # without the short summary: it repeats messages whole where the variable CI is set
    print(f"\\0{int(pytest.main(['-q', '-rN', '-p', 'no:cacheprovider', '-p', 'gtb_cli.pytest_plugin', *options]))}")

def move(height):
    spec = pathlib.Path("lamp.toml")
    lines = spec.read_text().replace('["8/7", "8/7", 5]', '["8/7", "8/7", "h"]')
    spec.write_text(f"let = {{h = {height}}}\\n" + lines.partition("\\n")[2])

"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "lamp.toml").write_text(f"let = {{}}\n{Path(PENTAGON).read_text(encoding='utf-8')}", encoding="utf-8")
    (tmp_path / "pytest.ini").write_text("[pytest]\nfilterwarnings = error\n")
    return tmp_path


def runs(folder: Path, test: str, steps: str) -> list[tuple[int, str]]:
    """Return the status and the output of each run of a test file."""
    (folder / "test_lamp.py").write_text(f"import gtb_cli, pytest, sys\n{test}")
    done = run_process([sys.executable, "-c", PREAMBLE + steps], folder)
    assert done.status == 0, done.err
    *parts, _ = re.split(r"\0(\d+)\n", done.text)
    return [(int(status), text) for text, status in zip(parts[::2], parts[1::2], strict=True)]


def failures(text: str) -> int:
    return len(re.findall(r"^_+ test_\S+ _+$", text, re.MULTILINE))


def files(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for kind in ("obj", "ply") for path in folder.rglob(f"*.{kind}")}


def test_a_mesh_is_compared_with_its_golden_file(folder):
    gtb("mesh", folder / "lamp.toml", "-n", 8, "-o", folder / "lamp.obj", status=0)
    page = (REPOSITORY / "specs" / "COMMANDS.md").read_text(encoding="utf-8")
    new, same, near, far, renewed, again = runs(
        folder,
        re.search(r"^```python\n((?:(?!```)[^\n]*\n)*?def test_lamp.*?)^```$", page, re.M | re.S)[1],
        """
run(), run(), move(5.0000001), run(), move(5.1), run()
shutil.copytree("test_lamp", "differs")
run("--force-regen"), move(5.1000001), run("--force-regen")
""",
    )
    assert [status for status, _ in (new, same, near, far, renewed, again)] == [1, 0, 0, 1, 1, 0]
    assert "golden file did not exist, written: test_lamp/test_lamp.obj" in new[1]
    golden, obtained = folder / "differs" / "test_lamp.obj", folder / "differs" / "test_lamp.obtained.obj"
    assert golden.read_bytes() == (folder / "lamp.obj").read_bytes()
    said = gtb("diff", golden, obtained, "--tolerance", "1e-6", status=1).text.replace(f"{folder}/differs", "test_lamp")
    assert re.sub("^E +", "", far[1], flags=re.M).count(re.sub("^ +", "", f"AssertionError: {said}", flags=re.M)) == 1
    assert "pytest_plugin.py" not in far[1]
    assert "golden file differed, written: test_lamp/test_lamp.obj" in renewed[1]
    assert {path.suffix for path in (folder / "differs").iterdir()} == {".obj", ".html"}
    assert {path.name for path in (folder / "test_lamp").iterdir()} == {"test_lamp.obj"}
    assert (folder / "test_lamp" / "test_lamp.obj").read_bytes() == obtained.read_bytes()


@long
def test_golden_files_that_no_test_asked_for_are_named_after_full_runs_that_passed(folder):
    test = """
def test_lamp(mesh_regression):
    mesh_regression.check("lamp.toml", n=1, normals=True)
    mesh_regression.check("test_lamp/input.obj", fullpath="lamp.obj")
def test_other(mesh_regression):
    mesh_regression.check("lamp.toml", n=2)
    mesh_regression.check("test_lamp/input.obj", fullpath="lamp.obj", kind="surface")
"""
    (folder / "test_lamp").mkdir()
    gtb("mesh", folder / "lamp.toml", "-n", 1, "--normals", "-o", folder / "test_lamp" / "input.obj", status=0)
    steps = """
again = "import _pytest.runner as r\\ndef pytest_runtest_protocol(item): r.runtestprotocol(item, 0)"  # twice
pathlib.Path("conftest.py").write_text(again), run(), os.unlink("conftest.py")
[shutil.copy("test_lamp/input.obj", "test_lamp/" + name) for name in ("old.obj", "old.obtained.obj", "notes.txt")]
run(), run("-k", "other"), run("test_lamp.py::test_lamp")
pathlib.Path("conftest.py").write_text("def pytest_collection_modifyitems(items): items.pop()")
run(), os.unlink("conftest.py")
mesh = pathlib.Path("test_lamp/input.obj"); mesh.write_text(mesh.read_text().replace("vn 0.", "vn 9."))
run()
"""
    *texts, turned = [text for _, text in runs(folder, test, steps)]
    assert ["file test_lamp/old.obj" in text for text in texts] == [False, True, False, False, False]
    golden = (folder / "test_lamp" / "test_lamp.obj").read_text()
    assert ["did not exist" in texts[0], "vn" in golden, "normals: up to " in turned] == [True] * 3
    assert "not compared, as surfaces were" in turned


def test_what_a_library_holds_is_kept_no_attribute_is_lost_and_nothing_is_written_where_ci_is_set(folder):
    (folder / "a.obj").write_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n")
    (folder / "a.mtl").write_text("newmtl red\nKd 1 0 0\n")
    checks = {"a": "'a.obj'", "u": "'lamp.toml', n=1, attributes=['u']", "far": "'b.obj'", "theft": "'c.obj'"}
    test = "".join(f"def test_{n}(mesh_regression):\n    mesh_regression.check({w})\n" for n, w in checks.items())
    test += '@pytest.mark.xfail\ndef test_expected(mesh_regression):\n    mesh_regression.check("lamp.toml", n=1)\n'
    steps = 'run("-k", "expected")\nos.environ["CI"] = "true"\nrun("-k", "expected or test_a"), os.environ.pop("CI")\n'
    steps += 'assert not os.path.exists("test_lamp")\n'
    far = 'os.mkdir("b"), shutil.copy("a.mtl", "b")\n'
    far += 'pathlib.Path("b.obj").write_text(pathlib.Path("a.obj").read_text().replace("a.mtl", "b/a.mtl"))\n'
    far += 'pathlib.Path("c.obj").write_text(pathlib.Path("a.obj").read_text().replace("a.mtl", "test_a.obj"))\n'
    far += 'shutil.copy("b.obj", "test_a.obj")\n'
    steps += far + 'run("-k", "test_a"), run("-k", "test_a"), pathlib.Path("a.mtl").write_text("newmtl red"), run()'
    steps += ', shutil.copytree("test_lamp", "kept"), run("-k", "test_a", "--force-regen")'
    expected, on_ci, new, same, (status, text), renewed = runs(folder, test, steps)
    assert (expected[0], on_ci[0]) == (0, 1)
    assert "test_lamp/test_a.obj does not exist, and is not written where CI is set" in on_ci[1]
    assert [new[0], same[0], status, (folder / "kept" / "a.mtl").read_text()[-7:]] == [1, 0, 1, " 1 0 0\n"]
    assert (folder / "test_lamp" / "a.mtl").read_text() == "newmtl red"
    assert not (folder / "kept" / "test_theft.obj").exists()
    assert (folder / "kept" / "test_a.obj").read_text() == (folder / "a.obj").read_text()
    told = (
        "libraries and pictures: not",
        "attributes: OBJ holds none, give",
        "b/a.mtl is in another folder, and",
        "test_a.obj would be its library",
    )
    assert [each in text for each in told] == [True] * 4
    assert "written: test_lamp/test_a.obj, a.mtl; look" in renewed[1]


@long
def test_everything_that_has_a_mesh_is_checked_and_each_check_has_its_file(folder):
    found = runs(
        folder,
        """
@pytest.mark.parametrize("name", ["a/b c"])
class TestLamp:
    def test_it(self, name, mesh_regression):
        patch = gtb_cli.load("lamp.toml")
        mesh_regression.check(patch, n=2)
        mesh_regression.check([patch, patch.replace(name="b")], n=2, basename="both")
        mesh_regression.check(gtb_cli.tessellate(patch, 3), "1%", basename="mesh", format="ply")
        mesh_regression.check("test_lamp/mesh.ply", ignore=["connectivity"], fullpath="golden/mesh.obj")
        mesh_regression.check(patch, mesh_tolerance="5%", radius=None, basename="coarse")
""",
        "run(), run()",
    )
    assert [status for status, _ in found] == [1, 0]
    assert found[0][1].count("did not exist") == 5
    names = {f"test_lamp/{name}" for name in ("TestLamp_test_it_a_b_c.obj", "both.obj", "mesh.ply", "coarse.obj")}
    assert files(folder) == names | {"golden/mesh.obj"}


@long
def test_errors_are_one_line_and_no_traceback_of_gtb(folder):
    (folder / "bad.toml").write_text("knots = [0, 1]\n")
    (folder / "bad.obj").write_text("v 0 0\n")
    (status, text), renewed, again = runs(
        folder,
        """
def test_bad(mesh_regression):
    mesh_regression.check("bad.toml")
def test_missing(mesh_regression):
    mesh_regression.check("missing.toml")
def test_golden(mesh_regression):
    mesh_regression.check("lamp.toml", n=1, fullpath="bad.obj")
def test_format(mesh_regression):
    mesh_regression.check("lamp.toml", format="docx")
def test_name(mesh_regression):
    mesh_regression.check("lamp.toml", basename="x", fullpath="x.obj")
def test_twice(mesh_regression):
    for n in (1, 2):
        mesh_regression.check("lamp.toml", n=n)
@pytest.mark.parametrize("n", [1, 1.0], ids=["a b", "a/b"])
def test_names(mesh_regression, n):
    mesh_regression.check("lamp.toml", n=int(n))
""",
        "run(), run('-k', 'golden', '--force-regen'), run('-k', 'golden')",
    )
    assert (renewed[0], again[0]) == (1, 0)
    assert re.search(r"golden file could not be compared \(.*bad.obj.*\), written: bad.obj", renewed[1])
    assert (status, failures(text), text.count("\nE  ")) == (1, 7, 7)
    for message in (
        "SpecError: .*bad.toml: control_points",
        "GtbError: .*missing.toml: No such file or directory",
        "GtbError: .*bad.obj: .*3 coordinates",
        "ExportError: format: expected one of obj, ply, stl, glb, 3mf, got 'docx'",
        "DomainError: fullpath: excludes basename",
        "DomainError: basename: expected one, as another golden file has the name of this test",
        r"DomainError: basename: expected one, as .*test_names\[a b\] has the golden file .*test_names_a_b\.obj",
    ):
        assert re.search(rf"^E  .*{message}", text, re.MULTILINE), message
    assert "gtb_cli/" not in text


@long
def test_it_costs_nothing_until_a_mesh_is_checked_is_loaded_once_and_leaves_its_option_to_others(folder):
    """It is installed, named on the command line and named in a conftest.py."""
    installed = folder / "site" / "x-1.dist-info"
    installed.mkdir(parents=True)
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    ((name, module),) = project["entry-points"]["pytest11"].items()
    (installed / "METADATA").write_text("Metadata-Version: 2.1\nName: x\nVersion: 1\n")
    (installed / "entry_points.txt").write_text(f"[pytest11]\n{name} = {module}\n")
    (folder / "conftest.py").write_text(f'pytest_plugins = ["{module}"]\n')
    other = "def pytest_addoption(parser):\n    parser.addoption('--force-regen', action='store_true')\n"
    (folder / "other.py").write_text(other)
    found = runs(
        folder,
        """
def test_start(mesh_regression, pytestconfig):
    assert pytestconfig.getoption("force_regen") is True
    assert "gtb_cli.pytest_plugin" in sys.modules
    assert not {"numpy", "click", "gtb_cli.tessellation"} & sys.modules.keys()
""",
        "sys.path.append('site'), os.environ.pop('PYTEST_DISABLE_PLUGIN_AUTOLOAD')\n"
        "run('--force-regen'), run('-p', 'other', '--force-regen')",
    )
    assert [status for status, _ in found] == [0, 0], found


@long
def test_workers_of_xdist_share_golden_files(folder):
    test = """
@pytest.mark.parametrize("number", range(2))
def test_lamp(mesh_regression, number):
    mesh_regression.check("lamp.toml", n=4, fullpath="golden/lamp.obj")
    mesh_regression.check("lamp.toml", n=4)
"""
    (folder / "golden").mkdir()
    (folder / "golden" / "lamp.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    ((status, text),) = runs(folder, test, "run('-p', 'xdist', '-n', '2', '--force-regen')")
    assert (status, failures(text)) == (1, 2)
    assert "golden file differed, written: golden/lamp.obj" in text
    contents = {(folder / name).read_bytes() for name in files(folder)}
    assert (len(files(folder)), len(contents)) == (3, 1)
    ((status, text),) = runs(folder, test.replace("range(2)", "range(1)"), "run('-p', 'xdist', '-n', '1')")
    assert (status, text.count("no test asked for the golden file test_")) == (0, 1)
