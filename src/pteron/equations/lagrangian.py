"""Mass matrix, Coriolis matrix, energies and forward dynamics, in platform coordinates x.

M x'' + C x' + g = J^T F + wrench, with h = C x' + g taken from `virtual_work`.
"""

from __future__ import annotations

import casadi as ca

from pteron.bodies import motion
from pteron.bodies.motion import Expression
from pteron.equations.kinematics import jacobian
from pteron.equations.machine import Machine, State
from pteron.equations.virtual_work import generalized_forces


def mass_matrix(machine: Machine, pose: Expression, parameters: Expression) -> Expression:
    """Return the mass matrix M (m, m) at a pose, for inertial parameters (N, 1).

    The mass of a body whose reference point is a platform point is added to the platform's.
    """
    legs, inertia = machine.moments(parameters)
    state = machine.state(pose)
    platform, none = state.platform, ca.SX(1, 1)
    point_masses = []
    for rides, bodies in zip((leg.rides for leg in machine.legs), legs, strict=True):
        point_masses.append(sum((bodies[k].m for k in rides), none))
        bodies |= {k: bodies[k]._replace(m=none) for k in rides}
    moments = machine.platform.add_point_masses(inertia, point_masses)
    total = machine.platform.mass_matrix(platform, moments)
    for leg, bodies, matrix in zip(state.legs, legs, platform.matrices, strict=True):
        at_c = sum(motion.mass_matrix(body, bodies[k]) for k, body in leg.bodies.items())
        total = total + ca.mtimes(matrix.T, ca.mtimes(at_c, matrix))
    return platform.pose_rows(platform.pose_forces(total))


def coriolis_matrix(
    machine: Machine, pose: Expression, velocity: Expression, parameters: Expression
) -> Expression:
    """Return the Coriolis matrix C (m, m) by Christoffel symbols: dM/dt - 2 C is skew-symmetric."""
    m = machine.freedom
    mass = mass_matrix(machine, pose, parameters)
    slopes = [ca.reshape(ca.jacobian(mass, pose[k]), m, m) for k in range(m)]
    rate = sum(slopes[k] * velocity[k] for k in range(m))
    tilt = ca.horzcat(*(ca.mtimes(slopes[k], velocity) for k in range(m)))
    return 0.5 * (rate + tilt - tilt.T)


def kinetic_energy(
    machine: Machine, pose: Expression, velocity: Expression, parameters: Expression
) -> Expression:
    """Return the kinetic energy x'^T M x' / 2, J."""
    return 0.5 * ca.bilin(mass_matrix(machine, pose, parameters), velocity, velocity)


def potential_energy(machine: Machine, pose: Expression, parameters: Expression) -> Expression:
    """Return the potential energy in gravity, J; zero for bodies at the base frame's origin."""
    legs, inertia = machine.moments(parameters)
    state = machine.state(pose)
    total = machine.platform.mass_moment(state.platform, inertia)
    for leg, bodies in zip(state.legs, legs, strict=True):
        total = total + sum(motion.mass_moment(body, bodies[k]) for k, body in leg.bodies.items())
    return -ca.dot(machine.gravity, total)


def forward_dynamics(
    machine: Machine,
    pose: Expression,
    velocity: Expression,
    forces: Expression,
    parameters: Expression,
    wrench: Expression,
) -> Expression:
    """Return the platform acceleration x'' (m, 1) with M x'' = J^T F + wrench - h."""
    state = machine.state(pose, velocity)
    bias = generalized_forces(machine, state, parameters)
    load = ca.mtimes(jacobian(state).T, forces) + generalized_wrench(machine, state, wrench) - bias
    return solve_positive_definite(mass_matrix(machine, pose, parameters), load)


def generalized_wrench(machine: Machine, state: State, wrench: Expression) -> Expression:
    """Return the generalized forces (m, 1) along the pose coordinates of a platform wrench."""
    return state.platform.pose_forces(machine.platform.generalized_forces(state.platform, wrench))


def solve_positive_definite(matrix: Expression, right: Expression) -> Expression:
    """Return the solution x of A x = b with a symmetric positive definite A, by L D L^T.

    CasADi's own `solve` on SX expressions loses two digits on these systems.
    """
    lower, pivots = ldl_factors(matrix)
    return substitute_backward(lower, substitute_forward(lower, right) / pivots)


def ldl_factors(matrix: Expression) -> tuple[Expression, Expression]:
    """Return L (n, n) and the diagonal (n, 1) of D with L D L^T = a positive definite matrix."""
    n = matrix.shape[0]
    lower = ca.SX.eye(n)
    pivots: list[Expression] = []
    for j in range(n):
        pivots.append(matrix[j, j] - sum(lower[j, k] ** 2 * pivots[k] for k in range(j)))
        for i in range(j + 1, n):
            partial_sum = sum(lower[i, k] * lower[j, k] * pivots[k] for k in range(j))
            lower[i, j] = (matrix[i, j] - partial_sum) / pivots[j]
    return lower, ca.vertcat(*pivots)


def substitute_forward(lower: Expression, right: Expression) -> Expression:
    """Return L^-1 B for a unit lower triangular L (n, n) and a matrix B."""
    rows: list[Expression] = []
    for i in range(lower.shape[0]):
        rows.append(right[i, :] - sum(lower[i, k] * rows[k] for k in range(i)))
    return ca.vertcat(*rows)


def substitute_backward(lower: Expression, right: Expression) -> Expression:
    """Return L^-T b (n, 1) for a unit lower triangular L (n, n) and a column b."""
    n = lower.shape[0]
    solution = [ca.SX(0)] * n
    for i in reversed(range(n)):
        solution[i] = right[i] - sum(lower[k, i] * solution[k] for k in range(i + 1, n))
    return ca.vertcat(*solution)
