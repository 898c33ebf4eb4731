"""Cycles and drives: the shortest time of a cycle within drives' limits, and motors' margins."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.errors import ModelError
from pteron.manipulator import Manipulator
from pteron.motion import Motion, Motor, MotorFit, Sizing, limits_of
from pteron.motion.sizing.motor_choice import fit_at, serving_span
from pteron.motion.trajectories.demand import curve_rate

_DECADES = 4.0
"""Range of the search for a motor's ratio: powers of ten below that of its greatest speed."""


def shortest_time(robot: Manipulator, motion: Motion) -> float:
    """Return the shortest duration, s, of a motion within the drives' limits, by uniform scaling.

    Limits are those of force and speed, and what the curve and the winding of a motor leave at
    speed. The Stribeck force counts in full at every speed.

    Raises
    ------
    ModelError
        If no drive has a limit, or one cannot hold the machine at rest.
    """
    curve = motion.pose, motion.velocity, motion.acceleration
    rate = curve_rate(robot, curve, limits_of(robot))
    if not np.isfinite(rate):
        raise ModelError("cycle_time: no limit of a drive is met, however fast the cycle is")
    return motion.duration / rate


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
