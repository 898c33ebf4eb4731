"""Value and derivatives of a sampled signal from a spline."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import (  # type: ignore[import-untyped]
    BSpline,
    make_interp_spline,
    make_lsq_spline,
)

from pteron.kernels import Array

__all__ = ["fitted_spline", "spline_motion"]

_DEGREE = 7
"""The sixth power of sampling is left in the second derivative."""


def fitted_spline(time: Array, signal: Array, cutoff: float | None) -> BSpline:
    """Return the spline of degree 7 that is nearest to samples, in the least-squares sense.

    Its knots are half a period of the cut-off apart, so that what is faster is taken for noise.
    Without a cut-off it passes through every sample. Samples need not be uniform in time.

    Parameters
    ----------
    time : array, shape (T,)
        Ascending, s.
    signal : array, shape (T, k)
        Any unit.
    cutoff : float, optional
        Hz.
    """
    if cutoff is not None:
        pieces = int(np.ceil((time[-1] - time[0]) * 2.0 * cutoff))
        if pieces + _DEGREE < len(time) // 2:
            inner = np.linspace(time[0], time[-1], pieces + 1)
            knots = np.r_[[time[0]] * _DEGREE, inner, [time[-1]] * _DEGREE]
            return make_lsq_spline(time, signal, knots, k=_DEGREE, method="qr")
    return make_interp_spline(time, signal, k=_DEGREE)


def spline_motion(time: Array, signal: Array, cutoff: float | None) -> tuple[Array, Array, Array]:
    """Return value, first and second derivative (T, k) of the fitted spline at the samples."""
    spline = fitted_spline(time, signal, cutoff)
    return spline(time), spline(time, 1), spline(time, 2)
