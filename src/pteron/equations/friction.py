"""Viscous friction in the passive joints: the actuator forces that it needs, by virtual work."""

from __future__ import annotations

from functools import lru_cache
from typing import Literal, NamedTuple

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.equations.machine import Machine, State
from pteron.manipulator import Manipulator


class PassiveJoint(NamedTuple):
    """The passive joint of a column of `passive_friction`."""

    leg: int | None
    """Number of its leg, from 1; None for joints of several legs about the platform's axis."""
    number: int
    """Its index in the leg's chain, from 0."""
    kind: Literal["P", "R"]


def passive_friction(machine: Machine, state: State) -> Expression:
    """Return actuator forces (n, columns) for a unit friction coefficient in each passive joint.

    By virtual work, a joint with the rate q' and the coefficient c needs J^T F = c (dq'/dx')^T q'.
    The columns are the passive joints of leg 1 that move with its platform point, those of leg 2
    and so on; one last column is for all joints that turn with the platform alone: they share its
    rate, so that only the sum of their coefficients matters.
    """
    columns = []
    for joint in _moving_passive_joints(state):
        if joint.leg is None:
            rows = [(turn.row, turn.rate) for turn in state.platform.rotation.turns]
            at_p = state.platform.matrix.T
            load = sum(ca.mtimes(at_p, row.T) * rate for row, rate in rows)
        else:
            passive = state.legs[joint.leg - 1].chain[joint.number]
            row = ca.mtimes(passive.row, state.platform.matrices[joint.leg - 1])
            load = ca.mtimes(row.T, passive.rate)
        columns.append(load)
    return machine.closure.forces(ca.horzcat(*columns), state.platform, state.legs)


@lru_cache(maxsize=64)
def passive_joints(robot: Manipulator) -> tuple[PassiveJoint, ...]:
    """Return the passive joint that each column of `passive_friction` belongs to."""
    machine = Machine.numeric(robot)
    return _moving_passive_joints(machine.state(ca.SX.sym("pose", machine.freedom)))


def _moving_passive_joints(state: State) -> tuple[PassiveJoint, ...]:
    """Return the passive joints that move; all that turn with the platform alone count as one."""
    passive, turning = [], []
    for i, leg in enumerate(state.legs, start=1):
        for k, joint in enumerate(leg.chain):
            if joint.driven:
                continue
            if not joint.row[:3].is_zero():
                passive.append(PassiveJoint(i, k, joint.kind))
            elif not joint.row[3:].is_zero():
                turning.append(PassiveJoint(None, k, joint.kind))
    return (*passive, *turning[:1])
