"""How noisy a sampled signal is, without a model of what it measures."""

from __future__ import annotations

from math import comb

import numpy as np

from pteron.kernels import Array

__all__ = ["white_noise"]

_ORDER = 8
"""Of the differences: what a smooth motion leaves of them falls with this power of its sampling."""

_NORMAL = 0.6744897501960817
"""Median size of a standard normal variable."""

_LOOK = 20_000
_ON_GRID = 1e-3
"""Deviation from a multiple of the step, in steps, that is rounding of the numbers."""


def white_noise(signal: Array) -> Array:
    """Return the standard deviation of the white noise on uniformly sampled signals.

    The eighth differences of a motion sampled much faster than it moves vanish; those of white
    noise have C(16, 8) times its variance. Values on a grid, such as an encoder's counts, have at
    least the rounding error of the grid, also where they stand still.

    Parameters
    ----------
    signal : array, shape (T, k)
        At least 9 samples; any unit.

    Returns
    -------
    array, shape (k,)
        In the signals' unit.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.linspace(0.0, 10.0, 10_001)[:, None]
    >>> noise = 1e-6 * np.random.default_rng(0).normal(size=t.shape)
    >>> bool(abs(white_noise(np.sin(t) + noise)[0] / 1e-6 - 1.0) < 0.05)
    True
    """
    rough = np.abs(np.diff(signal, n=_ORDER, axis=0)) / np.sqrt(comb(2 * _ORDER, _ORDER))
    # The median forgives jumps, such as those of Coulomb friction.
    spread = np.median(rough, axis=0) / _NORMAL
    return np.asarray(np.maximum(spread, _grid(signal) / np.sqrt(12.0)))


def _grid(signal: Array) -> Array:
    """Return the step (k,) of the grid that values stand on; 0 where there is none."""
    steps = np.zeros(signal.shape[1])
    for k, values in enumerate(signal[:_LOOK].T):
        levels = np.unique(values)
        if len(levels) < 2:
            continue
        step = float(np.diff(levels).min())
        multiples = (levels - levels[0]) / step
        # A grid has few levels for the values on it, and all of them are multiples of its step.
        if np.abs(multiples - np.round(multiples)).max() < _ON_GRID:
            steps[k] = step
    return steps
