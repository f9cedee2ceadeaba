"""What long work says of itself while it goes on, for the progress bar of this process."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

_current: Callable[[], str] = str


def status() -> str:
    """What the work that goes on says of itself, or an empty text."""
    return _current()


@contextmanager
def described(words: Callable[[], str]) -> Iterator[None]:
    """Let work be described by a function, which another thread may call at any time, until the work ends."""
    global _current
    before, _current = _current, words
    try:
        yield
    finally:
        _current = before
