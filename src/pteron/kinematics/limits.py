"""Joints that have limits, actuated and passive: their coordinates in a pose, and their limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from pteron.equations.kinematics import passive_joints
from pteron.equations.machine import Machine
from pteron.kernels import numeric
from pteron.kinematics.evaluate import finite_pose
from pteron.legs.leg import Passive
from pteron.manipulator import RobotLike, as_manipulator
from pteron.renamed import former_attribute
from pteron.result import Result
from pteron.shapes import PoseLike


@dataclass(frozen=True, eq=False, repr=False)
class LimitedJoint(Result):
    """A joint that has limits, and its coordinate in a pose.

    Attributes
    ----------
    leg : int
        Number of its leg, from 1; 0 for an angle of the platform.
    noun : str
        Kind of the joint: "slider", "elbow", ...
    actuated : bool
        Whether a drive moves it.
    unit : str
        Unit of the numbers, "m" or "rad".
    value, least, most : float
        Its coordinate and its limits, in `unit`.
    only_most : bool
        Whether only `most` is a limit, as of a cone's angle, which is never below 0.
    """

    leg: int
    noun: str
    actuated: bool
    unit: str
    value: float
    least: float
    most: float
    only_most: bool = False

    told_limits = former_attribute("told_limits", "limits_text")

    @property
    def margin(self) -> float:
        """The distance to the nearer limit over half the range: 1 in the middle."""
        return min(self.value - self.least, self.most - self.value) * 2 / (self.most - self.least)

    def limits_text(self, text: Callable[..., str]) -> str:
        """Return the joint's limits as text; `text` formats a value with its unit."""
        most = text(self.most, self.unit)
        return f"at most {most}" if self.only_most else f"{text(self.least, self.unit)} to {most}"


def limited_joints(robot: RobotLike, pose: PoseLike) -> tuple[LimitedJoint, ...]:
    """Return each joint that has limits, actuated or passive, with its value at a pose (m,)."""
    robot = as_manipulator(robot)
    pose_array = finite_pose(robot, pose, "pose")
    joints = numeric(robot, "joint_coordinates")(pose_array)[0]
    angles, *legs = passive_joints(Machine.numeric(robot), ca.SX(ca.DM(pose_array)))
    joints_with_limits = [_passive_limited_joint(0, joint) for joint in angles]
    for i, (leg, q, passive) in enumerate(zip(robot.legs, joints, legs, strict=True), start=1):
        if leg.limits is not None:
            actuated = leg.joint
            joints_with_limits.append(
                LimitedJoint(i, actuated.noun, True, actuated.unit, float(q), *leg.limits)
            )
        joints_with_limits += [_passive_limited_joint(i, joint) for joint in passive]
    return tuple(joints_with_limits)


def _passive_limited_joint(leg: int, at: Passive) -> LimitedJoint:
    """Return a leg's passive joint as a `LimitedJoint` with its value at the pose."""
    limits = at.least, at.most, at.only_most
    return LimitedJoint(leg, at.noun, False, at.unit, float(at.value), *limits)
