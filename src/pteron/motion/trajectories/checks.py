"""Checks that a machine can follow a path or a motion: reach, joint limits, singularities.

Between samples the margins are followed to their least values, so that a place where one fails
between two samples is found. This is a search, no proof.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pteron.equations.machine import closure_of
from pteron.errors import DataError, PteronError, SingularPose, UnreachablePose
from pteron.kernels import Array, numeric
from pteron.kernels.functions import TYPE_I, TYPE_II
from pteron.kinematics.architecture import expect_regular
from pteron.kinematics.limits import limited_joints
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion.motion import Motion, pose_text
from pteron.motion.trajectories.minima import first_below, least_along
from pteron.motion.trajectories.path import Path, poses_of
from pteron.tolerances import ROUNDING
from pteron.workspace.margins import joint_distances

_SAMPLES = 1001
"""Number of poses of a path evaluated before its margins are refined between them."""

_MILLIMETRES = 20.0
"""A pose out of a leg's reach by more than so many leg sizes is likely in millimetres."""


def check_path(robot: RobotLike, path: Path) -> None:
    """Raise if the machine cannot follow a path, at the first failure along it.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    path : Path
        Such as `line_path` makes.

    Raises
    ------
    UnreachablePose
        If it leaves a leg's reach, or the limits of an actuated or a passive joint; the message
        says where, by how much, and which leg.
    SingularPose
        If it comes to a singularity of type I, or crosses one of type II.
    """
    robot = as_manipulator(robot)
    s, _ = poses_of(path, _SAMPLES)
    check_curve(robot, lambda at: path.at(at)[0], s, lambda at: f"the path, {path.place(at)}")


def check_motion(
    robot: RobotLike, motion: Motion, place: Callable[[float], str] | None = None
) -> None:
    """Raise if the machine cannot do a motion; the error names the time of the first failure.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    motion : Motion
        Any motion of its platform.
    place : callable, optional
        Returns in words where a time, s, is; such as the row of a table.

    Raises
    ------
    DataError
        If the motion has another number of coordinates than the machine, or its times do not
        ascend.
    UnreachablePose, SingularPose
        As `check_path`.
    """
    robot = as_manipulator(robot)
    if motion.pose.shape[-1] != robot.freedom:
        raise DataError(
            f"motion: poses of {motion.pose.shape[-1]} numbers given, {robot.freedom} expected: "
            f"{' '.join(robot.coordinates)}"
        )
    motion.expect_ascending()
    if not np.isfinite(motion.pose).all():
        k = int(np.argmax(~np.isfinite(motion.pose).all(axis=-1)))
        raise DataError(
            f"motion.pose: {motion.pose[k].tolist()} in row {k}, finite numbers expected"
        )
    even = np.linspace(float(motion.time[0]), float(motion.time[-1]), _SAMPLES)
    marks = np.unique(np.concatenate([motion.time, even]))
    place_of = place or (lambda at: f"the motion, at {at:.4g} s")
    check_curve(robot, lambda at: motion.at(at)[0], marks, place_of)


def check_curve(
    robot: Manipulator, poses: Callable[[Array], Array], marks: Array, place: Callable[[float], str]
) -> None:
    """Raise the error of the first pose of a curve that is out of reach, limits, or singular.

    `marks` are the parameters checked first, and `place` returns as text where a parameter is.
    """
    expect_regular(robot)
    curve = _Curve(robot, poses, place)
    # Beyond the reach nothing else is measured.
    failures = [_reach_failure(curve, marks)]
    if failures[0] is not None:
        before_failure = marks < failures[0].at
        marks = np.append(marks[before_failure], failures[0].at)
    if len(marks) > 1:
        failures += [_joint_failure(curve, marks), _passive_failure(curve, marks)]
        failures += [_type_ii_failure(curve, marks), _constraint_failure(curve, marks)]
    raised = [failure for failure in failures if failure is not None]
    if raised:
        raise min(raised, key=lambda failure: failure.at).error


class _Curve(NamedTuple):
    """A curve of poses (K, m) over a parameter (K,), with a text for a place on it."""

    robot: Manipulator
    poses: Callable[[Array], Array]
    place: Callable[[float], str]

    def value(self, what: str, at: Array, index: int = 0) -> Array:
        """Return output `index` of the kernel `what` at the curve's parameters (K,): (K, ...)."""
        return np.asarray(numeric(self.robot, what)(self.poses(at))[index])

    def place_text(self, at: float) -> str:
        """Return as text where a parameter lies on the curve, and the pose there."""
        return f"{self.place(at)}, pose {pose_text(self.poses(np.array([at]))[0])}"


class _Failure(NamedTuple):
    """The place where a curve fails, and the error to raise."""

    at: float
    error: PteronError


def _reach_failure(curve: _Curve, marks: Array) -> _Failure | None:
    """Return the first failure where a leg is out of reach or singular (type I), or None."""

    def squares(at: Array) -> Array:
        """Return squared type-I measures (K, n) at curve parameters (K,); -1 out of reach."""
        return np.nan_to_num(curve.value("squared_type_i", at), nan=-1.0)

    first = first_below(squares, marks, TYPE_I**2)
    if first is None:
        return None
    at, i, square = first
    fine = np.linspace(marks[0], marks[-1], _SAMPLES)
    shortfall = -float(np.nanmin(curve.value("reach", fine)[:, i]))
    leg = curve.robot.legs[i]
    error: PteronError
    if shortfall <= ROUNDING:
        error = SingularPose(
            f"{curve.place_text(at)}: singular for leg {i + 1}: {leg.singular_text} (type I); take "
            "another path",
            kind="I",
            measure=float(np.sqrt(max(square, 0.0))),
            index=(),
            leg=i + 1,
        )
        return _Failure(at, error)
    millimetres = shortfall > _MILLIMETRES * leg.size
    verb = "is out of the reach" if at == marks[0] else "leaves the reach"
    error = UnreachablePose(
        f"{curve.place_text(at)}: {verb} of leg {i + 1}, which misses the path by up to "
        f"{shortfall:.3g} m: {leg.reach_text}; "
        f"{'is it in millimetres? lengths are in metres' if millimetres else 'take another path'}",
        leg=i + 1,
        shortfall=shortfall,
        index=(),
        millimetres=millimetres,
    )
    return _Failure(at, error)


def _joint_failure(curve: _Curve, marks: Array) -> _Failure | None:
    """Return the first failure where an actuated joint passes its limits, or None."""

    def margin(at: Array) -> Array:
        """Return actuated joints' distances (K, n) to their limits at parameters (K,)."""
        return joint_distances(curve.robot, curve.value("joint_coordinates", at))

    first = first_below(margin, marks, -ROUNDING)
    if first is None:
        return None
    at, i, _ = first
    leg = curve.robot.legs[i]
    assert leg.limits is not None
    excess = -float(least_along(margin, marks, -ROUNDING)[1][i])
    unit, (low, high) = leg.joint.unit, leg.limits
    fault = (
        f"leg {i + 1}: its {leg.joint.noun} passes its limits, {low:g} to {high:g} {unit}, by up "
    )
    return _limit_failure(curve, at, i + 1, f"{fault}to {excess:.3g} {unit}", excess * leg.lever)


def _passive_failure(curve: _Curve, marks: Array) -> _Failure | None:
    """Return the first failure where a passive joint passes its limits, or None."""

    def margin(at: Array) -> Array:
        """Return distances (K, n) of passive joints to their limits at curve parameters (K,)."""
        return curve.value("passive_room", at, 1)

    first = first_below(margin, marks, -ROUNDING)
    if first is None:
        return None
    at, i, _ = first
    places, least = least_along(margin, marks, -ROUNDING)
    worst = curve.poses(places[i : i + 1])[0]
    leg, fault = i + 1, f"leg {i + 1} passes a passive joint's limits"
    for joint in limited_joints(curve.robot, worst):
        may_fail = not joint.actuated and joint.leg in (0, i + 1)
        if may_fail and not joint.least <= joint.value <= joint.most:
            leg, whose = joint.leg, f"leg {i + 1}: its " if joint.leg else ""
            fault = f"{whose}{joint.noun} comes to {joint.value:.4g} {joint.unit}, its limits are "
            fault += joint.limits_text("{:g}".format)
            break
    return _limit_failure(curve, at, leg, fault, -float(least[i]))


def _limit_failure(curve: _Curve, at: float, leg: int, fault: str, metres: float) -> _Failure:
    """Return the failure of a joint limit at parameter `at`, passed by `metres`."""
    text = f"{curve.place_text(at)}: {fault}; take another path"
    return _Failure(at, UnreachablePose(text, leg=leg, shortfall=metres, index=()))


def _type_ii_failure(curve: _Curve, marks: Array) -> _Failure | None:
    """Return the first failure where the type-II measure changes its sign, or None."""
    if closure_of(curve.robot).vanishes() is False and not curve.robot.platform.angles:
        return None
    # Its sign is that of the beginning, as far as the actuators hold the platform.
    side = 1.0 if float(curve.value("type_ii", marks[:1])[0]) > 0.0 else -1.0
    first = first_below(lambda at: side * curve.value("type_ii", at)[:, None], marks, TYPE_II)
    if first is None:
        return None
    at = first[0]
    error = SingularPose(
        f"{curve.place_text(at)}: comes to a singularity (type II), where the actuators no longer "
        "hold the platform; take another path, or go round it",
        kind="II",
        measure=float(np.abs(curve.value("type_ii", np.array([at])))[0]),
        index=(),
    )
    return _Failure(at, error)


def _constraint_failure(curve: _Curve, marks: Array) -> _Failure | None:
    """Return the first failure where varying couples leave the platform a turn, or None."""
    if not any(leg.couples_vary for leg in curve.robot.legs):
        return None
    side = 1.0 if float(curve.value("constraint", marks[:1])[0]) > 0.0 else -1.0
    first = first_below(lambda at: side * curve.value("constraint", at)[:, None], marks, TYPE_II)
    if first is None:
        return None
    at = first[0]
    error = SingularPose(
        f"{curve.place_text(at)}: comes to a constraint singularity, where the legs leave the "
        "platform free to turn; take another path, or go round it",
        kind="constraint",
        measure=float(np.abs(curve.value("constraint", np.array([at])))[0]),
        index=(),
    )
    return _Failure(at, error)
