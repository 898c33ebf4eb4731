"""The zero-phase low-pass filter of the positions, and its cut-off from the data themselves."""

from __future__ import annotations

import numpy as np
from scipy.signal import butter, freqz_sos, sosfiltfilt  # type: ignore[import-untyped]

from pteron.identification.signals.noise import white_noise
from pteron.kernels import Array

__all__ = ["SETTLING", "cutoff_of", "noise_free", "smoothed"]

_ORDER = 4

SETTLING = 6.0
"""Time that a block's ends need to settle, in periods of the cut-off: 1e-6 of a step is left."""

_SAFETY = 2.0
"""Factor on the frequency that position needs: acceleration weighs what lies above it more."""

_HIGHEST = 0.2
"""Share of the sampling rate beyond which a filter would take nothing worth its edges."""

_MARGIN = 20.0
"""Factor on the motion's own bandwidth beyond which what shows is noise of another colour."""

_POWER = 0.9999
_CANDIDATES = 40
_LOOK = 60_000
"""Samples that the search for a cut-off looks at."""

_NOISE_FREE = 1e-12
"""Noise, relative to a signal's span, that is rounding: there is nothing to filter."""


def smoothed(signal: Array, rate: float, cutoff: float) -> Array:
    """Return signals (T, k) after a Butterworth filter of order 4 forward and backward.

    Its gain is 1 / (1 + (f / cutoff)^8), its phase zero.
    """
    sections = butter(_ORDER, cutoff, fs=rate, output="sos")
    padding = min(round(SETTLING * rate / cutoff), len(signal) - 1)
    return np.asarray(sosfiltfilt(sections, signal, axis=0, padlen=padding))


def noise_free(signal: Array, noise: Array) -> bool:
    """Say whether the noise of signals (T, k) is rounding alone."""
    return bool((noise <= _NOISE_FREE * np.ptp(signal, axis=0)).all())


def cutoff_of(signal: Array, rate: float) -> float | None:
    """Return the cut-off for signals, Hz, or None where they need no filter.

    It is twice the lowest frequency at which what the filter takes away is white noise, of the
    strength that `white_noise` finds, and no motion: the residual analysis of Winter. It is at most
    twenty times the frequency below which nearly all the motion is, as noise need not be white.

    Parameters
    ----------
    signal : array, shape (T, k)
        Uniformly sampled positions.
    rate : float
        Samples per second.

    Returns
    -------
    float or None
    """
    part = signal[:_LOOK]
    noise = white_noise(part)
    if noise_free(part, noise):
        return None
    inside = slice(len(part) // 10, len(part) - len(part) // 10)
    # Both the strength of the noise and that of the residual are estimates themselves.
    slack = 4.0 * np.sqrt(10.0 / len(part))
    lowest = min(20.0 * rate / len(part), 0.5 * _HIGHEST * rate / _SAFETY)
    highest = min(_HIGHEST * rate, _MARGIN * _bandwidth(part, rate)) / _SAFETY
    for candidate in np.geomspace(lowest, max(highest, lowest), _CANDIDATES):
        residual = (part - smoothed(part, rate, float(candidate)))[inside]
        share = _taken(rate, float(candidate))
        if (np.mean(residual**2, axis=0) <= noise**2 * (share + slack)).all():
            break
    return float(_SAFETY * candidate)


def _bandwidth(signal: Array, rate: float) -> float:
    """Return the frequency below which nearly all of a motion's power is.

    Of position, not of speed: the noise of a coarse encoder would outweigh the motion there.
    """
    window = np.hanning(len(signal))[:, None]
    power = np.abs(np.fft.rfft(window * (signal - signal.mean(axis=0)), axis=0)) ** 2
    share = np.cumsum(power, axis=0) / np.maximum(power.sum(axis=0), np.finfo(float).tiny)
    return float((share < _POWER).sum(axis=0).max() * rate / len(signal))


def _taken(rate: float, cutoff: float) -> float:
    """Return the share of white noise that the filter takes away."""
    sections = butter(_ORDER, cutoff, fs=rate, output="sos")
    _, gain = freqz_sos(sections, worN=2048, fs=rate)
    return float(np.mean((1.0 - np.abs(gain) ** 2) ** 2))
