"""How a function of a patch or model is made to take the path of its spec file as well."""

import os
from collections.abc import Callable
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeAlias, TypeVar

from gtb_cli.errors import DomainError
from gtb_cli.theory.patch import Patch

SpecPath: TypeAlias = str | os.PathLike[str]

Others = ParamSpec("Others")
Result = TypeVar("Result")


def of_patch(
    function: Callable[Concatenate[Patch, Others], Result],
) -> Callable[Concatenate[Patch | SpecPath, Others], Result]:
    """Let a function of a patch take a path, too; `DomainError` if it gets something else."""

    @wraps(function)
    def taking(patch: Patch | SpecPath, *others: Others.args, **options: Others.kwargs) -> Result:
        return function(loaded(patch, Patch), *others, **options)

    return taking  # type: ignore[return-value]  # it may be named, as `patch`


def loaded(thing: Any, *kinds: type) -> Any:
    """Load the patch or model of a path; `DomainError` if this or another thing is of none of these classes."""
    from gtb_cli.language.loading import load, load_patch

    read = load_patch if kinds == (Patch,) else load
    found = read(thing) if isinstance(thing, str | os.PathLike) else thing
    if not isinstance(found, kinds):
        names = " or ".join(kind.__name__ for kind in kinds)
        raise DomainError(f"expected a {names}, or the path of a spec file, got {type(found).__name__}")
    return found
