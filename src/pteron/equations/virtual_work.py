"""Inverse dynamics by virtual work, Eqs. (13) and (14), in factored form.

Each leg answers to its platform point alone: its bodies' wrenches become a force on that point and
a force at its joint. So J_u and J_l of Eq. (13) are never multiplied out: they are their rows with
respect to (c, phi), times d(c, phi)/dx. Given one column of parameters this is the inverse
dynamics; given the identity matrix instead, the same lines return the regressor of Eq. (15).
"""

from __future__ import annotations

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.equations.machine import Machine, State
from pteron.platforms.motion import Load


def inverse_dynamics(
    machine: Machine, state: State, parameters: Expression, wrench: Expression | None = None
) -> Expression:
    """Return the actuator forces F_a (n, K) for the columns of parameters (N, K), Eq. (13).

    `wrench` (m, K) acts on the platform at P: a force and, for 3T1R, a moment about k.
    """
    joints, load = needed_forces(machine, state, parameters)
    if wrench is not None:
        load = load.plus(machine.platform.given(-wrench))
    return joints + machine.closure.forces(load, state.platform, state.legs)


def generalized_forces(machine: Machine, state: State, parameters: Expression) -> Expression:
    """Return M x'' + h (m, K), the forces of the motion in platform coordinates: J^T F_a."""
    joints, load = needed_forces(machine, state, parameters)
    total = machine.platform.wrench(load, state.platform)
    for leg, matrix, force in zip(
        state.legs, state.platform.matrices, ca.vertsplit(joints), strict=True
    ):
        total = total + ca.mtimes(ca.mtimes(matrix.T, leg.row.T / leg.divisor), force)
    return total


def needed_forces(machine: Machine, state: State, parameters: Expression) -> tuple[Expression, Load]:
    """Return the forces that motion and gravity need at the joints (n, K), and on the platform.

    The mass of a body whose reference point is a platform point may be given to either side, as it
    moves with both; the platform has it.
    """
    legs, inertia = machine.moments(parameters)
    platform = state.platform
    masses = []
    for leg, bodies in zip(state.legs, legs, strict=True):
        riding = [letter for letter, body in leg.bodies.items() if body.rides]
        masses.append(sum((bodies[letter].m for letter in riding), ca.SX(1, parameters.shape[1])))
        for letter in riding:
            bodies[letter] = bodies[letter]._replace(m=ca.SX(1, parameters.shape[1]))
    inertia = machine.platform.carrying(inertia, masses)
    load = machine.platform.needs(platform, machine.gravity, inertia)
    joints = []
    for i, (leg, bodies) in enumerate(zip(machine.legs, legs, strict=True)):
        needs = leg.needs(platform.points[i], platform.angle, machine.gravity, bodies)
        joints.append(needs.joint)
        load = load.plus(machine.platform.load(i, needs.point))
    return ca.vertcat(*joints), load
