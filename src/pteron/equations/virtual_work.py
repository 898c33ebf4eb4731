"""Inverse dynamics by virtual work, Eqs. (13) and (14), in factored form.

Each leg answers to its platform point alone: its links' wrenches become a force on that point and
a reaction along its slider. So J_u and J_l of Eq. (13) are never multiplied out: they are their
rows with respect to c, times C_i. A mass that two bodies carry at a point they share may be given
to either: m_u goes with the slider, m_l with the platform.

Given one column of parameters this is the inverse dynamics; given the identity matrix instead, the
same lines return the regressor of Eq. (15).
"""

from __future__ import annotations

import casadi as ca

from pteron.equations.bodies import (
    Inertia,
    LegInertia,
    link_moments,
    moment,
    resting_moment,
    split,
    turning_force,
)
from pteron.equations.closure import Load, actuator_forces
from pteron.equations.geometry import Expression, Geometry, LegGeometry, weighted_sum
from pteron.equations.legs import LegMotion, leg_motion
from pteron.equations.platforms import PlatformMotion, platform_motion


def inverse_dynamics(
    geometry: Geometry,
    pose: Expression,
    velocity: Expression,
    acceleration: Expression,
    parameters: Expression,
    wrench: Expression | None = None,
) -> Expression:
    """Return the actuator forces F_a (n, K) for the columns of parameters (N, K), Eq. (13).

    `wrench` (m, K) acts on the platform at P: a force and, for 3T1R, a moment about k.
    """
    motion = platform_motion(geometry, pose, velocity, acceleration)
    on_sliders, load = needed_forces(geometry, motion, parameters)
    if wrench is not None:
        load = load + Load.of(-wrench)
    return on_sliders + actuator_forces(geometry, load, motion.turn)


def generalized_forces(
    geometry: Geometry,
    pose: Expression,
    velocity: Expression,
    acceleration: Expression,
    parameters: Expression,
) -> Expression:
    """Return M x'' + h (m, K), the forces of the motion in platform coordinates: J^T F_a."""
    motion = platform_motion(geometry, pose, velocity, acceleration)
    on_sliders, load = needed_forces(geometry, motion, parameters)
    total = load.wrench(motion.turn)
    for leg, point, force in zip(
        geometry.legs, motion.points, ca.vertsplit(on_sliders), strict=True
    ):
        total = total + ca.mtimes(ca.mtimes(point.matrix.T, leg.d_bar), force)
    return total


def needed_forces(
    geometry: Geometry, motion: PlatformMotion, parameters: Expression
) -> tuple[Expression, Load]:
    """Return the forces that motion and gravity need on the sliders (n, K), and on the platform."""
    bodies, platform = split(parameters, len(geometry.legs))
    carried = carried_inertia(geometry, platform, [leg.lower.m for leg in bodies])
    load = platform_load(geometry, motion, carried)
    on_sliders = []
    for i, (leg, inertia) in enumerate(zip(geometry.legs, bodies, strict=True)):
        state = leg_motion(leg, motion.points[i])
        on_slider, on_point = leg_forces(leg, state, geometry.gravity, inertia)
        on_sliders.append(on_slider)
        load = load + Load.at_point(geometry, i, on_point)
    return ca.vertcat(*on_sliders), load


def leg_forces(
    leg: LegGeometry, motion: LegMotion, gravity: Expression, bodies: LegInertia
) -> tuple[Expression, Expression]:
    """Return the force that a leg needs on its slider (1, K) and on its platform point (3, K).

    The moments of the links act through theta_u and theta_l, whose rows with respect to u turn
    them into a force tau; as u' is the part of c' - e rho' in the plane, tau acts on the point and
    -e . tau on the slider. The mass of the lower link is left to the platform.
    """
    at, upper, lower = motion.position, bodies.upper, bodies.lower
    # a - g in the leg's plane, on R1 (a = rho'' e) and on R3 (a = c'' = u'' + rho'' e there).
    a_slider = motion.slider_acceleration * leg.e_plane - ca.mtimes(leg.plane.T, gravity)
    a_point = a_slider + motion.closing_acceleration

    h, dh = link_moments(leg, at.l_u, leg.lu, upper)
    turning = turning_force(h, dh, motion.upper_rate**2, motion.upper_acceleration)
    upper_moment = moment(dh, upper.i, a_slider, motion.upper_acceleration)
    along_slider = motion.slider_acceleration - ca.dot(leg.e, gravity)

    h, dh = link_moments(leg, at.l_l, leg.ll, lower)
    lower_moment = moment(dh, lower.i, a_point, motion.lower_acceleration)
    tau = ca.mtimes(at.upper_row, upper_moment) + ca.mtimes(at.lower_row, lower_moment)
    on_slider = (bodies.slider + upper.m) * along_slider + ca.mtimes(leg.e_plane.T, turning - tau)
    on_point = tau + turning_force(h, dh, motion.lower_rate**2, motion.lower_acceleration)
    return on_slider, ca.mtimes(leg.plane, on_point)


def carried_inertia(geometry: Geometry, platform: Inertia, masses: list[Expression]) -> Inertia:
    """Return the platform's inertia with the lower links' masses placed on its points."""
    s0 = ca.horzcat(*(leg.s0 for leg in geometry.legs))
    x, y = s0[0, :].T, s0[1, :].T
    return Inertia(
        platform.m + weighted_sum(ca.SX.ones(len(masses)), masses),
        platform.hx + weighted_sum(x, masses),
        platform.hy + weighted_sum(y, masses),
        platform.i + weighted_sum(x * x + y * y, masses),
    )


def platform_load(geometry: Geometry, motion: PlatformMotion, inertia: Inertia) -> Load:
    """Return what the platform itself needs, -F_e."""
    a_p = motion.acceleration - geometry.gravity
    force = ca.mtimes(a_p, inertia.m)
    if motion.turn is None:
        return Load.of(force)
    turn = motion.turn
    h0, dh0 = resting_moment(geometry, inertia)
    return Load(
        force + turn.cosine_acceleration * h0 + turn.sine_acceleration * dh0,
        ca.mtimes(a_p.T, dh0),
        -ca.mtimes(a_p.T, h0),
        motion.angular_acceleration * inertia.i,
    )
