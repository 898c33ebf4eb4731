"""The dynamics as the paper's Eq. (15) writes it: J^-T [ J^T Om_p  J_u^T Om_u  J_l^T Om_l  Om_e ].

`virtual_work` gives the same regressor at less cost. This form stands here as the paper's own, to
check that one and to measure the paper's claim about it: `Terms` keeps its factors apart.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from pteron.equations.bodies import Inertia, first_moment, moment, turning_force
from pteron.equations.closure import Load, actuator_forces
from pteron.equations.geometry import Expression, Geometry
from pteron.equations.jacobians import jacobian, link_jacobians
from pteron.equations.legs import leg_motion
from pteron.equations.platforms import platform_motion


@dataclass(frozen=True)
class Terms:
    """The factors of Eq. (15), for one state."""

    jacobian: Expression
    """J (n, m)."""
    sliders: Expression
    """Om_p (n, n)."""
    link_jacobians: tuple[Expression, ...]
    """J_u1..J_un, J_l1..J_ln, each (6, m)."""
    links: tuple[Expression, ...]
    """Om_u1..Om_un, Om_l1..Om_ln, each (6, 4)."""
    platform: Expression
    """Om_e (m, 4)."""


def body_matrix(
    x: Expression,
    z: Expression,
    g_a: Expression,
    rate: Expression,
    ddtheta: Expression,
) -> Expression:
    """Return Om (6, 4) of a body: the wrench at its reference point, per unit of m, mgx, mgy, I.

    `x` and `z` are the body's axes, `g_a` is g - a, `rate` and `ddtheta` its motion about z.
    """
    unit = Inertia.rows(ca.SX.eye(4))
    h, dh = first_moment(x, ca.cross(z, x), unit.hx, unit.hy)
    force = ca.mtimes(g_a, unit.m) - turning_force(h, dh, rate * rate, ddtheta)
    return ca.vertcat(force, ca.mtimes(z, -moment(dh, unit.i, -g_a, ddtheta)))


def terms(
    geometry: Geometry, pose: Expression, velocity: Expression, acceleration: Expression
) -> Terms:
    """Return the factors of Eq. (15)."""
    motion = platform_motion(geometry, pose, velocity, acceleration)
    g = geometry.gravity
    diagonal, upper, lower = [], [], []
    for leg, point in zip(geometry.legs, motion.points, strict=True):
        state = leg_motion(leg, point)
        at = state.position
        diagonal.append(ca.dot(leg.e, g) - state.slider_acceleration)
        upper.append(
            body_matrix(
                ca.mtimes(leg.plane, at.l_u) / leg.lu,
                leg.d,
                g - state.slider_acceleration * leg.e,
                state.upper_rate,
                state.upper_acceleration,
            )
        )
        lower.append(
            body_matrix(
                ca.mtimes(leg.plane, at.l_l) / leg.ll,
                leg.d,
                g - point.acceleration,
                state.lower_rate,
                state.lower_acceleration,
            )
        )
    upper_jacobians, lower_jacobians = link_jacobians(geometry, pose)
    return Terms(
        jacobian(geometry, pose),
        ca.diag(ca.vertcat(*diagonal)),
        (*upper_jacobians, *lower_jacobians),
        (*upper, *lower),
        _platform_matrix(geometry, pose, velocity, acceleration),
    )


def _platform_matrix(
    geometry: Geometry, pose: Expression, velocity: Expression, acceleration: Expression
) -> Expression:
    g_p = geometry.gravity - acceleration[0:3]
    if not geometry.turns:
        still = ca.SX(0)
        return body_matrix(geometry.x0, geometry.k, g_p, still, still)[0:3, :]
    x = geometry.x0 * ca.cos(pose[3]) + geometry.y0 * ca.sin(pose[3])
    matrix = body_matrix(x, geometry.k, g_p, velocity[3], acceleration[3])
    return ca.vertcat(matrix[0:3, :], ca.mtimes(geometry.k.T, matrix[3:6, :]))


def generalized_regressor(parts: Terms) -> Expression:
    """Return the bracket of Eq. (15), (m, N)."""
    links = (
        ca.mtimes(jac.T, body) for jac, body in zip(parts.link_jacobians, parts.links, strict=True)
    )
    return ca.horzcat(ca.mtimes(parts.jacobian.T, parts.sliders), *links, parts.platform)


def paper_regressor(
    geometry: Geometry, pose: Expression, velocity: Expression, acceleration: Expression
) -> Expression:
    """Return the dynamic matrix D (n, N) of Eq. (15): F_a = D P.

    Omega holds what acts on the bodies, so that the forces which balance it carry a minus sign.
    """
    bracket = generalized_regressor(terms(geometry, pose, velocity, acceleration))
    turn = platform_motion(geometry, pose, velocity, acceleration).turn
    return -actuator_forces(geometry, Load.of(bracket), turn)
