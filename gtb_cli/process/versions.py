"""Everything beside a spec and its options on which the bytes of a mesh file depend."""

import functools
import hashlib
import platform
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from gtb_cli.version import __version__

PACKAGES = ("numpy", "scipy", "trimesh")  # packages that take part in making files


@functools.cache
def versions() -> dict[str, str | None]:
    """Return the versions of this program, of packages (None: not installed) and of Python; and the processor's kind.

    ``sources`` is a checksum of this program's own files, as its version stays through many changes.
    """
    sources = hashlib.sha256()
    for file in sorted(Path(__file__).parents[1].rglob("*.*")):
        if file.is_file() and file.suffix != ".pyc":
            sources.update(f"{file.name}:{hashlib.sha256(file.read_bytes()).hexdigest()}\n".encode())
    return {
        "gtb": __version__,
        "sources": sources.hexdigest(),
        **{package: package_version(package) for package in PACKAGES},
        "python": platform.python_version(),
        "system": "-".join((platform.system(), *platform.libc_ver())).rstrip("-"),
        "processor": f"{platform.machine()}-{_checksum_of_arithmetic()}",
    }


def package_version(package: str) -> str | None:
    """Return the version of a package, without importing it."""
    with suppress(PackageNotFoundError):
        return version(package)
    return None


def _checksum_of_arithmetic() -> str:
    """Return what tells processors apart: instructions that numpy uses, and the last digits of sums and functions."""
    import numpy as np

    x = np.linspace(0.01, 3.7, 2500)
    square = np.cos(np.outer(x[:90], x[-90:]))
    with np.errstate(all="ignore"):
        results = [np.exp(x), np.log(x), np.sin(x), np.tan(x), x**0.37, np.hypot(x, 1.3), np.add.reduce(1 / x), x @ x]
        results += [square @ square, square @ x[:90], np.linalg.solve(square + np.eye(90), x[:90])]
        results += [np.linalg.svd(square[:40, :40])[1], np.einsum("i,ij,j", x[:90], square, x[:90])]
    features = getattr(np._core._multiarray_umath, "__cpu_features__", {})  # type: ignore[attr-defined]
    found = hashlib.sha256(repr(sorted(name for name, used in features.items() if used)).encode())
    for result in results:
        found.update(np.asarray(result, dtype="<f8").tobytes())
    return found.hexdigest()[:12]
