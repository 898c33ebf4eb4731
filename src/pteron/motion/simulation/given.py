"""The forces that motors give: those asked for, within their curves and windings at a speed."""

from __future__ import annotations

import numpy as np

from pteron.kernels import Array
from pteron.manipulator import Manipulator


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
    found = np.array(forces, dtype=float)
    for i, leg in enumerate(robot.legs):
        drive, rates = leg.drive, motor_rates[..., i]
        if drive and drive.curve:
            speeds, most = np.array(drive.curve).T
            most = np.interp(np.abs(rates), speeds, most)
            found[..., i] = np.clip(found[..., i], -most, most)
        if drive and drive.winding:
            winding, gear = drive.winding, abs(drive.gear)
            stall = gear * winding.torque_constant * winding.voltage / winding.resistance
            back = (gear * winding.torque_constant) ** 2 / winding.resistance * rates
            found[..., i] = np.clip(found[..., i], -stall - back, stall - back)
    return found
