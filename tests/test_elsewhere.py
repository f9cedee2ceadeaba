"""What other repositories use of this one: hooks before a commit, and an action. No network is needed to try them."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

from tests.shell import CURVE, PENTAGON, REPOSITORY, environment, gtb


def test_hooks_are_commands_that_take_files():
    text = (REPOSITORY / ".pre-commit-hooks.yaml").read_text(encoding="utf-8")
    entries = re.findall(r"^  entry: (.*)$", text, re.MULTILINE)
    assert len(entries) == len(re.findall(r"^- id: ", text, re.MULTILINE)) == 2
    for entry in entries:
        name, *words = shlex.split(entry)
        assert name == "gtb"
        assert gtb(*words, CURVE, PENTAGON).status == 0


def test_the_action_compares_with_golden_meshes(tmp_path):
    action = REPOSITORY / ".github" / "actions" / "diff" / "action.yml"
    text = action.read_text(encoding="utf-8")
    runs = re.findall(r"^    - run: (.*)$", text, re.MULTILINE)
    given = dict(re.findall(r"^        ([A-Z]+): \$\{\{ inputs\.(\w+) \}\}$", text, re.MULTILINE))
    defaults = dict(re.findall(r"^  (\w+):\n    description: .*\n    default: (.*)$", text, re.MULTILINE))
    assert set(given.values()) == set(defaults)
    assert "$GITHUB_ACTION_PATH/../../.." in runs[0]
    assert (action.parent / "../../../pyproject.toml").resolve() == REPOSITORY / "pyproject.toml"
    command = tmp_path / "gtb" / "bin" / "gtb"
    command.parent.mkdir(parents=True)
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m gtb_cli "$@"\n', encoding="utf-8")
    command.chmod(0o755)
    values = {name: defaults[key].strip('"') for name, key in given.items()}

    def status() -> int:
        variables = environment(RUNNER_TEMP=str(tmp_path), **values)
        return subprocess.run(["bash", "-e", "-c", runs[1]], cwd=tmp_path, env=variables, check=False).returncode

    (tmp_path / "specs").mkdir()
    spec = tmp_path / "specs" / "curve.toml"
    spec.write_bytes(Path(CURVE).read_bytes())
    assert gtb("mesh", tmp_path / "specs", "-n", 8, "-o", tmp_path / "golden").status == 0
    assert status() == 0
    spec.write_text(spec.read_text(encoding="utf-8").replace("[1, 2]", "[1, 2.01]"), encoding="utf-8")
    assert status() == 1
