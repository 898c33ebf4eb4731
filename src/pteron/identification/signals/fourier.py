"""A periodic signal as a Fourier series fitted to all its periods at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve  # type: ignore[import-untyped]

from pteron.kernels import Array

__all__ = ["FourierSeries", "fitted_series"]

_MOST = 120
"""Harmonics that are looked at."""

_SIGNIFICANT = 5.0
"""Standard deviations of noise above which a harmonic belongs to the motion: by chance, one in a
million does."""

_ROUNDING = 1e-15
"""Noise relative to a signal's size that is rounding: harmonics below it are not looked for."""


@dataclass(frozen=True)
class FourierSeries:
    """A Fourier series of k signals.

    Attributes
    ----------
    period : float
        s.
    coefficients : array, shape (2 H + 1, k)
        The mean, then sine and cosine of each harmonic.
    noise : array, shape (k,)
        Standard deviation of what the fit leaves.
    samples : int
        To which it was fitted.
    """

    period: float
    coefficients: Array
    noise: Array
    samples: int

    @property
    def harmonics(self) -> int:
        """H."""
        return len(self.coefficients) // 2

    def basis(self, time: Array, derivative: int = 0) -> Array:
        """Return the basis functions (T, 2 H + 1) at times, or their derivatives."""
        return _basis(time, self.period, self.harmonics, derivative)

    def at(self, time: Array, derivative: int = 0) -> Array:
        """Return the signals (T, k) at times, or their derivatives."""
        return np.asarray(self.basis(time, derivative) @ self.coefficients)


def fitted_series(
    time: Array, signal: Array, period: float, *, highest: float | None = None
) -> FourierSeries:
    """Return the series fitted to samples by least squares, with the harmonics that show.

    All periods count alike, so that noise is averaged over them, and samples may stand anywhere in
    time. Harmonics above the last one that rises over the noise are left out.

    Parameters
    ----------
    time : array, shape (T,)
        s.
    signal : array, shape (T, k)
        Any unit.
    period : float
        s.
    highest : float, optional
        Take exactly the harmonics up to this frequency (Hz) instead.
    """
    rate = (len(time) - 1) / float(time[-1] - time[0])
    limit = max(int(0.4 * rate * period), 1)
    most = min(_MOST if highest is None else int(round(highest * period)), limit)
    # A series that repeats itself needs as many samples in one period as it has coefficients.
    matrix = _basis(time, period, most)
    found = _fitted(matrix, signal)
    rest = signal - matrix @ found
    noise = np.sqrt((rest**2).sum(axis=0) / max(len(time) - len(found), 1))
    noise = np.maximum(noise, _ROUNDING * np.abs(signal).max(axis=0))
    if highest is None:
        amplitudes = np.hypot(found[1::2], found[2::2])
        # Of one period only: the rounding of an encoder comes again in every period.
        samples = min(rate * period, len(time))
        shown = amplitudes > _SIGNIFICANT * noise * np.sqrt(2.0 / samples)
        last = int(np.flatnonzero(shown.any(axis=1)).max(initial=0)) + 1
        found = found[: 2 * last + 1]
        if last < most:
            # Uneven samples mix harmonics a little: what is kept is fitted by itself.
            found = _fitted(_basis(time, period, last), signal)
    return FourierSeries(period, found, noise, len(time))


def _fitted(matrix: Array, signal: Array) -> Array:
    """Return the coefficients of least squares.

    Over a period and more the basis is nearly orthogonal, so that the normal equations lose
    nothing; a second step takes out what rounding put in.
    """
    normal = cho_factor(matrix.T @ matrix)
    found = cho_solve(normal, matrix.T @ signal)
    return np.asarray(found + cho_solve(normal, matrix.T @ (signal - matrix @ found)))


def _basis(time: Array, period: float, harmonics: int, derivative: int = 0) -> Array:
    angle = 2.0 * np.pi / period
    columns = np.zeros((len(time), 2 * harmonics + 1))
    columns[:, 0] = float(derivative == 0)
    phase = np.remainder(time, period) * angle
    shift = derivative * np.pi / 2.0
    for h in range(1, harmonics + 1):
        scale = (h * angle) ** derivative
        columns[:, 2 * h - 1] = scale * np.sin(h * phase + shift)
        columns[:, 2 * h] = scale * np.cos(h * phase + shift)
    return columns
