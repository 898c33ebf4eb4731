"""Overloads: the drives' limits of force and speed that a motion exceeds, as warnings."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pteron.dynamics import drive_forces
from pteron.kernels import as_array
from pteron.kinematics import joint_rates
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion.motion import Motion
from pteron.motion.sizing.drive_margins import drive_margins


def overloads(robot: RobotLike, forces: ArrayLike, speeds: ArrayLike) -> tuple[str, ...]:
    """Return the limits of drives that a motion exceeds, one line each.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine; limits are each drive's `max_force` and `max_speed`, and its motor's curve and
        winding.
    forces : array, shape (..., n)
        Forces of the drives, such as `drive_forces` returns: friction and motors count. N, N m.
    speeds : array, shape (..., n)
        Speeds of the joints, m/s or rad/s.

    Returns
    -------
    tuple of str

    Examples
    --------
    >>> import pteron
    >>> from dataclasses import replace
    >>> from pteron.motion import overloads
    >>> robot = pteron.load("tripteron")
    >>> legs = [replace(leg, drive=pteron.legs.Drive(max_force=20.0)) for leg in robot.legs]
    >>> overloads(replace(robot, legs=legs), [[3.0, -25.0, 8.0]], [[0.1, 0.2, 0.3]])
    ('leg 2: the motion takes up to 25 N, but its drive gives 20 N (max_force)',)
    """
    robot = as_manipulator(robot)
    sizes = {"peak_force": ("forces", forces), "peak_speed": ("speeds", speeds)}
    needed, moments = {}, []
    for quantity, (name, rows_of_legs) in sizes.items():
        moments.append(
            as_array(rows_of_legs, name, (len(robot.legs),)).reshape(-1, len(robot.legs))
        )
        # Rows that no pose serves are NaN.
        needed[quantity] = np.fmax.reduce(np.abs(moments[-1]), axis=0, initial=0.0)
    margins = drive_margins(robot, needed, *moments)
    return tuple(margin.overload_text("") for margin in margins if margin.margin < 1.0)


def overloads_of(robot: Manipulator, motion: Motion) -> tuple[str, ...]:
    """Return the limits of drives that a motion of the platform exceeds, one line each."""
    state = motion.pose, motion.velocity, motion.acceleration
    rates = joint_rates(robot, *state[:2]).actuated
    return overloads(robot, drive_forces(robot, *state, smooth=True), rates)
