"""States of the machine at the samples of a log: joints and platform, in one assembly mode.

A mode is told by a pose in it: the others of the log follow by continuity. Where direct kinematics
has a closed form each of its columns is one mode throughout, so that the pose only chooses one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pteron.equations.machine import closure_of
from pteron.errors import DataError
from pteron.identification.errors import LogError
from pteron.identification.logs import Log
from pteron.kernels import Array
from pteron.kinematics import assembly_modes, direct_kinematics, follow, mode_of
from pteron.kinematics.evaluate import evaluate_unchecked
from pteron.kinematics.sampling import holding_measures
from pteron.manipulator import Manipulator
from pteron.result import Result
from pteron.shapes import PoseLike, Poses
from pteron.workspace import home_pose

_REGULAR = 1e-3
"""Least measure, 1 at best, of a state's distance from singularities: next to one the regressor
grows without bound, and with it every error."""

_LOOK = 1000
"""Samples of the measured pose that decide on the assembly mode."""


class FullMotion(NamedTuple):
    """Motion of platform and joints, (T, n) each; NaN where the joints have no pose."""

    pose: Array
    velocity: Array
    acceleration: Array
    joints: Array
    rates: Array
    accelerations: Array

    @classmethod
    def from_platform(
        cls, robot: Manipulator, pose: Array, velocity: Array, acceleration: Array
    ) -> FullMotion:
        """Return the motion of platform and joints for a motion of the platform, (T, m) each."""
        # A slider's motion is finite out of the legs' reach too; that of the links is not.
        joints = evaluate_unchecked(robot, "joint_coordinates", pose)
        rates = evaluate_unchecked(robot, "joint_rates", pose, velocity)[0]
        path = pose, velocity, acceleration
        return cls(*path, joints, rates, evaluate_unchecked(robot, "joint_accelerations", *path)[0])


@dataclass(frozen=True, eq=False, repr=False)
class States(Result):
    """States at R samples: of the joints, where they were measured, and of the platform.

    Attributes
    ----------
    time : array, shape (R,)
        s.
    joints, joint_rates, joint_accelerations : array, shape (R, n)
        m, at cranks rad, and s.
    pose, velocity, acceleration : array, shape (R, m)
        m, rad and s.
    payload : array of int, shape (R,)
        The phase: 0 without payload.
    """

    ROWS = (
        "time pose:1 velocity:1 acceleration:1 joints:1 joint_rates:1 joint_accelerations:1 payload"
    )

    time: Array
    joints: Array
    joint_rates: Array
    joint_accelerations: Array
    pose: Array
    velocity: Array
    acceleration: Array
    payload: NDArray[np.int64]

    @classmethod
    def from_motion(
        cls, time: Array, motion: FullMotion, payload: NDArray[np.int64] | None = None
    ) -> States:
        """Return the states of a motion at times (R,), with payload in some phases (R,) or none."""
        phases = np.zeros(len(time), dtype=np.int64) if payload is None else payload
        return cls(time, *motion[3:], *motion[:3], phases)

    @classmethod
    def from_joints(
        cls,
        robot: Manipulator,
        motion: tuple[Array, Array, Array],
        time: Array,
        start: PoseLike,
        *,
        payload: NDArray[np.int64] | None = None,
        source: str = "joints",
        first_row: int = 0,
    ) -> States:
        """Return the states that follow from the joints' motion, by direct kinematics.

        `motion` holds joint coordinates, rates and accelerations (R, n) at times (R,), s; `start`
        is a pose (m,) of their assembly mode, and `payload` the phases (R,). Messages call the log
        `source`; its row `first_row`, from 0, is the first sample.

        Raises
        ------
        LogError
            If no pose has the joints of a sample, or if it is next to a singularity.
        """
        joints, rates, accelerations = motion
        pose = poses_along(robot, joints, start)
        lost = np.isnan(pose).any(axis=-1)
        if lost.any():
            raise _no_pose(robot, joints, lost, source, first_row)
        _check_regular(robot, pose, source, first_row)
        velocity, acceleration = evaluate_unchecked(
            robot, "platform_motion", pose, rates, accelerations
        )
        return cls.from_motion(time, FullMotion(pose, velocity, acceleration, *motion), payload)

    @classmethod
    def from_log(
        cls, robot: Manipulator, log: Log, motion: tuple[Array, Array, Array], start: PoseLike
    ) -> States:
        """Return the states at a log's samples, from its joints' motion; see `from_joints`."""
        about: dict[str, Any] = {"source": log.source, "first_row": log.first_row}
        return cls.from_joints(robot, motion, log.time, start, payload=log.payload, **about)

    def __len__(self) -> int:
        return len(self.time)

    def part(self, rows: slice | NDArray[np.int64]) -> States:
        """Return some of the samples."""
        return replace(self, **{name: samples[rows] for name, samples in vars(self).items()})


def poses_along(robot: Manipulator, joints: Array, start: PoseLike) -> Poses:
    """Return the poses (R, m) of joint coordinates (R, n), in the assembly mode of a pose (m,).

    NaN where they have none; where that is found by following them, in all that come after too.
    """
    if not closure_of(robot).closed_form:
        return follow(robot, joints, start, on_failure="nan")
    column = mode_of(robot, tuple(np.asarray(start).tolist()))
    poses = assembly_modes(robot, joints)
    return np.ascontiguousarray(poses[:, column])


def start_pose(robot: Manipulator, log: Log) -> tuple[float, ...]:
    """Return a pose (m,) of the assembly mode that a log is in.

    The description's choice counts first, then the measured pose, if there is one, and else the
    mode of the machine's home pose.

    Raises
    ------
    DataError
        If the description names a mode that the machine has not, or that the log does not show.
    """
    closure = closure_of(robot)
    declared = log.description.assembly_mode
    if declared is None and (log.pose is None or closure.modes == 1):
        return home(robot)
    step = max(log.rows // _LOOK, 1)
    # Where modes have no columns of their own only the first sample tells them apart.
    seen = slice(None, None, step) if closure.closed_form else slice(1)
    if declared is None:
        assert log.pose is not None
        poses = assembly_modes(robot, log.joints[seen])
        column = int(np.argmin(np.median(_distances_to(robot, poses, log.pose[seen]), axis=0)))
    else:
        poses, column = direct_kinematics(robot, log.joints[seen], on_failure="nan"), declared - 1
        if declared > closure.modes:
            raise DataError(
                f"{log.source}: assembly_mode = {declared}; {robot.name} has "
                f"{' and '.join(map(str, range(1, closure.modes + 1)))}"
            )
    shown = poses[~np.isnan(poses[:, column]).any(axis=-1), column]
    if not len(shown):
        mode = "its measured pose" if declared is None else f"assembly_mode = {declared}"
        raise DataError(
            f"{log.source}: {mode} is no pose that its joints have; pteron direct lists those of "
            "the first sample"
        )
    return tuple(shown[0].tolist())


def _distances_to(robot: Manipulator, poses: Poses, measured: Array) -> Array:
    """Return distances of poses (R, k, m) from measured ones (R, m), infinite where there is none.

    Of position, and half-chords of the angles, so that whole turns count for nothing.
    """
    off = poses - measured[:, None]
    angular = robot.platform.angular
    distance = np.linalg.norm(off[..., ~angular], axis=-1)
    distance += np.abs(np.sin(0.5 * off[..., angular])).sum(axis=-1)
    return np.asarray(np.nan_to_num(distance, nan=np.inf))


@lru_cache(maxsize=64)
def home(robot: Manipulator) -> tuple[float, ...]:
    """Return the home pose (m,) of a machine, which takes a search the first time."""
    return tuple(home_pose(robot).tolist())


def home_mode(robot: Manipulator) -> int:
    """Return the assembly mode of the home pose, from 0."""
    return mode_of(robot, home(robot))


def _no_pose(
    robot: Manipulator, joints: Array, lost: NDArray[np.bool_], source: str, first: int
) -> LogError:
    """Return the error for the first sample without a pose, with a hint at its cause."""
    row = int(np.argmax(lost))
    coordinates = ", ".join(f"{coordinate:.4f}" for coordinate in joints[row])
    followed = not closure_of(robot).closed_form
    rows = [row] if followed else lost  # of what comes after the first nothing is known
    others = ~np.isnan(direct_kinematics(robot, joints[rows], on_failure="nan")).any(axis=(0, -1))
    count = len(joints[rows])
    count_text = f", nor those of {count - 1} more rows" if count > 1 else ""
    what = f"no pose of {robot.name} has the joints ({coordinates}){count_text}"
    hint = "perhaps it is the log of another machine, or its joints have other zeros"
    if others.any() and followed:
        what = f"{robot.name} does not come to the joints ({coordinates}) in its assembly mode"
        hint = (
            "perhaps samples are missing, or the mode is another: measure the pose, or declare it"
        )
    elif others.any():
        mode = 1 + int(np.argmax(others))
        hint = f"assembly mode {mode} has one: declare it in the log's description"
    return LogError("no pose", f"{source}: row {first + row + 1}", f"{what}; {hint}")


def _check_regular(robot: Manipulator, pose: Array, source: str, first_row: int) -> None:
    """Raise at the first pose that is singular or has a leg stretched or folded."""
    measures = {
        "a leg is all but stretched or folded": evaluate_unchecked(robot, "reach", pose)[1].min(-1)
    }
    if robot.platform.angles or closure_of(robot).vanishes() is None:
        sizes = [np.abs(evaluate_unchecked(robot, n, pose)) for n in holding_measures(robot)]
        measures["the pose is all but singular"] = np.minimum.reduce(sizes)
    for what, size in measures.items():
        lost = ~(size >= _REGULAR)  # NaN is none
        if lost.any():
            row = int(np.argmax(lost))
            raise LogError(
                "singular",
                f"{source}: row {first_row + row + 1}",
                f"{what} ({size[row]:.1e} of 1, at least {_REGULAR:g} is needed); cut this part "
                "out of the log",
            )
