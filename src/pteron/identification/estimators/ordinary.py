"""Ordinary least squares."""

from __future__ import annotations

import numpy as np

from pteron.identification.equations import Equations
from pteron.identification.estimators.estimate import Estimate, estimate_of
from pteron.identification.estimators.triangle import triangle

__all__ = ["ordinary"]


def ordinary(equations: Equations) -> Estimate:
    """Return the values of ordinary least squares: all actuators count alike.

    Parameters
    ----------
    equations : Equations
        From `equations_of`.

    Returns
    -------
    Estimate

    Raises
    ------
    DataError
        If the equations do not determine the values.
    """
    factor = triangle(equations)
    factor.check_seen()
    covariance = factor.rest / factor.degrees * factor.inverse()
    weights = np.ones(equations.actuators)
    return estimate_of("ordinary", equations, factor, factor.values(), covariance, weights=weights)
