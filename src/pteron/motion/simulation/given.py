"""The forces that motors give: those asked for within their limits at a speed, or the currents'."""

from __future__ import annotations

import numpy as np

from pteron.equations.transmissions import DriveKind
from pteron.kernels import Array
from pteron.legs.motor_limits import limit_to_motor
from pteron.manipulator import Manipulator


def given_forces(
    robot: Manipulator, forces: Array, motor_rates: Array, currents: Array | None
) -> Array:
    """Return the forces (..., n) that motors give, of what their drives are told to give.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    forces : array, shape (..., n)
        What its drives are told, within their `max_force`, N or N m.
    motor_rates : array, shape (..., n)
        Rates of the motors, counted at the joints.
    currents : array, shape (..., n), or None
        Forces of the currents, where some lag.
    """
    limited = within_motors(robot, forces, motor_rates)
    if currents is None:
        return limited
    return np.where(DriveKind.from_robot(robot).lag, currents, limited)


def within_motors(robot: Manipulator, forces: Array, motor_rates: Array) -> Array:
    """Return forces (..., n) of the drives, cut to what their motors can give at their rates.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    forces : array, shape (..., n)
        What is asked of its drives, N or N m.
    motor_rates : array, shape (..., n)
        Rates of the motors, counted at the joints.
    """
    limited = np.array(forces, dtype=float)
    for i, leg in enumerate(robot.legs):
        if leg.drive:
            limited[..., i] = limit_to_motor(leg.drive, limited[..., i], motor_rates[..., i])
    return limited
