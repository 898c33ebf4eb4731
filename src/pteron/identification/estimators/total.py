"""Total least squares: the regressor is noisy too."""

from __future__ import annotations

import numpy as np

from pteron.errors import DataError
from pteron.identification.equations import Equations
from pteron.identification.estimators.estimate import Estimate, estimate_of
from pteron.identification.estimators.triangle import triangle
from pteron.identification.estimators.weighted import actuator_noise
from pteron.kernels import Array

__all__ = ["total"]


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
    if errors is None:
        relative = np.sqrt(factor.rest / (factor.rest + factor.image @ factor.image))
        errors = relative * factor.scale / np.sqrt(factor.rows)
        errors[[k for k, name in enumerate(equations.names) if _constant(name)]] = 0.0
    else:
        errors = np.asarray(errors, dtype=float) * np.sqrt((1.0 / noise**2).mean())
    exact = np.flatnonzero(errors == 0.0)
    noisy = np.flatnonzero(errors > 0.0)
    p = len(equations.names)
    # Exact columns first: what an orthogonal factor leaves below them does not know them.
    stack = np.column_stack([factor.factor * factor.scale, factor.image])
    stack = np.vstack([stack, np.r_[np.zeros(p), np.sqrt(factor.rest)]])
    ordered = np.linalg.qr(stack[:, [*exact, *noisy, p]], mode="r")
    e = len(exact)
    size = np.r_[errors[noisy], 1.0]
    scaled = ordered[e:, e:] / size
    _, singular, directions = np.linalg.svd(scaled)
    last = directions[-1]
    if abs(last[-1]) < 1e-12 or (len(singular) > 1 and singular[-1] >= singular[-2]):
        raise DataError(
            "total least squares: noise explains all there is; record a livelier motion"
        )
    values = np.empty(p)
    values[noisy] = -last[:-1] / last[-1] / errors[noisy]
    rest = ordered[:e, -1] - ordered[:e, e:-1] @ values[noisy]
    values[exact] = np.linalg.solve(ordered[:e, :e], rest)
    # First-order perturbation: noise of variance s^2 in all entries, and its own bias taken out.
    variance = singular[-1] ** 2 / factor.degrees
    effective = variance * (1.0 + ((values * errors) ** 2).sum())
    normal = (factor.scale[:, None] * factor.factor.T) @ (factor.factor * factor.scale)
    normal = normal - singular[-1] ** 2 * np.diag(errors**2)
    covariance = effective * np.linalg.inv(normal / np.outer(factor.scale, factor.scale))
    covariance = covariance / np.outer(factor.scale, factor.scale)
    return estimate_of(
        "total", equations, factor, values, covariance, weights=1.0 / noise, iterations=1
    )


def _constant(name: str) -> bool:
    return name.startswith(("offset", "Fc"))
