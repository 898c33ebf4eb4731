"""Quantities of the joints and angles of the platform as people read them, with their units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pteron.kernels import Array
from pteron.legs.kind import ActuatedJoint
from pteron.manipulator import Manipulator
from pteron.platforms.coordinates import SHOWN, coordinate as pose_coordinate
from pteron.report.typeset import format_fixed

_NARROW = "\u202f"
"""The narrow space within a unit."""

SYMBOLS = {"rho": "\u03c1", "theta": "\u03b8"}
"""Greek letters of the joints' coordinates."""


@dataclass(frozen=True)
class JointQuantity:
    """A quantity of n joints: its name, their units, and the factors from SI units to these."""

    name: str
    units: tuple[str, ...]
    factors: tuple[float, ...]

    @property
    def common_unit(self) -> str:
        """The unit, if it is the same for all joints."""
        return self.units[0] if len(set(self.units)) == 1 else ""

    @property
    def heading(self) -> str:
        """The name, with the unit if it is the same for all joints."""
        unit = self.common_unit.replace(" ", _NARROW)
        return f"{self.name} ({unit})" if unit else self.name

    @property
    def axis(self) -> str:
        """The name with all units, for the axis of a figure."""
        return f"{self.name} ({', '.join(dict.fromkeys(self.units))})"

    def unit_suffix(self, i: int) -> str:
        """Return the unit of leg i, from 0, unless the heading has it."""
        return "" if self.common_unit else f" {self.units[i]}"


def coordinate(joints: Sequence[ActuatedJoint]) -> JointQuantity:
    """Return the joint coordinates, in display units."""
    names = dict.fromkeys(joint.coordinate for joint in joints)
    name = ", ".join(SYMBOLS.get(letter, letter) for letter in names)
    units, factors = zip(*(SHOWN[joint.unit] for joint in joints), strict=True)
    return JointQuantity(name, units, factors)


def force(joints: Sequence[ActuatedJoint]) -> JointQuantity:
    """Return the actuator forces."""
    name = " or ".join(dict.fromkeys(joint.force for joint in joints))
    return JointQuantity(name, tuple(joint.force_unit for joint in joints), (1.0,) * len(joints))


def speed(joints: Sequence[ActuatedJoint]) -> JointQuantity:
    """Return the joint speeds."""
    units = tuple(f"{joint.unit}/s" for joint in joints)
    return JointQuantity("speed", units, (1.0,) * len(joints))


def nouns(joints: Sequence[ActuatedJoint]) -> str:
    """Return the noun of the actuated joints, such as "slider", or "slider or crank"."""
    return " or ".join(dict.fromkeys(joint.noun for joint in joints))


def readable(coordinate: float, unit: str, places: int = 1) -> str:
    """Return the text of a coordinate, in display units.

    Examples
    --------
    >>> readable(0.5, "rad"), readable(0.12, "m")
    ('28.6°', '120.0 mm')
    """
    shown, factor = SHOWN[unit]
    text = format_fixed(factor * float(coordinate), places)
    return f"{text}{shown if shown == '°' else ' ' + shown}"


def angles_text(robot: Manipulator, pose: Array) -> str:
    """Return the angles of a pose (m,) with their symbols; empty without angles."""
    pairs = zip(robot.coordinates, pose, strict=True)
    return ", ".join(
        f"{pose_coordinate(name).symbol} = {readable(angle, 'rad', 0)}"
        for name, angle in pairs
        if name in robot.platform.angles
    )
