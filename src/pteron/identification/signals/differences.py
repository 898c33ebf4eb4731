"""Derivatives of a uniformly sampled signal by central differences."""

from __future__ import annotations

import numpy as np

from pteron.kernels import Array

__all__ = ["LOST", "central_differences"]

LOST = 4
"""Samples at each end that have no central difference."""

_FIRST = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])
_SECOND = np.array([-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560])


def central_differences(signal: Array, rate: float) -> tuple[Array, Array]:
    """Return first and second derivatives by central differences of eighth order.

    At a hundredth of the sampling rate they are wrong by 1e-12, where the usual ones of second
    order are wrong by 1e-3.

    Parameters
    ----------
    signal : array, shape (T, k)
        Uniformly sampled.
    rate : float
        Samples per second.

    Returns
    -------
    first, second : array, shape (T - 8, k)
        At the samples 4 to T - 5; per second, and per second squared.
    """
    rows = len(signal) - 2 * LOST
    first, second = np.zeros((2, rows, signal.shape[1]))
    for k in range(2 * LOST + 1):
        part = signal[k : k + rows]
        first += _FIRST[k] * part
        second += _SECOND[k] * part
    return first * rate, second * rate**2
