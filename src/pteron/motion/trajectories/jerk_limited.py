"""Motion of the joints from pose to pose with limited jerk, by Ruckig.

Each joint has limits of speed, acceleration and jerk, and all joints start and arrive together
(Berscheid and Kroeger, 2021, Robotics: Science and Systems). The tool's path is what results.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pteron.errors import DataError, PteronError, UnreachablePose
from pteron.extras import import_extra
from pteron.kernels import Array
from pteron.kinematics import follow, inverse_kinematics
from pteron.kinematics.evaluate import evaluate_unchecked, finite_pose
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion.motion import Motion
from pteron.motion.trajectories.checks import check_motion
from pteron.motion.trajectories.limits import MotionLimits, PerJointLimit, limit_array, limits_of
from pteron.motion.trajectories.time_law import STEP, limit_motion, sample_curve
from pteron.motion.trajectories.timed_path import Timed
from pteron.motion.trajectories.tool import Curve
from pteron.shapes import PoseLike
from pteron.tolerances import SAME

_FAST = 1e6
"""Limit that Ruckig gets for a joint without one, m/s or rad/s."""


def jerk_limited(
    robot: RobotLike,
    start: PoseLike,
    end: PoseLike,
    jerk: PerJointLimit,
    limits: MotionLimits | None = None,
    *,
    step: float | None = None,
) -> Motion:
    """Return the motion of the joints from rest in one pose to rest in another, with limited jerk.

    The joints start and arrive together; if drive forces or the tool are limited too, the motion is
    slowed as a whole. The tool's path follows from the joints' motion and is not a straight line.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    start, end : array, shape (m,)
        m and rad.
    jerk : float or sequence of n floats
        Most change of the joints' accelerations, m/s^3 or rad/s^3.
    limits : MotionLimits, optional
        Of joints, drives and tool; every joint needs an acceleration. By default those of the
        machine's drives.
    step : float, optional
        Time between samples, s; by default 1 ms, or a whole fraction of it where the motion needs
        more samples.

    Returns
    -------
    Motion
        Its samples are on the planned motion, whose jerk keeps the limit everywhere. Between two
        samples `Motion.at` is a polynomial of the pose: in a step in which the planned jerk jumps,
        that of the polynomial overshoots, by up to some 60 %. A shorter `step` makes these parts
        of the motion shorter, not lower.

    Raises
    ------
    DataError
        If a joint's acceleration has no limit, the poses are the same, or samples `step` apart do
        not tell the motion.
    UnreachablePose
        If the joints leave their limits on their path, or do not lead to the other pose.
    SingularPose
        If the path comes to a singularity.
    PteronError
        If ruckig is missing.

    Examples
    --------
    >>> import pteron
    >>> from pteron.motion import jerk_limited, limits_of
    >>> robot = pteron.load("delta")
    >>> limits = limits_of(robot, speed=5.0, acceleration=100.0)
    >>> motion = jerk_limited(robot, [0.0, 0.0, -0.9], [0.2, 0.1, -0.8], 5000.0, limits)
    >>> motion.pose[-1].round(6)
    array([ 0.2,  0.1, -0.8])
    """
    robot = as_manipulator(robot)
    ends = [finite_pose(robot, start, "start"), finite_pose(robot, end, "end")]
    motion_limits = limits_of(robot) if limits is None else limits
    jerks = limit_array(robot, "jerk", jerk, [None] * robot.joint_count)
    if not np.isfinite([*motion_limits.acceleration, *jerks]).all():
        raise DataError(
            "a motion with limited jerk needs jerk and acceleration of every joint; give both"
        )
    first, last = (
        _end_joints(robot, name, pose) for name, pose in zip(("start", "end"), ends, strict=True)
    )
    # The shorter way round, where the limits of a crank leave one.
    free = [leg.goes_round and leg.limits is None for leg in robot.legs]
    last = np.where(free, first + _wrap_half_turn(last - first), last)
    if np.abs(last - first).max() <= SAME:
        raise DataError("end: the joints are at start's already; give another pose")
    planned = _plan_trajectory(first, last, motion_limits, jerks)

    def curve(tau: Array) -> Curve:
        """Return poses and their first two derivatives by tau, (T, m) each, at tau from 0 to 1."""
        joints, rates, gains = (
            np.array(part)
            for part in zip(*map(planned.at_time, tau * planned.duration), strict=True)
        )
        poses = follow(robot, joints, ends[0], on_failure="nan")
        is_lost = np.isnan(poses).any(axis=-1)
        if is_lost.any():
            k = int(is_lost.argmax())
            raise _lost_error(
                f"the motion, at {tau[k] * planned.duration:.4g} s: the platform does not follow "
                f"to the joint coordinates {[round(float(q), 6) for q in joints[k]]}: its "
                "assembly mode ends before; go there by way of another pose"
            )
        velocity, acceleration = evaluate_unchecked(robot, "platform_motion", poses, rates, gains)
        return poses, planned.duration * velocity, planned.duration**2 * acceleration

    course = Timed(curve, planned.duration)
    rough = sample_curve(course.at, course.duration, min(step or STEP, course.duration / 100.0))
    check_motion(robot, rough)
    _expect_modes(robot, rough, planned, ends[1])
    return limit_motion(robot, course, motion_limits, step)


def _wrap_half_turn(angles: Array) -> Array:
    """Return angles, rad, wrapped to [-pi, pi]."""
    return (angles + np.pi) % (2.0 * np.pi) - np.pi


def _end_joints(robot: Manipulator, name: str, pose: Array) -> Array:
    """Return the joint coordinates (n,) at a pose; errors call the pose by `name`."""
    try:
        return inverse_kinematics(robot, pose)
    except UnreachablePose as error:
        text = f"{name} {error}"
        raise UnreachablePose(
            text, leg=error.leg, shortfall=error.shortfall, index=(), millimetres=error.millimetres
        ) from None


def _expect_modes(robot: Manipulator, motion: Motion, planned: Any, end: Array) -> None:
    """Raise if a motion leaves the working mode, or ends in another assembly mode."""
    end_error = motion.pose[-1] - end
    end_error = np.where(robot.wraps, _wrap_half_turn(end_error), end_error)
    joints = np.array([planned.at_time(t)[0] for t in motion.time])
    joint_errors = joints - inverse_kinematics(robot, motion.pose)
    joint_errors = np.where(
        [leg.joint.unit == "rad" for leg in robot.legs], _wrap_half_turn(joint_errors), joint_errors
    )
    if max(np.abs(end_error).max(), np.abs(joint_errors).max()) > SAME:
        raise _lost_error(
            "end: the joints' path leads to another assembly or working mode there; go by way of "
            "another pose"
        )


def _lost_error(text: str) -> UnreachablePose:
    """Return an `UnreachablePose` error with this text, without a leg or a distance."""
    return UnreachablePose(text, leg=0, shortfall=float("nan"), index=())


def _plan_trajectory(first: Array, last: Array, limits: MotionLimits, jerks: Array) -> Any:
    """Return Ruckig's trajectory between joint coordinates (n,), within the limits."""
    ruckig = import_extra("motion", "ruckig", "motion with limited jerk needs ruckig", PteronError)
    count = len(first)
    parameters = ruckig.InputParameter(count)
    parameters.current_position, parameters.target_position = first.tolist(), last.tolist()
    parameters.max_velocity = np.minimum(limits.speed, _FAST).tolist()
    parameters.max_acceleration, parameters.max_jerk = limits.acceleration.tolist(), jerks.tolist()
    planned = ruckig.Trajectory(count)
    outcome = ruckig.Ruckig(count).calculate(parameters, planned)
    if outcome not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise DataError(f"limits: Ruckig finds no motion within them ({outcome}); give others")
    return planned
