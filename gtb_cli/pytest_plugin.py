"""The pytest plugin: its fixture `mesh_regression` compares meshes with golden files beside the test.

Every run of pytest imports this module where gtb is installed: what computes is imported by the first check.
"""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Collection, Generator, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import pytest

from gtb_cli.vocabulary import FORMATS, Aspect, Comparison, suffix_of

if TYPE_CHECKING:
    from gtb_cli.distances.operands import Comparable
    from gtb_cli.verdicts.comparing import Comparing

_TESTS = pytest.StashKey[dict[str, str]]()  # that have golden files of their names, by these
_ASKED = pytest.StashKey[set[str]]()  # paths of golden files and of meshes that tests compared
_PARTLY = pytest.StashKey[bool]()  # whether tests were left out
_WRITTEN = pytest.StashKey[list[str]]()  # messages about the golden files that a test wrote
_TOLD = pytest.StashKey[str]()  # those with which it failed


@pytest.hookimpl(trylast=True)  # other plugins have the same option, and fail if they are not the first to add it
def pytest_load_initial_conftests(early_config: pytest.Config, parser: pytest.Parser) -> None:
    """Add the option that renews golden files, if no plugin has added it."""
    if not hasattr(early_config.option, "force_regen"):
        text = "renew the golden files that differ, and fail their tests once"
        parser.getgroup("gtb").addoption("--force-regen", action="store_true", help=text)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    """Fail a test that wrote golden files, at its end, so that one run writes those of all its checks; also a rerun."""
    try:
        result = yield
    except (pytest.skip.Exception, pytest.xfail.Exception):
        if not item.stash.get(_WRITTEN, None):
            raise
    if written := item.stash.get(_WRITTEN, None):
        item.stash[_TOLD] = "\n".join(written)
        pytest.fail(item.stash[_TOLD], pytrace=False)
    return result


@pytest.hookimpl(wrapper=True)
def pytest_collection_modifyitems(config: pytest.Config, items: Sequence[pytest.Item]) -> Generator[None]:
    """Note whether any plugin leaves tests out, as not all of them tell others so."""
    count = len(items)
    yield
    config.stash[_PARTLY] = len(items) < count


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Tell the process that started this worker of pytest-xdist which golden files were asked for."""
    if hasattr(session.config, "workeroutput"):
        stash = session.config.stash
        session.config.workeroutput["gtb"] = sorted(stash.get(_ASKED, ())), stash.get(_PARTLY, False)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Gather what a worker has told."""
    asked, partly = getattr(node, "workeroutput", {}).get("gtb", ((), True))
    node.config.stash.setdefault(_ASKED, set()).update(asked)
    node.config.stash[_PARTLY] = partly or node.config.stash.get(_PARTLY, False)


def pytest_terminal_summary(terminalreporter: Any, exitstatus: int, config: pytest.Config) -> None:
    """Name golden files in the folders of test modules that no test asked for, if all their tests ran and passed."""
    asked = config.stash.get(_ASKED, set())
    partly = config.stash.get(_PARTLY, False) or config.getoption("lf", False) or "::" in "".join(config.args)
    if exitstatus or partly or {"skipped", "xfailed", "xpassed"} & terminalreporter.stats.keys():
        return
    for folder in sorted({path.parent for path in map(Path, asked) if os.path.exists(f"{path.parent}.py")}):
        for path in sorted(folder.iterdir()):
            if suffix_of(path.name) in FORMATS and ".obtained." not in path.name and str(path) not in asked:
                shown = os.path.relpath(path, config.invocation_params.dir)
                terminalreporter.write_line(f"no test asked for the golden file {shown}")


@pytest.fixture
def mesh_regression(request: pytest.FixtureRequest) -> Iterator[MeshRegression]:
    """Compare meshes with golden files beside the test: ``mesh_regression.check("lamp.toml", tolerance="1e-6", n=8)``.

    A golden file that is missing is written, and the test fails once; --force-regen renews those that differ likewise.
    """
    yield MeshRegression(request)
    if (told := "\n".join(request.node.stash[_WRITTEN])) != request.node.stash.get(_TOLD, ""):  # after the test
        pytest.fail(told, pytrace=False)


class MeshRegression:
    """The golden files of one test."""

    def __init__(self, request: pytest.FixtureRequest) -> None:
        self._test, self._file, self._config = request.node, request.path, request.config
        self._written = self._test.stash.setdefault(_WRITTEN, [])
        self._named_after_test = False  # whether a golden file has the name of the test already

    def check(
        self,
        what: Comparable,
        tolerance: float | str | None = None,
        *,
        n: int | None = None,
        mesh_tolerance: float | str | None = None,
        kind: Comparison = "auto",
        ignore: Aspect | Collection[Aspect] = (),
        format: str | None = None,
        basename: str | None = None,
        fullpath: str | os.PathLike[str] | None = None,
        **options: Any,
    ) -> None:
        """Compare a mesh with its golden file, as ``gtb diff`` does.

        If the golden file is missing, or differs and pytest was called with ``--force-regen``, then it is written, and
        the test fails at its end, also when it is run again at once; no test marked xfail writes one.

        Parameters
        ----------
        what : Patch, Model, several patches, Mesh, or path of a spec or of a mesh file
            A path is relative to the folder of the test. A mesh file in the format of the golden file is compared in
            all that it and its libraries hold, any other in faces, groups, and normals where ``normals=True`` asks.
        tolerance : float or str, optional
            Largest distance that is no difference, in model units or as ``"1%"`` of the size. Default: 1e-9 of the
            size, but never less than the digits of the file.
        n, mesh_tolerance, **options
            How a spec, patch or model is meshed: ``-n`` or ``--tolerance`` of ``gtb mesh``, and other arguments of
            `gtb_cli.Recipe`.
        kind, ignore : as in `gtb_cli.diff`
        format : {"obj", "ply", "stl", "glb"}, optional
            Format of the golden file. Default: the suffix of `fullpath`, else OBJ, whose changes read as text.
        basename : str, optional
            Name of the golden file, without suffix, in the folder with the name of the test module. Default: the name
            of the test, which holds for one check.
        fullpath : path, optional
            Path of the golden file, relative to the folder of the test.

        Raises `AssertionError` if the mesh differs from the golden file; beside that one it is left as
        ``NAME.obtained.obj``, with a report, ``NAME.obtained.html``, until it differs no more. Raises `GtbError` if a
        file cannot be read or written, or the arguments make no sense.
        """
        __tracebackhide__ = True
        from gtb_cli.distances.operands import operand
        from gtb_cli.errors import DomainError, GtbError
        from gtb_cli.files import read_file
        from gtb_cli.formats.export import encode_mesh
        from gtb_cli.tessellation.recipe import Recipe
        from gtb_cli.verdicts.comparing import Comparing

        with suppress(TypeError, ValueError):  # None and percentages
            tolerance = float(tolerance)  # type: ignore[arg-type]
        if n is not None:
            options["resolution"] = n
        try:
            recipe = Recipe(tolerance=mesh_tolerance, **options)
            format = format or (suffix_of(os.fspath(fullpath)) if fullpath is not None else "obj")
            golden = self._golden(format, basename, fullpath)
            path = self._file.parent / what if isinstance(what, str | os.PathLike) else what
            self._config.stash.setdefault(_ASKED, set()).update({str(golden), str(path)})
            found = operand(path, recipe)
            mesh = found.made if recipe.normals else found.known.mesh
            files, kept = dict[str, bytes](), FORMATS.get(format)
            if isinstance(path, Path) and found.known.format == format:  # then it may hold more than a mesh
                data = path.read_bytes()
                named = [name for name, held in found.libraries.items() if isinstance(held, bytes)]
                if far := [name for name in named if os.path.dirname(name)]:
                    raise GtbError(f"{path}: {far[0]} is in another folder, and is not kept beside a golden file")
                files = {name: read_file(path.parent / name, os.path.getsize(path.parent / name)) for name in named}
            else:
                if mesh.attributes and kept and not kept.attributes:
                    raise DomainError(f"attributes: {format.upper()} holds none, give format='ply'")
                data = b"".join(encode_mesh(mesh, format, normals=recipe.normals or None))
            self._compare(golden, data, files, Comparing(recipe, tolerance, kind, ignore))
        except GtbError as error:
            raise error.with_traceback(None) from None

    def _golden(self, format: str, basename: str | None, fullpath: str | os.PathLike[str] | None) -> Path:
        from gtb_cli.errors import DomainError

        if fullpath is not None:
            if basename is not None:
                raise DomainError("fullpath: excludes basename, give one of them")
            return self._file.parent / fullpath
        nodes = [node.name for node in self._test.listchain() if isinstance(node, pytest.Class | pytest.Item)]
        name = basename if basename is not None else re.sub(r"[^\w.-]+", "_", "_".join(nodes)).rstrip("_")
        path = self._file.with_suffix("") / f"{name}.{format}"
        if basename is None:
            if self._named_after_test:
                raise DomainError("basename: expected one, as another golden file has the name of this test already")
            self._named_after_test = True
            test = self._config.stash.setdefault(_TESTS, {}).setdefault(str(path), self._test.nodeid)
            if test != self._test.nodeid:
                raise DomainError(f"basename: expected one, as {test} has the golden file {self._shown(path)}")
        return path

    def _compare(self, golden: Path, data: bytes, beside: Mapping[str, bytes], comparing: Comparing) -> None:
        """Compare a golden file with new bytes and material libraries, and write what has to be written."""
        __tracebackhide__ = True
        from gtb_cli.errors import GtbError
        from gtb_cli.files import place_outside, replace_file
        from gtb_cli.review.reports import reviewed, write_reports
        from gtb_cli.verdicts.verdict import Verdict

        if not os.path.exists(golden):  # `Path.exists` raises an error for names that are too long
            if os.environ.get("CI"):  # a second run would pass by what the first one wrote
                raise AssertionError(f"{self._shown(golden)} does not exist, and is not written where CI is set")
            self._renew(golden, data, beside, "did not exist")
            return
        renews = self._config.getoption("force_regen", False)
        obtained, page = (golden.with_name(f"{golden.stem}.obtained{end}") for end in (golden.suffix, ".html"))
        with TemporaryDirectory() as folder:  # another run may be comparing with the same golden file
            new = os.path.join(folder, obtained.name)
            for name, content in {**beside, obtained.name: data}.items():
                Path(folder, name).write_bytes(content)
            try:
                verdict = comparing.files(str(golden), new)
            except GtbError as error:
                if not renews:
                    raise
                verdict = Verdict(golden.name, (str(golden), new), "unreadable", errors=tuple(error.faults))
        if verdict.same or renews:
            for message in verdict.warnings if verdict.same else ():  # on what was not compared
                warnings.warn(f"{self._shown(golden)}: {message}", stacklevel=3)
            if not verdict.same:
                problem = f"could not be compared ({verdict.errors[0]})" if verdict.errors else "differed"
                self._renew(golden, data, beside, problem)
            obtained.unlink(missing_ok=True)
            page.unlink(missing_ok=True)
            return
        verdict = replace(verdict, paths=(self._shown(golden), self._shown(obtained)))
        replace_file(obtained, [data])
        write_reports(reviewed(verdict.paths, [verdict], comparing), [str(page)])
        takes = "" if place_outside(str(golden)) else ", and pytest --force-regen takes it as golden"
        ways_out = f"{self._shown(page)} shows it{takes}"
        raise AssertionError("\n".join([verdict.text.rstrip("\n"), *verdict.warnings, ways_out]))

    def _renew(self, golden: Path, data: bytes, beside: Mapping[str, bytes], reason: str) -> None:
        """Write a golden file and its libraries, and note why; not where a failure is expected, which hides a note."""
        from gtb_cli.files import StagedFiles

        if self._test.get_closest_marker("xfail") and not self._config.getoption("runxfail", False):
            told = f"{reason}, and is not written by a test marked xfail but with --runxfail"
            raise AssertionError(f"{self._shown(golden)} {told}")
        for name, content in beside.items():  # a golden file of another test, perhaps; its own library may be renewed
            held, may_be_own = golden.parent / name, golden.exists() and suffix_of(name) not in FORMATS
            if held != golden and held.is_file() and not may_be_own and held.read_bytes() != content:
                told = f"{self._shown(held)} would be its library, but is there already with other content"
                raise AssertionError(f"{self._shown(golden)} {reason}, and is not written: {told}")
        with StagedFiles(golden.parent) as files:
            for name, content in {**beside, golden.name: data}.items():
                files.add(str(golden.parent / name), [content])
        written = ", ".join([self._shown(golden), *beside])  # another golden file may have the same library
        self._written.append(f"golden file {reason}, written: {written}; look at it, and run again")

    def _shown(self, path: Path) -> str:
        """Return a path as commands take it in the folder in which pytest was called."""
        folder = self._config.invocation_params.dir
        return str(path.relative_to(folder) if path.is_relative_to(folder) else path)
