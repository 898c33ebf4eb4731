"""A P-R-R-R leg whose masses sit at its joints: its forces, in the cheapest form known.

The lower link's m and m gamma_x are two masses at its ends, so they may join the upper link, the
slider and the platform; what is left of it is a moment of inertia I_l and the first moment across
the link. A leg's kinetic energy is then, but for masses that move with R1 and R3,

    T = I_u theta_u'^2 / 2  +  I_l theta_l'^2 / 2  -  eta D theta_u' theta_l',

D = (l_u x l_l) . d and eta = m gamma_y / ll of the lower link. The coupling's two moments are eta
times D theta_l'' + C theta_l'^2 and D theta_u'' - C theta_u'^2, C = l_u . l_l, which the closure of
the links turns into products of what is known:

    D theta_l'' + C theta_l'^2 = -(l_u . u'' + lu^2 theta_u'^2),
    D theta_u'' - C theta_u'^2 =   l_l . u'' + ll^2 theta_l'^2.

The tests hold these forces against those of the bodies in motion.
"""

from __future__ import annotations

import casadi as ca

from pteron.bodies.motion import Expression, Moments
from pteron.legs.circles import quarter_turn


def two_bar_needs(
    lu: Expression,
    ll: Expression,
    sigma: Expression,
    u: list[Expression],
    on_slider: Expression,
    upper: Moments,
    lower: Moments,
) -> tuple[Expression, Expression, Expression]:
    """Return tau, the upper and lower link's h'' and what they need across R3, each (2, K).

    `u` is u, u' and u''; `on_slider` is the slider's acceleration less gravity in the plane. The
    lower link's m gamma_x must be zero; its mass, and the upper link's, are left out.
    """
    u, du, ddu = u
    n2, lu2, ll2 = ca.dot(u, u), lu * lu, ll * ll
    c = 0.5 * n2 - 0.5 * (lu2 + ll2)
    root = ca.sqrt(lu2 * ll2 - c * c)
    l_u = (0.5 + (0.5 * (lu2 - ll2)) / n2) * u + sigma * ((root / n2) * quarter_turn(u))
    l_l = u - l_u
    inverse_d = -sigma / root

    # theta_l is counted backwards: its row is then l_u / D, without a sign.
    upper_rate2 = (ca.dot(l_l, du) * inverse_d) ** 2
    lower_rate2 = (ca.dot(l_u, du) * inverse_d) ** 2
    along_upper = ca.dot(l_u, ddu) + lu2 * upper_rate2
    along_lower = ca.dot(l_l, ddu) + ll2 * lower_rate2
    upper_acceleration = (along_lower + c * upper_rate2) * inverse_d
    lower_acceleration = (along_upper + c * lower_rate2) * inverse_d

    h, dh = first_moment(l_u, upper.hx / lu, upper.hy / lu)
    eta = lower.hy / ll
    upper_moment = (
        ca.mtimes(on_slider.T, dh) + upper.i * upper_acceleration + eta * along_upper
    )
    lower_moment = lower.i * lower_acceleration + eta * (along_lower + ca.dot(on_slider, l_l))
    tau = ca.mtimes(l_l, upper_moment * inverse_d) + ca.mtimes(l_u, lower_moment * inverse_d)
    turning = second_derivative(h, dh, upper_rate2, upper_acceleration)
    h, dh = ca.mtimes(quarter_turn(l_l), eta), -ca.mtimes(l_l, eta)
    turning = turning + second_derivative(h, dh, lower_rate2, -lower_acceleration)
    return tau, turning, ca.SX(2, eta.shape[1])


def first_moment(
    vector: Expression, hx: Expression, hy: Expression
) -> tuple[Expression, Expression]:
    """Return h = vector hx + (d x vector) hy and d x h, each (2, K)."""
    turned = quarter_turn(vector)
    return (
        ca.mtimes(vector, hx) + ca.mtimes(turned, hy),
        ca.mtimes(turned, hx) - ca.mtimes(vector, hy),
    )


def second_derivative(
    h: Expression, dh: Expression, rate2: Expression, acceleration: Expression
) -> Expression:
    """Return h'' = theta'' d x h - theta'^2 h of a vector h that turns in the plane."""
    return acceleration * dh - rate2 * h
