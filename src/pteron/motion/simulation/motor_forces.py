"""Motor forces: commands limited by the torque at a speed, or the forces of lagging currents."""

from __future__ import annotations

import numpy as np

from pteron.equations.transmissions import DriveKind
from pteron.kernels import Array
from pteron.legs.motor_limits import limit_to_motor
from pteron.manipulator import Manipulator


def motor_forces(
    robot: Manipulator, forces: Array, motor_rates: Array, currents: Array | None
) -> Array:
    """Return the forces (..., n) that the motors give for commanded forces.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    forces : array, shape (..., n)
        Commands to the drives, within their `max_force`, N or N m.
    motor_rates : array, shape (..., n)
        Rates of the motors, counted at the joints.
    currents : array, shape (..., n), or None
        Forces of the currents, where some lag.
    """
    limited = limit_to_motors(robot, forces, motor_rates)
    return (
        limited
        if currents is None
        else np.where(DriveKind.from_robot(robot).lag, currents, limited)
    )


def limit_to_motors(robot: Manipulator, forces: Array, motor_rates: Array) -> Array:
    """Return drive forces (..., n) limited to their motors' torque at their rates.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    forces : array, shape (..., n)
        Commands to its drives, N or N m.
    motor_rates : array, shape (..., n)
        Rates of the motors, counted at the joints.
    """
    limited = np.array(forces, dtype=float)
    for i, leg in enumerate(robot.legs):
        if leg.drive:
            limited[..., i] = limit_to_motor(leg.drive, limited[..., i], motor_rates[..., i])
    return limited
