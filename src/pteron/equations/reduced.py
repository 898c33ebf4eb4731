"""The cheapest inverse dynamics: a leg as a two-bar whose masses sit at its joints.

The lower link's m and m gamma_x are two masses at its ends, so they join the upper link, the slider
and the platform; what is left of it is a moment of inertia I_l and the first moment across the
link. A leg's kinetic energy is then, but for masses that move with R1 and R3,

    T = I_u theta_u'^2 / 2  +  I_l theta_l'^2 / 2  -  eta D theta_u' theta_l',

D = (l_u x l_l) . d and eta = m gamma_y / ll of the lower link. The coupling's two moments are eta
times D theta_l'' + C theta_l'^2 and D theta_u'' - C theta_u'^2, C = l_u . l_l, which the closure of
the links turns into products of what is known:

    D theta_l'' + C theta_l'^2 = -(l_u . u'' + lu^2 theta_u'^2),
    D theta_u'' - C theta_u'^2 =   l_l . u'' + ll^2 theta_l'^2.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from pteron.equations.bodies import Inertia, first_moment, split, turning_force
from pteron.equations.circles import quarter_turn
from pteron.equations.closure import Load, actuator_forces
from pteron.equations.geometry import Expression, Geometry, LegGeometry
from pteron.equations.legs import closing_vector
from pteron.equations.platforms import PointMotion, platform_motion
from pteron.equations.virtual_work import platform_load


class ReducedLeg(NamedTuple):
    """What is left of a leg's inertia, each a row (1, K); zero where it joins others."""

    slider: Expression
    """Mass that moves with the slider; where e = d, with `point` added."""
    point: Expression
    """Mass at the platform point."""
    upper_inertia: Expression
    upper_x: Expression
    """First moment of the upper link along it, over its length, times `weight`."""
    upper_y: Expression
    """First moment of the upper link across it, likewise."""
    lower_inertia: Expression
    lower_y: Expression
    """eta: first moment of the lower link across it, over its length."""


def reduced_inertia(geometry: Geometry, parameters: Expression) -> tuple[list[ReducedLeg], Inertia]:
    """Return what P (N, K) is to the reduced model; the rows m gamma_x of the lower links are zero.

    It is linear in P, one number for each row that is not zero.
    """
    bodies, platform = split(parameters, len(geometry.legs))
    legs = []
    for leg, (slider, upper, lower) in zip(geometry.legs, bodies, strict=True):
        scale = weight(leg, geometry.gravity) / leg.lu
        legs.append(
            ReducedLeg(
                slider + upper.m + (lower.m if aligned(leg) else 0),
                lower.m,
                upper.i,
                upper.hx * scale,
                upper.hy * scale,
                lower.i,
                lower.hy / leg.ll,
            )
        )
    return legs, platform


def reduced_dynamics(
    geometry: Geometry,
    pose: Expression,
    velocity: Expression,
    acceleration: Expression,
    legs: list[ReducedLeg],
    platform: Inertia,
    wrench: Expression | None = None,
) -> Expression:
    """Return the actuator forces (n, K) for what `reduced_inertia` returns."""
    motion = platform_motion(geometry, pose, velocity, acceleration)
    load = platform_load(geometry, motion, platform)
    if wrench is not None:
        load = load + Load.of(-wrench)
    on_sliders = []
    for i, (leg, inertia) in enumerate(zip(geometry.legs, legs, strict=True)):
        on_slider, on_point = leg_forces(leg, motion.points[i], geometry.gravity, inertia)
        on_sliders.append(on_slider)
        load = load + Load.at_point(geometry, i, on_point)
    return ca.vertcat(*on_sliders) + actuator_forces(geometry, load, motion.turn)


def leg_forces(
    leg: LegGeometry, point: PointMotion, gravity: Expression, inertia: ReducedLeg
) -> tuple[Expression, Expression]:
    """Return the force that a leg needs on its slider (1, K) and on its platform point (3, K)."""
    u = closing_vector(leg, point.position)
    du, ddu = (ca.mtimes(leg.plane_rows, v) for v in (point.velocity, point.acceleration))
    sliding = ca.dot(leg.d_bar, point.acceleration)
    a_slider = sliding * leg.e_plane - ca.mtimes(leg.plane.T, gravity)

    n2, lu2, ll2 = ca.dot(u, u), leg.lu * leg.lu, leg.ll * leg.ll
    c = 0.5 * n2 - 0.5 * (lu2 + ll2)
    root = ca.sqrt(lu2 * ll2 - c * c)
    l_u = (0.5 + (0.5 * (lu2 - ll2)) / n2) * u + leg.sigma * ((root / n2) * quarter_turn(u))
    l_l = u - l_u
    inverse_d = -leg.sigma / root

    # theta_l is counted backwards: its row is then l_u / D, without a sign.
    upper_rate2 = (ca.dot(l_l, du) * inverse_d) ** 2
    lower_rate2 = (ca.dot(l_u, du) * inverse_d) ** 2
    along_upper = ca.dot(l_u, ddu) + lu2 * upper_rate2
    along_lower = ca.dot(l_l, ddu) + ll2 * lower_rate2
    upper_acceleration = (along_lower + c * upper_rate2) * inverse_d
    lower_acceleration = (along_upper + c * lower_rate2) * inverse_d

    _, dh = first_moment(l_u, quarter_turn(l_u), inertia.upper_x, inertia.upper_y)
    down = ca.mtimes((a_slider / weight(leg, gravity)).T, dh)
    upper_moment = down + inertia.upper_inertia * upper_acceleration + inertia.lower_y * along_upper
    lower_moment = inertia.lower_inertia * lower_acceleration + inertia.lower_y * (
        along_lower + ca.dot(a_slider, l_l)
    )
    tau = ca.mtimes(l_l, upper_moment * inverse_d) + ca.mtimes(l_u, lower_moment * inverse_d)
    on_point = tau + ca.mtimes(a_slider + ddu, inertia.point)
    on_slider = inertia.slider * (-ca.dot(leg.e, gravity) + sliding)
    if not aligned(leg):
        h, dh = first_moment(l_u, quarter_turn(l_u), inertia.upper_x, inertia.upper_y)
        turning = turning_force(h, dh, upper_rate2, upper_acceleration)
        h, dh = ca.mtimes(quarter_turn(l_l), inertia.lower_y), -ca.mtimes(l_l, inertia.lower_y)
        turning = turning + turning_force(h, dh, lower_rate2, -lower_acceleration)
        on_slider = on_slider + ca.mtimes(leg.e_plane.T, turning - tau)
        share = ca.dot(leg.d, leg.e)
        on_slider = on_slider + share * (share * sliding - ca.dot(leg.d, gravity)) * inertia.point
    return on_slider, ca.mtimes(leg.plane, on_point)


def aligned(leg: LegGeometry) -> bool:
    """Return whether the slider moves along d, so that the leg's plane does not accelerate."""
    return bool(leg.e_plane.is_zero())


def weight(leg: LegGeometry, gravity: Expression) -> Expression:
    """Return gravity in the leg's plane where it is one constant component, or 1."""
    components = [
        value for value in ca.vertsplit(ca.mtimes(leg.plane.T, gravity)) if not value.is_zero()
    ]
    fit = aligned(leg) and len(components) == 1 and components[0].is_constant()
    return components[0] if fit else ca.SX(1)
