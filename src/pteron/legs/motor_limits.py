"""The greatest force of a drive at a speed: the limits of its motor's curve and winding."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pteron.legs.drive import Drive


class SpeedLine(NamedTuple):
    """A straight limit of a drive's force f by its speed q': |f + back q'| <= force - fall |q'|."""

    force: float
    fall: float
    back: float


def supply(drive: Drive) -> tuple[float, float]:
    """Return a winding's stall force, N or N m, and its decrease per joint rate (m/s or rad/s)."""
    winding, gear = drive.winding, abs(drive.gear)
    if winding is None:
        raise ValueError("drive: has no winding")
    stall = gear * winding.torque_constant * winding.voltage / winding.resistance
    return stall, (gear * winding.torque_constant) ** 2 / winding.resistance


def limit_to_motor(
    drive: Drive, forces: NDArray[np.float64], rates: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return drive forces (...) limited to what the motor can give at its rates (...).

    Parameters
    ----------
    drive : Drive
        The drive.
    forces : array, shape (...)
        Commanded forces, N or N m.
    rates : array, shape (...)
        Of the motor, at the joint, m/s or rad/s.
    """
    if drive.curve:
        speeds, most = np.array(drive.curve).T
        most = np.interp(np.abs(rates), speeds, most)
        forces = np.clip(forces, -most, most)
    if drive.winding:
        stall, back = supply(drive)
        forces = np.clip(forces, -stall - back * rates, stall - back * rates)
    return forces


class MotorPeak(NamedTuple):
    """The moment at which a drive's force is nearest to, or farthest beyond, its motor's limit."""

    force: float
    """Its size, N or N m."""
    most: float
    """The motor's limit in that direction at its speed, N or N m."""
    at: int
    """The flat index of the moment in the array."""


def motor_peak(drive: Drive, forces: NDArray[np.float64], rates: NDArray[np.float64]) -> MotorPeak:
    """Return force, limit and index of the sample (...) with the greatest force over limit."""
    forces, rates = np.broadcast_arrays(forces, rates)
    side = np.where(forces < 0.0, -1.0, 1.0)
    most = np.maximum(side * limit_to_motor(drive, side * np.inf, rates), 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.where(forces == 0.0, 0.0, np.abs(forces) / most)
    at = int(np.nan_to_num(shares, nan=-1.0, posinf=np.inf).argmax())
    return MotorPeak(abs(float(forces.flat[at])), float(most.flat[at]), at)


def speed_lines(drive: Drive) -> tuple[SpeedLine, ...]:
    """Return linear force limits that fall with speed, within the motor's curve and winding.

    They include the winding's limits and those of the motor's curve as long as each piece is
    steeper than the one before. Where the curve becomes flatter again, the steeper line continues
    (conservative).
    """
    lines: list[SpeedLine] = []
    if drive.curve:
        ends = (0.0, drive.curve[0][1]), (math.inf, drive.curve[-1][1])
        for (slow, high), (fast, low) in pairwise([ends[0], *drive.curve, ends[1]]):
            if fast > slow and all(line.force - line.fall * fast > low for line in lines):
                fall = (high - low) / (fast - slow)
                lines.append(SpeedLine(high + fall * slow, fall, 0.0))
    if drive.winding:
        stall, back = supply(drive)
        lines.append(SpeedLine(stall, 0.0, back))
    return tuple(lines)
