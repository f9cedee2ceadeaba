"""Options of commands, written as their help shows them, and several that become one argument of a function."""

import functools
from collections.abc import Callable
from inspect import signature
from typing import Any, TypeAlias

import click

from gtb_cli.errors import DomainError

Function: TypeAlias = Callable[..., object]
Option: TypeAlias = Callable[[Function], Function]


def reads(read: Callable[[Any], object], absent: object = None) -> Callable[..., object]:
    """Return the callback of an option whose value `read` turns into another; its `ValueError` is a usage error."""

    def callback(_ctx: click.Context, param: click.Parameter, value: object) -> object:
        try:
            return absent if value is None else read(value)
        except ValueError as error:
            raise click.BadParameter(str(error).removeprefix(f"{param.name}: ")) from None

    return callback


def option(usage: str, takes: Any, *, into: str | None = None, **more: Any) -> Callable[..., Option]:
    """Return `click.option` for an option, named as its help shows it, ``-n, --resolution N``; only the help is left.

    It takes no value (`bool`), one of a tuple of words, a value of a type of click, or text (`str`), from which a
    function may read its value. `into` is the name of the argument, if it is another one, and `more` is as in click.
    """
    names = usage.split(" ")
    more["metavar"] = None if names[-1].startswith("-") else names.pop()
    if takes is bool:
        more["is_flag"] = True
    elif isinstance(takes, tuple):
        more["type"] = click.Choice(takes)
    elif takes is str or isinstance(takes, click.ParamType):
        more["type"] = takes
    else:
        more["callback"] = reads(takes)
    return functools.partial(click.option, *(name.rstrip(",") for name in names), *filter(None, [into]), **more)


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
        for each in reversed(options):
            result = each(result)
        return result

    return decorator
