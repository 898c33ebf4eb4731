"""Fourier series of periodic signals, and the projection of samples onto their harmonics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.errors import DataError
from pteron.kernels import Array
from pteron.motion.trajectories.fourier import FourierSeries, fourier_basis, row_blocks

_MOST = 120
"""Most harmonics of a series where no highest frequency is given."""

_SIGNIFICANT = 5.0
"""Size of a harmonic, in standard deviations of noise, above which it counts as motion. Of
harmonics that are noise alone one in a million is as large."""

_SHARE = 0.4
"""Most harmonics of a fit, as a share of the samples in a period."""

_ROUNDING = 1e-15
"""Rounding of a signal, relative to its size: noise is taken to be at least this."""


@dataclass(frozen=True)
class Projection:
    """The least-squares fit of a period's lowest harmonics to samples at given times.

    `time`, shape (T,), and `period` are in s.

    The basis is nearly orthogonal over a whole period or more, so that the normal equations are
    well conditioned.
    """

    time: Array
    period: float
    harmonics: int

    @cached_property
    def _normal(self) -> tuple[Array, bool]:
        """The Cholesky factor of the normal equations of the fit."""
        bases = (self.basis(rows) for rows in row_blocks(len(self.time)))
        size = 2 * self.harmonics + 1
        normal = sum((basis.T @ basis for basis in bases), np.zeros((size, size)))
        return scipy.linalg.cho_factor(normal)  # type: ignore[no-any-return]

    @cached_property
    def _first(self) -> Array:
        """The basis functions at the first block of samples; a short log has only this block."""
        rows = next(row_blocks(len(self.time)))
        return fourier_basis(self.time[rows], self.harmonics, self.period)

    def basis(self, rows: slice) -> Array:
        """Return the basis functions at a block of the samples."""
        if rows.start == 0:
            return self._first
        return fourier_basis(self.time[rows], self.harmonics, self.period)

    def coefficients(self, signal: Callable[[slice], Array], size: int) -> Array:
        """Return the coefficients (2 H + 1, k) of a signal that comes as (rows, k)."""
        right = np.zeros((2 * self.harmonics + 1, size))
        for rows in row_blocks(len(self.time)):
            right += self.basis(rows).T @ signal(rows)
        return np.asarray(scipy.linalg.cho_solve(self._normal, right))

    def noise(self, used: Array, times: Array) -> Array:
        """Return the standard deviation (K, n) of the fitted series at `times` (K,), s.

        The samples have white noise of unit variance where `used` (T, n) is 1, none where it is 0.
        """
        at = scipy.linalg.cho_solve(
            self._normal, fourier_basis(times, self.harmonics, self.period).T
        )
        variance = np.zeros((len(times), used.shape[1]))
        for rows in row_blocks(len(self.time)):
            variance += ((self.basis(rows) @ at) ** 2).T @ used[rows]
        return np.asarray(np.sqrt(variance))


@dataclass(frozen=True, eq=False)
class FittedSeries(FourierSeries):
    """The Fourier series of k signals, fitted to samples.

    Attributes
    ----------
    noise : array, shape (k,)
        Standard deviation of the samples about the series.
    """

    noise: Array

    def later(self, delay: float) -> FittedSeries:
        """Return the series of the same signals, delayed by a time, s."""
        if not delay:
            return self
        turn = delay * 2.0 * np.pi / self.period * np.arange(1, self.harmonics + 1)[:, None]
        turned = (np.array(self.cosines) + 1j * np.array(self.sines)) * np.exp(1j * turn)
        return replace(self, cosines=turned.real, sines=turned.imag)


def fitted_series(
    time: Array, signal: Array, period: float, *, highest: float | None = None
) -> FittedSeries:
    """Return the series fitted to samples by least squares, with the harmonics that show.

    All periods count alike, so that noise is averaged over them, and samples (T, k) may stand at
    any times (T,), s. Harmonics above the last one that rises over the noise are left out, unless
    `highest` (Hz) is given: then all up to that frequency are kept, and no others.

    Raises
    ------
    DataError
        If the samples leave out so much of the period that they do not determine the series.
    """
    rate = (len(time) - 1) / float(time[-1] - time[0])
    limit = most_harmonics(time, period)
    wanted_harmonics = _MOST if highest is None else round(highest * period)
    most = min(wanted_harmonics, limit)
    if most < 1 or (
        highest is not None and most < min(wanted_harmonics, int(_SHARE * rate * period))
    ):
        raise DataError(
            f"period: the samples leave {_largest_hole(time, period):g} s out of the period of "
            f"{period:g} s, too much for its harmonics; record whole periods without a gap, or "
            'choose derivatives "central"'
        )
    coefficients, squares = _fit_coefficients(time, signal, period, most)
    noise = np.sqrt(squares / max(len(time) - len(coefficients), 1))
    noise = np.maximum(noise, _ROUNDING * np.abs(signal).max(axis=0))
    if highest is None:
        amplitudes = np.hypot(coefficients[1 : most + 1], coefficients[most + 1 :])
        # One period counts: the rounding of an encoder repeats in every period.
        samples = min(rate * period, len(time))
        shown = amplitudes > _SIGNIFICANT * noise * np.sqrt(2.0 / samples)
        last = int(np.flatnonzero(shown.any(axis=1)).max(initial=0)) + 1
        coefficients = np.vstack(
            [coefficients[: last + 1], coefficients[most + 1 : most + 1 + last]]
        )
        if last < most:
            # Uneven samples mix harmonics a little: those that are kept are fitted again, alone.
            coefficients, _ = _fit_coefficients(time, signal, period, last)
    last = len(coefficients) // 2
    cosines: Any = coefficients[1 : last + 1]
    sines: Any = coefficients[last + 1 :]
    return FittedSeries(coefficients[0], cosines, sines, period, noise)


def most_harmonics(time: Array, period: float) -> int:
    """Return how many harmonics samples at these times determine: the largest gap limits them."""
    rate = (len(time) - 1) / float(time[-1] - time[0])
    # A gap of one step counts as even sampling does, whatever its rounding.
    hole = max(_largest_hole(time, period), (1.0 - 1e-6) / rate)
    return int(_SHARE * period / hole + 1e-6)


def _largest_hole(time: Array, period: float) -> float:
    """Return the longest part of the period without a sample, s."""
    phase = np.sort(np.remainder(time - time[0], period))
    return float(np.diff(phase, append=phase[0] + period).max())


def _fit_coefficients(
    time: Array, signal: Array, period: float, harmonics: int
) -> tuple[Array, Array]:
    """Return the coefficients of least squares, and the residual sum of squares (k,)."""
    projection = Projection(time, period, harmonics)
    size = signal.shape[1]
    first = projection.coefficients(lambda rows: signal[rows], size)

    def residuals_of(rows: slice) -> Array:
        """Return the residuals (rows, k) of the first solution in a block of samples."""
        return np.asarray(signal[rows] - projection.basis(rows) @ first)

    # A step of iterative refinement removes the rounding of the first solution.
    coefficients = first + projection.coefficients(residuals_of, size)
    squares = np.zeros(size)
    for rows in row_blocks(len(time)):
        squares += ((signal[rows] - projection.basis(rows) @ coefficients) ** 2).sum(axis=0)
    return coefficients, squares
