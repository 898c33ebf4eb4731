"""A rod between two ball joints, or parallel rods: keys, motion, joints and couples for any leg."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import casadi as ca

from pteron.bodies.motion import BodyMotion, Expression, PointMotion, RotationMotion, point_rows
from pteron.bodies.vectors import Vector, parallel
from pteron.legs.ball_end import ball_joint
from pteron.legs.cones import within_cone
from pteron.legs.keys import Key
from pteron.legs.leg import Joint, LegMotion, Passive

ROD_KEYS: dict[str, Key] = {
    "lower_length": Key("length", "ll, of the rod, m"),
    "rods": Key(
        "count",
        "parallel rods, which keep their bars parallel; lower is their sum; 1 under a platform "
        "that tilts",
        default=2,
        tilting=1,
    ),
    "bar_length": Key(
        "length",
        "how far parallel rods are apart, m: clearances then take them for two",
        default=None,
        example=0.08,
    ),
    "platform_cone": Key(
        "cone",
        "how far the rod may lean at the platform; axis in the platform frame, at phi = 0 for "
        "parallel rods",
        default=None,
        example={"axis": [0.0, 0.0, 1.0], "angle": 0.8},
    ),
    "lower": Key("rod", "the rods: origin at the platform point, x along them to there", "l"),
}
"""The keys that legs with a rod share."""


def free_axes(rods: int, bar: Vector | None, axis: Vector | None) -> tuple[Vector, ...]:
    """Return axes about which rods let the platform turn; `axis` is the platform's, if it turns.

    Parallel rods keep the bar at their ends, on a hinge where the platform turns; one alone keeps
    nothing. Where the bar is not told, nothing is held against the machine.
    """
    if rods == 1:
        return (1, 0, 0), (0, 1, 0), (0, 0, 1)
    return tuple(v for v in (bar, axis) if v is not None)


def couples(leg: Any, motion: LegMotion) -> list[Expression] | None:
    """Return the couple about bar x rod that parallel rods hold: both push along themselves.

    Its length is the sine between bar and rod: it is lost where the parallelogram is flat. What
    turns the bar about the rods they do not hold. None where the bar is not told.
    """
    if leg.rods == 1:
        return []
    if leg.bar is None:
        return None
    return [rod_couple(leg, motion) / leg.lower_length]


def cones(
    leg: Any, motion: LegMotion, tip: Expression, still: Expression, turned: Expression
) -> list[Passive]:
    """Return the ball joints at the ends of a leg's rod that have cones.

    The columns of `tip` are the axes of the body that carries the rod, those of `still` and
    `turned` the platform's. The bars of parallel rods do not turn, nor does what has a fixed
    offset.
    """
    rod, length = motion.links[1], leg.lower_length
    assert rod is not None
    socket = turned if leg.rods == 1 and not any(leg.fixed_offset) else still
    return [
        *within_cone("rod at its tip", leg.tip_cone, tip, rod, length),
        *within_cone("rod at the platform", leg.platform_cone, socket, -rod, length),
    ]


def rod_couple(leg: Any, motion: LegMotion) -> Expression:
    """Return the couple of parallel rods, across their plane; zero for one.

    Where the bar is not told it is taken along the leg's first passive joint.
    """
    if leg.rods == 1:
        return ca.SX(3, 1)
    bar = motion.chain[1].axis if leg.bar is None else ca.SX(list(leg.bar))
    return ca.cross(bar, motion.links[1])


def hinge_doubts(leg: Any, axis: Vector | None) -> Iterator[str]:
    """Yield it where parallel rods would keep their end of the platform from turning about an axis.

    The file does not tell whether their bar is on a hinge at the platform point; of an articulated
    platform it is where the fixed offset begins.
    """
    x, y, _ = leg.platform_point
    alone = leg.rods == 1 or any(leg.fixed_offset) or x == y == 0.0
    if axis is None or alone or (leg.bar_direction and parallel(leg.bar_direction, axis)):
        return
    yield (
        "platform_point: turns with phi, but parallel rods keep their bar from turning: is the bar "
        "on a hinge there? What does not turn belongs in fixed_offset"
    )


def rod_body(point: PointMotion, n: Expression, ddn: Expression, swing: Expression) -> BodyMotion:
    """Return a rod in motion: its direction n towards the platform point, n'' and the row of n'.

    `swing` is (3, 6). The rod's angular velocity is n x n', its reference point the platform point.
    """
    rides = point_rows(ca.SX.eye(3))
    turning = ca.mtimes(ca.skew(n), swing)
    return BodyMotion(point.position, rides, point.acceleration, ca.SX.eye(3), turning, n, ddx=ddn)


def universal_joints(
    d: Expression,
    tip: Expression,
    point: PointMotion,
    swing: Expression,
    direction: tuple[Expression, Expression, Expression],
    rotation: RotationMotion,
    before: Joint | None = None,
    body: str = "l",
) -> list[Joint]:
    """Return the universal joints at a rod's ends, tip and c: about d, and about d x n across it.

    A hinge about each axis of the platform's rotation follows; where the platform tilts the joint
    at c is a ball joint.

    With n' = omega x n and omega = alpha' d + beta' e, e = d x n / |d x n|: alpha' = n'.(d x n) /
    |d x n|^2 and beta' = - n'.d / |d x n|. `direction` is n, n' and n''; `swing` (3, 6) is
    the row of n'; `before` is a joint about d that turns the tip's side, such as a crank's. `body`
    is the rod's letter.
    """
    c, (n, dn, ddn) = point.position, direction
    across, turning = ca.cross(d, n), ca.cross(d, dn)
    square = ca.dot(across, across)
    size, growth = ca.sqrt(square), ca.dot(across, turning) / square
    alpha, beta = ca.dot(dn, across) / square, -ca.dot(dn, d) / size
    about_d = (
        ca.mtimes(across.T, swing) / square,
        alpha,
        ca.dot(ddn, across) / square - 2 * alpha * growth,
    )
    about_e = (-ca.mtimes(d.T, swing) / size, beta, -ca.dot(ddn, d) / size - beta * growth)
    knee = about_d
    if before is not None:
        knee = tuple(a - b for a, b in zip(about_d, before[3:6], strict=True))
    axis = across / size
    ends = [Joint("R", d, tip, *knee), Joint("R", axis, tip, *about_e, body)]
    if rotation.tilts:
        rod = (
            ca.mtimes(d, about_d[0]) + ca.mtimes(axis, about_e[0]),
            alpha * d + beta * axis,
            about_d[2] * d + about_e[2] * axis + alpha * beta * ca.cross(d, axis),
        )
        return [*ends, *ball_joint(c, rotation, *rod)]
    hinges = [
        Joint("R", turn.axis, rotation.center(point), turn.row, turn.rate, turn.acceleration)
        for turn in rotation.turns
    ]
    return [
        *ends,
        Joint("R", axis, c, *(-a for a in about_e)),
        Joint("R", d, c, *(-a for a in about_d)),
        *hinges,
    ]
