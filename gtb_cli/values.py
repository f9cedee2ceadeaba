"""Value objects: frozen, and compared, hashed, copied and pickled by their fields, arrays included."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import MISSING, FrozenInstanceError, dataclass, field, fields
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar, dataclass_transform

if TYPE_CHECKING:
    from inspect import Signature

T = TypeVar("T", bound=type)


@dataclass_transform(frozen_default=True, eq_default=False, field_specifiers=(field,))
def frozen(kind: T) -> T:
    """Do what ``@dataclass(frozen=True, eq=False)`` does, with methods that classes share instead of compiled ones."""
    dataclass(init=False, repr=False, eq=False)(kind)
    known = fields(kind)
    names = frozenset(field.name for field in known)
    positional = [field.name for field in known if not field.kw_only]
    values = {field.name: field.default for field in known if field.default is not MISSING}
    factories = {field.name: field.default_factory for field in known if field.default_factory is not MISSING}
    required = names - values.keys() - factories.keys()
    finish = getattr(kind, "__post_init__", None)
    signature = _Signature()

    def __init__(self: Any, /, *places: Any, **given: Any) -> None:
        contents = dict(zip(positional, places, strict=False)) | given
        if len(contents) < len(places) + len(given) or not required <= contents.keys() <= names:
            signature.__get__(self, kind).bind(*places, **given)  # says what is wrong
        for name in factories.keys() - contents.keys():
            contents[name] = factories[name]()
        self.__dict__.update(values | contents)
        if finish is not None:
            finish(self)

    methods = {"__init__": __init__, "__repr__": _described, "__setattr__": _refuse, "__delattr__": _refuse}
    for name, method in (methods | {"__signature__": signature}).items():
        if name not in vars(kind):
            setattr(kind, name, method)
    return kind


class _Signature:
    """The signature of a class, made when somebody asks for it."""

    def __get__(self, instance: object, kind: Any) -> Signature:
        from inspect import Parameter, Signature

        def parameter(field: Any) -> Parameter:
            place = Parameter.KEYWORD_ONLY if field.kw_only else Parameter.POSITIONAL_OR_KEYWORD
            default = field.default if field.default_factory is MISSING else field.default_factory
            return Parameter(
                field.name, place, default=Parameter.empty if default is MISSING else default, annotation=field.type
            )

        return Signature([parameter(field) for field in fields(kind)])


def _described(self: Any) -> str:
    contents = (f"{field.name}={getattr(self, field.name)!r}" for field in fields(self) if field.repr)
    return f"{type(self).__qualname__}({', '.join(contents)})"


def _refuse(self: object, name: str, value: object = None) -> NoReturn:
    raise FrozenInstanceError(f"{name!r} of a {type(self).__name__} cannot change: it is frozen")


def by_value(kind: T) -> T:
    """Give a frozen dataclass equality, a hash and pickling by its fields.

    All three leave out fields with ``compare=False`` and cached values. A copy is made by the constructor, so that its
    arrays are read-only again, which pickle alone would not do. NaN equals NaN, and -0 equals 0.
    """
    names = tuple(field.name for field in fields(kind) if field.compare)

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
    import numpy as np  # options are values, too, and are read without it

    for value in contents.values():
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
    return kind(**contents)


def _plain(value: object) -> object:
    return dict(value) if isinstance(value, Mapping) else value


def _same(a: Any, b: Any) -> bool:
    if a is b:
        return True
    import numpy as np

    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return np.shape(a) == np.shape(b) and np.array_equal(a, b, equal_nan=np.asarray(a).dtype.kind == "f")
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(map(_same, a, b))
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return list(a) == list(b) and all(_same(a[key], b[key]) for key in a)
    return bool(a == b)


def _hashable(value: Any) -> Hashable:
    """A hashable object, equal for values that `_same` considers equal."""
    import numpy as np

    if isinstance(value, np.ndarray):
        if value.dtype.kind != "f":
            return value.shape, value.tobytes()
        return value.shape, np.where(np.isnan(value), np.nan, value + 0.0).tobytes()
    if isinstance(value, tuple):
        return tuple(map(_hashable, value))
    if isinstance(value, Mapping):
        return tuple((key, _hashable(entry)) for key, entry in value.items())
    return value  # type: ignore[no-any-return]
