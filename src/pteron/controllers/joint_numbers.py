"""Checks of a controller's numbers: above zero, one for all joints or one for each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pteron.arguments import number_or_nan
from pteron.errors import DataError, shown
from pteron.kernels import Array
from pteron.manipulator import Manipulator

PerJoint = float | Sequence[float]
"""One number for all joints, or one for each."""

_SLOWEST = 0.1
"""Longest period, s; a larger number is taken for a rate."""


def above_zero(name: str, value: PerJoint | None) -> float | tuple[float, ...] | None:
    """Return a number, or one for each joint, after a check that each is above zero."""
    if value is None:
        return None
    several: object = value
    if isinstance(several, np.ndarray):
        several = several.tolist()
    if not isinstance(several, list | tuple):
        return _number(f"{name}: {{}} given, a number above 0 expected", several)
    return tuple(
        _number(f"{name}: {{}} given for joint {i}, a number above 0 expected", number)
        for i, number in enumerate(several, start=1)
    )


def _number(message: str, value: object) -> float:
    number = number_or_nan(value)
    if isinstance(value, str | bool) or not (np.isfinite(number) and number > 0.0):
        raise DataError(message.format(shown(value)))
    return number


def period_of(value: float) -> float:
    """Return a period in s, or refuse what is none."""
    period = _number("period: {} given, seconds between two samples expected, such as 0.001", value)
    if period > _SLOWEST:
        raise DataError(
            f"period: {period:g} s given, at most {_SLOWEST:g} s expected; is it a rate in Hz? "
            f"then give {1 / period:g}"
        )
    return period


def per_joint(model: Manipulator, name: str, value: PerJoint) -> Array:
    """Return a number for each joint (n,)."""
    numbers = np.asarray(value, dtype=float)
    if numbers.ndim and numbers.shape != (model.joint_count,):
        raise DataError(
            f"{name}: {numbers.size} numbers given, but {model.name} has {model.joint_count} "
            f"joints ({', '.join(model.joint_names)}); give one for each, or one for all"
        )
    return np.broadcast_to(numbers, model.joint_count)
