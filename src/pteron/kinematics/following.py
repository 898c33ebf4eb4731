"""Direct kinematics along a motion of the joints, in the assembly mode that it starts in."""

from __future__ import annotations

import numpy as np

from pteron.errors import DataError, UnreachablePose
from pteron.kernels import Array, Kernel, numeric
from pteron.kinematics.direct import assembly_modes, nearest
from pteron.kinematics.evaluate import evaluate_unchecked, finite_rows
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.shapes import JointsLike, OnFailure, PerCoordinate, PoseLike

_AGREEMENT = 1e-2
"""Share of the legs' size within which readings of a redundant machine belong to one pose."""

_HALVINGS = 12
"""Most halvings of the step between two samples."""


def follow(
    robot: RobotLike, joints: JointsLike, start: PoseLike, *, on_failure: OnFailure = "raise"
) -> PerCoordinate:
    """Return the poses along a motion of the joints, in the assembly mode of the start pose.

    Each pose is extrapolated from the last two and refined by Newton's method; if that does not
    converge, the joints' step is halved. An assembly mode, and the motion with it, ends at a
    type-II singularity.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    joints : array, shape (N, n)
        Joint coordinates along the motion, m or rad: close enough that the path between them
        may be taken as straight.
    start : array, shape (m,)
        The pose of the first sample, or one from whose joint coordinates a straight path leads
        there, m and rad.
    on_failure : {"raise", "nan"}
        Whether a sample that the motion does not come to raises, or gives NaN with all after it.

    Returns
    -------
    array, shape (N, m)
        The poses, m and rad; angles go on beyond a turn.

    Raises
    ------
    UnreachablePose
        If the motion of the platform ends before that of the joints.

    Examples
    --------
    >>> import numpy as np, pteron
    >>> robot = pteron.load("delta")
    >>> poses = np.linspace([0.0, 0.0, -0.9], [0.2, 0.1, -0.8], 50)
    >>> joints = pteron.inverse_kinematics(robot, poses)
    >>> bool(np.allclose(pteron.follow(robot, joints, poses[0]), poses, atol=1e-12))
    True
    """
    robot = as_manipulator(robot)
    joint_rows, pose = (
        finite_rows(robot, joints, "joints", on_failure),
        finite_rows(robot, start, "start"),
    )
    if joint_rows.ndim != 2 or pose.ndim != 1:
        n, m = robot.joint_count, robot.freedom
        raise DataError(
            f"joints, start: shapes {joint_rows.shape} and {pose.shape} given, (N, {n}) and ({m},) "
            "expected"
        )
    step = numeric(robot, "followed_step")
    poses = np.full((len(joint_rows), robot.freedom), np.nan)
    if robot.redundancy and len(joint_rows):
        pose = _first_pose(robot, joint_rows[0], pose)
    previous, side = pose, 0.0
    for k, q in enumerate(joint_rows):
        ahead, measure, _ = step(q, 2.0 * pose - previous)
        if not side * measure >= 0.0 or np.isnan(ahead[0]):
            here = joint_rows[k - 1] if k else _joints_of(robot, pose, q)
            ahead, measure = _follow_halved_steps(step, here, q, pose, side)
            if np.isnan(ahead[0]):
                if on_failure == "raise":
                    raise _end_of_mode(joint_rows, k)
                break
        previous, pose, side = pose, ahead, measure
        poses[k] = pose
    # Where samples are far apart the last of Newton's steps may leave some digits.
    refined: Array = step(joint_rows, poses)[0]
    return np.where(np.isnan(refined), poses, refined)


def _first_pose(robot: Manipulator, joints: Array, start: Array) -> Array:
    """Return the pose (m,) of a redundant machine's first joints (n,), nearest to a start pose.

    On a straight path from there the joints would contradict each other.
    """
    step = numeric(robot, "followed_step")(joints, start)[0]
    if np.isfinite(step).all():
        return start
    size = max(leg.size for leg in robot.legs)
    poses = assembly_modes(robot, joints, tolerance=_AGREEMENT * size)
    if np.isnan(poses).all():
        return start
    first: Array = poses[nearest(robot, poses, start)]
    return first


def _joints_of(robot: Manipulator, pose: Array, near: Array) -> Array:
    """Return a pose's joint coordinates (n,), cranks' full turns chosen nearest to `near` (n,)."""
    joints: Array = evaluate_unchecked(robot, "inverse_kinematics", pose)
    cranks = [leg.goes_round for leg in robot.legs]
    turns = np.where(cranks, np.round((near - joints) / (2.0 * np.pi)), 0.0)
    turned: Array = joints + 2.0 * np.pi * turns
    return turned


def _follow_halved_steps(
    step: Kernel, here: Array, there: Array, pose: Array, side: float
) -> tuple[Array, float]:
    """Return the pose (m,) at joints `there`, followed from that at `here` in halved steps.

    `side` is the sign of the type-II measure, which must not change; the measure is returned too.
    """
    done, size = 0.0, 1.0
    while done < 1.0:
        to = min(done + size, 1.0)
        ahead, measure, _ = step(here + to * (there - here), pose)
        if not side * measure >= 0.0 or np.isnan(ahead[0]):
            size *= 0.5
            if size < 0.5**_HALVINGS:
                return np.full_like(pose, np.nan), side
        else:
            done, pose, side, size = to, ahead, measure, 2.0 * size
    return pose, side


def _end_of_mode(joints: Array, k: int) -> UnreachablePose:
    """Return the error that the platform cannot follow to the joint coordinates of sample k."""
    text = ", ".join(f"{coordinate:.6g}" for coordinate in joints[k])
    return UnreachablePose(
        f"joints[{k}]: the platform does not follow to the joint coordinates [{text}]: "
        "its assembly mode ends before, or the way from the sample before is too long",
        leg=0,
        shortfall=float("nan"),
        index=(k,),
    )
