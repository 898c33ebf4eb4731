"""Samples at even steps of time."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import make_interp_spline  # type: ignore[import-untyped]

from pteron.kernels import Array

__all__ = ["uniform"]

_EVEN = 1e-3
"""Deviation from even steps, in steps, that is a matter of how stamps were written."""


def uniform(time: Array, signal: Array) -> tuple[Array, Array]:
    """Return even times and the signals (T, k) there, by a quintic spline through the samples.

    Samples that are even already are returned as they are; the log's findings tell of uneven ones.
    """
    even = np.linspace(time[0], time[-1], len(time))
    step = (time[-1] - time[0]) / (len(time) - 1)
    if np.abs(time - even).max() <= _EVEN * step:
        return even, signal
    return even, make_interp_spline(time, signal, k=5)(even)
