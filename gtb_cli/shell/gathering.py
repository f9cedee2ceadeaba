"""Options of a command that become one argument of its function."""

import functools
from collections.abc import Callable
from inspect import signature
from typing import Any, TypeAlias

import click

from gtb_cli.errors import DomainError

Function: TypeAlias = Callable[..., object]
Option: TypeAlias = Callable[[Function], Function]


def gathered(name: str, made: Callable[..., object], *options: Option, takes: object = None) -> Option:
    """Add options that the command gets as one argument, `name`.

    It is what `made` returns for the values that are parameters of `takes`, or of `made` itself. A `DomainError` about
    an argument becomes a usage error about the option of that name.
    """
    names = signature(takes or made).parameters  # type: ignore[arg-type]

    def decorator(function: Function) -> Function:
        @functools.wraps(function)
        def command(**values: Any) -> object:
            try:
                values[name] = made(**{key: values.pop(key) for key in names if key in values})
            except DomainError as error:
                raise click.UsageError(f"--{error}") from None
            return function(**values)

        result: Function = command
        for option in reversed(options):
            result = option(result)
        return result

    return decorator
