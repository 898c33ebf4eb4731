"""Limits of a motion: of the joints, of the drives, and of the tool."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pteron.arguments import checked_arguments, number_or_nan
from pteron.errors import DataError, shorten
from pteron.kernels import Array
from pteron.legs import Drive
from pteron.legs.motor_limits import SpeedLine, speed_lines
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.renamed import former_attribute

PerJointLimit = float | Sequence[float] | Array | None
"""One number for every joint, or one for each; None for the drives' own, or none."""


@checked_arguments
@dataclass(frozen=True, eq=False)
class MotionLimits:
    """Largest speeds, accelerations and forces, infinite without a limit; from `limits_of`.

    A drive whose force is limited by its speed has lines |f + back q'| <= force - fall |q'| beside.

    Attributes
    ----------
    speed, acceleration : array, shape (n,)
        Limits of the joints, m/s and m/s^2 or rad/s and rad/s^2.
    force : array, shape (n,)
        Limits of the drives, N or N m, friction and motors' inertia included.
    tool_speed, tool_acceleration : float
        Limits of the tool's centre point, m/s and m/s^2.
    lines : tuple of tuple of SpeedLine
        What curve and winding of each drive leave at speed.
    """

    speed: Array
    acceleration: Array
    force: Array
    tool_speed: float = math.inf
    tool_acceleration: float = math.inf
    lines: tuple[tuple[SpeedLine, ...], ...] = ()

    @property
    def bounds_acceleration(self) -> bool:
        """Whether any limit bounds the acceleration: of joints, forces or tool."""
        finite = np.isfinite([*self.acceleration, *self.force, self.tool_acceleration])
        return bool(finite.any()) or any(self.lines)

    @property
    def force_lines(self) -> tuple[NDArray[np.int64], Array, Array, Array]:
        """Force limits as lines falling with speed: joint index, force, fall, back, (R,) each."""
        flat = [(i, (force, 0.0, 0.0)) for i, force in enumerate(self.force) if force < math.inf]
        every = [*flat, *((i, line) for i, lines in enumerate(self.lines) for line in lines)]
        joints = np.array([i for i, _ in every], dtype=np.int64)
        force, fall, back = np.array([line for _, line in every]).reshape(-1, 3).T
        return joints, force, fall, back

    @property
    def is_limited(self) -> bool:
        """Whether the motion has any limit at all."""
        return self.bounds_acceleration or bool(np.isfinite([*self.speed, self.tool_speed]).any())

    any = former_attribute("any", "is_limited")


def limits_of(
    robot: RobotLike,
    *,
    speed: PerJointLimit = None,
    acceleration: PerJointLimit = None,
    force: PerJointLimit = None,
    tool_speed: float | None = None,
    tool_acceleration: float | None = None,
) -> MotionLimits:
    """Return the limits of a motion; those of speed and force are the drives' by default.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine, whose drives' `max_speed` and `max_force` are the defaults; what their `curve`
        and `winding` leave at speed counts in any case.
    speed, acceleration, force : float or sequence of n floats, optional
        Limits of each joint: m/s, m/s^2 and N, or rad/s, rad/s^2 and N m.
    tool_speed, tool_acceleration : float, optional
        Limits of the tool's centre point, m/s and m/s^2.

    Returns
    -------
    MotionLimits

    Raises
    ------
    DataError
        If a number is not above 0, or the numbers are neither one nor n.

    Examples
    --------
    >>> import pteron
    >>> from pteron.motion import limits_of
    >>> limits_of(pteron.load("tripteron"), speed=0.5, force=[40.0, 40.0, 60.0]).force
    array([40., 40., 60.])
    """
    robot = as_manipulator(robot)
    drives = [leg.drive or Drive() for leg in robot.legs]
    return MotionLimits(
        limit_array(robot, "speed", speed, [drive.max_speed for drive in drives]),
        limit_array(robot, "acceleration", acceleration, [None] * len(drives)),
        limit_array(robot, "force", force, [drive.max_force for drive in drives]),
        math.inf if tool_speed is None else _positive_number("tool_speed", tool_speed),
        math.inf
        if tool_acceleration is None
        else _positive_number("tool_acceleration", tool_acceleration),
        tuple(map(speed_lines, drives)),
    )


def limit_array(
    robot: Manipulator, name: str, setting: PerJointLimit, defaults: Sequence[float | None]
) -> Array:
    """Return a limit of each joint (n,): `setting`, else the defaults; infinite without a limit."""
    if setting is None:
        return np.array([math.inf if limit is None else limit for limit in defaults])
    several = list(setting) if isinstance(setting, Sequence | np.ndarray) else [setting]
    checked = [_positive_number(name, limit) for limit in several]
    if len(checked) not in (1, robot.joint_count):
        raise DataError(
            f"{name}: {len(checked)} numbers given, one expected or {robot.joint_count}, one for "
            f"each joint of {robot.name}"
        )
    return np.broadcast_to(np.array(checked), (robot.joint_count,)).copy()


def _positive_number(name: str, setting: object) -> float:
    """Return `setting` as a float; raise unless it is a number above 0."""
    number = number_or_nan(setting)
    if not number > 0.0:
        text = setting if isinstance(setting, float) else shorten(setting)
        raise DataError(f"{name}: {text} given, a number above 0 expected")
    return number
