"""The part of a log that repeats: a periodic motion, without lead-in, lead-out and rest."""

from __future__ import annotations

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.identification.logs.spikes import runs
from pteron.identification.signals.filters import position_noise
from pteron.kernels import Array
from pteron.tolerances import SAME

_NOISE = 6.0
"""Distance of two positions, in standard deviations of their noise, below which they are the
same."""

_SPIKES = 10
"""Samples in a row that may be elsewhere without an end of the repetition."""

_MOVES = 0.5
"""Least travel in the part, as a share of each joint's span: at rest everything repeats."""

_LONGER = 0.002
"""Part of a period by which the stretch is longer than one, at least: a motion that crosses its own
path is there again for an instant."""

_WHOLE = 0.02
"""Part of a period that may be missing from the last one."""


def repeating_rows(time: Array, joints: Array, period: float) -> slice | None:
    """Return the rows of the longest stretch that repeats after a period, or None.

    The clock of the log does not matter: what counts is that the joints are after the period where
    they were, to within their noise. Whole periods are returned, in the middle of the stretch.

    Parameters
    ----------
    time : array, shape (T,)
        s, rising.
    joints : array, shape (T, n)
        Joint coordinates, m or rad.
    period : float
        s.

    Examples
    --------
    >>> import numpy as np
    >>> from pteron.identification.signals.repetition import repeating_rows
    >>> t = np.arange(800) / 100  # rest for 1 s, three swings of 2 s, and rest again
    >>> swings = np.cos(np.pi * np.clip(t - 1.0, 0.0, 6.0))
    >>> repeating_rows(t, swings[:, None], 2.0)
    slice(100, 700, None)
    """
    last = int(np.searchsorted(time, time[-1] - period, side="right"))
    if last < 2:
        return None
    rate = (len(time) - 1) / float(time[-1] - time[0])
    after = scipy.interpolate.make_interp_spline(time, joints, k=5)(time[:last] + period)
    span = np.ptp(joints, axis=0)
    near = np.maximum(_NOISE * position_noise(joints), SAME * span)
    same = (np.abs(after - joints[:last]) <= near).all(axis=1)
    ends = np.pad(same, _SPIKES, mode="edge")
    same = scipy.ndimage.binary_closing(ends, np.ones(_SPIKES + 1))[_SPIKES:-_SPIKES]

    best: tuple[float, float] | None = None
    for start, stop in runs(same):
        begin, end = float(time[start]), float(time[stop - 1]) + period
        through = joints[start : int(np.searchsorted(time, end, side="right"))]
        moves = (np.ptp(through, axis=0) >= _MOVES * span).all() and span.all()
        lasts = time[stop - 1] - time[start] >= _LONGER * period
        if moves and lasts and (best is None or end - begin > best[1] - best[0]):
            best = begin, end
    if best is None:
        return None
    begin, end = best
    periods = max(int((end - begin) / period + _WHOLE), 1)
    begin = max(begin + 0.5 * (end - begin - periods * period), begin)
    first = int(np.searchsorted(time, begin - 0.5 / rate))
    return slice(first, int(np.searchsorted(time, begin + periods * period - 0.5 / rate)))
