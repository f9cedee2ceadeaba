"""Git shows changes of meshes, with the configuration that specs/COMMANDS.md gives."""

import re
import shutil
from pathlib import Path

import pytest

from tests.marks import long
from tests.shell import PENTAGON, REPOSITORY, shell

IDENTITY = "git -c user.name=a -c user.email=a@b.c -c commit.gpgsign=false"

COMMANDS = (REPOSITORY / "specs" / "COMMANDS.md").read_text(encoding="utf-8")
CONFIGURATION = "\n".join(re.findall(r"^    (git config .*)$", COMMANDS, re.MULTILINE))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A repository with a mesh of which there is a newer version."""
    folder = tmp_path_factory.mktemp("repository")
    lines = f"""
    export GIT_CONFIG_GLOBAL=/dev/null
    git init -q . && echo '*.obj diff=gtb' > .gitattributes
    {CONFIGURATION}
    cp {PENTAGON} p.toml && gtb mesh -q p.toml -n 4 -o 'a mesh.obj'
    git add '*.obj' .gitattributes && {IDENTITY} commit -qm one
    sed -i 's/"8\\/7", 5/"8\\/7", 7/' p.toml && gtb mesh -q p.toml -n 4 -o 'a mesh.obj'
    """
    assert shell(lines, folder).status == 0
    return folder


@pytest.fixture
def repository(made: Path, tmp_path: Path) -> Path:
    return shutil.copytree(made, tmp_path / "repository", symlinks=True)


def test_git_diff_shows_a_change_as_text(repository):
    changed = shell("git diff", repository)
    assert changed.status == 0
    lines = [line for line in changed.text.splitlines() if line[0] in "+-"]
    said = ["area", "centroid", "digest of positions", "second moments"]
    assert sorted({line[1:22].strip() for line in lines[2:]}) == said


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        ("s/^v 1.5.*/v 1.5 1.001 2/", "centroid"),  # a vertex moved
        ("s/^vn .*/vn 0 0 -1/", "digest of normals"),
        pytest.param(r"s/^v \([^ ]*\) /v -\1 /", "centroid", marks=long),  # mirrored in x
        pytest.param("s/^vt 1.*/vt 0.5 0.5/", "digest of texture coordinates", marks=long),
        pytest.param(r"s/^f \([^ ]*\) \([^ ]*\)/f \2 \1/", "digest of faces", marks=long),
    ],
)
def test_git_diff_shows_every_change_of_a_mesh(repository, edit, said):
    made = f"gtb mesh -q p.toml -n 4 --normals --uv -o 'a mesh.obj' && git add . && {IDENTITY} commit -qm more"
    assert shell(f"{made} && sed -i '0,/xxx/{edit}' 'a mesh.obj'", repository).status == 0
    assert said in shell("git diff", repository).text


def test_git_goes_on_after_a_file_that_cannot_be_read(repository):
    steps = "git commit -qam 2; sed -i 1i= 'a mesh.obj'; git commit -qam 3; sed -i 1d 'a mesh.obj'; git commit -qam 4"
    assert shell(steps.replace("git", IDENTITY), repository).status == 0
    shown = shell("git log -p --format=%s", repository)
    assert (shown.status, shown.text.count("diff --git")) == (0, 5)


@long
def test_git_diff_shows_no_other_digits(repository):
    made = f"gtb mesh -q p.toml -n 1 -o 'a mesh.obj' && git add . && {IDENTITY} commit -qm more"
    edit = r"sed -i 's/^v \(.*\)\.00000000/v \1.0/' 'a mesh.obj'"
    assert shell(f"{made} && {edit} && git diff --stat | grep -q obj", repository).status == 0
    assert not [line for line in shell("git diff", repository).text.splitlines()[4:] if line[0] in "+-"]


def test_git_diff_shows_a_mesh_that_breaks(repository):
    (repository / "a mesh.obj").write_text("v 0 0 nan\n")
    changed = shell("git diff", repository)
    assert (changed.status, "+fault                 line 1: a vertex is not finite" in changed.text) == (0, True)


def test_git_difftool_writes_a_page_of_all_files(repository):
    done = shell("git difftool -d", repository)
    assert (done.status, "0 same, 1 different, 0 missing, 0 extra" in done.text) == (0, True)
    assert "a mesh.obj" in (repository / "changes.html").read_text()
