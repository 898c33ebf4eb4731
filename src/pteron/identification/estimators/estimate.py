"""The result of every estimator: values, their covariance, and the residuals with their test."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from statistics import NormalDist
from typing import Any

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import ArrayLike, NDArray

from pteron.identification.estimators.covariance import noise_of
from pteron.identification.estimators.qr import QrFactor
from pteron.identification.observation import Observations
from pteron.json_values import json_fields
from pteron.kernels import Array
from pteron.renamed import former_attribute
from pteron.result import Result

_LAGS = 20
"""Lags of the residuals' autocorrelation that are tested."""

_LEVEL = 0.01
"""Chance at which white residuals would be called coloured."""


@dataclass(frozen=True, eq=False, repr=False)
class Whiteness(Result):
    """The test of Ljung and Box on each actuator's residuals.

    Attributes
    ----------
    autocorrelation : array, shape (n,)
        Between neighbouring rows; 0 for white noise.
    p_values : array, shape (n,)
        The chance that white noise looks less white.
    """

    ROWS = "autocorrelation p_values"

    autocorrelation: Array
    p_values: Array

    @property
    def white(self) -> bool:
        """Whether nothing speaks against white noise, at 1 % over all actuators."""
        return bool((self.p_values > _LEVEL / len(self.p_values)).all())


@dataclass(frozen=True, eq=False, repr=False)
class Estimate(Result):
    """Estimated values of a model.

    Attributes
    ----------
    method : str
        The estimator.
    names, units : tuple of str
        What the p values are called, and their SI units.
    values : array, shape (p,)
        The values, SI units.
    covariance : array, shape (p, p)
        Their covariance.
    noise : array, shape (n,)
        Standard deviation of each actuator's residuals, N, of the samples before the filter.
    whiteness : Whiteness
        Whether the residuals are white.
    condition : float
        Condition number of the regressor with its columns scaled to unit length.
    rows : int
        Equations used.
    iterations : int
        How many iterations the search took.
    converged : bool
        Whether the search settled within the iterations allowed.
    residuals : array, shape (R, n)
        F - W values at the rows of the observations, in units of the noise before the filter, N.
    """

    ROWS = "names values deviations units"

    method: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    covariance: Array = field(repr=False)
    noise: Array
    whiteness: Whiteness
    condition: float
    rows: int
    iterations: int = 1
    converged: bool = True
    residuals: Array = field(repr=False, default_factory=lambda: np.empty((0, 0)))

    @property
    def has_correlated_residuals(self) -> bool:
        """Whether residuals are not white; the covariance allows for it anyway."""
        return not self.whiteness.white

    @property
    def degrees(self) -> int:
        """Degrees of freedom: the number of equations less that of values."""
        return self.rows - len(self.values)

    @property
    def deviations(self) -> Array:
        """Standard deviations (p,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def relative_deviations(self) -> Array:
        """Standard deviations over values (p,), without unit; infinite for a value of zero."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.deviations / np.abs(self.values))

    @property
    def correlation(self) -> Array:
        """Correlation matrix (p, p)."""
        sizes = np.where(self.deviations > 0.0, self.deviations, 1.0)
        return np.asarray(self.covariance / np.outer(sizes, sizes))

    def intervals(self, level: float = 0.95) -> tuple[Array, Array]:
        """Return the lower and upper ends (p,) of the values' intervals at a level."""
        reach = NormalDist().inv_cdf(0.5 + level / 2.0) * self.deviations
        return self.values - reach, self.values + reach

    def distance(self, truth: ArrayLike) -> float:
        """Return the Mahalanobis distance of true values (p,) from the estimate.

        It is the square root of (values - truth)^T covariance^-1 (values - truth).
        """
        return float(np.sqrt(self.wald(self.values - np.asarray(truth, dtype=float))))

    def p_value(self, truth: ArrayLike) -> float:
        """Return the p-value of true values (p,): the probability of an estimate farther away.

        The joint region at 95 % is where it is at least 0.05.
        """
        p = len(self.values)
        return float(scipy.stats.f.sf(self.distance(truth) ** 2 / p, p, self.degrees))

    def wald(self, shift: Array, chosen: Sequence[int] | None = None) -> float:
        """Return Wald's statistic of a shift of all or `chosen` values: s^T covariance^-1 s."""
        rows = range(len(self.values)) if chosen is None else chosen
        return wald(shift, self.covariance[np.ix_(rows, rows)])

    def value(self, name: str) -> float:
        """Return one value by name."""
        return float(self.values[self.names.index(name)])

    def as_dict(self) -> dict[str, Any]:
        """Return everything but the residuals as plain data."""
        return {
            **json_fields(
                method=self.method,
                names=self.names,
                units=self.units,
                values=self.values,
                standard_deviations=self.deviations,
            ),
            **json_fields(relative_deviations=self.relative_deviations),
            "intervals_95": [end.tolist() for end in self.intervals()],
            **json_fields(correlation=self.correlation, noise=self.noise),
            "residuals": json_fields(
                white=self.whiteness.white,
                autocorrelation=self.whiteness.autocorrelation,
                p_values=self.whiteness.p_values,
            )
            | {"correlated": self.has_correlated_residuals},
            **json_fields(
                condition_number=self.condition,
                equations=self.rows,
                iterations=self.iterations,
                converged=self.converged,
            ),
        }

    correlated = former_attribute("correlated", "has_correlated_residuals")


def wald(shift: Array, covariance: Array) -> float:
    """Return Wald's statistic s^T covariance^-1 s of a shift s (q,), covariance (q, q)."""
    unit = np.maximum(np.sqrt(np.maximum(np.diag(covariance), 0.0)), 1e-150)
    standard = shift / unit
    # Values of a fit without noise may be known alike: least squares, where it is singular.
    correlation = covariance / np.outer(unit, unit)
    return float(standard @ np.linalg.lstsq(correlation, standard, rcond=None)[0])


def residuals_of(observations: Observations, beta: Array) -> Array:
    """Return the residuals F - W beta (R, n) of fitted values beta (p,)."""
    return np.asarray(observations.forces - observations.matrix @ beta)


@dataclass
class SearchRecord:
    """An estimator's search: its method, how many iterations it took, and whether it settled."""

    method: str
    iterations: int = 1
    converged: bool = True

    def steps(self, most: int) -> Iterator[None]:
        """Yield for each iteration, up to `most` or until `converged` is set."""
        for self.iterations in range(1, most + 1):
            yield
            if self.converged:
                return


def estimate_of(
    search: SearchRecord,
    observations: Observations,
    factor: QrFactor,
    beta: Array,
    *,
    weights: Array,
    pull: Array | None = None,
    inverse: Array | None = None,
    instruments: Array | None = None,
    extra: Array | float = 0.0,
) -> Estimate:
    """Return an estimator's result: values (p,) with covariance, noise and whiteness of residuals.

    The values are B Z^T V F, `factor` is that of the rows times `weights` (R, n) or (n,), whose
    squares are V, and the covariance B (Z^T V cov(F) V Z + `extra`) B, (p, p). By default B is
    (W^T V W)^-1, another one is `inverse`, and Z is W, another one is `instruments` (R, n, p).
    `pull` (R, n) stands for the weighted residuals where these count in another way.
    """
    residuals = residuals_of(observations, beta)
    share = factor.degrees / factor.rows
    noise = np.sqrt(
        (residuals**2).sum(axis=0) / np.maximum(observations.equation_counts, 1) / share
    )
    bread = factor.inverse() if inverse is None else inverse
    rows = observations.matrix if instruments is None else instruments
    pulled = weights * residuals if pull is None else pull
    whitened = factor.inverse_triangle() if instruments is None else None
    noise_model = noise_of(rows, pulled, observations.gain > 0.0, weights, whitened)
    if observations.independent < 1.0:
        noise_model = noise_model.independent_of_each_other()
    middle = noise_model.sum_covariance(rows, weights) / observations.independent
    covariance = bread @ (middle + extra) @ bread.T
    symmetric = 0.5 * (covariance + covariance.T)
    white = whiteness(residuals, observations.gain > 0.0)
    figures = factor.condition, factor.rows, search.iterations, search.converged, residuals
    names, units = observations.names, observations.units
    return Estimate(search.method, names, units, beta, symmetric, noise, white, *figures)


def whiteness(residuals: Array, used: NDArray[np.bool_] | None = None) -> Whiteness:
    """Return Ljung and Box's whiteness test of residuals (R, n), in the order of time.

    Those that are not `used` (R, n) take no part: a lag has the pairs of which both are used.
    """
    taken = np.ones(residuals.shape, dtype=bool) if used is None else used
    correlations, pairs = autocorrelations(residuals, taken, _LAGS)
    if not len(correlations):
        return Whiteness(np.zeros(residuals.shape[1]), np.ones(residuals.shape[1]))
    count = taken.sum(axis=0)
    statistic = count * (count + 2.0) * (correlations**2 / np.maximum(pairs, 1)).sum(axis=0)
    degrees = np.maximum((pairs > 0).sum(axis=0), 1)
    return Whiteness(correlations[0], np.asarray(scipy.stats.chi2.sf(statistic, degrees)))


def autocorrelations(
    residuals: Array, used: NDArray[np.bool_], most: int
) -> tuple[Array, NDArray[np.int64]]:
    """Return the autocorrelations (L, n) at lags from 1 to `most`, and their numbers of pairs.

    Residuals (R, n) that are not used take no part; a lag leaves at least four fifths of the rows.
    """
    mean = np.where(used, residuals, 0.0).sum(axis=0) / np.maximum(used.sum(axis=0), 1)
    centred = np.where(used, residuals - mean, 0.0)
    power = np.maximum((centred**2).sum(axis=0), np.finfo(float).tiny)
    lags = range(1, min(most, len(residuals) // 5) + 1)
    correlations = [(centred[k:] * centred[:-k]).sum(axis=0) / power for k in lags]
    pairs = [(used[k:] & used[:-k]).sum(axis=0) for k in lags]
    shape = len(lags), residuals.shape[1]
    return np.reshape(correlations, shape), np.reshape(np.array(pairs, dtype=np.int64), shape)
