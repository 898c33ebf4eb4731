"""Limits of an exciting motion at every instant: those given, or the drives' own."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from pteron.arguments import expect
from pteron.errors import DataError
from pteron.identification.signals.states import home
from pteron.kernels import Array
from pteron.kinematics import inverse_kinematics
from pteron.legs import Drive
from pteron.manipulator import Manipulator
from pteron.workspace.margins import joint_distances

UNITS = {
    "type_i": "",
    "type_ii": "",
    "joint_clearance": "{unit}",
    "passive_clearance": "",
    "speed": "{unit}/s",
    "acceleration": "{unit}/s^2",
    "force": "{force_unit}",
}
"""The limits by name, and the units of their margins: those of the joint."""

PER_JOINT = ("speed", "acceleration", "force")
"""Limits that may be given for each joint."""

_SHARES: dict[str, tuple[Callable[[float], bool], str]] = {
    "type_i": (lambda share: 0.0 < share < 1.0, "between 0 and 1"),
    "type_ii": (lambda share: 0.0 < share < 1.0, "between 0 and 1"),
    "joint_clearance": (lambda length: length >= 0.0, "0 or more"),
    "joint_share": (lambda share: 0.0 <= share < 0.5, "at least 0 and below 0.5"),
    "passive_clearance": (lambda share: 0.0 <= share < 1.0, "at least 0 and below 1"),
}
"""Check of each of the other limits, and the range that its message states."""

_SPEED = 1.0
"""Speed limit of joints whose drives have none, m/s or rad/s."""


@dataclass(frozen=True)
class Limits:
    """Limits of a trajectory at every instant.

    Attributes
    ----------
    speed : float or sequence of n floats
        Largest speed of the joints, m/s or rad/s.
    acceleration : float or sequence of n floats
        Largest acceleration of the joints, m/s^2 or rad/s^2.
    force : float or sequence of n floats, optional
        Largest force of the drives, N or N m, infinite or None for no limit: by the machine's
        nominal inertia and what its drives need for themselves, dry friction in full whichever way
        a joint moves. It holds at rest in every pose too, so that the machine can stop anywhere.
    type_i : float
        Least type-I measure of each leg, in (0, 1): the distance from stretched and folded legs.
    type_ii : float
        Least share, in (0, 1), of the best type-II measure that the machine has: the distance from
        poses where the actuators do not hold the platform. Without meaning where J is constant. The
        same share of the best constraint measure holds for legs whose couples turn with the pose.
    joint_clearance : float
        Least distance of the actuated joints from their limits, m or rad; without effect on a joint
        that has none.
    joint_share : float
        The same as a share of each joint's range, in [0, 0.5); the larger of the two counts, but no
        more of this one than half of what the home pose has.
    passive_clearance : float
        Least distance of the passive joints and of the pose's angles from their limits, over half
        their ranges, in [0, 1).

    Raises
    ------
    DataError
        If a number is not what it should be; the message names it.

    Examples
    --------
    >>> from pteron.identification.excitation import Limits
    >>> Limits(speed=[0.5, 0.5, 1.0, 0.5]).speed
    (0.5, 0.5, 1.0, 0.5)
    """

    speed: float | Sequence[float] = 1.0
    acceleration: float | Sequence[float] = 10.0
    force: float | Sequence[float] | None = None
    type_i: float = 0.25
    type_ii: float = 0.3
    joint_clearance: float = 0.005
    passive_clearance: float = 0.02
    joint_share: float = 0.0

    @classmethod
    def of(cls, robot: Manipulator, **limits: Any) -> Limits:
        """Return limits with defaults for speed and force taken from the machine's drives.

        Examples
        --------
        >>> import pteron
        >>> from pteron.identification.excitation import Limits
        >>> Limits.of(pteron.load("tripteron"), acceleration=5.0).speed
        1.0
        """
        drives = [leg.drive or Drive() for leg in robot.legs]
        for name, fallback in (("speed", _SPEED), ("force", math.inf)):
            drive_limits = [getattr(drive, f"max_{name}") for drive in drives]
            if limits.get(name) is None and any(limit is not None for limit in drive_limits):
                limits[name] = tuple(fallback if limit is None else limit for limit in drive_limits)
        return cls(**{name: limit for name, limit in limits.items() if limit is not None})

    def __post_init__(self) -> None:
        for name in PER_JOINT:
            setting = getattr(self, name)
            if setting is None and name == "force":
                continue
            several = isinstance(setting, list | tuple | np.ndarray)
            limits = tuple(_number(name, limit) for limit in (setting if several else (setting,)))
            expect(min(limits, default=0.0) > 0.0, "limits", f"{name} {setting}", "numbers above 0")
            object.__setattr__(self, name, limits if several else limits[0])
        for name, (fits, expected) in _SHARES.items():
            number = _number(name, getattr(self, name))
            expect(fits(number), "limits", f"{name} {number:g}", expected)


def joint_limits(limits: Limits, name: str, robot: Manipulator) -> Array:
    """Return a limit's number for each joint (n,), infinite where there is none."""
    setting = getattr(limits, name)
    bounds = np.atleast_1d(np.array(np.inf if setting is None else setting, dtype=float))
    if bounds.size not in (1, robot.joint_count):
        raise DataError(
            f"limits: {bounds.size} numbers for {name}, one expected or {robot.joint_count}, one "
            f"for each joint of {robot.name}"
        )
    return np.broadcast_to(bounds, (robot.joint_count,)).copy()


def joint_sizes(robot: Manipulator) -> Array:
    """Return half the range (n,) of each joint, m or rad; 1 where it has no limits."""
    ranges = [leg.limits or (-1.0, 1.0) for leg in robot.legs]
    return np.array([0.5 * (high - low) for low, high in ranges])


def joint_clearances(limits: Limits, robot: Manipulator) -> Array:
    """Return the least distance (n,) of the joints from their limits, m or rad."""
    # A share is for safety, and must not refuse a machine whose home pose is near a limit.
    most = 0.5 * np.maximum(_home_distances(robot), 0.0)
    share = np.minimum(2.0 * limits.joint_share * joint_sizes(robot), most)
    return np.asarray(np.maximum(limits.joint_clearance, share))


@lru_cache(maxsize=64)
def _home_distances(robot: Manipulator) -> Array:
    """Return the distance (n,) of the joints from their nearer limits in the home pose, or inf."""
    return joint_distances(robot, inverse_kinematics(robot, np.array(home(robot))))


def unit_of(robot: Manipulator, name: str, leg: int) -> str:
    """Return the unit of a limit's margin, for the joint of a leg, counted from 0."""
    joint = robot.legs[leg].joint
    return UNITS[name].format(unit=joint.unit, force_unit=joint.force_unit)


def _number(name: str, setting: object) -> float:
    """Return a limit as a number; raise unless it is finite, or an infinite force."""
    try:
        number = float(setting)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise DataError(f"limits: {name} {setting!r} given, a number expected") from None
    sound = math.isfinite(number) or (name, number) == ("force", math.inf)
    expect(sound, "limits", f"{name} {number}", "a finite number")
    return number
