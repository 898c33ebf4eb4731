"""Conversion of joint coordinates to drives' readings and back: q = zero + scale reading.

Rates follow by the scale; a force along a reading is scale times the force along the coordinate.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pteron.errors import ModelError
from pteron.legs.reading import Reading
from pteron.manipulator.manipulator import Manipulator

Array = NDArray[np.float64]


def has_readings(robot: Manipulator) -> bool:
    """Return whether the drive readings of any leg differ from its joint coordinate."""
    return any(leg.reading not in (None, Reading()) for leg in robot.legs)


def reading_scales(robot: Manipulator) -> Array:
    """Return the joint coordinate per unit of each drive's reading (n,)."""
    return np.array([(leg.reading or Reading()).scale for leg in robot.legs])


def reading_zeros(robot: Manipulator) -> Array:
    """Return each joint's coordinate where its drive reads 0, (n,), m or rad."""
    return np.array([(leg.reading or Reading()).zero for leg in robot.legs])


def from_readings(robot: Manipulator, readings: ArrayLike) -> Array:
    """Return joint coordinates (..., n), m or rad, from drive readings (..., n)."""
    array = np.asarray(readings, dtype=float)
    return reading_zeros(robot) + reading_scales(robot) * array if has_readings(robot) else array


def to_readings(robot: Manipulator, joints: ArrayLike) -> Array:
    """Return drive readings (..., n) from joint coordinates (..., n), m or rad."""
    array = np.asarray(joints, dtype=float)
    return (array - reading_zeros(robot)) / reading_scales(robot) if has_readings(robot) else array


def remove_readings(robot: Manipulator) -> Manipulator:
    """Return the machine without readings: its drives read the joint coordinates."""
    legs = tuple(replace(leg, reading=None) for leg in robot.legs)
    return replace(robot, legs=legs) if has_readings(robot) else robot


def refuse_readings(robot: Manipulator, writer: str) -> None:
    """Raise if the machine's drives have readings, which `writer` does not support."""
    if has_readings(robot):
        legs = [str(i) for i, leg in enumerate(robot.legs, start=1) if leg.reading is not None]
        raise ModelError(
            f"{robot.name}: {writer} counts joint coordinates, and the drives of legs "
            f"{', '.join(legs)} read others (key `reading`); leave that key out of a copy of the "
            "file, and convert by q = zero + scale reading"
        )
