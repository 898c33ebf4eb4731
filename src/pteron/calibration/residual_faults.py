"""Faults that measurements show: before a fit in what the drawing misses, after it in residuals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pteron.calibration.fit import Fit
from pteron.calibration.guess import Block, Guess
from pteron.calibration.measurements import Measurements
from pteron.calibration.result import Finding

Array = NDArray[np.float64]


def raw_faults(start: Guess, given: Measurements, poses: Array) -> str | None:
    """Return what is wrong with measurements as such, or None."""
    return None


def residual_faults(fit: Fit, blocks: Sequence[Block], given: Measurements) -> tuple[Finding, ...]:
    """Return the faults that residuals show."""
    return tuple(
        Finding("outlier", f"{given.places[i]} does not fit: {fit.distances[i]:.3g} deviations.")
        for i in np.flatnonzero(~fit.kept)
    )
