"""States of the machine at the samples of a log: joints and platform, in one assembly mode."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pteron.equations.machine import closure_of
from pteron.errors import DataError
from pteron.identification.errors import LogError
from pteron.identification.logs import Log
from pteron.kernels import Array
from pteron.kinematics import assembly_modes, mode_of
from pteron.kinematics.evaluate import unchecked
from pteron.manipulator import Manipulator
from pteron.workspace import home_pose

_REGULAR = 1e-3
"""Next to a singularity the regressor grows without bound, and with it every error."""

_LOOK = 1000
"""Samples of the measured pose that decide on the assembly mode."""


@dataclass(frozen=True)
class States:
    """States at R samples: of the joints, where they were measured, and of the platform.

    Attributes
    ----------
    time : array, shape (R,)
        s.
    joints, joint_rates, joint_accelerations : array, shape (R, n)
        m and s.
    pose, velocity, acceleration : array, shape (R, m)
        m, rad and s.
    payload : array of int, shape (R,)
        The phase: 0 without payload.
    """

    time: Array
    joints: Array
    joint_rates: Array
    joint_accelerations: Array
    pose: Array
    velocity: Array
    acceleration: Array
    payload: NDArray[np.int64]

    @classmethod
    def of_joints(
        cls,
        robot: Manipulator,
        motion: tuple[Array, Array, Array],
        time: Array,
        mode: int,
        *,
        payload: NDArray[np.int64] | None = None,
        source: str = "joints",
        first_row: int = 0,
    ) -> States:
        """Return the states of joints that move so: rho = J x inverted, and differentiated twice.

        `motion` holds joint coordinates, rates and accelerations (R, n) at times (R,), s; `mode`
        is the assembly mode, from 0, and `payload` the phases (R,). Messages call the log `source`;
        its row `first_row`, from 0, is the first sample.

        Raises
        ------
        LogError
            If no pose has the joints of a sample, or if it is next to a singularity.
        """
        joints, rates, accelerations = motion
        pose = np.ascontiguousarray(assembly_modes(robot, joints)[:, mode])
        lost = np.isnan(pose).any(axis=-1)
        if lost.any():
            raise _no_pose(robot, joints, lost, mode, source, first_row)
        _check_regular(robot, pose, source, first_row)
        velocity, acceleration = unchecked(robot, "platform_motion", pose, rates, accelerations)
        phases = np.zeros(len(time), dtype=np.int64) if payload is None else payload
        return cls(time, joints, rates, accelerations, pose, velocity, acceleration, phases)

    def __len__(self) -> int:
        return len(self.time)

    def part(self, rows: slice) -> States:
        """Return some of the samples."""
        return replace(self, **{name: value[rows] for name, value in vars(self).items()})


def assembly_mode(robot: Manipulator, log: Log) -> int:
    """Return the column of `assembly_modes`, from 0, that a log follows.

    A column stands for one assembly mode throughout, between the singular poses: to follow
    it is to follow the motion by continuity. The description's choice counts first, then the
    measured pose, if there is one, and else the mode of the machine's home pose.

    Raises
    ------
    DataError
        If the description names a mode that the machine has not.
    """
    modes = closure_of(robot).modes
    declared = log.description.assembly_mode
    if declared is not None:
        if not 1 <= declared <= modes:
            raise DataError(
                f"{log.source}: assembly_mode = {declared}; {robot.name} has "
                f"{' and '.join(map(str, range(1, modes + 1)))}"
            )
        return declared - 1
    if modes == 1:
        return 0
    if log.pose is None:
        return home_mode(robot)
    # Position and half-chord of the angle, so that whole turns count for nothing.
    step = max(log.rows // _LOOK, 1)
    poses, measured = assembly_modes(robot, log.joints[::step]), log.pose[::step, None]
    off = np.linalg.norm(poses[..., :3] - measured[..., :3], axis=-1)
    if robot.platform.turns:
        off += np.abs(np.sin(0.5 * (poses[..., 3] - measured[..., 3])))
    off = np.nan_to_num(off, nan=np.inf)
    return int(np.argmin(np.median(off, axis=0)))


@lru_cache(maxsize=64)
def home(robot: Manipulator) -> tuple[float, ...]:
    """Return the home pose, which takes a search the first time."""
    return tuple(home_pose(robot).tolist())


def home_mode(robot: Manipulator) -> int:
    """Return the assembly mode of the home pose, from 0."""
    return mode_of(robot, home(robot))


def _no_pose(
    robot: Manipulator, joints: Array, lost: NDArray[np.bool_], mode: int, source: str, first: int
) -> LogError:
    row = int(np.argmax(lost))
    count = int(lost.sum())
    values = ", ".join(f"{value:.4f}" for value in joints[row])
    others = assembly_modes(robot, joints[lost])
    hint = "perhaps it is the log of another machine, or its joints have other zeros"
    if others.shape[-2] > 1 and not np.isnan(others[:, 1 - mode]).any():
        hint = f"assembly mode {2 - mode} has one: declare it in the log's description"
    more = f", nor those of {count - 1} more rows" if count > 1 else ""
    return LogError(
        "no pose",
        f"{source}: row {first + row + 1}",
        f"no pose of {robot.name} has the joints ({values}){more}; {hint}",
    )


def _check_regular(robot: Manipulator, pose: Array, source: str, first_row: int) -> None:
    measures = {"a leg is all but stretched or folded": unchecked(robot, "reach", pose)[1].min(-1)}
    if closure_of(robot).vanishes() is None or robot.platform.turns:
        measures["the pose is all but singular"] = np.abs(unchecked(robot, "type_ii", pose))
    for what, size in measures.items():
        if (size < _REGULAR).any():
            row = int(np.argmax(size < _REGULAR))
            raise LogError(
                "singular",
                f"{source}: row {first_row + row + 1}",
                f"{what} ({size[row]:.1e} of 1, at least {_REGULAR:g} is needed); cut this part "
                "out of the log",
            )
