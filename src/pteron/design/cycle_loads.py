"""Cycles and drives: the shortest time of a cycle within drives' limits, and motors' margins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.dynamics import drive_forces
from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.kinematics import joint_rates
from pteron.legs import Drive
from pteron.manipulator import Manipulator
from pteron.motion import Motion, Motor, MotorFit, Sizing, limits_of
from pteron.motion.sizing.motor_choice import fit_at, serving_span

_RATES = np.array([1.0, 2.0, 3.0])
"""Rates at which forces are evaluated: they are quadratic in the rate."""

_DECADES = 4.0
"""Range of the search for a motor's ratio: powers of ten below that of its greatest speed."""


def shortest_time(robot: Manipulator, motion: Motion) -> float:
    """Return the shortest duration, s, of a motion within the drives' limits, by uniform scaling.

    At a rate of u times the given speed the forces are A + B u + C u^2 at each sample; the first u
    at which a force reaches its limit is computed exactly. The Stribeck force counts in full at
    every speed.

    Raises
    ------
    ModelError
        If no drive has a limit, or one cannot hold the machine at rest.
    """
    robot = replace(
        robot, legs=tuple(replace(leg, drive=_remove_stribeck(leg.drive)) for leg in robot.legs)
    )
    forces = np.stack(
        [
            drive_forces(robot, motion.pose, u * motion.velocity, u**2 * motion.acceleration)
            for u in _RATES
        ]
    )
    static, line, square = np.tensordot(np.linalg.inv(np.vander(_RATES, 3, True)), forces, axes=1)
    limits = limits_of(robot)
    most = limits.force
    for i in np.flatnonzero((np.abs(static) > most).any(axis=0)):
        raise ModelError(
            f"leg {i + 1}: its drive gives {most[i]:g}, but it takes "
            f"{np.abs(static[:, i]).max():.4g} to hold the machine in the cycle"
        )
    rates = [_first_root(side * square, side * line, side * static - most) for side in (1.0, -1.0)]
    speeds = np.abs(joint_rates(robot, motion.pose, motion.velocity).actuated).max(axis=0)
    with np.errstate(divide="ignore"):
        rate = min(*(float(part.min()) for part in rates), float((limits.speed / speeds).min()))
    if not np.isfinite(rate):
        raise ModelError("cycle_time: no limit of a drive is met, however fast the cycle is")
    return motion.duration / rate


def _remove_stribeck(drive: Drive | None) -> Drive | None:
    """Return a drive with its Stribeck force added to Coulomb friction; a bound at every speed."""
    if drive is None or drive.stribeck is None:
        return drive
    return replace(drive, coulomb=drive.coulomb + drive.stribeck.force, stribeck=None)


def _first_root(square: Array, line: Array, constant: Array) -> Array:
    """Return the least u > 0 with square u^2 + line u + constant = 0; inf if none."""
    with np.errstate(invalid="ignore", divide="ignore"):
        root = np.sqrt(line**2 - 4.0 * square * constant)
        falls = (line < 0.0) & (square > 0.0)  # the form without cancellation
        roots = np.where(falls, (root - line) / (2.0 * square), -2.0 * constant / (line + root))
    return np.where(np.isfinite(roots) & (roots > 0.0), roots, inf)


def _best_fit(sizing: Sizing, leg: int, motor: Motor) -> MotorFit:
    """Return the motor's fit at the gear ratio of its greatest margin (limit over load).

    Each limit allows an interval of ratios, so that the least margin has a single maximum.
    """
    span, fastest = serving_span(sizing, leg, motor, 1.0), float(sizing.peak_speeds[leg - 1])

    def fit_at_log(log_ratio: float) -> MotorFit:
        """Return the motor's fit at the gear ratio exp(log_ratio), rad/m or rad/rad."""
        return fit_at(sizing, leg, motor, span, float(np.exp(log_ratio)))

    middle = np.log(motor.max_speed / fastest if fastest else 1.0)
    optimum = scipy.optimize.minimize_scalar(
        lambda log_ratio: -np.log(fit_at_log(log_ratio).margin),
        bounds=(middle - _DECADES * np.log(10.0), middle + np.log(10.0)),
        method="bounded",
        options={"xatol": 1e-6},
    )
    return fit_at_log(optimum.x)


def best_motors(sizing: Sizing, motors: Sequence[Motor], enough: float = inf) -> list[MotorFit]:
    """Return for each joint the smallest motor of the list with a margin of at least `enough`.

    Where no motor has the margin `enough`, it is the motor with the greatest margin.
    """
    best = []
    for leg in range(1, sizing.robot.joint_count + 1):
        fits = [_best_fit(sizing, leg, motor) for motor in motors]
        serving = [fit for fit in fits if fit.margin >= enough]
        best.append(
            min(serving, key=lambda fit: fit.motor.rated_torque * fit.motor.max_speed)
            if serving
            else max(fits, key=lambda fit: fit.margin)
        )
    return best
