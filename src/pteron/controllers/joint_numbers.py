"""Checks of a controller's numbers: above zero, one for all joints or one for each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pteron.arguments import number_or_nan
from pteron.errors import DataError, shorten
from pteron.kernels import Array
from pteron.manipulator import Manipulator

PerJoint = float | Sequence[float]
"""One number for all joints, or one for each."""

_SLOWEST = 0.1
"""Longest period, s; a larger number is taken for a rate."""


def positive_numbers(name: str, numbers: PerJoint | None) -> float | tuple[float, ...] | None:
    """Return positive numbers as they are, one or one for each joint; raise for others."""
    if numbers is None:
        return None
    several: object = numbers
    if isinstance(several, np.ndarray):
        several = several.tolist()
    if not isinstance(several, list | tuple):
        return _positive_number(f"{name}: {{}} given, a number above 0 expected", several)
    return tuple(
        _positive_number(f"{name}: {{}} given for joint {i}, a number above 0 expected", number)
        for i, number in enumerate(several, start=1)
    )


def _positive_number(message: str, argument: object) -> float:
    """Return an argument as a float; raise DataError if it is not a finite number above 0."""
    number = number_or_nan(argument)
    if isinstance(argument, str | bool) or not (np.isfinite(number) and number > 0.0):
        raise DataError(message.format(shorten(argument)))
    return number


def period_of(seconds: float) -> float:
    """Return a period in s after a check that it is positive, finite and no rate."""
    period = _positive_number(
        "period: {} given, seconds between two samples expected, such as 0.001", seconds
    )
    if period > _SLOWEST:
        raise DataError(
            f"period: {period:g} s given, at most {_SLOWEST:g} s expected; is it a rate in Hz? "
            f"then give {1 / period:g}"
        )
    return period


def joint_array(model: Manipulator, name: str, numbers: PerJoint) -> Array:
    """Return `numbers` as one number for each joint (n,); a single one is repeated."""
    array = np.asarray(numbers, dtype=float)
    if array.ndim and array.shape != (model.joint_count,):
        raise DataError(
            f"{name}: {array.size} numbers given, but {model.name} has {model.joint_count} joints "
            f"({', '.join(model.joint_names)}); give one for each, or one for all"
        )
    return np.broadcast_to(array, model.joint_count)
