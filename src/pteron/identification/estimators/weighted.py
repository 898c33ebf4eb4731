"""Weighted least squares, with a variance for each actuator."""

from __future__ import annotations

import numpy as np

from pteron.identification.equations import Equations
from pteron.identification.estimators.estimate import Estimate, estimate_of, residuals_of
from pteron.identification.estimators.triangle import triangle
from pteron.kernels import Array

__all__ = ["actuator_noise", "weighted"]

_ITERATIONS = 20
_SETTLED = 1e-3
"""Relative change of the noise that no longer matters: weights hardly touch the values."""

_NOISELESS = 1e-10
"""Residuals, relative to the forces, below which weights would be made of rounding."""


def weighted(equations: Equations) -> Estimate:
    """Return the values of weighted least squares, iterated: an actuator counts by its noise.

    This is the default: actuators differ in their noise, and equal weights would let the worst
    spoil the rest.

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
    noise = actuator_noise(equations, factor.values())
    for iteration in range(1, _ITERATIONS + 1):  # noqa: B007 (told in the result)
        factor = triangle(equations, 1.0 / noise)
        values = factor.values()
        before, noise = noise, actuator_noise(equations, values)
        if np.abs(noise / before - 1.0).max() < _SETTLED:
            break
    # The residuals of the weighted equations have unit variance but for rounding of the above.
    covariance = factor.rest / factor.degrees * factor.inverse()
    return estimate_of(
        "weighted",
        equations,
        factor,
        values,
        covariance,
        weights=1.0 / before,
        iterations=iteration,
    )


def actuator_noise(equations: Equations, values: Array, *, fitted: bool = True) -> Array:
    """Return the standard deviation (n,) of each actuator's residuals, N.

    The values have cost degrees of freedom if they were fitted to these equations.
    """
    rest = residuals_of(equations, values)
    spent = len(values) / equations.rows if fitted else 0.0
    used = np.maximum(equations.used, 1)
    noise = np.sqrt((rest**2).sum(axis=0) / used / (1.0 - spent))
    size = np.sqrt((equations.forces**2).sum(axis=0) / used)
    if (noise <= _NOISELESS * size).all():
        return np.ones_like(noise)
    return np.asarray(np.maximum(noise, 1e-6 * noise.max()))
