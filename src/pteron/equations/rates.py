"""Rates and accelerations of every joint, the passive ones included."""

from __future__ import annotations

import casadi as ca

from pteron.equations.closure import platform_acceleration
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


def platform_rates(
    geometry: Geometry, pose: Expression, rates: Expression, accelerations: Expression
) -> tuple[Expression, Expression]:
    """Return x' and x'' (m, 1) of sliders that move at rho' and rho'', (n, 1) each.

    J x' = rho' and J x'' = rho'' - J' x', whose last term is the sliders' acceleration at x'' = 0.
    """
    angle = pose[3] if geometry.turns else ca.SX(0)
    turn = ca.cos(angle), ca.sin(angle)
    velocity = platform_acceleration(geometry, rates, *turn)
    rest = ca.SX.zeros(geometry.freedom)
    _, drift = joint_motion(geometry, pose, velocity, rest)
    return velocity, platform_acceleration(geometry, accelerations - drift[:, 0], *turn)
