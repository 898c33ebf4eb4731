"""Total least squares: the regressor is noisy too."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pteron.errors import DataError
from pteron.identification.equations import Equations
from pteron.identification.estimators.estimate import Estimate, estimate_of
from pteron.identification.estimators.triangle import triangle
from pteron.identification.estimators.weighted import actuator_noise
from pteron.kernels import Array

__all__ = ["total"]

_ITERATIONS = 50
_SETTLED = 1e-3
"""Relative change of the forces' noise that no longer matters."""

_LEAST_SHARE = 0.01
"""Of the residuals' variance that is left to the forces, whatever the columns' noise is said to be:
columns whose errors belong together add up to less than the sum of their squares."""


def total(equations: Equations, errors: Array | None = None) -> Estimate:
    """Return the values of mixed total least squares (Van Huffel and Vandewalle).

    Forces and regressor both get the smallest corrections that make them agree, each measured by
    its own noise. Columns without noise, such as constant ones, are left as they are.

    Parameters
    ----------
    equations : Equations
        From `equations_of`.
    errors : array, shape (p,), optional
        Standard deviation of the noise in each column, N per unit of its value and before the
        filter; zero for an exact one. `column_errors` finds them. By default every column but
        constant and Coulomb ones has the same noise relative to its size as the forces have.

    Returns
    -------
    Estimate

    Raises
    ------
    DataError
        If the equations do not determine the values, or noise explains all there is.
    """
    plain = triangle(equations)
    plain.check_seen()
    noise = actuator_noise(equations, plain.values())
    factor = triangle(equations, 1.0 / noise)
    given = errors
    if given is None:
        relative = np.sqrt(factor.rest / (factor.rest + factor.image @ factor.image))
        errors = relative * factor.scale / np.sqrt(factor.rows)
        errors[[k for k, name in enumerate(equations.names) if _constant(name)]] = 0.0
    else:
        # On average over the equations that there are: an actuator without any has no noise.
        weight = (equations.used / noise**2).sum() / equations.rows
        errors = np.asarray(given, dtype=float) * np.sqrt(weight)
    exact = np.flatnonzero(errors == 0.0)
    noisy = np.flatnonzero(errors > 0.0)
    p = len(equations.names)
    # Exact columns first: what an orthogonal factor leaves below them does not know them.
    stack = np.column_stack([factor.factor * factor.scale, factor.image])
    stack = np.vstack([stack, np.r_[np.zeros(p), np.sqrt(factor.rest)]])
    ordered = np.asarray(np.linalg.qr(stack[:, [*exact, *noisy, p]], mode="r"))
    forces = 1.0
    for _ in range(_ITERATIONS):
        values, least = _smallest_corrections(ordered, exact, noisy, errors, forces)
        through = ((values * errors) ** 2).sum()
        if given is None:
            break
        # The residuals hold the noise of the columns as well as that of the forces.
        left = factor.rest + ((factor.image - factor.factor @ (factor.scale * values)) ** 2).sum()
        variance = left / factor.degrees
        if variance == 0.0:
            break
        before, forces = forces, np.sqrt(max(variance - through, _LEAST_SHARE * variance))
        if abs(forces / before - 1.0) < _SETTLED:
            break
    # First-order perturbation: noise of variance s^2 in all entries, and its own bias taken out.
    effective = least / factor.degrees * (forces**2 + through)
    normal = (factor.scale[:, None] * factor.factor.T) @ (factor.factor * factor.scale)
    normal = normal - least * np.diag(errors**2)
    covariance = effective * np.linalg.inv(normal / np.outer(factor.scale, factor.scale))
    covariance = covariance / np.outer(factor.scale, factor.scale)
    return estimate_of(
        "total", equations, factor, values, covariance, weights=1.0 / noise, iterations=1
    )


def _smallest_corrections(
    ordered: Array, exact: NDArray[np.intp], noisy: NDArray[np.intp], errors: Array, forces: float
) -> tuple[Array, float]:
    """Return the values (p,), and the sum of squares of the corrections, in units of the noise.

    `ordered` is the triangular factor of the exact columns, the noisy ones and the forces.
    """
    e = len(exact)
    scaled = ordered[e:, e:] / np.r_[errors[noisy], forces]
    _, singular, directions = np.linalg.svd(scaled)
    last = directions[-1]
    if abs(last[-1]) < 1e-12 or (len(singular) > 1 and singular[-1] >= singular[-2]):
        raise DataError(
            "total least squares: noise explains all there is; record a livelier motion"
        )
    values = np.empty(len(errors))
    values[noisy] = -last[:-1] / last[-1] * forces / errors[noisy]
    rest = ordered[:e, -1] - ordered[:e, e:-1] @ values[noisy]
    values[exact] = np.linalg.solve(ordered[:e, :e], rest)
    return values, float(singular[-1] ** 2)


def _constant(name: str) -> bool:
    return name.startswith(("offset", "Fc"))
