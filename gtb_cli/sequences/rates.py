"""How fast the distances of a sequence from its limit fall, as measured."""

import math
from collections.abc import Sequence

from gtb_cli.values import frozen


@frozen
class MeasuredRate:
    """An exponent ρ of distances that fall like x^−ρ, x^ρ for x → 0, or (1 − step)^ρ, between two members."""

    exponent: float
    first: float  # x or step of the member from which it is measured
    last: float


def measured_rate(
    values: Sequence[float], distances: Sequence[float | None], errors: Sequence[float | None], key: str
) -> MeasuredRate | None:
    """Measure how fast distances fall between the last members before the limit, if they agree on it.

    Parameters
    ----------
    values, distances, errors : sequences of float
        One for each member, without the limit; errors are those of the distances, None where they are unknown.
    key : {"x", "step"}

    Returns
    -------
    MeasuredRate or None
        None if there are not three members with distances that are known well enough, or the exponents of the last two
        intervals, or those that the errors allow, differ by more than a twentieth.

    Notes
    -----
    That exponents agree does not make them the limit's: the next term may fall only a little faster.
    """
    agreement, largest_error = 0.05, 0.02  # of an exponent, and of a distance
    found = [
        (value, abs(math.log(value)) if key == "x" else -math.log1p(-value), math.log(distance), error / distance)
        for value, distance, error in zip(values, distances, errors, strict=True)
        if distance and error is not None and error <= largest_error * distance
    ]
    if len(found) < 3:
        return None
    (_, s0, d0, e0), (first, s1, d1, e1), (last, s2, d2, e2) = found[-3:]
    before, exponent = (d0 - d1) / (s1 - s0), (d1 - d2) / (s2 - s1)
    doubt = abs(exponent - before) + max((e0 + e1) / (s1 - s0), (e1 + e2) / (s2 - s1))
    return MeasuredRate(exponent, first, last) if exponent > 0 and doubt <= agreement * exponent else None
