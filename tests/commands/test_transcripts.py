"""Every session of `tests/transcripts`, and the runner itself: what differs must be seen."""

from pathlib import Path

import pytest

from tests.marks import long
from tests.transcripts import TRANSCRIPTS, Session, Step, matches, read

ALL = [session for path in sorted(TRANSCRIPTS.glob("*.txt")) for session in read(path)[1]]


@pytest.mark.usefixtures("probed_here")
@pytest.mark.parametrize(
    "session",
    [pytest.param(session, marks=long if session.title.startswith("long: ") else ()) for session in ALL],
    ids=str,
)
def test_transcripts(session: Session, tmp_path: Path) -> None:
    session.run(tmp_path)


def test_titles_differ_and_every_session_runs_gtb() -> None:
    assert len({str(session) for session in ALL}) == len(ALL)
    assert all(any("gtb" in step.command.split() for step in session.steps) for session in ALL)


@pytest.mark.parametrize(
    ("step", "seen"),
    [
        (Step(1, "gtb --version", 0, ("gtb …",)), None),
        (Step(1, "gtb --version", 0, ("…", "gtb …", "…")), None),
        (Step(1, "gtb --version"), "does\ngtb "),
        (Step(1, "gtb --version", 1, ("gtb …",)), "does\ngtb "),
        (Step(1, "gtb frob", 0, (), ("gtb: error: No such command: frob.…",)), r"does\n\? 2\n! gtb: error: No such"),
        (Step(1, "gtb frob", 2), "does\n"),
        (Step(1, "gtb frob", 2, ("gtb: error: No such command: frob.…",)), "does\n"),
        (Step(1, "gtb frob; false", 1, (), ("…",)), None),
        (Step(1, "gtb frob | cat", 2, (), ("gtb: error: …",)), None),
    ],
)
def test_the_runner_sees_what_differs(step: Step, seen: str | None, tmp_path: Path) -> None:
    session = Session("x.txt", "x", [step])
    if seen is None:
        session.run(tmp_path)
    else:
        with pytest.raises(AssertionError, match=seen):
            session.run(tmp_path)


def test_silent_commands_share_a_shell_up_to_the_first_that_fails(tmp_path: Path) -> None:
    steps = [Step(1, "cat > a <<E\nx\nE"), Step(2, "grep -q y a"), Step(3, "echo z > a"), Step(4, "gtb --version")]
    with pytest.raises(AssertionError, match=r"(?s)x.txt:1: .*grep -q y a.*does\n\? 1$"):
        Session("x.txt", "x", steps).run(tmp_path)
    assert (tmp_path / "a").read_text(encoding="utf-8") == "x\n"


def test_the_parts_of_a_transcript(tmp_path: Path) -> None:
    text = "# words\n$ cd\n\n=== one\n# why\n$ cat <<E\n> a\n> E\n? 3\nx\n\n! y\n!\n\n=== two\n$ true\n"
    (tmp_path / "t.txt").write_text(text, encoding="utf-8")
    first, (one, two) = read(tmp_path / "t.txt")
    assert first == [Step(2, "cd")]
    assert one.steps == [*first, Step(6, "cat <<E\na\nE", 3, ("x",), ("y", ""))]
    assert two.steps == [*first, Step(16, "true")]
    assert [matches(("a", "…"), text) for text in ("a\n", "a\nb\nc\n", "b\na\n", "")] == [True, True, False, False]
    assert [matches((), text) for text in ("", "\n", "a")] == [True, True, False]
