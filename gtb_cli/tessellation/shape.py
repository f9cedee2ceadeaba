"""Shapes: patches, models, and files of specs, which functions take alike."""

import os
from collections.abc import Iterable
from typing import TypeAlias

from gtb_cli.errors import DomainError
from gtb_cli.language.loading import load
from gtb_cli.theory.model import Model
from gtb_cli.theory.patch import Patch

Shape: TypeAlias = Patch | Model | Iterable[Patch] | str | os.PathLike[str]


def shape_of(shape: Shape) -> Patch | Model:
    """Return a patch or model as it is, load the file of a spec, and make a model of several patches.

    Raises
    ------
    DomainError
        It is something else.
    SpecError
        See `load`.
    """
    match shape:
        case Patch() | Model():
            return shape
        case str() | os.PathLike():
            return load(shape)
        case list() | tuple():
            return Model(tuple(shape))
    expected = "a Patch, a Model, several patches or the name of a spec file"
    raise DomainError(f"shape: expected {expected}, got {type(shape).__name__}")
