"""Functions of a patch or a model that take the path of its spec file as well."""

import os
from collections.abc import Callable
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeAlias, TypeVar

from gtb_cli.display import registered
from gtb_cli.errors import DomainError

SpecPath: TypeAlias = str | os.PathLike[str]

Spec = TypeVar("Spec")
Result = TypeVar("Result")
Others = ParamSpec("Others")


def of_patch(
    function: Callable[Concatenate[Spec, Others], Result],
) -> Callable[Concatenate[Spec | SpecPath, Others], Result]:
    """Let a function of a patch take a path, too; `DomainError` if it gets something else."""

    @wraps(function)
    def taking(patch: Spec | SpecPath, *others: Others.args, **options: Others.kwargs) -> Result:
        found = registered("load_patch")(patch) if isinstance(patch, str | os.PathLike) else patch
        if not isinstance(found, registered("Patch")):
            raise DomainError(f"patch: expected a Patch or the path of its spec file, got {type(patch).__name__}")
        return function(found, *others, **options)

    return taking  # type: ignore[return-value]  # it may be named, as `patch`


def loaded(thing: Any, *kinds: str) -> Any:
    """Load the patch or model of a path; `DomainError` if this or another thing is of none of these public classes."""
    found = registered("load")(thing) if isinstance(thing, str | os.PathLike) else thing
    if not isinstance(found, tuple(map(registered, kinds))):
        raise DomainError(f"expected a {' or '.join(kinds)}, or the path of a spec file, got {type(found).__name__}")
    return found
