"""Findings: oddities of a log that a person should know."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Kind = Literal[
    "gap", "jitter", "clipped", "frozen", "spike", "read", "guessed", "units", "periodic"
]
"""Missing samples, uneven steps, saturated forces, a channel that stops, samples that stand out,
how the file was read where that is not as documented, columns that may have been meant, a unit that
looks wrong, which rows repeat."""


@dataclass(frozen=True)
class Finding:
    """An oddity of a log that a person should know; nothing was repaired.

    Parameters
    ----------
    kind : str
        One of `Kind`.
    message : str
        One line: the oddity, its place and its size.
    row : int or None
        Its first data row, from 1.
    column : str or None
        The column, as the file calls it.
    count : int
        Number of gaps, uneven steps, clipped rows, frozen stretches, spikes or columns.
    """

    kind: Kind
    message: str
    row: int | None = None
    column: str | None = None
    count: int = 1
