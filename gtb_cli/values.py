"""Value objects: frozen, and compared, hashed, copied and pickled by their fields, arrays included."""

import math
from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, TypeVar, dataclass_transform

T = TypeVar("T", bound=type)
Key = TypeVar("Key", bound=Hashable)
Entry = TypeVar("Entry")


def grouped(pairs: Iterable[tuple[Key, Entry]]) -> dict[Key, list[Entry]]:
    """Collect what pairs have second by what they have first, in their order."""
    found: dict[Key, list[Entry]] = {}
    for key, entry in pairs:
        found.setdefault(key, []).append(entry)
    return found


def if_finite(value: float | None) -> float | None:
    """Return a number for JSON, which has no others: None if it is infinite or not a number."""
    return value if value is not None and math.isfinite(value) else None


@dataclass_transform(frozen_default=True, eq_default=False, field_specifiers=(field,))
def frozen(kind: T) -> T:
    """Make a frozen dataclass whose objects are equal to themselves only."""
    dataclass(frozen=True, eq=False)(kind)
    return kind


@dataclass_transform(frozen_default=True, eq_default=False, field_specifiers=(field,))
def by_value(kind: T) -> T:
    """Make a frozen dataclass whose objects have equality, a hash and pickling by their fields.

    All three leave out fields with ``compare=False`` and cached values. A copy is made by the constructor, so that its
    arrays are read-only again, which pickle alone would not do. NaN equals NaN, and -0 equals 0.
    """
    names = tuple(field.name for field in fields(frozen(kind)) if field.compare)

    def key(self: Any) -> Hashable:
        return _hashable(tuple(getattr(self, name) for name in names))

    def equals(self: Any, other: object) -> bool:
        return self is other or (other.__class__ is self.__class__ and key(self) == key(other))

    def hashed(self: Any) -> int:
        return hash(key(self))

    def reduced(self: Any) -> tuple[Any, ...]:
        contents = {name: getattr(self, name) for name in names}
        return _made, (kind, {name: dict(x) if isinstance(x, Mapping) else x for name, x in contents.items()})

    kind.__eq__, kind.__hash__, kind.__reduce__ = equals, hashed, reduced  # type: ignore[method-assign,assignment]
    return kind


def _made(kind: Any, contents: dict[str, object]) -> object:
    import numpy as np  # options are values, too, and are read without it

    for value in contents.values():
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
    return kind(**contents)


def _hashable(value: Any) -> Hashable:
    import numpy as np

    if isinstance(value, np.ndarray):
        plain = value.astype(np.int64) if value.dtype.kind in "iu" else value
        if value.dtype.kind == "f":
            plain = np.where(np.isnan(value), np.nan, value + 0.0)
        return value.shape, plain.tobytes()
    if isinstance(value, tuple):
        return tuple(map(_hashable, value))
    if isinstance(value, Mapping):
        return tuple((key, _hashable(entry)) for key, entry in value.items())
    return value  # type: ignore[no-any-return]
