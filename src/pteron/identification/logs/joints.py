"""The units of joints in logs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pteron.legs.kind import ActuatedJoint
from pteron.manipulator import Manipulator

LENGTHS = ("m", "mm", "um")
ANGLES = ("rad", "deg")
_PER_UNIT = {"s": 1.0, "ms": 1e3, "us": 1e6, "m": 1.0, "mm": 1e3, "um": 1e6, "rad": 1.0}


def joint_symbols(robot: Manipulator) -> tuple[ActuatedJoint, ...]:
    """Return how the actuated joint of each leg is spoken of."""
    return tuple(leg.joint for leg in robot.legs)


def units_of(joint: ActuatedJoint) -> tuple[str, ...]:
    """Return the units in which a joint's coordinate may stand in a file."""
    return LENGTHS if joint.unit == "m" else ANGLES


def in_si(values: NDArray[np.float64], unit: str) -> NDArray[np.float64]:
    """Return times, lengths or angles in s, m or rad."""
    return np.radians(values) if unit == "deg" else values / _PER_UNIT[unit]
