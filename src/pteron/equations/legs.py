"""A leg: what its slider and its links do when its platform point moves."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from pteron.equations.circles import link_vectors
from pteron.equations.geometry import Expression, LegGeometry
from pteron.equations.platforms import PointMotion


def slider_coordinate(leg: LegGeometry, c: Expression) -> Expression:
    """Return rho, Eq. (4)."""
    return ca.dot(leg.d_bar, c - leg.r)


def closing_vector(leg: LegGeometry, c: Expression) -> Expression:
    """Return u, from R1 to R3 in the leg's plane, Eq. (5)."""
    return ca.mtimes(leg.plane_rows, c - leg.r)


@dataclass(frozen=True)
class LegPosition:
    """The links of a leg, in its plane, and how their angles follow u."""

    l_u: Expression
    l_l: Expression
    upper_row: Expression
    """d theta_u / d u = l_l / D."""
    lower_row: Expression
    """d theta_l / d u = -l_u / D."""


@dataclass(frozen=True)
class LegMotion:
    """Rates and accelerations of a leg's slider and of its two links."""

    position: LegPosition
    closing_acceleration: Expression
    """u''."""
    slider_rate: Expression
    upper_rate: Expression
    lower_rate: Expression
    slider_acceleration: Expression
    upper_acceleration: Expression
    lower_acceleration: Expression


def leg_position(leg: LegGeometry, c: Expression) -> LegPosition:
    """Return the links of a leg whose platform point is at c."""
    l_u, l_l, inverse_d = link_vectors(leg, closing_vector(leg, c))
    return LegPosition(l_u, l_l, l_l * inverse_d, -(l_u * inverse_d))


def leg_motion(leg: LegGeometry, point: PointMotion) -> LegMotion:
    """Return how a leg follows its platform point, to second order.

    theta_u' = l_l . u' / D and theta_l' = -l_u . u' / D. Differentiated, and with l_l . l_l = ll^2,
    theta_u'' = l_l . v / D and theta_l'' = -l_u . v / D, v = u'' + theta_u'^2 l_u + theta_l'^2 l_l.
    """
    at = leg_position(leg, point.position)
    slider_rate = ca.dot(leg.d_bar, point.velocity)
    slider_acceleration = ca.dot(leg.d_bar, point.acceleration)
    du = ca.mtimes(leg.plane_rows, point.velocity)
    ddu = ca.mtimes(leg.plane_rows, point.acceleration)
    upper_rate, lower_rate = ca.dot(at.upper_row, du), ca.dot(at.lower_row, du)
    v = ddu + (upper_rate * upper_rate) * at.l_u + (lower_rate * lower_rate) * at.l_l
    return LegMotion(
        at,
        ddu,
        slider_rate,
        upper_rate,
        lower_rate,
        slider_acceleration,
        ca.dot(at.upper_row, v),
        ca.dot(at.lower_row, v),
    )


def point_rows(leg: LegGeometry, at: LegPosition) -> tuple[Expression, Expression, Expression]:
    """Return the rows d rho / dc, d theta_u / dc and d theta_l / dc, as three-vectors."""
    across = leg.plane_rows.T
    return leg.d_bar, ca.mtimes(across, at.upper_row), ca.mtimes(across, at.lower_row)
