"""Joint screws, Eq. (8): a wrench reciprocal to the passive ones gives the Jacobian again.

A screw is (omega, v), the velocity v being that of the body's point at P.
"""

from __future__ import annotations

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.equations.machine import State


def joint_screws(state: State) -> list[Expression]:
    """Return the unit screws of every leg's joints, from the base to the platform, as columns.

    Each is (6, j), Eq. (8); NaN for a joint that a leg has not. Where d is parallel to k, R4 of a
    P-R-R-R leg coincides with R3.
    """
    p = state.platform.body.position
    longest = max(len(leg.chain) for leg in state.legs)
    screws = []
    for leg in state.legs:
        columns = []
        for joint in leg.chain:
            if joint.kind == "P":
                columns.append(ca.vertcat(ca.SX(3, 1), joint.axis))
            else:
                columns.append(ca.vertcat(joint.axis, ca.cross(joint.point - p, joint.axis)))
        screws.append(ca.horzcat(*columns, ca.SX.nan(6, longest - len(columns))))
    return screws
