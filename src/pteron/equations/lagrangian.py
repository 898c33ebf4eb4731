"""Mass matrix, Coriolis matrix, energies and forward dynamics, in platform coordinates.

M x'' + C x' + g = J^T F + wrench. The forces themselves come from `virtual_work`; only M and the
energies are written here.
"""

from __future__ import annotations

import casadi as ca

from pteron.equations.bodies import Inertia, link_moments, resting_moment, split
from pteron.equations.geometry import Expression, Geometry
from pteron.equations.jacobians import jacobian
from pteron.equations.legs import leg_position, point_rows, slider_coordinate
from pteron.equations.position import platform_at
from pteron.equations.virtual_work import carried_inertia, generalized_forces


def body_mass_matrix(
    v: Expression, omega: Expression, dh: Expression, inertia: Inertia
) -> Expression:
    """Return m V^T V + V^T (z x h) w + w^T (z x h)^T V + I w^T w, with V (3, m) and w (1, m)."""
    coupling = ca.mtimes(v.T, ca.mtimes(dh, omega))
    return (
        inertia.m * ca.mtimes(v.T, v)
        + coupling
        + coupling.T
        + inertia.i * ca.mtimes(omega.T, omega)
    )


def mass_matrix(geometry: Geometry, pose: Expression, parameters: Expression) -> Expression:
    """Return M (m, m): the sum of J_b^T M_b J_b over the bodies."""
    bodies, platform = split(parameters, len(geometry.legs))
    motion = platform_at(geometry, pose)
    carried = carried_inertia(geometry, platform, [leg.lower.m for leg in bodies])
    m = geometry.freedom
    v = ca.horzcat(ca.SX.eye(3), ca.SX(3, m - 3))
    if motion.turn is None:
        total = carried.m * ca.mtimes(v.T, v)
    else:
        h0, dh0 = resting_moment(geometry, carried)
        dh = motion.turn.cosine * dh0 - motion.turn.sine * h0
        total = body_mass_matrix(v, ca.horzcat(ca.SX(1, 3), 1), dh, carried)
    for leg, point, inertia in zip(geometry.legs, motion.points, bodies, strict=True):
        at = leg_position(leg, point.position)
        slider, upper_row, lower_row = point_rows(leg, at)
        upper, lower = inertia.upper, inertia.lower
        _, dh_u = link_moments(leg, at.l_u, leg.lu, upper)
        _, dh_l = link_moments(leg, at.l_l, leg.ll, lower)
        slides = upper._replace(m=inertia.slider + upper.m)
        rides = lower._replace(m=ca.SX(1, 1))
        at_point = body_mass_matrix(
            ca.mtimes(leg.e, slider.T), upper_row.T, ca.mtimes(leg.plane, dh_u), slides
        ) + body_mass_matrix(ca.SX.eye(3), lower_row.T, ca.mtimes(leg.plane, dh_l), rides)
        total = total + ca.mtimes(point.matrix.T, ca.mtimes(at_point, point.matrix))
    return total


def coriolis_matrix(
    geometry: Geometry, pose: Expression, velocity: Expression, parameters: Expression
) -> Expression:
    """Return C (m, m) of Christoffel's symbols, so that dM/dt - 2 C is skew-symmetric."""
    m = geometry.freedom
    mass = mass_matrix(geometry, pose, parameters)
    slopes = [ca.reshape(ca.jacobian(mass, pose[k]), m, m) for k in range(m)]
    rate = sum(slopes[k] * velocity[k] for k in range(m))
    tilt = ca.horzcat(*(ca.mtimes(slopes[k], velocity) for k in range(m)))
    return 0.5 * (rate + tilt - tilt.T)


def kinetic_energy(
    geometry: Geometry, pose: Expression, velocity: Expression, parameters: Expression
) -> Expression:
    """Return T = x'^T M x' / 2."""
    return 0.5 * ca.bilin(mass_matrix(geometry, pose, parameters), velocity, velocity)


def potential_energy(geometry: Geometry, pose: Expression, parameters: Expression) -> Expression:
    """Return V = - sum m g . (centre of mass), zero for bodies at the base frame's origin."""
    bodies, platform = split(parameters, len(geometry.legs))
    motion = platform_at(geometry, pose)
    carried = carried_inertia(geometry, platform, [leg.lower.m for leg in bodies])
    h0, dh0 = resting_moment(geometry, carried)
    h = h0 if motion.turn is None else motion.turn.cosine * h0 + motion.turn.sine * dh0
    moments = carried.m * pose[0:3] + h
    for i, leg in enumerate(geometry.legs):
        # The lower link's mass rides on the platform, at c = p + s; the part of s along k and, for
        # 3T, nothing else is missing from the platform's planar first moment.
        inertia, c = bodies[i], motion.points[i].position
        at = leg_position(leg, c)
        h_u, _ = link_moments(leg, at.l_u, leg.lu, inertia.upper)
        h_l, _ = link_moments(leg, at.l_l, leg.ll, inertia.lower)
        slide = leg.r + slider_coordinate(leg, c) * leg.e
        height = inertia.lower.m * leg.s0[2] * geometry.k
        links = ca.mtimes(leg.plane, h_u + h_l)
        moments = moments + (inertia.slider + inertia.upper.m) * slide + links + height
    return -ca.dot(geometry.gravity, moments)


def forward_dynamics(
    geometry: Geometry,
    pose: Expression,
    velocity: Expression,
    forces: Expression,
    parameters: Expression,
    wrench: Expression,
) -> Expression:
    """Return x'' with M x'' = J^T F + wrench - h."""
    rest = ca.SX.zeros(geometry.freedom)
    bias = generalized_forces(geometry, pose, velocity, rest, parameters)
    load = ca.mtimes(jacobian(geometry, pose).T, forces) + wrench - bias
    return solve_positive_definite(mass_matrix(geometry, pose, parameters), load)


def solve_positive_definite(matrix: Expression, right: Expression) -> Expression:
    """Return the solution of a small symmetric positive definite system, by L D L^T.

    CasADi's own `solve` on SX expressions loses two digits on these systems.
    """
    n = matrix.shape[0]
    lower = ca.SX.eye(n)
    pivots: list[Expression] = []
    for j in range(n):
        pivots.append(matrix[j, j] - sum(lower[j, k] ** 2 * pivots[k] for k in range(j)))
        for i in range(j + 1, n):
            rest = sum(lower[i, k] * lower[j, k] * pivots[k] for k in range(j))
            lower[i, j] = (matrix[i, j] - rest) / pivots[j]
    solution = [ca.SX(0)] * n
    for i in range(n):
        solution[i] = right[i] - sum(lower[i, k] * solution[k] for k in range(i))
    for i in reversed(range(n)):
        later = sum(lower[k, i] * solution[k] for k in range(i + 1, n))
        solution[i] = solution[i] / pivots[i] - later
    return ca.vertcat(*solution)
