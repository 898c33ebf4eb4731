"""Viscous friction in the passive joints, as forces that it asks of the actuators."""

from __future__ import annotations

import casadi as ca

from pteron.equations.closure import Load, actuator_forces
from pteron.equations.geometry import Expression, Geometry
from pteron.equations.legs import leg_motion, point_rows
from pteron.equations.platforms import platform_motion

_PARALLEL = 1.0 - 1e-12
"""Cosine between d and k above which R3 and R4 of a leg are one joint."""


def passive_friction(geometry: Geometry, pose: Expression, velocity: Expression) -> Expression:
    """Return, for a unit coefficient in each passive joint, the actuator forces (n, 3 n + 1).

    By virtual work: a joint at the rate q' with the coefficient c needs J^T F = c (dq'/dx')^T q'.
    Columns are R1, R2 and R3 of leg 1, of leg 2, ...; for 3T1R one more follows, for all R4: they
    turn alike, at phi', so that only the sum of their coefficients acts. Where d is parallel to k,
    R3 and R4 are one joint, at the column of R3.
    """
    motion = platform_motion(geometry, pose, velocity, ca.SX.zeros(geometry.freedom))
    turn_rate = velocity[3] if geometry.turns else ca.SX(0)
    columns = []
    for i, (leg, point) in enumerate(zip(geometry.legs, motion.points, strict=True)):
        state = leg_motion(leg, point)
        _, upper, lower = point_rows(leg, state.position)
        along = ca.dot(leg.d, geometry.k)
        sense = ca.if_else(ca.fabs(along) > _PARALLEL, along, 0) if geometry.turns else ca.SX(0)
        joints = (
            (state.upper_rate, upper, 0),
            (state.lower_rate - state.upper_rate, lower - upper, 0),
            (sense * turn_rate - state.lower_rate, -lower, sense),
        )
        for rate, row, share in joints:
            load = Load.at_point(geometry, i, row * rate)
            columns.append(load + _moment(geometry, share * rate))
    if geometry.turns:
        columns.append(_moment(geometry, turn_rate))
    forces = (actuator_forces(geometry, load, motion.turn) for load in columns)
    return ca.horzcat(*forces)


def _moment(geometry: Geometry, moment: Expression) -> Load:
    """Return the load of a moment about k."""
    wrench = ca.SX.zeros(geometry.freedom)
    if geometry.turns:
        wrench[3] = moment
    return Load.of(wrench)
