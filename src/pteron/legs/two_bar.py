"""The required forces of the two links of a P-R-R-R leg, in the cheapest form known.

The lower link's m and m gamma_x are two masses at its ends, so they may join the upper link, the
slider and the platform; a moment of inertia I_l and the first moment normal to the link, m gamma_y,
remain. With links l_u + l_l = u, a leg's kinetic energy is then, except for masses that move with
its first and last revolute joint, R1 and R3,

    T = I_u theta_u'^2 / 2  +  I_l theta_l'^2 / 2  -  eta D theta_u' theta_l',

D = (l_u x l_l) . d and eta = m gamma_y / ll of the lower link. The coupling's two moments are eta
times D theta_l'' + C theta_l'^2 and D theta_u'' - C theta_u'^2, C = l_u . l_l, which the closure of
the links turns into products of known terms:

    D theta_l'' + C theta_l'^2 = -(l_u . u'' + lu^2 theta_u'^2),
    D theta_u'' - C theta_u'^2 =   l_l . u'' + ll^2 theta_l'^2.
"""

from __future__ import annotations

from typing import Protocol

import casadi as ca

from pteron.bodies.motion import Expression, Moments
from pteron.legs.circles import quarter_turn


class TwoBar(Protocol):
    """The attributes of a leg's equations that `two_bar_needs` uses."""

    lu: Expression
    ll: Expression
    sigma: Expression
    e_plane: Expression
    """e in the axes of the leg's plane, (2, 1)."""
    aligned: bool
    """Whether e is along d, so that sliding moves nothing in the plane."""


def two_bar_needs(
    leg: TwoBar,
    u: list[Expression],
    sliding: Expression,
    gravity: Expression,
    inertia: tuple[Moments, Moments],
) -> tuple[Expression, Expression]:
    """Return the links' required forces along the slider, (1, K), and at joint R3, (2, K).

    `u` is u, u' and u'', `sliding` is rho'', `gravity` is gravity in the leg's plane. The lower
    link's m gamma_x must be zero; both links' masses are not included.
    """
    u, du, ddu = u
    upper, lower = inertia
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

    # Both first moments are h = x l_u + v d x l_u + eta d x u; `slide_vector` and `gravity_vector`
    # are the projections of e and gravity on the part that turns with the upper link.
    eta, x = lower.hy / leg.ll, upper.hx / leg.lu
    v = upper.hy / leg.lu - eta
    turned = quarter_turn(l_u)
    slide_vector, gravity_vector = (
        ca.mtimes(vector, x) - ca.mtimes(quarter_turn(vector), v)
        for vector in (leg.e_plane, gravity)
    )
    along_e, across_e = ca.mtimes(l_u.T, slide_vector), ca.mtimes(turned.T, slide_vector)
    upper_moment = (
        upper.i * upper_acceleration
        + eta * along_upper
        + sliding * across_e
        - ca.mtimes(turned.T, gravity_vector)
    )
    lower_moment = lower.i * lower_acceleration + eta * along_lower
    tau = (
        ca.mtimes(l_l, upper_moment * inverse_d)
        + ca.mtimes(l_u, lower_moment * inverse_d)
        - ca.mtimes(quarter_turn(sliding * leg.e_plane - gravity), eta)
    )
    if leg.aligned:
        return ca.SX(1, eta.shape[1]), tau
    turning = ca.mtimes(quarter_turn(ddu), eta) - tau
    swinging = upper_acceleration * across_e - upper_rate2 * along_e
    return ca.mtimes(leg.e_plane.T, turning) + swinging, tau
