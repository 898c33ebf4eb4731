"""The parallel filter: one low-pass and one decimation for both sides of the equation.

A linear filter that treats forces and regressor alike leaves F = W beta as true as it was. It takes
away what the motion does not cover, noise above all, and leaves residuals that are nearly white, so
that standard deviations may be believed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.signal import firwin, upfirdn  # type: ignore[import-untyped]

from pteron.kernels import Array

__all__ = ["Decimation"]

_HALF = 4
"""Half the filter's length, in samples that are kept."""


@dataclass(frozen=True)
class Decimation:
    """A linear-phase low-pass filter that keeps every `factor`-th sample.

    The cut-off is half the new sampling rate. What is folded over it does no harm: it is the same
    on both sides.
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
        """Return the indices of the samples kept, of so many."""
        return np.arange(self.margin, rows - self.margin, self.factor, dtype=np.int64)

    @cached_property
    def taps(self) -> Array:
        """The filter's coefficients, which sum to one."""
        if self.factor == 1:
            return np.ones(1)
        return np.asarray(firwin(2 * self.margin + 1, 1.0 / self.factor, window=("kaiser", 5.0)))

    def noise(self, used: Array) -> Array:
        """Return what is left of unit white noise on the samples (T, n) that are 1, not 0."""
        return np.asarray(np.sqrt(np.maximum(self._filtered(used, self.taps**2), 0.0)))

    def __call__(self, signal: Array) -> Array:
        """Return signals (T, ...) filtered and decimated: one row for each of `centers`."""
        return self._filtered(signal, self.taps)

    def _filtered(self, signal: Array, taps: Array) -> Array:
        if self.factor == 1:
            return signal
        count = len(self.centers(len(signal)))
        if count == 0:
            return signal[:0]
        flat = signal.reshape(len(signal), -1)
        # Sample k of the full convolution belongs to the centre k - margin, and the margin is a
        # multiple of the factor.
        filtered = upfirdn(taps, flat, down=self.factor, axis=0)[2 * _HALF : 2 * _HALF + count]
        return np.asarray(filtered.reshape(count, *signal.shape[1:]))
