"""Inverse dynamics by virtual work, Eq. (13), in factored form.

The required wrenches of a leg's bodies become a force at its joint and a load at its platform
point, by rows in (c', omega), the velocity of that point and the platform's angular velocity; J_u
and J_l of Eq. (13) are never multiplied out. The paper's F_b acts on a body; forces here are those
required to move it, -F_b. One column of parameters gives the inverse dynamics, the identity matrix
the regressor.
"""

from __future__ import annotations

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.equations.machine import Machine, State
from pteron.legs.leg import Needs


def inverse_dynamics(
    machine: Machine,
    state: State,
    parameters: Expression,
    wrench: Expression | None = None,
    *,
    carried: bool = True,
) -> Expression:
    """Return the actuator forces F_a (n, K) of a state for parameter columns (N, K), Eq. (13).

    `wrench` acts on the platform at P: a force and, if it turns, a moment about k, (m, K); force
    and moment, (6, K), if it tilts. With `carried`, masses at platform points, which move with leg
    and platform, are computed with the platform.
    """
    joints, load = needed_forces(machine, state, parameters, carried)
    if wrench is not None:
        load = load - machine.platform.generalized_forces(state.platform, wrench)
    forces = machine.closure.forces(load, state.platform, state.legs)
    return joints + forces  # Eq. (13), Contribution 2, Section 4


def generalized_forces(machine: Machine, state: State, parameters: Expression) -> Expression:
    """Return the generalized inertia, Coriolis and gravity forces M x'' + h (m, K) of a state."""
    joints, total = needed_forces(machine, state, parameters)
    for leg, matrix, force in zip(
        state.legs, state.platform.matrices, ca.vertsplit(joints), strict=True
    ):
        total = total + ca.mtimes(ca.mtimes(matrix.T, leg.row.T / leg.divisor), force)
    return state.platform.pose_forces(total)


def needed_forces(
    machine: Machine, state: State, parameters: Expression, carried: bool = True
) -> tuple[Expression, Expression]:
    """Return the forces required at the joints (n, K) and at the platform (m, K) of a state.

    The platform's forces are along its quasi-velocities, which are the pose's rates unless it
    tilts.
    """
    legs, inertia = machine.moments(parameters)
    platform = state.platform
    needs = [
        leg.needs(point, platform.rotation, machine.gravity, bodies)
        if bodies
        else Needs.zeros(parameters.shape[1])
        for leg, point, bodies in zip(machine.legs, platform.points, legs, strict=True)
    ]
    if carried:
        inertia = machine.platform.add_point_masses(inertia, [leg.mass for leg in needs])
    else:
        trios = zip(machine.legs, platform.points, needs, strict=True)
        needs += [
            leg.point_mass_needs(point, machine.gravity, need.mass) for leg, point, need in trios
        ]
    load = machine.platform.needs(platform, machine.gravity, inertia)
    joints = ca.SX(len(machine.legs), parameters.shape[1])
    for k, need in enumerate(needs):
        i = k % len(machine.legs)
        load = load + ca.mtimes(platform.matrices[i].T, need.point)
        joints[i, :] = joints[i, :] + need.joint
    return joints, load
