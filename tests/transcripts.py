"""Sessions of a shell as data: `transcripts/*.txt`, where each command's status and both streams are compared whole.

    === A title that says what holds
    # Comments stand between the title and the first command.
    $ cat > two.toml <<END
    > name = "two"
    > END
    $ gtb mesh specs/pentagon.toml -n 4 -o x.obj
    ! gtb: x.obj: 51 vertices, 80 faces
    $ gtb mesh two.toml | head -n 1
    ? 2
    ! gtb: error: two.toml: knots: is missing…

A session has a folder of its own, in which `specs` is that of the repository; commands before the first title open
every session. A command, which `> ` continues over lines, is followed by its status where that is not 0, the lines of
its standard output, and behind `! ` those of standard error; JSON must also be as `tests/outputs.py` says. … stands
for anything in a line, and for any number of lines where it is alone. A title that begins with `long: ` leaves its
session out of `make test`. Commands of gtb and scripts of Python run in the process of the tests but where they need a
shell (shell.run_line).

`python -m tests.transcripts FILE` prints commands of a file of this form with what they do now.
"""

import re
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from tests.outputs import check_json
from tests.shell import SPECS, Result, run_line

TRANSCRIPTS = Path(__file__).parent / "transcripts"


@dataclass(frozen=True)
class Step:
    """A command, and what it must end with and print; its line is that in the file."""

    line: int
    command: str
    status: int = 0
    out: tuple[str, ...] = ()
    err: tuple[str, ...] = ()


@dataclass
class Session:
    """Commands that share a folder."""

    file: str
    title: str
    steps: list[Step] = field(default_factory=list)

    def __str__(self) -> str:
        return f"{self.file}: {self.title}"

    def run(self, folder: Path) -> None:
        """Run all commands, and compare what they do with what they must do."""
        for step, done in replace(self, steps=joined(self.steps)).results(folder):
            if done.status != step.status or not matches(step.out, done.text) or not matches(step.err, done.err):
                expected = shown(step.command, step.status, step.out, step.err)
                found = shown("", done.status, done.text.splitlines(), done.err.splitlines())
                raise AssertionError(f"{self.file}:{step.line}: {expected}\ndoes\n{found}")
            check_json(step.command, done)

    def results(self, folder: Path) -> Iterator[tuple[Step, Result]]:
        """Run one command after the other."""
        (folder / "specs").symlink_to(SPECS)
        for step in self.steps:
            yield step, run_line(step.command, folder)


def joined(steps: list[Step]) -> list[Step]:
    """Let one shell run successive silent commands: to start it takes longer than they do."""
    found: list[Step] = []
    joinable = False
    for step in steps:
        silent = step == Step(step.line, step.command) and not re.search(r"\b(gtb|git|python3)\b", step.command)
        if silent and joinable:
            found[-1] = replace(found[-1], command=f"{{ {found[-1].command}\n}} || exit\n{step.command}")
        else:
            found.append(step)
        joinable = silent
    return found


def matches(lines: tuple[str, ...], text: str) -> bool:
    """Tell whether a text has these lines, but for empty ones at its end."""
    parts = ["(?:.*\n)*" if line == "…" else ".*".join(map(re.escape, line.split("…"))) + "\n" for line in lines]
    return re.fullmatch("".join(parts), text.rstrip("\n") + "\n" if text.strip("\n") else "") is not None


def shown(command: str, status: int, out: Sequence[str], err: Sequence[str]) -> str:
    """A step as it stands in a transcript."""
    head = ["$ " + command.replace("\n", "\n> ")] * bool(command) + [f"? {status}"] * bool(status)
    return "\n".join([*head, *out, *(f"! {line}".rstrip() for line in err)])


def read(path: Path) -> tuple[list[Step], list[Session]]:
    """Read a transcript: the commands that open every session, and the sessions, with these."""
    first: list[Step] = []
    found: list[Session] = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        steps = found[-1].steps if found else first
        if line.startswith("=== "):
            found.append(Session(path.name, line[4:], first[:]))
        elif line.startswith("$ "):
            steps.append(Step(number, line[2:]))
        elif steps and line.startswith("> "):
            steps[-1] = replace(steps[-1], command=f"{steps[-1].command}\n{line[2:]}")
        elif steps and line.startswith("? "):
            steps[-1] = replace(steps[-1], status=int(line[2:]))
        elif steps and line.startswith("!"):
            steps[-1] = replace(steps[-1], err=(*steps[-1].err, line[2:]))
        elif len(steps) > (len(first) if found else 0):
            steps[-1] = replace(steps[-1], out=(*steps[-1].out, line))
        elif line and not line.startswith("#"):
            raise ValueError(f"{path}:{number}: expected a title, a command or a comment, got {line}")
    for steps in (first, *(session.steps for session in found)):
        steps[:] = [replace(step, out=_without_empty_lines(step.out)) for step in steps]
    return first, found


def _without_empty_lines(lines: tuple[str, ...]) -> tuple[str, ...]:
    """Drop empty lines at the end."""
    return _without_empty_lines(lines[:-1]) if lines and not lines[-1] else lines


if __name__ == "__main__":
    first, found = read(Path(sys.argv[1]))
    print("\n".join(shown(step.command, step.status, step.out, step.err) for step in first))
    for session in found:
        print(f"\n=== {session.title}")
        with tempfile.TemporaryDirectory() as name:
            for step, done in [*session.results(Path(name))][len(first) :]:
                print(shown(step.command, done.status, done.text.splitlines(), done.err.splitlines()))
