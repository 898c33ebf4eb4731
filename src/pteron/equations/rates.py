"""Rates and accelerations of every joint, the passive ones included."""

from __future__ import annotations

import casadi as ca

from pteron.equations.geometry import Expression, Geometry
from pteron.equations.legs import leg_motion
from pteron.equations.platforms import platform_motion


def joint_motion(
    geometry: Geometry, pose: Expression, velocity: Expression, acceleration: Expression
) -> tuple[Expression, Expression]:
    """Return rates and accelerations (n, 3) of slider, upper link and lower link of every leg.

    The links' are absolute, about d: theta_u and theta_l.
    """
    motion = platform_motion(geometry, pose, velocity, acceleration)
    rates, accelerations = [], []
    for leg, point in zip(geometry.legs, motion.points, strict=True):
        state = leg_motion(leg, point)
        rates.append(ca.horzcat(state.slider_rate, state.upper_rate, state.lower_rate))
        accelerations.append(
            ca.horzcat(
                state.slider_acceleration, state.upper_acceleration, state.lower_acceleration
            )
        )
    return ca.vertcat(*rates), ca.vertcat(*accelerations)
