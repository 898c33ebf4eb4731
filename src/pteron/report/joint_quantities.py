"""How the quantities of the joints are printed: one unit for all legs, or one for each."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import pi

from pteron.legs.kind import ActuatedJoint
from pteron.report.typeset import fixed

_NARROW = "\u202f"
_SYMBOLS = {"rho": "\u03c1", "theta": "\u03b8"}
_SHOWN = {"m": ("mm", 1e3), "rad": ("°", 180.0 / pi)}
"""The unit in which people read it, and how many of it make one."""


@dataclass(frozen=True)
class Quantity:
    """A quantity of n joints: its name, and each one's unit and the factor that leads to it."""

    name: str
    units: tuple[str, ...]
    factors: tuple[float, ...]

    @property
    def shared(self) -> str:
        """The unit, if all have the same."""
        return self.units[0] if len(set(self.units)) == 1 else ""

    @property
    def heading(self) -> str:
        """The name, with the unit if all have the same."""
        unit = self.shared.replace(" ", _NARROW)
        return f"{self.name} ({unit})" if unit else self.name

    @property
    def axis(self) -> str:
        """The name with all units, for the axis of a figure."""
        return f"{self.name} ({', '.join(dict.fromkeys(self.units))})"

    def own(self, i: int) -> str:
        """Return the unit of leg i, from 0, if the heading does not have it."""
        return "" if self.shared else f" {self.units[i]}"


def coordinate(joints: Sequence[ActuatedJoint]) -> Quantity:
    """Return the joint coordinates, as people read them."""
    names = _distinct(joint.coordinate for joint in joints)
    name = ", ".join(_SYMBOLS.get(one, one) for one in names)
    shown = [_SHOWN[joint.unit] for joint in joints]
    return Quantity(name, tuple(unit for unit, _ in shown), tuple(factor for _, factor in shown))


def force(joints: Sequence[ActuatedJoint]) -> Quantity:
    """Return the actuator forces."""
    name = " or ".join(_distinct(joint.force for joint in joints))
    return Quantity(name, tuple(joint.force_unit for joint in joints), (1.0,) * len(joints))


def speed(joints: Sequence[ActuatedJoint]) -> Quantity:
    """Return the joint speeds."""
    return Quantity("speed", tuple(f"{joint.unit}/s" for joint in joints), (1.0,) * len(joints))


def nouns(joints: Sequence[ActuatedJoint]) -> str:
    """Return what the actuated joints are: "slider", or "slider or crank"."""
    return " or ".join(_distinct(joint.noun for joint in joints))


def readable(value: float, unit: str) -> str:
    """Return a joint's coordinate as people read it.

    Examples
    --------
    >>> readable(0.5, "rad"), readable(0.12, "m")
    ('28.6°', '120.0 mm')
    """
    shown, factor = _SHOWN[unit]
    return f"{fixed(factor * value)}{shown if shown == '°' else ' ' + shown}"


def _distinct(words: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(words))
