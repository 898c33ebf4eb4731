"""The protocol of a movement: an object that gives the motion of platform and joints at times."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from pteron.kernels import Array
from pteron.kinematics.evaluate import unchecked
from pteron.manipulator import Manipulator


class FullMotion(NamedTuple):
    """Motion of platform and joints, (T, n) each; NaN where the joints have no pose."""

    pose: Array
    velocity: Array
    acceleration: Array
    joints: Array
    rates: Array
    accelerations: Array


class Movement(Protocol):
    """A motion of a machine that lasts `duration`, s, or repeats after it."""

    @property
    def robot(self) -> Manipulator:
        """The machine."""

    @property
    def duration(self) -> float:
        """Duration, s."""

    def states(self, times: Array, /) -> FullMotion:
        """Return the motion of platform and joints at times (T,), s."""


def motion_of_platform(
    robot: Manipulator, pose: Array, velocity: Array, acceleration: Array
) -> FullMotion:
    """Return the motion of platform and joints for a motion of the platform, (T, m) each."""
    # A slider's motion is finite out of the legs' reach too; that of the links is not.
    joints = unchecked(robot, "joint_coordinates", pose)
    rates = unchecked(robot, "joint_rates", pose, velocity)[0]
    path = pose, velocity, acceleration
    return FullMotion(*path, joints, rates, unchecked(robot, "joint_accelerations", *path)[0])
