"""Joint screws and the reciprocal wrench, Eqs. (8) to (10): a second derivation of the Jacobian.

A screw is (omega, v), the velocity v being that of the body's point at P.
"""

from __future__ import annotations

import casadi as ca

from pteron.equations.geometry import Expression, Geometry
from pteron.equations.legs import leg_position
from pteron.equations.position import platform_at


def joint_screws(geometry: Geometry, pose: Expression) -> list[Expression]:
    """Return the unit screws of P, R1, R2, R3 and R4 of every leg, as columns (6, 5), Eq. (8).

    Where d is parallel to k, R4 coincides with R3. A 3T leg has no R4: (6, 4).
    """
    p = pose[0:3]
    screws = []
    for leg, point in zip(geometry.legs, platform_at(geometry, pose).points, strict=True):
        at = leg_position(leg, point.position)
        s = point.position - p
        columns = [ca.vertcat(ca.SX.zeros(3), leg.e)]
        for axis, through in (
            (leg.d, s - ca.mtimes(leg.plane, at.l_u + at.l_l)),
            (leg.d, s - ca.mtimes(leg.plane, at.l_l)),
            (leg.d, s),
            (geometry.k, s),
        ):
            columns.append(ca.vertcat(axis, ca.cross(through, axis)))
        screws.append(ca.horzcat(*columns[: 5 if geometry.turns else 4]))
    return screws


def reciprocal_wrench(geometry: Geometry, pose: Expression, i: int) -> Expression:
    """Return ((s x d), d), a force along d through the platform point of leg i.

    Its power on a screw (omega, v) is (s x d) . omega + d . v, which vanishes for R1 to R4.
    """
    point = platform_at(geometry, pose).points[i]
    d = geometry.legs[i].d
    return ca.vertcat(ca.cross(point.position - pose[0:3], d), d)


def jacobian_by_screws(geometry: Geometry, pose: Expression) -> Expression:
    """Return J (n, m) by screws: the wrench's power on the platform's twist over that on P."""
    twists = ca.vertcat(
        ca.horzcat(ca.SX.zeros(3, 3), *([geometry.k] if geometry.turns else [])),
        ca.horzcat(ca.SX.eye(3), *([ca.SX.zeros(3)] if geometry.turns else [])),
    )
    rows = []
    for i, screws in enumerate(joint_screws(geometry, pose)):
        wrench = reciprocal_wrench(geometry, pose, i)
        rows.append(ca.mtimes(wrench.T, twists) / ca.dot(wrench, screws[:, 0]))
    return ca.vertcat(*rows)
