"""Whether residuals are white noise, and covariances that do not ask them to be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2  # type: ignore[import-untyped]

from pteron.kernels import Array

__all__ = ["Whiteness", "long_run_covariance", "whiteness"]

_LAGS = 20
_MOST_LAGS = 100
"""Rows, of a parallel filter's, beyond which noise has forgotten itself in any case."""

_LEVEL = 0.01
"""Chance at which white residuals would be called coloured."""


@dataclass(frozen=True)
class Whiteness:
    """The test of Ljung and Box on each actuator's residuals.

    Attributes
    ----------
    autocorrelation : array, shape (n,)
        Between neighbouring rows; 0 for white noise.
    p_values : array, shape (n,)
        The chance that white noise looks less white.
    """

    autocorrelation: Array
    p_values: Array

    @property
    def white(self) -> bool:
        """Whether nothing speaks against white noise, at 1 % over all actuators."""
        return bool((self.p_values > _LEVEL / len(self.p_values)).all())


def whiteness(residuals: Array, used: NDArray[np.bool_] | None = None) -> Whiteness:
    """Return the test of residuals (R, n), in the order of time.

    Of those that are not used, none takes part: a lag has the pairs of which both are used.
    """
    taken = np.ones(residuals.shape, dtype=bool) if used is None else used
    count = taken.sum(axis=0)
    mean = np.where(taken, residuals, 0.0).sum(axis=0) / np.maximum(count, 1)
    centred = np.where(taken, residuals - mean, 0.0)
    power = np.maximum((centred**2).sum(axis=0), np.finfo(float).tiny)
    lags = range(1, min(_LAGS, len(residuals) // 5) + 1)
    if not lags:
        return Whiteness(np.zeros(residuals.shape[1]), np.ones(residuals.shape[1]))
    found = np.array([(centred[k:] * centred[:-k]).sum(axis=0) / power for k in lags])
    pairs = np.array([(taken[k:] & taken[:-k]).sum(axis=0) for k in lags])
    statistic = count * (count + 2.0) * (found**2 / np.maximum(pairs, 1)).sum(axis=0)
    degrees = np.maximum((pairs > 0).sum(axis=0), 1)
    return Whiteness(found[0], np.asarray(chi2.sf(statistic, degrees)))


def long_run_covariance(scores: Array, inverse: Array, degrees: float) -> Array:
    """Return the covariance of values whose residuals are correlated in time.

    Parameters
    ----------
    scores : array, shape (R, p)
        W^T times the weighted residuals of each row.
    inverse : array, shape (p, p)
        (W^T W)^-1 of the weighted equations.
    degrees : float
        Share of the equations that is not spent on the values.

    Returns
    -------
    array, shape (p, p)
        The sandwich of Newey and West, with Bartlett's weights.
    """
    rows = len(scores)
    lags = min(int(np.ceil(1.3 * np.sqrt(rows))), _MOST_LAGS)
    middle = scores.T @ scores
    for lag in range(1, min(lags, rows - 1) + 1):
        shifted = scores[lag:].T @ scores[:-lag]
        middle += (1.0 - lag / (lags + 1.0)) * (shifted + shifted.T)
    return np.asarray(inverse @ middle @ inverse / degrees)
