"""Inverse dynamics by virtual work, Eq. (13), in factored form.

The required wrenches of a leg's bodies become a force at its joint and a load at its platform
point, by rows in (c', omega), the velocity of that point and the platform's angular velocity; J_u
and J_l of Eq. (13) are never multiplied out. The paper's F_b acts on a body; forces here are those
required to move it, -F_b. One column of parameters gives the inverse dynamics, the identity matrix
the regressor.
"""

from __future__ import annotations

from copy import copy

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.closures.closure import nan_below_zero
from pteron.equations.machine import Machine, State
from pteron.legs.leg import Needs

_WITHIN = 1e-9
"""Share of its limit by which a force may exceed it: rounding."""

_MISSED = 1e-6
"""Share of a load by which shared forces may miss it: rounding, also next to a singularity."""


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
    if machine.closure.is_redundant:  # all of it is shared out, not the platform's part alone
        joints, load = ca.SX(0), load + _platform_load(state, joints)
    forces = machine.closure.forces(load, state.platform, state.legs)
    return joints + forces  # Eq. (13), Contribution 2, Section 4


def rigid_forces(
    machine: Machine,
    state: State,
    parameters: Expression,
    wrench: Expression | None = None,
    *,
    carried: bool = True,
    drive_loads: Expression | None = None,
) -> Expression:
    """Return the actuator forces (n, 1) of a state, without those of the drives themselves.

    `drive_loads` (n, 1), friction and rotors, count for the drives' greatest forces. The
    force farthest beyond its limit is held there and the rest are solved again, n - m times; forces
    are NaN where that finds none within limits, which may exist all the same.
    """
    forces = inverse_dynamics(machine, state, parameters, wrench, carried=carried)
    return share_forces(machine, state, forces, drive_loads)


def share_forces(
    machine: Machine, state: State, forces: Expression, drive_loads: Expression | None = None
) -> Expression:
    """Return forces of least norm (n, 1) as the machine shares them: see `rigid_forces`."""
    reference = machine.reference
    if reference is not None:
        forces = forces + _internal_forces(machine, state, reference)
    if machine.greatest is None:
        return forces
    loads = ca.SX(len(machine.legs), 1) if drive_loads is None else drive_loads
    low, high = -machine.greatest - loads, machine.greatest - loads
    load, is_held = _platform_load(state, forces), ca.SX(0)
    for _ in range(len(machine.legs) - machine.freedom):
        excess = ca.fmax(low - forces, forces - high) / machine.closure.strengths
        is_held = ca.if_else(excess >= ca.fmax(ca.mmax(excess), _WITHIN), 1, is_held)
        held_forces = is_held * ca.fmin(ca.fmax(forces, low), high)
        free = held_forces if reference is None else held_forces + (1 - is_held) * reference
        closure = copy(machine.closure)
        closure.strengths = (1 - is_held) * machine.closure.strengths
        remainder = load - _platform_load(state, free)
        forces = free + closure.forces(remainder, state.platform, state.legs)
    beyond = ca.fmax(low - forces, forces - high) - _WITHIN * machine.greatest
    # Where too few forces are free, those that are found do not act as they should.
    missed = ca.fabs(_platform_load(state, forces) - load) - _MISSED * ca.norm_1(load)
    return forces + nan_below_zero(-ca.mmax(beyond)) + nan_below_zero(-ca.mmax(missed))


def _internal_forces(machine: Machine, state: State, reference: Expression) -> Expression:
    """Return the drive forces (n, 1), which move nothing, that a reference adds to the least."""
    felt = _platform_load(state, reference)
    return reference - machine.closure.forces(felt, state.platform, state.legs)


def _platform_load(state: State, joints: Expression) -> Expression:
    """Return the load J^T F (m, K) of joint forces (n, K) along the platform's quasi-velocities."""
    load = ca.SX(0)
    for leg, matrix, force in zip(
        state.legs, state.platform.matrices, ca.vertsplit(joints), strict=True
    ):
        load = load + ca.mtimes(ca.mtimes(matrix.T, leg.row.T / leg.divisor), force)
    return load


def generalized_forces(machine: Machine, state: State, parameters: Expression) -> Expression:
    """Return the generalized inertia, Coriolis and gravity forces M x'' + h (m, K) of a state."""
    joints, load = needed_forces(machine, state, parameters)
    return state.platform.pose_forces(load + _platform_load(state, joints))


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
