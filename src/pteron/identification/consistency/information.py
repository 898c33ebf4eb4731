"""In which metric identified values are near: the information of the fit, or relative."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pteron.errors import DataError
from pteron.kernels import Array

__all__ = ["checked_values", "square_root"]


def checked_values(values: ArrayLike, rank: int) -> Array:
    """Return identified values (rank,) as an array.

    Raises
    ------
    DataError
        If their number is wrong or one is not finite.
    """
    vector = np.asarray(values, dtype=float)
    if vector.shape != (rank,):
        raise DataError(f"values: shape {vector.shape} given, ({rank},) expected")
    if not np.isfinite(vector).all():
        raise DataError("values: not all are finite numbers; identify the parameters again")
    return vector


def square_root(covariance: ArrayLike, rank: int) -> Array:
    """Return the lower triangular square root of a covariance (rank, rank).

    Raises
    ------
    DataError
        If its shape is wrong, or it is not symmetric and positive definite.
    """
    matrix = np.asarray(covariance, dtype=float)
    if matrix.shape != (rank, rank):
        raise DataError(f"covariance: shape {matrix.shape} given, ({rank}, {rank}) expected")
    deviations = np.sqrt(np.abs(np.diag(matrix)))
    if not np.isfinite(matrix).all() or (np.diag(matrix) <= 0.0).any():
        raise DataError("covariance: every variance must be a positive, finite number")
    correlations = matrix / np.outer(deviations, deviations)
    if np.abs(correlations - correlations.T).max() > 1e-8:
        raise DataError("covariance: the matrix is not symmetric")
    try:
        # Correlations, since the variances' units differ by orders of magnitude.
        root = np.linalg.cholesky(0.5 * (correlations + correlations.T))
    except np.linalg.LinAlgError:
        raise DataError(
            "covariance: the matrix is not positive definite; give that of a fit in which every "
            "base parameter is identified"
        ) from None
    return np.asarray(deviations[:, None] * root)
