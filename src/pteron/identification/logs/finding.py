"""What was noticed in a log and left as it is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

__all__ = ["Finding", "Kind"]

Kind = Literal["gap", "jitter", "clipped", "frozen", "spike", "guessed", "units"]
"""Missing samples, uneven steps, saturated forces, a channel that stops, single samples
that stand out, a name or a unit guessed,
a unit that looks wrong."""


@dataclass(frozen=True)
class Finding:
    """Something in a log that a person should know; nothing was repaired.

    Parameters
    ----------
    kind : str
        One of `Kind`.
    message : str
        One line: what, where and how much.
    row : int or None
        The data row, from 1, where it is first seen.
    column : str or None
        The column, as the file calls it.
    count : int
        How often it occurs: gaps, uneven steps, clipped rows, frozen stretches, spikes or columns.
    """

    kind: Kind
    message: str
    row: int | None = None
    column: str | None = None
    count: int = 1
