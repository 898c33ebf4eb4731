"""The end of a machine's way to a pose or joint values: a leg's reach, a limit, a singularity."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pteron.kernels import Array, numeric
from pteron.kinematics import follow, inverse_kinematics
from pteron.kinematics.limits import limited_joints
from pteron.manipulator import Manipulator
from pteron.report.quantities import readable
from pteron.tolerances import ROUNDING, SAME
from pteron.workspace.margins import distance_to_limits, joint_distances

LEAST_TYPE_I = 0.01
"""Least type-I measure of a leg in the viewer: forces still have most of their digits there."""

_ENDS = 2.0 * LEAST_TYPE_I
"""Type-I measure below which a leg's reach is named as what stops the machine."""

_PIECES = 32
"""Pieces into which a path is divided in each round of the search for its end."""

_ROUNDS = 5
"""Rounds of the search for the end of a path."""

_STEPS = 8
"""Pieces of a path of the joints, along each of which the platform is followed."""


def is_allowed(robot: Manipulator, poses: Array) -> NDArray[np.bool_]:
    """Return whether poses (..., m) are in reach of all legs and within all limits, (...)."""
    measure = numeric(robot, "reach")(poses)[1]
    bent = (measure >= LEAST_TYPE_I).all(axis=-1)
    return np.asarray(bent & (distance_to_limits(robot, poses).min(axis=-1) >= -ROUNDING))


def farthest_reachable_pose(
    robot: Manipulator, start: Array, target: Array
) -> tuple[Array, Array | None]:
    """Return the last pose that the platform reaches on the straight path to another.

    A target that is allowed is always reached. With the pose comes one next to it that is not
    allowed; None where nothing stops the platform.
    """
    if bool(is_allowed(robot, target)):
        return target, None

    def try_shares(shares: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return poses (S, m) at shares (S,) of the straight path and whether each is allowed."""
        poses = start + shares[:, None] * (target - start)
        return poses, is_allowed(robot, poses)

    return _last_good_pose(try_shares, start, _PIECES)


def follow_joints(
    robot: Manipulator, pose: Array, joints: Array, target: Array
) -> tuple[Array, Array | None]:
    """Return the last pose in which the platform follows its joints on their straight path.

    The joints go from `joints` to `target`, (n,) each. With the pose comes one next to it that is
    not allowed, NaN where the assembly mode ends; None where nothing stops it.
    """
    rounds = np.array([leg.goes_round for leg in robot.legs])
    turn = 2.0 * np.pi

    def try_shares(shares: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return poses (S, m) at shares (S,) of the joints' path and whether each is allowed."""
        way = joints + shares[:, None] * (target - joints)
        poses = follow(robot, way, pose, on_failure="nan")
        differences = np.abs(inverse_kinematics(robot, poses, on_failure="nan") - way)
        differences = np.where(rounds, np.abs((differences + np.pi) % turn - np.pi), differences)
        return poses, is_allowed(robot, poses) & (differences <= SAME).all(axis=-1)

    return _last_good_pose(try_shares, pose, _STEPS)


def _last_good_pose(
    try_shares: Callable[[Array], tuple[Array, NDArray[np.bool_]]], start: Array, pieces: int
) -> tuple[Array, Array | None]:
    """Return the last feasible pose and the first infeasible one, by repeated subdivision."""
    low, high, last = 0.0, 1.0, start
    beyond: Array | None = None
    for _ in range(_ROUNDS):
        shares = np.linspace(low, high, pieces + 1)[1:]
        poses, good = try_shares(shares)
        if good.all():
            return poses[-1], beyond
        k = int(good.argmin())
        beyond, high = poses[k], float(shares[k])
        if k:
            low, last = float(shares[k - 1]), poses[k - 1]
    return last, beyond


def stop_reason(robot: Manipulator, beyond: Array) -> str:
    """Return the text of the leg or limit that excludes a pose (m,), without a full stop.

    A pose that nothing forbids is one at which an assembly mode ends.
    """
    margin, measure, _, _ = numeric(robot, "reach")(beyond)
    short = ~(measure >= _ENDS)
    if short.any():
        i = int(np.where(short, margin, np.inf).argmin())
        return f"Leg {i + 1} reaches no further: {robot.legs[i].singular_text}"
    joints = numeric(robot, "joint_coordinates")(beyond)[0]
    room = joint_distances(robot, joints)
    if room.min() < 0.0:
        i = int(room.argmin())
        leg = robot.legs[i]
        assert leg.limits is not None
        limit = min(leg.limits, key=lambda end: abs(end - joints[i]))
        name, unit = leg.joint.noun, leg.joint.unit
        return f"The {name} of leg {i + 1} is at its limit, {readable(limit, unit)}"
    for joint in limited_joints(robot, beyond):
        if not joint.actuated and not joint.least <= joint.value <= joint.most:
            whose = f"of leg {joint.leg}" if joint.leg else "of the platform"
            return f"The {joint.noun} {whose} is at its limit, {joint.limits_text(readable)}"
    return "The assembly mode ends here (singular, type II)"


def distance_text(robot: Manipulator, last: Array, target: Array) -> str:
    """Return the distance of a pose (m,) from its target as text, in mm and degrees."""
    way = float(np.linalg.norm((target - last)[~robot.platform.angular]))
    angles = np.abs((target - last)[robot.platform.angular]).tolist()
    parts = [readable(way, "m")] * (way > 0.0)
    parts += [readable(angle, "rad") for angle in angles if angle > 0.0]
    return " and ".join(parts) or readable(0.0, "m")
