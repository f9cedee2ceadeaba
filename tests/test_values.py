"""Frozen classes are what the standard library's frozen dataclasses are."""

import copy
import inspect
import pickle
from collections.abc import Callable
from dataclasses import FrozenInstanceError, dataclass, field, fields, replace
from typing import Any

import pytest

from gtb_cli.values import frozen


def body(decorate: Callable[[type], type]) -> Any:
    @decorate
    class Body:
        """A class with every kind of field."""

        first: int
        second: str = "two"
        several: tuple[int, ...] = field(default_factory=lambda: (1, 2), repr=False)
        last: float = field(default=0.5, kw_only=True)

    return Body


OURS = body(frozen)
THEIRS = body(dataclass(frozen=True, eq=False))
KINDS = pytest.mark.parametrize("kind", [OURS, THEIRS], ids=["ours", "theirs"])


@frozen
class Doubled:
    """A class that computes a field."""

    number: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "number", 2 * self.number)


@KINDS
def test_fields_have_the_values_given_and_defaults(kind: Any):
    assert vars(kind(1)) == {"first": 1, "second": "two", "several": (1, 2), "last": 0.5}
    assert vars(kind(1, second="b", last=2)) == {"first": 1, "second": "b", "several": (1, 2), "last": 2}
    assert vars(replace(kind(1, "b"), first=3, several=())) == {"first": 3, "second": "b", "several": (), "last": 0.5}
    assert repr(kind(1, "b")) == "body.<locals>.Body(first=1, second='b', last=0.5)"


@KINDS
@pytest.mark.parametrize(
    ("places", "given"),
    [((), {}), ((1, "b", (), 2), {}), ((1,), {"first": 2}), ((1,), {"third": 3}), ((), {"last": 1})],
)
def test_wrong_arguments_are_refused(kind: Any, places: tuple[Any, ...], given: dict[str, Any]):
    with pytest.raises(TypeError, match="argument"):
        kind(*places, **given)


@KINDS
def test_a_field_neither_changes_nor_goes(kind: Any):
    one = kind(1)
    for change in (lambda: setattr(one, "first", 2), lambda: delattr(one, "first"), lambda: setattr(one, "new", 2)):
        with pytest.raises(FrozenInstanceError, match=r"first|new"):
            change()
    assert one.first == 1


@KINDS
def test_objects_are_equal_to_themselves_only(kind: Any):
    assert kind(1) != kind(1)
    assert len({kind(1), kind(1)}) == 2


def test_the_signature_and_the_fields_are_the_same():
    ours, theirs = (inspect.signature(kind).parameters for kind in (OURS, THEIRS))
    assert list(ours) == list(theirs)
    assert [one.kind for one in ours.values()] == [one.kind for one in theirs.values()]
    assert [one.annotation for one in ours.values()] == [one.annotation for one in theirs.values()]
    assert ours["first"].default is inspect.Parameter.empty
    assert ours["last"].default == theirs["last"].default
    assert [one.name for one in fields(OURS)] == [one.name for one in fields(THEIRS)]


def test_a_computed_field_is_computed_once():
    one = Doubled(2)
    assert one.number == 4
    assert [copy.copy(one).number, copy.deepcopy(one).number, pickle.loads(pickle.dumps(one)).number] == [4, 4, 4]
