"""Velocity: the input-output Jacobian, Eq. (10), and the link Jacobians, Eqs. (11) and (12)."""

from __future__ import annotations

import casadi as ca

from pteron.equations.geometry import Expression, Geometry
from pteron.equations.legs import leg_position, point_rows
from pteron.equations.position import platform_at


def jacobian(geometry: Geometry, pose: Expression) -> Expression:
    """Return J (n, m), Eq. (10): row i is d_bar^T C_i = [ d_bar^T | d_bar . (k x s) ]."""
    points = platform_at(geometry, pose).points
    return ca.vertcat(
        *(
            ca.mtimes(leg.d_bar.T, point.matrix)
            for leg, point in zip(geometry.legs, points, strict=True)
        )
    )


def link_jacobians(
    geometry: Geometry, pose: Expression
) -> tuple[list[Expression], list[Expression]]:
    """Return J_u and J_l of every leg, each (6, m): rows v, then omega; Eqs. (11) and (12).

    Upper link, reference point on R1: v = rho' e, omega = theta_u' d. Lower link, reference point
    on R3 (the platform's end): v = c', omega = theta_l' d.
    """
    points = platform_at(geometry, pose).points
    upper, lower = [], []
    for leg, point in zip(geometry.legs, points, strict=True):
        slider, upper_row, lower_row = point_rows(leg, leg_position(leg, point.position))
        matrix = point.matrix
        upper.append(
            ca.mtimes(ca.vertcat(ca.mtimes(leg.e, slider.T), ca.mtimes(leg.d, upper_row.T)), matrix)
        )
        lower.append(ca.mtimes(ca.vertcat(ca.SX.eye(3), ca.mtimes(leg.d, lower_row.T)), matrix))
    return upper, lower
