"""States of the machine at the samples of a log: sliders and platform, in one assembly mode."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pteron.errors import DataError
from pteron.identification.errors import LogError
from pteron.identification.logs import Log
from pteron.kernels import Array, numeric
from pteron.kinematics import direct_kinematics
from pteron.manipulator import Manipulator
from pteron.workspace import home_pose

_LEAST_SINE = 1e-3
_LEAST_REGULARITY = 1e-3
"""Next to a singularity the regressor grows without bound, and with it every error."""

_LOOK = 1000
"""Samples of the measured pose that decide on the assembly mode."""


@dataclass(frozen=True)
class States:
    """States at R samples: of the sliders, where they were measured, and of the platform.

    Attributes
    ----------
    time : array, shape (R,)
        s.
    sliders, slider_rates, slider_accelerations : array, shape (R, n)
        m and s.
    pose, velocity, acceleration : array, shape (R, m)
        m, rad and s.
    payload : array of int, shape (R,)
        The phase: 0 without payload.
    """

    time: Array
    sliders: Array
    slider_rates: Array
    slider_accelerations: Array
    pose: Array
    velocity: Array
    acceleration: Array
    payload: NDArray[np.int64]

    @classmethod
    def of_sliders(
        cls,
        robot: Manipulator,
        motion: tuple[Array, Array, Array],
        time: Array,
        mode: int,
        *,
        payload: NDArray[np.int64] | None = None,
        source: str = "sliders",
        first_row: int = 0,
    ) -> States:
        """Return the states of sliders that move so: rho = J x inverted, and differentiated twice.

        `motion` holds slider coordinates, rates and accelerations (R, n) at times (R,), s; `mode`
        is the assembly mode, from 0, and `payload` the phases (R,). Messages call the log `source`;
        its row `first_row`, from 0, is the first sample.

        Raises
        ------
        LogError
            If no pose has the sliders of a sample, or if it is next to a singularity.
        """
        sliders, rates, accelerations = motion
        pose = np.ascontiguousarray(direct_kinematics(robot, sliders)[:, mode])
        lost = np.isnan(pose).any(axis=-1)
        if lost.any():
            raise _no_pose(robot, sliders, lost, mode, source, first_row)
        _check_regular(robot, pose, source, first_row)
        velocity, acceleration = numeric(robot, "platform_motion")(pose, rates, accelerations)
        phases = np.zeros(len(time), dtype=np.int64) if payload is None else payload
        return cls(time, sliders, rates, accelerations, pose, velocity, acceleration, phases)

    def __len__(self) -> int:
        return len(self.time)

    def part(self, rows: slice) -> States:
        """Return some of the samples."""
        return replace(self, **{name: value[rows] for name, value in vars(self).items()})


def assembly_mode(robot: Manipulator, log: Log) -> int:
    """Return the column of `direct_kinematics`, from 0, that a log follows.

    A column stands for one assembly mode throughout, between the singular orientations: to follow
    it is to follow the motion by continuity. The description's choice counts first, then the
    measured pose, if there is one, and else the mode of the machine's home pose.

    Raises
    ------
    DataError
        If the description names a mode that the machine has not.
    """
    if not robot.platform.turns:
        return 0
    declared = log.description.assembly_mode
    if declared is not None:
        if declared not in (1, 2):
            raise DataError(f"{log.source}: assembly_mode = {declared}; {robot.name} has 1 and 2")
        return declared - 1
    if log.pose is None:
        return home_mode(robot)
    # Position and half-chord of the angle, so that whole turns count for nothing.
    step = max(log.rows // _LOOK, 1)
    poses, measured = direct_kinematics(robot, log.sliders[::step]), log.pose[::step, None]
    position = np.linalg.norm(poses[..., :3] - measured[..., :3], axis=-1)
    angle = np.abs(np.sin(0.5 * (poses[..., 3] - measured[..., 3])))
    off = np.nan_to_num(position + angle, nan=np.inf)
    return int(np.argmin(np.median(off, axis=0)))


@lru_cache(maxsize=64)
def home_mode(robot: Manipulator) -> int:
    """Return the assembly mode of the home pose, from 0."""
    if not robot.platform.turns:
        return 0
    # The first mode has the positive determinant; see `pteron.direct_kinematics`.
    return 0 if float(numeric(robot, "regularity")(home_pose(robot))) > 0.0 else 1


def _no_pose(
    robot: Manipulator, sliders: Array, lost: NDArray[np.bool_], mode: int, source: str, first: int
) -> LogError:
    row = int(np.argmax(lost))
    count = int(lost.sum())
    values = ", ".join(f"{value:.4f}" for value in sliders[row])
    others = direct_kinematics(robot, sliders[lost])
    hint = "perhaps it is the log of another machine, or its sliders have other zeros"
    if others.shape[-2] > 1 and not np.isnan(others[:, 1 - mode]).any():
        hint = f"assembly mode {2 - mode} has one: declare it in the log's description"
    more = f", nor those of {count - 1} more rows" if count > 1 else ""
    return LogError(
        "no pose",
        f"{source}: row {first + row + 1}",
        f"no pose of {robot.name} has the sliders ({values}) m{more}; {hint}",
    )


def _check_regular(robot: Manipulator, pose: Array, source: str, first_row: int) -> None:
    _, _, sine = numeric(robot, "reach")(pose)
    found = [("a leg is all but stretched or folded", sine.min(axis=-1), _LEAST_SINE)]
    if robot.platform.turns:
        regularity = np.abs(numeric(robot, "regularity")(pose))
        found.append(("the orientation is all but singular", regularity, _LEAST_REGULARITY))
    for what, size, least in found:
        if (size < least).any():
            row = int(np.argmax(size < least))
            raise LogError(
                "singular",
                f"{source}: row {first_row + row + 1}",
                f"{what} ({size[row]:.1e} of 1, at least {least:g} is needed); cut this part out "
                "of the log",
            )
