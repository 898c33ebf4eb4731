"""Observability: which combinations of a geometry's values measurements show, and which not.

Their number is a rank, found exactly (modulo primes) at random poses by `exact_rank`; singular
values at the measured poses confirm it, and tell which combinations are weak. Those that are not
shown are put in words by `unseen`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pteron.calibration.exact_rank import exact_rank
from pteron.calibration.guess import Guess, UnknownBlock, tolerances_of
from pteron.calibration.measurements import Measurements
from pteron.calibration.unseen import combination_text, unseen_combinations
from pteron.renamed import former_attribute
from pteron.result import Result
from pteron.tolerances import ROUNDING

Array = NDArray[np.float64]

_NAMED = 6
"""Most weak combinations that are named."""


@dataclass(frozen=True, eq=False, repr=False)
class Observability(Result):
    """The combinations of values that measurements show, and those that they do not.

    Attributes
    ----------
    rank : int
        Number of combinations of the values that enough such measurements show.
    columns : int
        Number of values.
    primes : tuple of int
        Primes modulo which the rank is found; none where a row's kind has no exact form.
    rows : int
        Number of random rows modulo each of them.
    at_poses : int
        The rank at the measured poses, by singular values.
    smallest_kept, largest_dropped : float
        Singular values next to it, relative to the greatest.
    unseen : tuple of str
        Combinations that they do not show, in words.
    weak : tuple of str
        Combinations of which they say less than ordinary tolerances do, in words.
    """

    rank: int
    columns: int
    primes: tuple[int, ...]
    rows: int
    at_poses: int
    smallest_kept: float
    largest_dropped: float
    unseen: tuple[str, ...]
    weak: tuple[str, ...]

    @property
    def determined_count(self) -> int:
        """The number of combinations that these rows show."""
        return min(self.rank, self.at_poses)

    def summary(self) -> str:
        """Return the reasons for the rank in a few sentences."""
        exact = (
            f"Exact rank {self.rank} of {self.columns} values: at {self.rows} random rows a square "
            "submatrix of that size has a nonzero determinant, computed exactly modulo "
            f"{len(self.primes)} primes of {max(self.primes, default=0).bit_length()} bits, and no "
            "greater one has."
        )
        here = (
            f"At the measured poses {self.at_poses} (smallest singular value kept "
            f"{self.smallest_kept:.2g}, largest dropped {self.largest_dropped:.2g})."
        )
        if self.at_poses < self.rank:
            here += " More, or other, poses would show more."
        return f"{exact} {here}"

    shown = former_attribute("shown", "determined_count")


def observability_of(
    start: Guess,
    measurements: Measurements,
    blocks: Sequence[UnknownBlock],
    slopes: Array,
    seed: int = 0,
) -> Observability:
    """Return which combinations of values measurements show, exactly and by singular values.

    Parameters
    ----------
    start : Guess
        The machine.
    measurements : Measurements
        The measurements.
    blocks : sequence of Block
        The unknowns.
    slopes : array, shape (R, p)
        Of the residuals at the measured poses, in standard deviations of their noise and of the
        tolerances: a singular value below 1 is a combination of which the tolerance says more.
    seed : int
        Of the random poses.
    """
    count = blocks[-1].where.stop
    sizes, axes = _spectrum(slopes, count)
    relative = sizes / max(float(sizes[0]), 1e-300)
    here = int((relative > ROUNDING).sum())
    rank, primes, rows = exact_rank(start, blocks, measurements, seed)
    tolerances = tolerances_of(blocks)
    tolerances[~np.isfinite(tolerances)] = 1.0
    names = [unknown.name for block in blocks for unknown in block.unknowns]
    weak = [
        f"{combination_text(axes[k] * tolerances, names)} (the tolerance is "
        f"{_ratio_text(1.0 / sizes[k])} times as narrow as the measurements' interval)"
        for k in reversed(range(here))
        if sizes[k] < 1.0
    ]
    last_shown, first_dropped = np.append(0.0, relative)[here], np.append(relative, 0.0)[here]
    exact = here if rank is None else rank, count, primes, rows
    unseen = unseen_combinations(start, blocks, axes[here:], tolerances)
    sizes_beside = here, float(last_shown), float(first_dropped)
    return Observability(*exact, *sizes_beside, unseen, tuple(weak[:_NAMED]))


def _ratio_text(ratio: float) -> str:
    """Return a ratio of 1 or more with two digits."""
    return f"{ratio:.0f}" if ratio >= 10.0 else f"{ratio:.2g}"


def _spectrum(slopes: Array, count: int) -> tuple[Array, Array]:
    """Return all singular values and right singular vectors of slopes (R, p)."""
    small = np.linalg.qr(slopes, mode="r") if len(slopes) > count else slopes
    padded = np.zeros((max(count, len(small)), count))
    padded[: len(small)] = small
    _, sizes, axes = np.linalg.svd(padded)
    return sizes, axes
