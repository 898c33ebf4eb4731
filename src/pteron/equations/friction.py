"""Viscous friction in the passive joints, as forces that it asks of the actuators."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.equations.machine import Machine, State
from pteron.manipulator import Manipulator


def passive_friction(machine: Machine, state: State) -> Expression:
    """Return, for a unit coefficient in each passive joint, the actuator forces (n, columns).

    By virtual work: a joint at the rate q' with the coefficient c needs J^T F = c (dq'/dx')^T q'.
    Columns are the passive joints of leg 1 that turn by the motion of its point, of leg 2, ...;
    under a platform that turns one more follows, for all joints about its axis: they turn alike, at
    phi', so that only the sum of their coefficients acts.
    """
    columns = []
    for i, k in _turning(state):
        joint = state.legs[i].chain[k]
        row = ca.mtimes(joint.row, state.platform.matrices[i])
        columns.append(ca.mtimes(row.T, joint.rate))
    if state.platform.angle is not None:
        columns.append(ca.vertcat(ca.SX(3, 1), state.platform.angle.rate))
    forces = [machine.closure.forces(load, state.platform, state.legs) for load in columns]
    return ca.horzcat(*forces)


@lru_cache(maxsize=64)
def passive_joints(robot: Manipulator) -> tuple[tuple[int, int], ...]:
    """Return the leg and the number in its chain, both from 1, of each column but the last."""
    machine = Machine.of(robot)
    state = machine.state(ca.SX.sym("pose", machine.freedom))
    return tuple((i + 1, k) for i, k in _turning(state))


def _turning(state: State) -> list[tuple[int, int]]:
    """Return leg and place in its chain of the passive joints that their point's motion turns."""
    return [
        (i, k)
        for i, leg in enumerate(state.legs)
        for k, joint in enumerate(leg.chain)
        if k > 0 and not joint.row[:3].is_zero()
    ]
