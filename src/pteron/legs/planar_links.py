"""A link that turns in its leg's plane, about d: its motion, and the revolute joints at its ends.

Vectors of the plane are two-vectors in its axes (3, 2), as in `circles`.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from pteron.bodies.motion import AngleMotion, BodyMotion, Expression, PointMotion
from pteron.legs.circles import quarter_turn
from pteron.legs.leg import Joint

_PARALLEL = 1.0 - 1e-12
"""Cosine between d and k above which a leg's last revolute joint and the one about k are one."""

_COINCIDENT = 1e-12
"""m between their axes below which they are."""


class Turning(NamedTuple):
    """How a link turns about d: d theta / d(c, phi) (1, 4), theta' and theta''."""

    row: Expression
    rate: Expression
    acceleration: Expression

    def less(self, other: Turning) -> Turning:
        """Return how it turns against another link."""
        return Turning(*(a - b for a, b in zip(self, other, strict=True)))


def link_body(
    reference: tuple[Expression, Expression, Expression],
    d: Expression,
    plane: Expression,
    x: Expression,
    turning: Turning,
) -> BodyMotion:
    """Return a link in motion: its reference point's place, row (3, 4) and acceleration; its x."""
    y = quarter_turn(x)
    along, square = turning.acceleration, turning.rate * turning.rate
    vectors = (x, y, along * y - square * x, -along * x - square * y)
    placed = (ca.mtimes(plane, vector) for vector in vectors)
    return BodyMotion(*reference, d, turning.row, *placed)


def lower_link_body(
    point: PointMotion, d: Expression, plane: Expression, x: Expression, turning: Turning
) -> BodyMotion:
    """Return the link that ends at the platform point, its reference point."""
    rides = point.position, ca.horzcat(ca.SX.eye(3), ca.SX(3, 1)), point.acceleration
    return link_body(rides, d, plane, x, turning)


def last_joints(
    d: Expression, point: PointMotion, lower: Turning, angle: AngleMotion | None
) -> list[Joint]:
    """Return the revolute joint at the platform point and, where the platform turns, one about k.

    Where both have one axis they are one: its motion is under the first, the second has none.
    """
    ankle = Turning(*(-a for a in lower))
    if angle is None:
        return [Joint("R", d, point.position, *ankle)]
    at = angle.axis_point(point)
    along, apart = ca.dot(d, angle.axis), ca.cross(d, point.position - at)
    one = ca.logic_and(ca.fabs(along) > _PARALLEL, ca.dot(apart, apart) < _COINCIDENT**2)
    sense = ca.if_else(one, along, 0)
    turn = Turning(ca.SX([[0, 0, 0, 1]]), angle.rate, angle.acceleration)
    ankle = Turning(*(a + sense * b for a, b in zip(ankle, turn, strict=True)))
    rest = 1 - sense * sense
    hinge = Joint("R", angle.axis, at, *(rest * b for b in turn))
    return [Joint("R", d, point.position, *ankle), hinge]
