"""What the joints of a machine, and their units, are called in logs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pteron.manipulator import Manipulator

LENGTHS = ("m", "mm", "um")
ANGLES = ("rad", "deg")
_PER_UNIT = {"s": 1.0, "ms": 1e3, "us": 1e6, "m": 1.0, "mm": 1e3, "um": 1e6, "rad": 1.0}


@dataclass(frozen=True)
class JointSymbols:
    """How an actuated joint is spoken of: a noun, the stems of its columns, its SI units."""

    noun: str
    coordinate: str
    unit: str
    force: str
    force_unit: str


SLIDER = JointSymbols("slider", "rho", "m", "force", "N")


def joint_symbols(robot: Manipulator) -> tuple[JointSymbols, ...]:
    """Return how the actuated joint of each leg is spoken of; a slider's where a leg is silent."""
    return tuple(getattr(leg, "joint", SLIDER) for leg in robot.legs)


def units_of(joint: JointSymbols) -> tuple[str, ...]:
    """Return the units in which a joint's coordinate may stand in a file."""
    return LENGTHS if joint.unit == "m" else ANGLES


def in_si(values: NDArray[np.float64], unit: str) -> NDArray[np.float64]:
    """Return times, lengths or angles in s, m or rad."""
    return np.radians(values) if unit == "deg" else values / _PER_UNIT[unit]
