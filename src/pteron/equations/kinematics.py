"""Kinematics, inverse and direct: positions, reach, margins, Jacobians, rates."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.bodies.parameters import LINK_BODIES
from pteron.bodies.vectors import norm
from pteron.closures.closure import nan_below_zero
from pteron.equations.machine import Machine, State
from pteron.legs.leg import Joint, Passive, Reach

FAR = 1e3
"""The margin without a limit, m: finite, as controllers and optimisers need it."""


def inverse_position(machine: Machine, pose: Expression) -> Expression:
    """Return the joint coordinates (n, 1) of a pose (m, 1), m or rad."""
    return ca.vertcat(*(leg.coordinate for leg in machine.state(pose).legs))


def reach(machine: Machine, pose: Expression) -> list[Reach]:
    """Return each leg's discriminant of reach, reach margin (m) and type-I measure at a pose."""
    zero_rates = ca.SX.zeros(machine.freedom)
    platform = machine.platform.motion(pose, zero_rates, zero_rates)
    legs = zip(machine.legs_at(platform), platform.points, strict=True)
    return [leg.reach(c.position) for leg, c in legs]


def motion_at_point(
    machine: Machine,
    pose: Expression,
    velocity: Expression,
    acceleration: Expression,
    pivot: Expression,
) -> tuple[Expression, Expression, Expression]:
    """Return pose, velocity and acceleration (m, 1) with another point of the platform for P.

    `pivot` (3, 1) is the point in the platform's frame, m; the angles are the same. Given the
    motion at the pivot, and minus the pivot, the result is the motion at P.
    """
    zero_rates = ca.SX.zeros(machine.freedom)
    axes = machine.platform.motion(pose, zero_rates, zero_rates).axes
    count = len(machine.robot.platform.lengths)
    arm = ca.mtimes(machine.platform.directions.T, ca.mtimes(axes, pivot))
    shift = ca.vertcat(arm[:count], ca.SX(machine.freedom - count, 1))
    rate = ca.jtimes(shift, pose, velocity)
    growth = ca.jtimes(rate, pose, velocity) + ca.jtimes(shift, pose, acceleration)
    return pose + shift, velocity + rate, acceleration + growth


def radicands(machine: Machine, pose: Expression) -> Expression:
    """Return the radicands (k, 1) of all roots of the legs' closures, inner ones first."""
    zero_rates = ca.SX.zeros(machine.freedom)
    platform = machine.platform.motion(pose, zero_rates, zero_rates)
    legs = zip(machine.legs_at(platform), platform.points, strict=True)
    return ca.vertcat(*(square for leg, c in legs for square in leg.radicands(c.position)))


def reach_validity(machine: Machine, pose: Expression) -> Expression:
    """Return 0 for each leg that reaches the pose, NaN for the others, (n, 1)."""
    reaches = reach(machine, pose)
    return ca.vertcat(*(nan_below_zero(leg.discriminant) for leg in reaches))  # Remark 2


def passive_joints(machine: Machine, pose: Expression) -> list[list[Passive]]:
    """Return the limited passive joints: the platform's angles first, then every leg's."""
    state, platform = machine.state(pose), machine.robot.platform
    base_axes, platform_axes = ca.horzcat(*machine.platform.frame), state.platform.axes
    radius = _platform_radius(machine)
    angles = [
        Passive(name, "rad", pose[platform.coordinates.index(name)], *limits, radius)
        for name, limits in platform.angle_limits.items()
    ]
    pairs = zip(machine.robot.legs, state.legs, strict=True)
    return [
        angles,
        *(leg.passive_joints(motion, base_axes, platform_axes) for leg, motion in pairs),
    ]


def _platform_radius(machine: Machine) -> Expression:
    """Return the greatest distance of a platform point from P, m; 1 m where all are at P."""
    points = [leg.platform_point for leg in machine.robot.legs]
    if all(isinstance(component, float) for point in points for component in point):
        return max(map(norm, points)) or 1.0
    radius = ca.mmax(ca.vertcat(*(ca.norm_2(ca.vertcat(*point)) for point in points)))
    return ca.if_else(radius > 0.0, radius, 1.0)


def passive_margins(machine: Machine, pose: Expression) -> tuple[Expression, Expression]:
    """Return each leg's least margin to its passive limits (n, 1): relative, and in m.

    The first is relative to half the joint's range, the second in metres of the leg's motion;
    negative beyond a limit, 1 and `FAR` for a leg without such limits. The platform's angles count
    for every leg.
    """
    shares, metres = [], []
    angles, *legs = passive_joints(machine, pose)
    for joints in legs:
        share, way = ca.SX(1), ca.SX(FAR)
        for joint in (*angles, *joints):
            distance = ca.fmin(joint.value - joint.least, joint.most - joint.value)
            share = ca.fmin(share, distance / (0.5 * (joint.most - joint.least)))
            way = ca.fmin(way, distance * joint.lever)
        shares.append(share)
        metres.append(way)
    return ca.vertcat(*shares), ca.vertcat(*metres)


def pose_status(machine: Machine, pose: Expression) -> tuple[Expression, Expression]:
    """Return a pose's status (0 inside, leg number, or -1) and margin to the workspace boundary, m.

    The status is 0 in the workspace, else the number, from 1, of the leg that is most out of reach,
    or -1 if all legs reach the pose but a joint exceeds its limit. The margin is the least of the
    legs' reach margins and, if all legs reach the pose, of the distances to the joints' limits, at
    most `FAR`; it is negative outside.
    """
    reaches = reach(machine, pose)
    joints = ca.vertsplit(inverse_position(machine, pose))
    passive = ca.vertsplit(passive_margins(machine, pose)[1])
    least, worst, joint_room = reaches[0].margin, ca.SX(1), ca.SX(FAR)
    rows = zip(machine.robot.legs, reaches, joints, passive, strict=True)
    for i, (leg, at, joint, way) in enumerate(rows, start=1):
        worst = ca.if_else(at.margin < least, i, worst)
        least = ca.fmin(least, at.margin)
        joint_room = ca.fmin(joint_room, way)
        if leg.limits is not None:
            # The margin of an angle's limits counts only where it is exceeded.
            joint_margin = ca.fmin(joint - leg.limits[0], leg.limits[1] - joint) * leg.lever
            joint_room = ca.fmin(
                joint_room,
                ca.if_else(joint_margin < 0, joint_margin, FAR)
                if leg.follows_angle
                else joint_margin,
            )
    status, nearest = ca.if_else(joint_room < 0, -1, 0), ca.fmin(least, joint_room)
    for at in reaches:
        status = ca.if_else(at.discriminant < 0, worst, status)
        nearest = ca.if_else(at.discriminant < 0, least, nearest)
    return status, nearest


def direct_position(machine: Machine, joints: Expression, *, reached: bool = True) -> Expression:
    """Return all poses of joint coordinates (n, 1) as columns (m, k), NaN where not real.

    With `reached`, a pose is also NaN where a leg does not reach it.
    """
    poses = machine.closure.poses(joints)
    if not reached:
        return poses
    columns = ca.horzsplit(poses)
    return ca.horzcat(*(pose + ca.sum1(reach_validity(machine, pose)) for pose in columns))


def jacobian(state: State) -> Expression:
    """Return the Jacobian J (n, m) from pose rates to joint rates, Eq. (10)."""
    pairs = zip(state.legs, state.platform.matrices, strict=True)
    rows = ca.vertcat(*(ca.mtimes(leg.row / leg.divisor, matrix) for leg, matrix in pairs))
    return state.platform.pose_rows(rows)  # Eq. (10)


def twist_jacobian(state: State) -> Expression:
    """Return the rows (n, 6) that map the twist of P to joint rates: q' = rows (v, omega)."""
    platform = state.platform
    if not platform.point_twists:  # x' is the twist in orthonormal axes
        return ca.mtimes(jacobian(state), platform.matrix.T)
    pairs = zip(state.legs, platform.point_twists, strict=True)
    return ca.vertcat(*(ca.mtimes(leg.row / leg.divisor, shift) for leg, shift in pairs))


def body_jacobian(state: State, i: int, letter: str) -> Expression | None:
    """Return the Jacobian J_b (6, m) of a leg's body, rows v then omega; None without the body."""
    body = state.legs[i].bodies.get(letter)
    if body is None:
        return None
    rows = ca.vertcat(body.velocity_row, body.turning_row)
    return state.platform.pose_rows(ca.mtimes(rows, state.platform.matrices[i]))  # Eqs. (11), (12)


def link_jacobians(state: State) -> tuple[list[Expression], list[Expression]]:
    """Return the Jacobians of every leg's upper and lower link, (6, m) each; NaN for no link."""
    n = len(state.legs)
    m = state.platform.matrix.shape[1]
    upper, lower = (
        [ca.SX.nan(6, m) if j is None else j for j in jacobians]
        for jacobians in ([body_jacobian(state, i, k) for i in range(n)] for k in LINK_BODIES)
    )
    return upper, lower


def link_vectors(state: State) -> tuple[Expression, Expression]:
    """Return the vectors of every leg's upper and lower link, (n, 3) each, m; NaN for no link."""

    def rows(k: int) -> Expression:
        """Return each leg's link k as a row (n, 3), m; NaN where a leg has none."""
        links = (leg.links[k] for leg in state.legs)
        return ca.horzcat(*(ca.SX.nan(3, 1) if link is None else link for link in links)).T

    return rows(0), rows(1)


def link_turning(state: State, order: int) -> Expression:
    """Return, for every leg (n, 2), the rates of theta_u and theta_l, or their accelerations.

    NaN stands for links whose motion these angles do not describe. `order` is 0 for rates, 1 for
    accelerations.
    """
    rows = [
        ca.horzcat(*(ca.SX.nan() if angle is None else angle[order] for angle in leg.turning))
        for leg in state.legs
    ]
    return ca.vertcat(*rows)


def driven_motion(state: State, order: int) -> Expression:
    """Return rates (`order` 0) or accelerations (1) of the actuated joints, (n, 1)."""
    return ca.vertcat(*((leg.rate, leg.acceleration)[order] for leg in state.legs))


def passive_motion(state: State, order: int) -> Expression:
    """Return rates (`order` 0) or accelerations (1) of passive joints, (n, j), padded with NaN."""
    passive = [[joint for joint in leg.chain if not joint.driven] for leg in state.legs]
    rows = [[(joint.rate, joint.acceleration)[order] for joint in joints] for joints in passive]
    longest = max(map(len, rows))
    return ca.vertcat(*(ca.horzcat(*row, ca.SX.nan(1, longest - len(row))) for row in rows))


def chain_points(state: State) -> list[Expression]:
    """Return a point (j, 3) on every leg's joint axes, m; NaN where a leg has fewer joints."""
    return [points.T for points in _chains(state, lambda j: j.point if j.seat is None else j.seat)]


def _chains(state: State, column: Callable[[Joint], Expression]) -> list[Expression]:
    """Return column(joint) for every joint of every leg, (k, j) each, padded with NaN."""
    longest = max(len(leg.chain) for leg in state.legs)
    chains = [ca.horzcat(*map(column, leg.chain)) for leg in state.legs]
    return [
        ca.horzcat(columns, ca.SX.nan(columns.shape[0], longest - columns.shape[1]))
        for columns in chains
    ]


def platform_rates(
    machine: Machine, pose: Expression, rates: Expression, accelerations: Expression
) -> tuple[Expression, Expression]:
    """Return pose rates x' and accelerations x'' (m, 1) for joint rates and accelerations (n, 1).

    J x' = q' and J x'' = q'' - J' x'; J' x' is the joints' acceleration at x'' = 0.
    """
    at_rest = machine.state(pose)
    velocity = machine.closure.rates(rates, at_rest.platform, at_rest.legs)
    drift = ca.vertcat(*(leg.acceleration for leg in machine.state(pose, velocity).legs))
    return velocity, machine.closure.rates(accelerations - drift, at_rest.platform, at_rest.legs)


def joint_screws(state: State) -> list[Expression]:
    """Return the unit screws (6, j) of each leg's joints about P, from base to platform.

    Each is (6, j), rows omega, then v; NaN where a leg has fewer joints. Where d is parallel to
    k, R4 of a P-R-R-R leg coincides with R3.
    """
    p = state.platform.body.position

    def screw(joint: Joint) -> Expression:
        """Return a joint's unit screw (6, 1) about P: angular part, then linear part."""
        if joint.kind == "P":
            return ca.vertcat(ca.SX(3, 1), joint.axis)  # Eq. (8), of P
        return ca.vertcat(joint.axis, ca.cross(joint.point - p, joint.axis))  # Eq. (8), of R

    return _chains(state, screw)
