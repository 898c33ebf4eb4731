"""Filters against noise: the size of noise, the positions' low-pass filter, the parallel filter."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import comb

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.kernels import Array
from pteron.tolerances import EXACT

MEDIAN_SIZE = 0.6744897501960817
"""Median size of a standard normal variable."""

SETTLING = 6.0
"""Time that a filter needs at a block's ends, in periods of the cut-off: 1e-6 of a step is left."""

DIFFERENCE = 8
"""Order of the differences that show noise: what a smooth motion leaves in them falls with this
power of its sampling."""

_GRID_LOOK = 20_000
"""Samples in which an encoder's step is sought: a motion crosses thousands of steps in them."""

_ON_GRID = 1e-3
"""Deviation from a multiple of the step, in steps, that is rounding of the numbers: files with
three digits after those of the step."""

_ORDER = 4
"""Order of the Butterworth filter."""

_HIGHEST = 0.2
"""Largest cut-off, as a share of the sampling rate: beyond it a filter takes too little to be worth
its edges."""

_MARGIN = 20.0
"""Factor on the motion's own bandwidth beyond which what shows is noise of another colour."""

_REPEATED = 1.3
"""Factor on the cut-off of least error: what the filter takes of a motion is the same whenever the
machine moves so, and shifts the values; what it leaves of the noise averages out."""

_POSITION_POWER = 0.9999
"""Share of the positions' power that is within the motion's bandwidth."""

_CANDIDATES = 40
"""Cut-offs that are compared: each is at most 15 % above the one before, over a range of 200."""

_CORRELATED = 12870.0 / 4900.0
"""Variance of a sum over the spectrum, over that of independent powers: of Hann's window squared,
the mean of w^4 over the square of that of w^2."""

_LOOK = 60_000
"""Samples that are used in the search for a cut-off."""

_HALF = 4
"""Half the parallel filter's length, in samples that are kept."""


def white_noise(signal: Array) -> Array:
    """Return the standard deviation (k,) of the white noise on uniformly sampled signals (T, k).

    The eighth differences of a motion sampled much faster than it moves vanish; those of white
    noise have C(16, 8) times its variance. Values on a grid, such as an encoder's counts, have at
    least the rounding error of the grid, also where they stand still. At least 9 samples.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.linspace(0.0, 10.0, 10_001)[:, None]
    >>> noise = 1e-6 * np.random.default_rng(0).normal(size=t.shape)
    >>> bool(abs(white_noise(np.sin(t) + noise)[0] / 1e-6 - 1.0) < 0.05)
    True
    """
    rough = np.abs(np.diff(signal, n=DIFFERENCE, axis=0)) / np.sqrt(
        comb(2 * DIFFERENCE, DIFFERENCE)
    )
    # The median forgives jumps, such as those of Coulomb friction.
    spread = np.median(rough, axis=0) / MEDIAN_SIZE
    return np.asarray(np.maximum(spread, quantisation_steps(signal) / np.sqrt(12.0)))


def position_noise(signal: Array) -> Array:
    """Return the root mean square (k,) of the noise on uniformly sampled positions (T, k).

    What they have above a quarter of the sampling rate is no motion, and noise that comes and goes
    counts by its mean there: jitter of the sampling, which is proportional to the speed. On a grid
    it is the rounding error at least.
    """
    power = _spectrum(signal)
    high = power[len(power) // 2 :]
    # Of noise the median of a periodogram is its mean times log 2; it forgives lines.
    plateau = np.sqrt(np.median(high, axis=0) / np.log(2.0))
    return np.asarray(np.maximum(plateau, quantisation_steps(signal) / np.sqrt(12.0)))


def _spectrum(signal: Array) -> Array:
    """Return the power (F, k) of signals (T, k): 1 for white noise of variance 1."""
    # Squared, Hann's window lets nothing of the motion through to where noise is.
    window = np.hanning(len(signal))[:, None] ** 2
    transform = np.fft.rfft(window * (signal - signal.mean(axis=0)), axis=0)
    return np.asarray(np.abs(transform) ** 2 / (window**2).sum())


def quantisation_steps(signal: Array) -> Array:
    """Return the quantisation step (k,) of signals (T, k); 0 where there is none."""
    steps = np.zeros(signal.shape[1])
    for k, samples in enumerate(signal[:_GRID_LOOK].T):
        levels = np.unique(samples)
        if len(levels) < 2:
            continue
        step = float(np.diff(levels).min())
        multiples = (levels - levels[0]) / step
        # A grid has few levels for the values on it, and all of them are multiples of its step.
        if np.abs(multiples - np.round(multiples)).max() < _ON_GRID:
            steps[k] = step
    return steps


def lowpass(signal: Array, rate: float, cutoff: float | None) -> Array:
    """Return signals (T, k) after a Butterworth filter of order 4 forward and backward.

    Its gain is 1 / (1 + (f / cutoff)^8), its phase zero. Without a cut-off there is no filter.
    """
    if cutoff is None:
        return signal
    sections = scipy.signal.butter(_ORDER, cutoff, fs=rate, output="sos")
    padding = min(round(SETTLING * rate / cutoff), len(signal) - 1)
    return np.asarray(scipy.signal.sosfiltfilt(sections, signal, axis=0, padlen=padding))


def cutoff_of(
    signal: Array, rate: float, *, harmless: float = 0.0, tolerable: float = 0.0
) -> float | None:
    """Return the cut-off for positions (T, k), Hz, or None where they need no filter.

    It makes the mean square error of the filtered accelerations least, each over its signal's
    noise, as far as the measured positions tell: by Stein's estimate, from their spectrum and
    `position_noise`. So the filter passes what is more motion than noise. It passes more, since it
    then mixes less, as long as the accelerations' noise, which is all below the cut-off, is less
    than that of white noise of a `harmless` size, relative to them, which is everywhere; and up to
    1.3 times the frequency of least error as long as it is less than that of a `tolerable` size.
    The cut-off is at most twenty times the frequency below which nearly all the motion is, as noise
    need not be white.

    References
    ----------
    C. M. Stein, "Estimation of the mean of a multivariate normal distribution", Annals of
    Statistics 9(6), 1981.
    """
    part = signal[:_LOOK]
    rounding = EXACT * np.ptp(part, axis=0)
    if (white_noise(part) <= rounding).all():
        return None
    noise, power = np.maximum(position_noise(part), rounding.max()), _spectrum(part)
    # Bandwidth of the position, not of the speed: coarse encoders' noise would outweigh the motion.
    bandwidth = bins_below(power, _POSITION_POWER) * rate / len(part)
    lowest = min(40.0 * rate / len(part), _HIGHEST * rate)
    highest = max(min(_HIGHEST * rate, _MARGIN * bandwidth), lowest)
    candidates = np.geomspace(lowest, highest, _CANDIDATES)
    frequencies: Array = np.fft.rfftfreq(len(part), 1.0 / rate)[:, None].astype(float)
    gains, fourth = 1.0 / (1.0 + (frequencies / candidates) ** (2 * _ORDER)), frequencies**4
    best = _least_risk(power / noise**2, gains, fourth)

    # What the noise makes of the accelerations' power, over what the motion makes of it
    passed = (fourth * gains**2).mean(axis=0)
    motion = (fourth * gains[:, [best]] ** 2 * power).mean(axis=0) - noise**2 * passed[best]
    with np.errstate(over="ignore"):  # infinite where nothing of a motion is left
        share = np.outer(passed, noise**2 / np.maximum(motion, np.finfo(float).tiny)).max(axis=1)
    below = 2.0 * candidates / rate
    near = candidates <= _REPEATED * candidates[best]
    allowed = (share <= harmless**2 * below) | (near & (share <= tolerable**2 * below))
    return float(candidates[max(best, int(np.flatnonzero(allowed).max(initial=0)))])


def _least_risk(relative: Array, gains: Array, weights: Array) -> int:
    """Return which filter's mean square error, at these weights (F, 1), is estimated least.

    `relative` (F, k) is the power of signals over that of their noise, `gains` (F, C) are those of
    filters, from the lowest on.
    """
    # What a filter takes of the motion and leaves of the noise, but for a constant: the power times
    # `slopes`, and what is `given`.
    slopes, noise_terms = weights * (gains**2 - 2.0 * gains), weights * 2.0 * gains
    total, count = relative.sum(axis=1), relative.shape[1]
    risks = total @ slopes + count * noise_terms.sum(axis=0)
    best = int(np.argmin(risks))
    # Chance may make a higher one the best: the lowest that is as good within a standard error.
    # Noise makes a power 1 + s vary by 1 + 2 s, s being the motion's.
    variances = np.maximum(2.0 * total - count, 0.0) @ (slopes - slopes[:, [best]]) ** 2
    return int(np.argmax(risks - risks[best] <= np.sqrt(_CORRELATED * variances)))


def bins_below(power: Array, share: float) -> int:
    """Return the number of frequencies of a spectrum (F, k) with a share of each signal's power."""
    total = np.maximum(power.sum(axis=0), np.finfo(float).tiny)
    return int((np.cumsum(power, axis=0) / total < share).sum(axis=0).max())


@dataclass(frozen=True)
class Decimation:
    """The parallel filter: a linear-phase low-pass that keeps every `factor`-th sample.

    A linear filter that treats forces and regressor alike leaves F = W beta as true as it was. It
    takes away what the motion does not cover, noise above all, and leaves residuals that are nearly
    white, so that standard deviations may be believed. The cut-off is half the new sampling rate;
    what is folded over it is the same on both sides.
    """

    factor: int

    @classmethod
    def to_band(cls, rate: float, band: float | None) -> Decimation:
        """Return the decimation for a band from 0 to `band` Hz; none, where it is None."""
        return cls(1 if band is None else max(int(rate / (2.0 * band)), 1))

    @property
    def margin(self) -> int:
        """Samples at each end that are lost."""
        return 0 if self.factor == 1 else _HALF * self.factor

    def centers(self, rows: int) -> NDArray[np.int64]:
        """Return the indices of the samples after decimation, of so many rows."""
        return np.arange(self.margin, rows - self.margin, self.factor, dtype=np.int64)

    @cached_property
    def taps(self) -> Array:
        """The filter's coefficients, which sum to one."""
        if self.factor == 1:
            return np.ones(1)
        return np.asarray(
            scipy.signal.firwin(2 * self.margin + 1, 1.0 / self.factor, window=("kaiser", 5.0))
        )

    def noise(self, used: Array) -> Array:
        """Return the deviation of filtered unit white noise on the samples (T, n) that are 1."""
        return np.asarray(np.sqrt(np.maximum(self._filter_channel(used, self.taps**2), 0.0)))

    def __call__(self, signal: Array) -> Array:
        """Return signals (T, ...) filtered and decimated: one row for each of `centers`."""
        return self._filter_channel(signal, self.taps)

    def _filter_channel(self, signal: Array, taps: Array) -> Array:
        """Return a signal (T, ...) filtered and decimated; empty if it is too short."""
        if self.factor == 1:
            return signal
        count = len(self.centers(len(signal)))
        if count == 0:
            return signal[:0]
        flat = signal.reshape(len(signal), -1)
        # Sample k of the full convolution belongs to the centre k - margin, and the margin is a
        # multiple of the factor.
        filtered = scipy.signal.upfirdn(taps, flat, down=self.factor, axis=0)[
            2 * _HALF : 2 * _HALF + count
        ]
        return np.asarray(filtered.reshape(count, *signal.shape[1:]))
