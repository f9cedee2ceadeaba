"""`fit` for Python: a curve through points, or a surface through them or near them."""

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.design.curve_fit import Fit, curve_through
from gtb_cli.design.surface_fit import surface_near, surface_through
from gtb_cli.errors import DomainError
from gtb_cli.theory.patch import Patch


def fit(
    points: ArrayLike,
    knots: ArrayLike | None = None,
    *,
    patch: Patch | None = None,
    parameters: ArrayLike | None = None,
) -> Fit:
    """Find a curve through points, or a surface through them or near them.

    Parameters
    ----------
    points : (n, 3) or (n, 2) float
        Points in the order in which a curve passes them or, if there are as many, in the order of the knots of `patch`.
    knots : (n,) float, optional
        Knots of the curve, ascending. Default: the lengths of the polygon up to each point.
    patch : Patch, optional
        A surface, whose knots and weights the result has.
    parameters : (n, 2) float, optional
        Parameters of the points on the surface, in its linear parametrisation. Default: the knots, if there are as many
        points; otherwise by projection, corrected in rounds.

    Returns
    -------
    Fit
        A curve passes through all points, and so does a surface with as many knots, by progressive iterative
        approximation. Other surfaces are near the points: least squares with a little thin-plate energy.

    Raises
    ------
    DomainError, ToleranceError
        See `gtb_cli.design.curve_fit.curve_through` and `gtb_cli.design.surface_fit`.
    """
    if patch is None:
        if parameters is not None:
            raise DomainError("parameters: are those of a surface, and no patch is given")
        return curve_through(points, knots)
    if knots is not None:
        raise DomainError("knots: are for curves, and a patch has its own")
    is_met = patch.dimension == 2 and np.ndim(points) == 2 and len(np.asarray(points)) == len(patch.knots)
    return (surface_through if is_met else surface_near)(points, patch, parameters)
