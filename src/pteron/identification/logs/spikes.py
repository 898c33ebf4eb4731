"""Single samples that stand out from their neighbours."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter  # type: ignore[import-untyped]

from pteron.identification.logs.finding import Finding

__all__ = ["Spikes"]

_WINDOW = 5
"""Samples whose median a sample is compared with: steps pass, single samples do not."""

_USUAL = 20.0
"""Distance from the median, in that which one sample in a hundred exceeds."""

_SHARES = (1.0, 99.0)
"""Percentiles between which a channel's usual span lies."""


class Spikes:
    """The spikes of one channel.

    Parameters
    ----------
    column : str
        What the file calls it.
    source : str
        What messages call the file.
    share : float
        Distance from the median, as a share of the channel's usual span, that is none of a motion.
    """

    def __init__(self, column: str, source: str, share: float) -> None:
        self._column = column
        self._source = source
        self._share = share
        self._rows = 0
        self._count = 0
        self._first = (0, 0.0)

    def take(self, values: NDArray[np.float64]) -> None:
        """Look at the next piece, shape (rows,); its first and last samples have no neighbours."""
        if len(values) > _WINDOW:
            apart = np.abs(values - median_filter(values, _WINDOW, mode="nearest"))
            low, high = np.percentile(values, _SHARES)
            usual = _USUAL * np.percentile(apart, _SHARES[1])
            found = np.flatnonzero(apart > max(usual, self._share * (high - low)))
            if len(found) and not self._count:
                self._first = (self._rows + int(found[0]), float(values[found[0]]))
            self._count += len(found)
        self._rows += len(values)

    def findings(self) -> tuple[Finding, ...]:
        """Return what was found, once all pieces are taken."""
        if not self._count:
            return ()
        row, value = self._first
        more = f" ({self._count} such samples in all)" if self._count > 1 else ""
        message = (
            f"{self._source}: row {row + 1}, column {self._column}: {value:g} stands out from its "
            f"neighbours: spike{more}"
        )
        return (Finding("spike", message, row + 1, self._column, self._count),)
