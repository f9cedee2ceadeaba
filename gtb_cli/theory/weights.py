"""Weights and coefficients of a patch, from any of the forms in which they may be given."""

from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import FloatArray, finite, positive, read_only
from gtb_cli.errors import DomainError
from gtb_cli.knots.domain import Domain
from gtb_cli.knots.lattice import binomial_coefficients
from gtb_cli.theory.basis import unity_coefficients

CoefficientRule: TypeAlias = Literal["binomial", "partition-of-unity"]

# Rules by their names in specs
COEFFICIENTS = {"binomial": binomial_coefficients, "partition-of-unity": unity_coefficients}


def coefficients_of(shape: Domain, values: ArrayLike | str | None) -> FloatArray:
    """Return the positive coefficients c, (n,), as given, by a rule, or by default 1."""
    if isinstance(values, str):
        if values not in COEFFICIENTS:
            raise DomainError(f"coefficients: expected numbers, {' or '.join(COEFFICIENTS)}, got {values!r}")
        values = COEFFICIENTS[values](shape)
    return positive("coefficients", np.ones(len(shape.knots)) if values is None else values)


def both_weights(weights: ArrayLike | None, logarithms: ArrayLike | None, n: int) -> tuple[FloatArray, FloatArray]:
    """Return weights and their logarithms, (n,) each, from either or both; by default 1 and 0."""
    if logarithms is None:
        weights = positive("weights", np.ones(n) if weights is None else weights)
        return weights, read_only(np.log(weights))
    logarithms = finite("log_weights", logarithms)
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        powers = read_only(np.exp(logarithms))
        weights = powers if weights is None else read_only(weights)
        if weights.shape == powers.shape:  # others are refused later
            rounding = 1e-9 * np.minimum(weights, powers) + np.finfo(float).tiny
            if not ((weights == powers) | (np.abs(weights - powers) <= rounding)).all():
                raise DomainError("weights: disagree with log_weights; `Patch.replace` changes both")
    return weights, logarithms
