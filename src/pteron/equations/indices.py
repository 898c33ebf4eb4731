"""Performance indices of a machine at a pose, such as the condition number, as expressions.

Most use the homogeneous Jacobian, whose entries have one unit: joint rates are speeds in m/s, of a
slider or of a crank's end, and the platform's turning counts as the speed at a length L from P. The
meaning and source of each index is in `pteron.indices`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from itertools import product
from typing import NamedTuple

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.closures.closure import plain_rows, rows_in_quasi_velocities
from pteron.closures.determinants import adjugate, determinant, solve
from pteron.equations.machine import Machine, State
from pteron.equations.singular_values import largest, singular_values, smallest
from pteron.errors import ModelError
from pteron.legs.leg import force_arm


class Homogeneous(NamedTuple):
    """The dimensionless Jacobian, and its characteristic length, m."""

    matrix: Expression
    length: Expression


def lever_arms(machine: Machine, state: State) -> list[Expression]:
    """Return the derivatives (3, k) of each pushed platform point by the platform's rotations."""
    lengths = _lengths_of(machine)
    pairs = zip(state.legs, state.platform.matrices, strict=True)
    return [matrix[:3, lengths:] for leg, matrix in pairs if leg.pushes]


def homogeneous(machine: Machine, state: State) -> Homogeneous:
    """Return the Jacobian in homogeneous units (m/m), and the characteristic length L, m.

    L is the root mean square distance of the moving platform points from the axis through P, or
    from all axes through P; 1 m where no point moves. The joint of a leg that follows the
    platform's angle counts as that angle times L, without its gear. If the platform tilts,
    rotations are those about the base axes, or for a tripod roll and pitch.
    """
    if not machine.platform.angles():
        return Homogeneous(_with_joints_in_metres(machine, _jacobian(state), ca.SX(1)), ca.SX(1))
    arms = lever_arms(machine, state)
    square = sum(ca.sumsqr(arm) for arm in arms) / (len(arms) * arms[0].shape[1])
    length = _root_or_one(square)
    rows = _with_joints_in_metres(machine, _jacobian(state), length)
    lengths = _lengths_of(machine)
    return Homogeneous(ca.horzcat(rows[:, :lengths], rows[:, lengths:] / length), length)


def point_jacobian(machine: Machine, state: State) -> Expression:
    """Return the Jacobian (n, m) from normalised velocities of all platform points to joints.

    With V = S x' these velocities and S^T S = n R^T R, the matrix is J R^-1: the Jacobian at the
    points' centroid, with their root mean square distance from it as L. It depends on no chosen
    length or point P.
    """
    if not machine.platform.angles():
        return homogeneous(machine, state).matrix
    if machine.platform.axis_angle is None:
        return _point_jacobian_in_space(machine, state)
    first, *_ = arms = lever_arms(machine, state)
    # Relative to the first point, so that coincident points differ by exactly zero.
    offset = sum(arm - first for arm in arms) / len(arms)
    centred = [arm - first - offset for arm in arms]
    length = _root_or_one(sum(ca.dot(arm, arm) for arm in centred) / len(arms))
    rows = _with_joints_in_metres(machine, _jacobian(state), length)
    # The joint rates for a turn about the centroid.
    rates_about_centroid = ca.mtimes(
        rows[:, :-1], ca.mtimes(machine.platform.directions.T, first + offset)
    )
    rows[:, -1] = (rows[:, -1] - rates_about_centroid) / length
    return rows


def _point_jacobian_in_space(machine: Machine, state: State) -> Expression:
    """Return `point_jacobian` for a platform that tilts, by a Cholesky root of the metric."""
    matrices = [matrix[:3, :] for matrix in state.platform.matrices]
    lower = _root(sum(ca.mtimes(matrix.T, matrix) for matrix in matrices) / len(matrices))
    rows = _with_joints_in_metres(machine, _jacobian(state), ca.SX(1))
    columns: list[Expression] = []  # X lower^T = rows, by columns
    for k in range(rows.shape[1]):
        eliminated = sum(
            (lower[k, j] * column for j, column in enumerate(columns)), ca.SX(rows.shape[0], 1)
        )
        columns.append((rows[:, k] - eliminated) / lower[k, k])
    return ca.horzcat(*columns)


def _jacobian(state: State) -> Expression:
    """Return the Jacobian (n, m) against the platform's quasi-velocities."""
    return rows_in_quasi_velocities(state.platform, [leg.row / leg.divisor for leg in state.legs])


def _lengths_of(machine: Machine) -> int:
    """Return the number of length coordinates in the pose."""
    return int(machine.platform.directions.shape[1])


def _with_joints_in_metres(
    machine: Machine, jacobian: Expression, length: Expression
) -> Expression:
    """Return the Jacobian with each joint's row scaled to m/s by its lever."""
    levers = [leg.lever(length) for leg in machine.legs]
    rows = zip(levers, ca.vertsplit(jacobian), strict=True)
    return ca.vertcat(*(lever * row for lever, row in rows))


def _root_or_one(square: Expression) -> Expression:
    """Return the square root, or 1 where the square is 0."""
    return ca.sqrt(square + (square == 0))


def condition(machine: Machine, state: State) -> Expression:
    """Return the condition number of the homogeneous Jacobian."""
    return _ratio(homogeneous(machine, state).matrix)


def condition_points(machine: Machine, state: State) -> Expression:
    """Return the condition number of the Jacobian of the platform points' velocities."""
    return _ratio(point_jacobian(machine, state))


def _ratio(matrix: Expression) -> Expression:
    """Return the condition number of a matrix: largest over smallest singular value."""
    sigmas = singular_values(matrix)
    return largest(sigmas) / smallest(sigmas)


def manipulability(machine: Machine, state: State) -> Expression:
    """Return the manipulability 1 / sqrt(det(J^T J)) of the homogeneous Jacobian."""
    rows = homogeneous(machine, state).matrix
    if rows.shape[0] > rows.shape[1]:
        return 1 / determinant(rows)
    return 1 / ca.fabs(ca.mtimes(rows[0, :], adjugate(rows)[:, 0]))


def speed_least(machine: Machine, state: State) -> Expression:
    """Return the least speed of P in any direction at |q'| = 1 without rotation."""
    return 1 / largest(singular_values(_lengths(machine, homogeneous(machine, state).matrix)))


def speed_most(machine: Machine, state: State) -> Expression:
    """Return the greatest speed of P in any direction at |q'| = 1 without rotation."""
    return 1 / smallest(singular_values(_lengths(machine, homogeneous(machine, state).matrix)))


def turning_speed(machine: Machine, state: State) -> Expression:
    """Return the turning speed at |q'| = 1 while P rests, rad/s per m/s, about the worst axis."""
    rows, length = homogeneous(machine, state)
    return 1 / (length * largest(singular_values(_turns(machine, rows))))


def force_least(machine: Machine, state: State) -> Expression:
    """Return the least force at P in any direction that drive forces |F| = 1 hold, no moment."""
    adj, volume = _inverse(homogeneous(machine, state).matrix)
    return ca.fabs(volume) / largest(singular_values(_lengths(machine, adj.T)))


def force_most(machine: Machine, state: State) -> Expression:
    """Return the greatest force at P in any direction that drive forces |F| = 1 hold, no moment."""
    adj, volume = _inverse(homogeneous(machine, state).matrix)
    return ca.fabs(volume) / smallest(singular_values(_lengths(machine, adj.T)))


def turning_moment(machine: Machine, state: State) -> Expression:
    """Return the least moment that drive forces |F| = 1 hold, no force at P, N m per N."""
    rows, length = homogeneous(machine, state)
    adj, volume = _inverse(rows)
    return length * ca.fabs(volume) / largest(singular_values(_turns(machine, adj.T)))


def error(machine: Machine, state: State) -> Expression:
    """Return the position error of P per joint error, root sum square over the joints, m/m."""
    adj, volume = _inverse(homogeneous(machine, state).matrix)
    return ca.norm_fro(_lengths(machine, adj.T)) / ca.fabs(volume)


def error_worst(machine: Machine, state: State) -> Expression:
    """Return the worst position error of P for joint errors of +-1, m/m."""
    adj, volume = _inverse(homogeneous(machine, state).matrix)
    return _worst_signed_sum(_lengths(machine, adj.T).T) / ca.fabs(volume)


def turning_error(machine: Machine, state: State) -> Expression:
    """Return the platform's angular error per joint error, root sum square, rad/m."""
    rows, length = homogeneous(machine, state)
    adj, volume = _inverse(rows)
    return ca.norm_fro(_turns(machine, adj.T)) / (length * ca.fabs(volume))


def turning_error_worst(machine: Machine, state: State) -> Expression:
    """Return the platform's worst angular error for joint errors of +-1, rad/m."""
    rows, length = homogeneous(machine, state)
    adj, volume = _inverse(rows)
    return _worst_signed_sum(_turns(machine, adj.T).T) / (length * ca.fabs(volume))


def _worst_signed_sum(columns: Expression) -> Expression:
    """Return the greatest norm of any signed sum (+-) of a matrix's columns."""
    first, *others = ca.horzsplit(columns)
    sums = (
        first + sum(sign * column for sign, column in zip(signs, others, strict=True))
        for signs in product((1, -1), repeat=len(others))
    )
    return ca.sqrt(reduce(ca.fmax, (ca.dot(total, total) for total in sums)))


def _lengths(machine: Machine, rows: Expression) -> Expression:
    """Return the columns of the pose's length coordinates; raise if there are none."""
    return _require_columns(machine, rows[:, : _lengths_of(machine)], "only turns")


def _turns(machine: Machine, rows: Expression) -> Expression:
    """Return the columns of the platform's rotations; raise if there are none."""
    return _require_columns(machine, rows[:, _lengths_of(machine) :], "does not turn")


def _require_columns(machine: Machine, columns: Expression, lacking: str) -> Expression:
    """Return the columns; raise a ModelError with `lacking` if there are none."""
    if columns.shape[1] == 0:
        motion = machine.robot.platform.motion
        raise ModelError(
            f"a {motion} platform {lacking}, so that it has no such index; "
            "pteron.indices.indices_of lists those of a machine"
        )
    return columns


def _inverse(rows: Expression) -> tuple[Expression, Expression]:
    """Return adjugate (m, m) and determinant of a square matrix; their quotient is the inverse.

    Of more rows than columns these are the pseudo-inverse (m, n) and 1.
    """
    if rows.shape[0] > rows.shape[1]:
        return solve(rows, ca.SX.eye(rows.shape[0]))
    adj = adjugate(rows)
    return adj, ca.mtimes(rows[0, :], adj[:, 0])


def pressure_angle(machine: Machine, state: State) -> Expression:
    """Return the greatest angle between a leg's force and the motion of its joint, rad.

    The force that a leg transmits acts along the derivative dq/dc of its joint coordinate; the
    joint moves along its axis or, at a crank's end, perpendicular to the crank.
    """
    angles = [ca.SX(0)]
    for leg in state.legs:
        if not leg.pushes:
            continue
        place = leg.chain.index(leg.actuated_joint)
        joint, next_joint = leg.chain[place : place + 2]
        direction = joint.axis
        if joint.kind == "R":
            direction = ca.cross(joint.axis, next_joint.point - joint.point)
        thrust = leg.row[:3].T if leg.thrust is None else leg.thrust
        angles.append(_angle_between_lines(thrust, direction))
    return reduce(ca.fmax, angles)


def output_pressure_angle(machine: Machine, state: State) -> Expression:
    """Return the greatest angle between a leg's force and its point's motion, rad.

    The motion is that with the other joints held: a column of J^-1. Where the force does not pass
    through the platform point, it is the motion of the point of its line that is nearest to it.
    """
    if machine.closure.is_redundant:
        raise ModelError(
            "output_pressure_angle: with more legs than freedoms no joint can move while the "
            "others are held; pteron.indices.indices_of lists the indices of a machine"
        )
    adj, angles = adjugate(plain_rows(state.platform, state.legs)), [ca.SX(0)]
    for i, (leg, matrix) in enumerate(zip(state.legs, state.platform.matrices, strict=True)):
        if leg.pushes:
            motion = ca.mtimes(matrix[:3, :], adj[:, i])
            if (arm := force_arm(leg.row)) is not None:  # at the force's line
                motion += ca.cross(ca.mtimes(matrix[3:, :], adj[:, i]), arm)
            angles.append(_angle_between_lines(leg.row[:3].T, motion))
    return reduce(ca.fmax, angles)


def _angle_between_lines(u: Expression, v: Expression) -> Expression:
    """Return the angle between two lines, in [0, pi/2]; pi/2 where one has no direction."""
    cross = ca.cross(u, v)
    dot_size, cross_size = ca.fabs(ca.dot(u, v)), ca.sqrt(ca.dot(cross, cross))
    return ca.atan2(cross_size + (dot_size == 0), dot_size)


def kappa(machine: Machine, state: State, mass: Expression) -> Expression:
    """Return the condition number of the mass matrix, rotations scaled by the length L."""
    units = ca.SX.ones(machine.freedom)
    if machine.platform.angles():
        units[_lengths_of(machine) :] = homogeneous(machine, state).length
        mass = state.platform.quasi_forces(state.platform.quasi_forces(mass).T)
    sigmas = singular_values(_root(mass / ca.mtimes(units, units.T)))
    ratio = largest(sigmas) / smallest(sigmas)
    return ratio * ratio


def _root(matrix: Expression) -> Expression:
    """Return the lower Cholesky factor L (n, n) of a positive definite matrix L L^T."""
    n = matrix.shape[0]
    lower = ca.SX(n, n)
    for j in range(n):
        lower[j, j] = ca.sqrt(matrix[j, j] - sum(lower[j, k] ** 2 for k in range(j)))
        for i in range(j + 1, n):
            partial_sum = sum(lower[i, k] * lower[j, k] for k in range(j))
            lower[i, j] = (matrix[i, j] - partial_sum) / lower[j, j]
    return lower


GEOMETRIC_INDICES: dict[str, Callable[[Machine, State], Expression]] = {
    "condition": condition,
    "condition_points": condition_points,
    "manipulability": manipulability,
    "speed_least": speed_least,
    "speed_most": speed_most,
    "turning_speed": turning_speed,
    "force_least": force_least,
    "force_most": force_most,
    "turning_moment": turning_moment,
    "pressure_angle": pressure_angle,
    "output_pressure_angle": output_pressure_angle,
    "error": error,
    "error_worst": error_worst,
    "turning_error": turning_error,
    "turning_error_worst": turning_error_worst,
}
"""The indices that depend on the geometry alone, by name."""
