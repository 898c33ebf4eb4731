"""`CalibrationFit`, an iterate of a calibration's fit: values, residuals, normal equations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.calibration.guess import Guess
from pteron.errors import DataError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CalibrationFit:
    """An iterate of a calibration's fit: values, residuals of the rows, and normal equations.

    Attributes
    ----------
    guess : Guess
        The values.
    total : array, shape (p,)
        All steps from the drawing.
    noise : dict
        Standard deviation by kind of measurement.
    kept : array of bool, shape (N,)
        The rows that are no outliers.
    poses : array, shape (N, m)
        Of all rows.
    prior : array, shape (p,)
        What tolerances say: one over their squares.
    residuals, measured : array, shape (N, K)
        Of all rows, computed minus measured, m and rad; and which of them count.
    distances : array, shape (N,)
        Of each row's residuals from zero, in standard deviations (Mahalanobis).
    information, gradient : array, shapes (p, p) and (p,)
        What the data alone say: J' W J and J' W r.
    cost : float
        Squared residuals, in variances, and tolerances.
    steps : int
        Gauss and Newton's steps in all.
    shared : array, shape (p, p), or 0
        By how much `information` is too great where several distances share a row's readings: each
        row is weighted as if its noise were its own alone.
    settled : bool
        Whether the search has ended where nothing is more probable nearby.
    """

    guess: Guess
    total: Array
    noise: dict[str, float]
    kept: NDArray[np.bool_]
    poses: Array
    prior: Array
    residuals: Array
    measured: NDArray[np.bool_]
    distances: Array
    information: Array
    gradient: Array
    cost: float = np.inf
    steps: int = 0
    shared: Array | float = 0.0
    settled: bool = True

    @cached_property
    def covariance(self) -> Array:
        """The covariance of all unknowns (p, p), from data and tolerances."""
        matrix = self.information + np.diag(self.prior)
        size = np.sqrt(np.diag(matrix))
        size[size == 0.0] = 1.0
        try:
            factor = scipy.linalg.cho_factor(matrix / np.outer(size, size))
        except np.linalg.LinAlgError:
            raise DataError(
                "the measurements leave open what has no tolerance: free less, or give `prior` "
                "finite standard deviations"
            ) from None
        inverse = scipy.linalg.cho_solve(factor, np.eye(len(size))) / np.outer(size, size)
        return np.asarray(
            inverse if np.ndim(self.shared) == 0 else inverse + inverse @ self.shared @ inverse
        )
