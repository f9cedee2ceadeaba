"""Exponentials e^<a_i, s> c_i ω_i of knots at torus coordinates s, and sums of values under them."""

import numpy as np

from gtb_cli.arrays import FloatArray

BLOCK_NUMBERS = 1 << 18  # of a work array, knots times parameters of a block: two megabytes, which fit in the cache
UNDERFLOW_EXPONENT = -700.0  # lower ones are cut off: exp would be subnormal, a hundred times slower, for 1e-304
CUT_OFF_SHARE = float(np.exp(UNDERFLOW_EXPONENT))  # shares up to this count as 0


def block_length(knots: int) -> int:
    """The number of parameters handled at once for a given number of knots."""
    return max(256, BLOCK_NUMBERS // knots)


def exponents(knots: FloatArray, log_weights: FloatArray, s: FloatArray) -> FloatArray:
    """Return the logarithms of `exponentials`: <a_i, s> + log(c_i ω_i), (n, m)."""
    return np.asarray(np.column_stack([knots, log_weights]) @ np.concatenate([s, np.ones((1, s.shape[1]))]))


def exponentials(knots: FloatArray, log_weights: FloatArray, s: FloatArray) -> FloatArray:
    """Return numbers proportional, in each column, to the rational basis at torus coordinates: (d, m) → (n, m).

    Knots should be centred: only their differences matter. log(c_i ω_i) are (n,) for all columns, or (n, m).
    """
    if log_weights.ndim == 2:
        return scaled_exponentials(knots @ s + log_weights)
    e = exponents(knots, log_weights, s)
    safe = 250.0  # neither overflows nor underflows, even times coordinates: then the largest need not be subtracted
    bound = np.abs(knots).max(axis=0) @ np.abs(s).max(axis=1, initial=0.0) + np.abs(log_weights).max()
    return np.exp(e, out=e) if bound <= safe and len(knots) > 1 else scaled_exponentials(e)  # 1 of a single knot


def scaled_exponentials(e: FloatArray) -> FloatArray:
    """Replace (…, n, m) exponents by their exponentials, up to a factor for each column."""
    e -= e.max(axis=-2, keepdims=True)
    np.maximum(e, UNDERFLOW_EXPONENT, out=e)
    return np.exp(e, out=e)


def weighted_sums(knots: FloatArray, log_weights: FloatArray, values: FloatArray, s: FloatArray) -> FloatArray:
    """Return sums of weights and of weighted (n, k) values, up to a common factor: (d, m) → (1 + k, m)."""
    return np.asarray(np.concatenate([np.ones((1, len(values))), values.T]) @ exponentials(knots, log_weights, s))


def shares(e: FloatArray) -> FloatArray:
    """Return the softmax of each column of exponents, (…, n, m)."""
    t = scaled_exponentials(e.copy())
    t /= t.sum(axis=-2, keepdims=True)
    return np.asarray(t)


def covariance(e: FloatArray, eta: FloatArray, deltas: FloatArray, mean: FloatArray) -> FloatArray:
    """Return Σ_i T_i η_i (δ_i − mean), up to a positive factor per column, (…, 3, m); mean is Σ_i T_i δ_i, (…, 3, m).

    T is given by (…, n, m) logarithms, up to a constant per column. η are (n, m) or (n, 1) coordinates of the knots: a
    knot with an exact 0 does not count, however large its T. δ are (…, n, 3).
    """
    x = e - np.max(e, axis=-2, where=eta != 0, initial=-np.inf, keepdims=True)
    np.clip(x, UNDERFLOW_EXPONENT, 0.0, out=x)
    np.exp(x, out=x)
    x *= eta
    return np.asarray(deltas.swapaxes(-1, -2) @ x - mean * x.sum(axis=-2, keepdims=True))
