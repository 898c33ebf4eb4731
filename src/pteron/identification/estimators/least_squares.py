"""Least squares: ordinary, weighted by each actuator's noise, and Huber's robust kind."""

from __future__ import annotations

import numpy as np

from pteron.arguments import expect
from pteron.identification.estimators.estimate import (
    Estimate,
    SearchRecord,
    estimate_of,
    residuals_of,
)
from pteron.identification.estimators.qr import actuator_factors, qr_factor
from pteron.identification.observation import Observations
from pteron.identification.signals.filters import MEDIAN_SIZE
from pteron.kernels import Array

_SETTLED_NOISE = 1e-3
"""Relative change of the noise at which iterations end: values hardly depend on the weights."""

_SETTLED_VALUES = 1e-6
"""Change of Huber's values at which iterations end: that of their forces over the noise."""

_NOISELESS = 1e-10
"""Residuals, relative to the forces, that count as rounding and get no weights from it."""


def ordinary(observations: Observations) -> Estimate:
    """Return the values of ordinary least squares: all actuators have equal weights.

    Parameters
    ----------
    observations : Observations
        From `observations_of`.

    Raises
    ------
    LogError
        If the observations do not determine the values.
    """
    factor = qr_factor(observations).check_seen()
    weights, search = np.ones(observations.actuators), SearchRecord("ordinary")
    return estimate_of(search, observations, factor, factor.values(), weights=weights)


def weighted_least_squares(
    observations: Observations, *, iterations: int = 20, triangles: Observations | None = None
) -> Estimate:
    """Return the values of weighted least squares, iterated: weights are 1 / variance an actuator.

    This is the default: actuators differ in their noise, and with equal weights the noisiest would
    spoil the values.

    Parameters
    ----------
    observations : Observations
        From `observations_of`.
    iterations : int
        Greatest number of times that the noise is estimated again.
    triangles : Observations, optional
        The `actuator_factors` of the observations, where they are known.

    Raises
    ------
    LogError
        If the observations do not determine the values.
    """
    triangles = triangles or actuator_factors(observations)
    factor = qr_factor(triangles).check_seen()
    noise = actuator_noise(observations, factor.values())
    search = SearchRecord("weighted")
    for _ in search.steps(iterations):
        factor = qr_factor(triangles, 1.0 / noise)
        beta = factor.values()
        last_noise, noise = noise, actuator_noise(observations, beta)
        search.converged = bool(np.abs(noise / last_noise - 1.0).max() < _SETTLED_NOISE)
    return estimate_of(search, observations, factor, beta, weights=1.0 / last_noise)


def huber(
    observations: Observations, *, threshold: float = 1.345, iterations: int = 100
) -> Estimate:
    """Return Huber's M-estimate, by iteratively reweighted least squares.

    A residual beyond `threshold` standard deviations pulls as one at the threshold does. The scale
    is the median absolute deviation, for each actuator. For bursts that last a few samples choose a
    wide band, so that the parallel filter does not spread them.

    Parameters
    ----------
    observations : Observations
        From `observations_of`.
    threshold : float
        In standard deviations; 1.345 costs 5 % of efficiency where there are no outliers.
    iterations : int
        Greatest number of times that the rows are weighted again.

    Raises
    ------
    DataError
        If the observations do not determine the values, or the threshold is not positive.
    """
    expect(threshold > 0.0, "threshold", threshold, "a number above 0")
    factor = qr_factor(observations).check_seen()
    beta = factor.values()
    search = SearchRecord("huber")
    for _ in search.steps(iterations):
        residuals = residuals_of(observations, beta)
        scale = median_noise(observations, residuals)
        # An actuator without equations needs a scale too: any positive one.
        scale = np.where(scale > 0.0, scale, actuator_noise(observations, beta))
        reduction = np.minimum(1.0, threshold / np.maximum(np.abs(residuals) / scale, 1e-300))
        factor = qr_factor(observations, np.sqrt(reduction) / scale)
        last_beta, beta = beta, factor.values()
        change = factor.scale * np.abs(beta - last_beta)
        search.converged = bool(change.max() <= _SETTLED_VALUES * np.sqrt(observations.rows))
    plain = qr_factor(observations, 1.0 / scale)
    standard = residuals_of(observations, beta) / scale
    pull = np.clip(standard, -threshold, threshold)
    # Huber (1981), section 7.6: variance of the pull over the square of its mean slope, with the
    # correction for a small number of equations for each value.
    used = observations.gain > 0.0
    slope = float((np.abs(standard)[used] < threshold).mean())
    spent = 1.0 + len(beta) / observations.rows * (1.0 - slope) / slope
    pull = spent * pull / slope
    return estimate_of(search, observations, plain, beta, weights=1.0 / scale, pull=pull)


def actuator_noise(observations: Observations, beta: Array) -> Array:
    """Return the standard deviation (n,) of the residuals of fitted values, N or N m."""
    residuals = residuals_of(observations, beta)
    spent = len(beta) / observations.rows
    used = np.maximum(observations.equation_counts, 1)
    noise = np.sqrt((residuals**2).sum(axis=0) / used / (1.0 - spent))
    size = np.sqrt((observations.forces**2).sum(axis=0) / used)
    if (noise <= _NOISELESS * size).all():
        return np.ones_like(noise)
    return np.asarray(np.maximum(noise, 1e-6 * noise.max()))


def median_noise(observations: Observations, residuals: Array) -> Array:
    """Return the robust standard deviation (n,) of residuals; 0 for an actuator without any."""
    used = observations.gain > 0.0
    sizes = np.where(used | ~used.any(axis=0), np.abs(residuals), np.nan)
    return np.asarray(np.nanmedian(sizes, axis=0) / MEDIAN_SIZE)
