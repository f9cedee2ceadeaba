"""Value objects: compared, hashed, copied and pickled by their fields, arrays included."""

from __future__ import annotations

import dataclasses
from collections.abc import Hashable, Mapping
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T", bound=type)


def by_value(kind: T) -> T:
    """Give a frozen dataclass equality, a hash and pickling by its fields.

    All three leave out fields with ``compare=False`` and cached values. A copy is made by the constructor, so that its
    arrays are read-only again, which pickle alone would not do. NaN equals NaN, and -0 equals 0.
    """
    names = tuple(field.name for field in dataclasses.fields(kind) if field.compare)

    def contents(self: Any) -> tuple[object, ...]:
        return tuple(getattr(self, name) for name in names)

    def equals(self: Any, other: object) -> bool:
        if self is other:
            return True
        if other.__class__ is not self.__class__:
            return False
        return _same(contents(self), contents(other))

    def hashed(self: Any) -> int:
        return hash(_hashable(contents(self)))

    def reduced(self: Any) -> tuple[Any, ...]:
        return _made, (kind, {name: _plain(getattr(self, name)) for name in names})

    for name, method in (("__eq__", equals), ("__hash__", hashed), ("__reduce__", reduced)):
        method.__name__ = name
        setattr(kind, name, method)
    return kind


def _made(kind: Any, contents: dict[str, object]) -> object:
    for value in contents.values():
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
    return kind(**contents)


def _plain(value: object) -> object:
    return dict(value) if isinstance(value, Mapping) else value


def _same(a: Any, b: Any) -> bool:
    if a is b:
        return True
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return np.shape(a) == np.shape(b) and np.array_equal(a, b, equal_nan=np.asarray(a).dtype.kind == "f")
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(map(_same, a, b))
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return list(a) == list(b) and all(_same(a[key], b[key]) for key in a)
    return bool(a == b)


def _hashable(value: Any) -> Hashable:
    """A hashable object, equal for values that `_same` considers equal."""
    if isinstance(value, np.ndarray):
        if value.dtype.kind != "f":
            return value.shape, value.tobytes()
        return value.shape, np.where(np.isnan(value), np.nan, value + 0.0).tobytes()
    if isinstance(value, tuple):
        return tuple(map(_hashable, value))
    if isinstance(value, Mapping):
        return tuple((key, _hashable(entry)) for key, entry in value.items())
    return value  # type: ignore[no-any-return]
