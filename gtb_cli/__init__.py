"""Generalized toric-Bézier patches: from a short text description to a mesh, and the theory as functions.

The public names are listed below by the modules that have them. Each has its shapes, units, errors and source in its
own help, and all are in specs/PYTHON.md with examples. They are imported when first used, and cost nothing before.
"""

from gtb_cli.version import __version__ as __version__

_SECTIONS = __spec__.loader.get_data(f"{__path__[0]}/__init__.pyi").decode("utf-8").split("\n# ")[1:]
_HOMES = {}  # the module of each name
for _title, *_lines in map(str.splitlines, _SECTIONS):
    __doc__ = f"{__doc__}\n{_title}\n"
    for _, _module, _, *_words in (_line.split() for _line in _lines if _line):
        _names = [_word.rstrip(",") for _word in _words[::3]]  # of: name as name, …
        __doc__ += f"    {_module.removeprefix('gtb_cli.')}: {', '.join(_names)}\n"
        _HOMES |= dict.fromkeys(_names, _module)
__all__ = ["__version__", *_HOMES]
_HOMES["notebook_html"] = "gtb_cli.pages.notebook"  # what a notebook shows, which nobody calls


def __getattr__(name):
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    value = globals()[name] = getattr(import_module(_HOMES[name]), name)
    return value


def __dir__():
    return sorted(__all__)
