"""A mistake in a whole log of measurements, and the changes that undo one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pteron.calibration.guess import Guess
from pteron.calibration.measurements import Measurements
from pteron.manipulator import Manipulator

Array = NDArray[np.float64]


class Mistake(NamedTuple):
    """A mistake in a whole log: a sentence without a stop, and what undoes it."""

    text: str
    undo: Callable[[Measurements], Measurements]
    freedom: int = 0
    """Number of values that were fitted to name it."""


def leg_orders(guess: Guess) -> Iterator[tuple[int, ...]]:
    """Yield the orders of the readings in which two legs are swapped.

    Of three legs also those in which they follow each other round.
    """
    count = len(guess.robot.legs)
    for i, j in combinations(range(count), 2):
        order = list(range(count))
        order[i], order[j] = j, i
        yield tuple(order)
    if count == 3:
        yield from ((1, 2, 0), (2, 0, 1))


def travel_ends(robot: Manipulator) -> list[tuple[str, Array]]:
    """Return joint coordinates (n,) that readings may count from, in words: zero and both ends.

    The ends of the travel are left out where a joint has no limits.
    """
    ends = [("", np.zeros(len(robot.legs)))]
    if all(leg.limits is not None for leg in robot.legs):
        limits = np.array([leg.limits for leg in robot.legs])
        ends += [(" from the upper end", limits[:, 1]), (" from the lower end", limits[:, 0])]
    return ends


def reorder_readings(measurements: Measurements, order: Sequence[int]) -> Measurements:
    """Return measurements whose readings of leg i are those of leg order[i]."""
    return replace(measurements, readings=measurements.readings[:, list(order)])


def multiply_fields(factors: Mapping[str, ArrayLike]) -> Callable[[Measurements], Measurements]:
    """Return the change that multiplies fields of measurements by factors."""

    def undo(measurements: Measurements) -> Measurements:
        """Return the measurements with fields multiplied by the factors."""
        changed: Any = {n: getattr(measurements, n) * factor for n, factor in factors.items()}
        return replace(measurements, **changed)

    return undo


def transform_joints(
    guess: Guess, offsets: Array, factors: Array
) -> Callable[[Measurements], Measurements]:
    """Return the change of readings that takes joint coordinates q to offset + factor q."""

    def undo(measurements: Measurements) -> Measurements:
        """Return the measurements with readings at the joint coordinates offset + factor q."""
        joints = offsets + factors * guess.joints(measurements.readings)
        return replace(measurements, readings=guess.readings(joints))

    return undo
