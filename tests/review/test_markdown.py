"""Markdown: nothing in a name is markup, and a comment is never too long."""

import pytest
from markdown_it import MarkdownIt

from gtb_cli import diff
from gtb_cli.review.changes import review
from gtb_cli.review.markdown import MAX_BYTES, markdown
from tests.review.test_changes import change, mesh_of, moved

HOSTILE = [
    "a|b.obj",
    "`x`",
    "``",
    "<script>alert(1)</script>",
    "line\nbreak",
    "[x](javascript:1)",
    "@all #1",
    " x ",
    "a\\|b",
    "!",
]


def rendered(text: str) -> str:
    return MarkdownIt("commonmark").enable("table").render(text)


@pytest.mark.parametrize("name", HOSTILE)
def test_no_name_is_markup(name):
    text = markdown(review((name, "b"), iter([change(name, "unreadable", reasons=[name])])), page=name)
    page = rendered(text)
    assert page.count("<tr>") == 2
    assert page.count("<td") == 4
    assert page.count("<code>") == 6
    shown = name.replace("\n", "\\n").replace("<", "&lt;").replace(">", "&gt;")
    assert page.count(f"<code>{shown}</code>") == 5
    assert not any(mark in page for mark in ("<script", "<a ", "<img"))


def test_the_table_has_old_and_new():
    old = mesh_of("pentagon", 4)
    new = moved(old, 1.0)
    text = markdown(review(("a", "b"), iter([None, change("x.obj", "different", old, new, diff(old, new))])), "p.html")
    assert "1 same, 1 different." in text
    assert "`p.html`" in text
    assert "| `x.obj` | different | 1 |" in text
    assert "→ **" in text
    assert "most at (" in text


def test_a_comment_is_never_too_long():
    reasons = ["an error that has many words in it"] * 3
    changes = [change(f"mesh-{k}.obj", "unreadable", reasons=reasons) for k in range(900)]
    text = markdown(review(("a", "b"), iter(changes)))
    assert MAX_BYTES - 1000 < len(text.encode()) <= MAX_BYTES
    shown = text.count("| `mesh-")
    assert f"And {900 - shown} more." in text
    assert rendered(text).count("<tr>") == shown + 1
