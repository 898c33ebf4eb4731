"""Numbers on the viewer's panel: forces, condition number, margins to singularities and limits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pteron.dynamics import drive_forces
from pteron.errors import PteronError
from pteron.kernels import Array
from pteron.kinematics import joint_rates
from pteron.kinematics.jacobian_at import jacobian_at
from pteron.viewer.state import ViewerState
from pteron.workspace import pose_margins

Level = Literal["far", "near", "close"]
"""Level of a margin to a singularity or a limit: see `level`."""

_NEAR = 0.3
"""Margin, 1 at best and 0 at the singularity or limit, below which its level is "near"."""

_CLOSE = 0.1
"""Margin below which its level is "close"."""


@dataclass(frozen=True, eq=False)
class Readings:
    """The numbers that the panel shows for a state of the machine.

    Attributes
    ----------
    joints : array, shape (n,)
        m or rad.
    forces : array, shape (n,)
        Forces of the drives, at rest or as the machine moves, N or N m; NaN where they are not
        determined.
    power : array, shape (n,)
        That the drives give, W.
    shares : array, shape (n,)
        Their sizes over what the drives can do; NaN where the file does not say it.
    condition : float
        Condition number of the Jacobian, no unit mixed with another; NaN at a singular pose.
    type_i : array, shape (n,)
        Each leg's type-I measure: 1 at best, 0 where the leg is stretched or folded.
    type_ii : float
        The type-II or the constraint measure, the lesser share of its best: 0 where the platform
        is held no more.
    clearances : array, shape (n,)
        From each leg's joints to the nearest limit, over half its range; 1 without limits.
    fault : str
        Why there are no forces; empty where there are.
    """

    joints: Array
    forces: Array
    power: Array
    shares: Array
    condition: float
    type_i: Array
    type_ii: float
    clearances: Array
    fault: str = ""


def readings(state: ViewerState, forces: Array | None = None) -> Readings:
    """Return the numbers of a state, as the library computes them.

    Forces (n,) that are given are those of drives which somebody pushes against.
    """
    robot, fault = state.robot, ""
    if forces is None:
        try:
            moves = state.velocity, state.acceleration
            forces = drive_forces(state.robot_with_payload, state.pose, *moves)
        except PteronError as error:
            forces, fault = np.full(robot.joint_count, np.nan), str(error)
    try:
        rates = joint_rates(robot, state.pose, state.velocity).actuated
    except PteronError:
        rates = np.full(robot.joint_count, np.nan)
    try:
        condition = jacobian_at(robot, state.pose).condition
    except PteronError:
        condition = float("nan")
    most = [leg.drive.max_force if leg.drive else None for leg in robot.legs]
    shares = np.abs(forces) / np.array([np.nan if force is None else force for force in most])
    at = pose_margins(robot, state.pose)
    return Readings(
        joints=state.joints,
        forces=forces,
        power=forces * rates,
        shares=shares,
        condition=condition,
        type_i=at.type_i,
        type_ii=float(min(at.type_ii, at.constraint)),
        clearances=at.joints,
        fault=fault,
    )


def level(share: float) -> Level:
    """Return the level of a margin, 1 at best and 0 at a singularity or limit: "far" and so on.

    Examples
    --------
    >>> level(0.8), level(0.2), level(0.0)
    ('far', 'near', 'close')
    """
    if share >= _NEAR:
        return "far"
    return "near" if share >= _CLOSE else "close"
