"""Covariance of estimated values whose residuals are correlated, in time and between actuators.

Newey and West's sandwich estimates p x p numbers at each lag from a few hundred rows: its small
eigenvalues come out far too small, and with them the confidence regions of several values. Here the
noise of each actuator is an autoregression, a few numbers each, and the p x p covariance follows
from these.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.kernels import Array

_LAGS = 5
"""Order of the autoregression, after the correlation of neighbouring rows is taken out: the
parallel filter leaves little beyond it."""

_MOST_REFLECTION = 0.5
"""Largest reflection coefficient of that autoregression: what is left is nearly white."""

_ROUNDS = 3
"""Rounds in which the noise is found anew, corrected for the fit's leverage."""

_FEW = 200
"""Equations per value above which leverage is negligible: 0.5 %."""

_LEVEL = 0.01
"""Chance at which independent noise of the actuators would be taken for shared."""

_BLOCK = 1 << 13
"""Rows that are filtered at a time."""


@dataclass(frozen=True)
class Noise:
    """Autoregressive noise e of n actuators: A_i(q) e_i = (root u)_i, with q the shift by a row.

    Attributes
    ----------
    polynomials : tuple of array
        A_i, beginning with 1.
    root : array, shape (n, n)
        What white noise u of unit variance is multiplied with.
    """

    polynomials: tuple[Array, ...]
    root: Array

    def independent_of_each_other(self) -> Noise:
        """Return the noise without the correlation between actuators."""
        return Noise(self.polynomials, np.diag(np.linalg.norm(self.root, axis=1)))

    def sum_covariance(self, matrix: Array, weights: Array | float = 1.0) -> Array:
        """Return the covariance (p, p) of W^T e for rows W (R, n, p) times weights (R, n)."""
        p = matrix.shape[-1]
        factors = np.broadcast_to(weights, matrix.shape[:2])
        states = [np.zeros((len(polynomial) - 1, p)) for polynomial in self.polynomials]
        total = np.zeros((p, p))
        # What a row's innovation adds depends on the rows after it: from the last to the first.
        for stop in range(len(matrix), 0, -_BLOCK):
            block = slice(max(stop - _BLOCK, 0), stop)
            rows = (matrix[block] * factors[block, :, None])[::-1]
            passed = np.empty(rows.shape)
            for i, polynomial in enumerate(self.polynomials):
                passed[:, i], states[i] = scipy.signal.lfilter(
                    [1.0], polynomial, rows[:, i], axis=0, zi=states[i]
                )
            each = np.einsum("ij,rip->rjp", self.root, passed).reshape(-1, p)
            total += each.T @ each
        return total

    def multiply_covariance(self, matrix: Array) -> Array:
        """Return C X for columns X (R, n, p), C being the covariance of the noise of all rows."""
        backwards = self._filter_noise(matrix[::-1])[::-1]
        return self._filter_noise(np.einsum("ij,rjp->rip", self.root @ self.root.T, backwards))

    def _filter_noise(self, matrix: Array) -> Array:
        """Return columns (R, n, p) filtered by 1 / A_i along the rows of each actuator."""
        columns = [
            scipy.signal.lfilter([1.0], polynomial, matrix[:, i], axis=0)
            for i, polynomial in enumerate(self.polynomials)
        ]
        return np.stack(columns, axis=1)


def noise_of(
    matrix: Array,
    residuals: Array,
    used: NDArray[np.bool_],
    weights: Array | float = 1.0,
    whitened: Array | None = None,
) -> Noise:
    """Return the noise model that is estimated from the residuals of a fit.

    With H the projection on W, residuals of noise of covariance C have (I - H) C (I - H): they are
    smaller than the noise, and less alike. What they miss is computed from the noise found so far.

    Parameters
    ----------
    matrix : array, shape (R, n, p)
        The rows W of the fit, in the order of time.
    residuals : array, shape (R, n)
        Its weighted residuals.
    used : array of bool, shape (R, n)
        Which equations there are; rows and residuals of the others are 0.
    weights : array, shape (R, n), or float
        What the fit has multiplied the rows with.
    whitened : array, shape (p, p), optional
        What makes orthonormal columns of the weighted rows, where that is known: else they are
        decomposed.
    """
    counts = np.maximum(_lagged_products(used[..., None].astype(float)), 1.0)
    autocovariances = _lagged_products(residuals[..., None])
    rows, n, p = matrix.shape
    if used.sum() >= _FEW * p:
        return _with_actuator_correlation(
            _autoregression(autocovariances / counts, rows), residuals, used
        )
    factors = np.broadcast_to(weights, used.shape)
    weighted = (matrix * factors[..., None]).reshape(-1, p)
    orthonormal = np.linalg.qr(weighted)[0] if whitened is None else weighted @ whitened
    columns = orthonormal.reshape(rows, n, p)  # H = X X^T
    noise = Noise((np.ones(1),) * n, np.diag(np.sqrt(autocovariances[0] / counts[0])))
    for _ in range(_ROUNDS):
        times = noise.multiply_covariance(columns) * used[..., None]
        taken = columns @ np.einsum("rip,riq->pq", columns, times)
        missing = (
            _lagged_products(columns, times)
            + _lagged_products(times, columns)
            - _lagged_products(taken, columns)
        )
        noise = _autoregression((autocovariances + missing) / counts, rows)
    return _with_actuator_correlation(noise, residuals, used)


def _lagged_products(first: Array, second: Array | None = None) -> Array:
    """Return the sums (K, n) over rows and columns of (R, n, p) times (R, n, p), k rows apart."""
    second = first if second is None else second
    rows, n = first.shape[:2]
    sums = np.zeros((_LAGS + 2, n))
    for k in range(min(_LAGS + 2, rows)):
        sums[k] = np.einsum("rip,rip->i", first[k:], second[: rows - k])
    return sums


def _autoregression(lagged: Array, rows: int) -> Noise:
    """Return the autoregressive noise with these autocovariances (K, n), by actuator."""
    most = 1.0 - 1.0 / np.sqrt(rows)  # beyond it memory is as long as the whole
    polynomials, sizes = [], []
    for g in lagged.T.copy():
        if g[0] <= 0.0:
            polynomials.append(np.ones(1))
            sizes.append(0.0)
            continue
        # Take out the correlation with the next row ...
        memory = float(np.clip(g[1] / g[0], -most, most))
        g[1] = memory * g[0]
        previous_lag = np.r_[g[1], g[:-2]]
        prewhitened = (1.0 + memory**2) * g[:-1] - memory * (previous_lag + g[1:])
        # ... and fit an autoregression to the rest, seen through Parzen's window.
        polynomial, variance = _levinson(
            prewhitened * _parzen_window(np.arange(len(prewhitened)) / len(prewhitened))
        )
        polynomials.append(np.convolve([1.0, -memory], polynomial))
        sizes.append(np.sqrt(variance))
    return Noise(tuple(polynomials), np.diag(sizes))


def _levinson(autocovariances: Array) -> tuple[Array, float]:
    """Return an autoregression's polynomial, 1 first, and its innovations' variance."""
    g = autocovariances
    polynomial, variance = np.ones(1), float(g[0])
    for order in range(1, len(g)):
        ahead = float(polynomial @ g[order:0:-1][: len(polynomial)])
        reflection = float(np.clip(-ahead / variance, -_MOST_REFLECTION, _MOST_REFLECTION))
        longer = np.r_[polynomial, 0.0]
        polynomial = longer + reflection * longer[::-1]
        variance *= 1.0 - reflection**2
    return polynomial, variance


def _parzen_window(share: Array) -> Array:
    """Return the Parzen window at lags as shares of its width."""
    near = 1.0 - 6.0 * share**2 * (1.0 - share)
    return np.asarray(np.where(share < 0.5, near, 2.0 * (1.0 - share) ** 3))


def _with_actuator_correlation(noise: Noise, residuals: Array, used: NDArray[np.bool_]) -> Noise:
    """Return the noise with the correlation between actuators of the residuals' innovations."""
    parts = [
        scipy.signal.lfilter(polynomial, [1.0], residuals[:, i])
        for i, polynomial in enumerate(noise.polynomials)
    ]
    innovations = np.stack(parts, axis=1) * used
    together = used.T.astype(float) @ used
    products = innovations.T @ innovations / np.maximum(together, 1.0)
    size = np.sqrt(np.diag(products))
    size = np.where(size > 0.0, size, 1.0)
    correlation = products / np.outer(size, size)
    np.fill_diagonal(correlation, 1.0)
    least = np.linalg.eigvalsh(correlation)[0]
    if least <= 0.0:  # rows that only some actuators have
        correlation = (correlation - 2.0 * least * np.eye(len(size))) / (1.0 - 2.0 * least)
    n = len(size)
    # The likelihood ratio of independence.
    statistic = -float(together.min()) * np.linalg.slogdet(correlation)[1]
    if n == 1 or statistic < scipy.stats.chi2.ppf(1.0 - _LEVEL, n * (n - 1) / 2):
        return noise
    return Noise(noise.polynomials, np.diag(noise.root)[:, None] * np.linalg.cholesky(correlation))
