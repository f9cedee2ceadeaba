"""What a parameter means: toric, the paper's, or linear, in which the knots are their own control points."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal, TypeAlias

from numpy.typing import ArrayLike

from gtb_cli.errors import DomainError
from gtb_cli.theory.basis import Location, toric_locations
from gtb_cli.theory.linear import LinearParametrization
from gtb_cli.theory.patch import Patch

Parametrization: TypeAlias = Literal["toric", "linear"]


def locations(patch: Patch, u: ArrayLike, parametrization: Parametrization = "toric") -> Iterable[Location]:
    """Locate (m, d) parameters of a patch in either parametrisation."""
    columns = patch.domain.columns(u)
    if parametrization == "linear":
        return LinearParametrization(patch.domain, patch.log_products).locations(columns)
    if parametrization == "toric":
        return toric_locations(patch.domain, columns)
    raise DomainError(f"parametrization: expected toric or linear, got {parametrization!r}")
