"""Likely mistakes in a whole log, and how each is undone: units, order, signs, steps, zeros, frame.

They are in the order in which they are likely; `raw_faults` chooses among them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import combinations, permutations, product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pteron.calibration.guess import Guess
from pteron.calibration.measurements import VALUES, Measurements
from pteron.calibration.mistake import Mistake, multiply_fields
from pteron.calibration.reading_mistakes import (
    reversed_joints,
    swapped_legs,
    wrong_steps,
    wrong_zeros_and_scales,
)

Array = NDArray[np.float64]


_LARGE_HEIGHTS = 0.01
"""Spread of heights, as a share of the machine's size, from which they may be in millimetres.

Chosen: heights over a bed spread by 2e-5 of the size and more, which mm read as m make 2e-2."""


def likely_mistakes(measurements: Measurements, guess: Guess) -> Iterator[list[Mistake]]:
    """Yield groups of likely mistakes, the likeliest first; zeros and scales are fitted to rows."""
    kinds = (
        *(_wrong_units, _downward_heights, _swapped_marks, _turned_frames, swapped_legs),
        *(reversed_joints, _mirrored_frames, _shifted_rows),
    )
    for kind in kinds:
        yield list(kind(measurements, guess))
    yield [*wrong_steps(measurements, guess), *wrong_zeros_and_scales(measurements, guess)]


def order_mistakes(measurements: Measurements, guess: Guess) -> Iterator[Mistake]:
    """Yield mistakes in the order of rows and the sign of heights.

    Of small residuals they make other small ones, which may look like noise.
    """
    for kind in (_downward_heights, _shifted_rows):
        yield from kind(measurements, guess)


def _wrong_units(measurements: Measurements, guess: Guess) -> Iterator[Mistake]:
    """Yield likely mistakes: smaller units, where values vary by more than the machine's size."""
    linear = np.array([leg.joint.unit == "m" for leg in guess.robot.legs])
    lengths = [f"{k}s" for k in ("position", "height", "distance") if k in measurements.kinds]
    large = _large_lengths(measurements, guess, lengths)
    for factor, text in (
        (1e-3, "in millimetres"),
        (25.4e-3, "in inches"),
        (1e3, "1000 times too small, as of km for m"),
    ):
        factors: dict[str, ArrayLike] = dict.fromkeys(lengths, factor)
        if linear.any():
            factors["readings"] = np.where(linear, factor, 1.0)
        if factor < 1.0:
            factors = {name: factors[name] for name in factors if name in large}
        advice = f"are {text}: give them in metres"
        for name in factors:
            yield Mistake(f"the {name} {advice}", multiply_fields({name: factors[name]}))
        if len(factors) > 1:
            yield Mistake(f"all lengths {advice}", multiply_fields(factors))
    if not linear.all():
        turned = np.where(linear, 1.0, np.pi / 180.0)
        text = "the readings are in degrees: give them in radians"
        yield Mistake(text, multiply_fields({"readings": turned}))
    if "angle" in measurements.kinds:
        text = "the measured angles are in degrees: give them in radians"
        yield Mistake(text, multiply_fields({"angles": np.pi / 180.0}))


def _downward_heights(measurements: Measurements, guess: Guess) -> Iterator[Mistake]:
    """Yield a likely mistake: heights that count downwards."""
    if "height" in measurements.kinds:
        text = "the heights count downwards: reverse their signs"
        yield Mistake(text, multiply_fields({"heights": -1.0}))


def _large_lengths(measurements: Measurements, guess: Guess, lengths: Sequence[str]) -> set[str]:
    """Return the fields of lengths that vary by more than the machine's size.

    Divided by 1000, distances would lie within tolerances of anything. Heights vary by less.
    """
    legs = guess.robot.legs
    size = max(leg.size for leg in legs)
    linear = [leg.joint.unit == "m" for leg in legs]
    lengths_read = {name: getattr(measurements, name) for name in lengths}
    lengths_read["readings"] = measurements.readings[:, linear]
    large = set()
    for name, columns in lengths_read.items():
        seen = columns[np.isfinite(columns)]
        least = _LARGE_HEIGHTS * size if name == "heights" else size
        if seen.size and np.median(np.abs(seen - np.median(seen))) > least:
            large.add(name)
    return large


def _swapped_marks(measurements: Measurements, guess: Guess) -> Iterator[Mistake]:
    """Yield likely mistakes: two marks that are swapped."""
    for a, b in combinations(sorted(set(measurements.marks)), 2):

        def undo(rows: Measurements, a: str = a, b: str = b) -> Measurements:
            """Return the measurements with the marks a and b exchanged."""
            other = {a: b, b: a}
            return replace(rows, marks=tuple(other.get(name, name) for name in rows.marks))

        yield Mistake(
            f"the marks {a or 'tool'} and {b or 'tool'} are swapped: exchange their names", undo
        )


def _turned_frames(measurements: Measurements, guess: Guess) -> Iterator[Mistake]:
    """Yield likely mistakes: the instrument's frame turned by quarter turns."""
    if not _whole_positions(measurements):
        return
    for turn in _signed_axes(1.0):
        text = (
            f"the instrument's frame is turned: its {_described_axes(turn)} of the base; turn the "
            'positions, or say [instrument] frame = "unknown"'
        )
        yield Mistake(text, _rotate_positions(turn))


def _mirrored_frames(measurements: Measurements, guess: Guess) -> Iterator[Mistake]:
    """Yield likely mistakes: columns of positions exchanged or reversed, as axes of a left hand."""
    if _whole_positions(measurements):
        for turn in _signed_axes(-1.0):
            text = (
                f"the positions' columns are exchanged or reversed: {_described_axes(turn)} of the "
                "base; exchange the columns or reverse their signs"
            )
            yield Mistake(text, _rotate_positions(turn))


def _whole_positions(measurements: Measurements) -> bool:
    """Return whether positions are measured in the base frame, all three coordinates each."""
    seen = ~np.isnan(measurements.positions)
    complete = bool((seen.all(axis=1) == seen.any(axis=1)).all())
    return measurements.setup.frame_known and complete and bool(seen.any())


def _signed_axes(determinant: float) -> list[Array]:
    """Return the signed permutations (3, 3) of a determinant, without the identity."""
    matrices = [
        np.array(signs)[:, None] * np.eye(3)[list(order)]
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
    ]
    # Few changes first.
    matrices.sort(key=lambda matrix: -float(np.trace(matrix)))
    return [m for m in matrices[1:] if np.linalg.det(m) * determinant > 0.0]


def _described_axes(turn: Array) -> str:
    """Return the axes of a signed permutation in words: x along -y, for example."""
    return ", ".join(
        f"{'xyz'[k]} along {'-' if row.sum() < 0 else ''}{'xyz'[int(np.abs(row).argmax())]}"
        for k, row in enumerate(turn)
    )


def _rotate_positions(turn: Array) -> Callable[[Measurements], Measurements]:
    """Return the change of positions to the base frame, from a frame whose axes are rows."""
    return lambda measurements: replace(measurements, positions=measurements.positions @ turn)


def _shifted_rows(measurements: Measurements, guess: Guess) -> Iterator[Mistake]:
    """Yield likely mistakes: measurements a row or two off their readings."""
    if "distance" in measurements.kinds:  # rows name each other
        return
    for shift in (1, -1, 2, -2):

        def undo(rows: Measurements, shift: int = shift) -> Measurements:
            """Return the rows with all their values `shift` rows later; NaN beyond the ends."""
            changed: dict[str, Array] = {}
            for name in VALUES:
                column = np.roll(getattr(rows, name), shift, axis=0)
                column[: max(shift, 0)] = np.nan
                column[len(column) + min(shift, 0) :] = np.nan
                changed[name] = column
            moved: Any = changed
            return replace(rows, **moved)

        rows = "a row" if abs(shift) == 1 else f"{abs(shift)} rows"
        way = "before" if shift > 0 else "after"
        text = f"what was measured stands {rows} {way} its readings: shift one against the other"
        yield Mistake(text, undo)
