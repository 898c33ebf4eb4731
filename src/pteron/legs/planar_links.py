"""A link that turns in its leg's plane, about d: its motion, and the revolute joints at its ends.

Vectors of the plane are two-vectors in its axes (3, 2), as in `circles`.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from pteron.bodies.motion import BodyMotion, Expression, PointMotion, RotationMotion, point_rows
from pteron.legs.ball_end import ball_joint
from pteron.legs.circles import quarter_turn
from pteron.legs.leg import Joint

_PARALLEL = 1.0 - 1e-12
"""Cosine between d and the platform's axis k above which the revolute joints about them are one."""

_COINCIDENT = 1e-12
"""Distance of the two axes, m, below which they are."""


class Turning(NamedTuple):
    """A link's turning about d: its row (1, 6) against (c', omega), theta' and theta''."""

    row: Expression
    rate: Expression
    acceleration: Expression

    def less(self, other: Turning) -> Turning:
        """Return its turning against another link's."""
        return Turning(*(a - b for a, b in zip(self, other, strict=True)))


def link_body(
    reference: tuple[Expression, Expression, Expression],
    d: Expression,
    plane: Expression,
    x: Expression,
    turning: Turning,
) -> BodyMotion:
    """Return a link in motion: its reference point's place, row (3, 6) and acceleration; its x."""
    y = quarter_turn(x)  # Fig. 3
    along, square = turning.acceleration, turning.rate * turning.rate
    vectors = (x, y, along * y - square * x, -along * x - square * y)
    placed = (ca.mtimes(plane, vector) for vector in vectors)
    return BodyMotion(*reference, d, turning.row, *placed)


def lower_link_body(
    point: PointMotion, d: Expression, plane: Expression, x: Expression, turning: Turning
) -> BodyMotion:
    """Return the link that ends at the platform point, its reference point."""
    rides = point.position, point_rows(ca.SX.eye(3)), point.acceleration  # Fig. 3, origin on R3
    return link_body(rides, d, plane, x, turning)


def last_joints(
    d: Expression, point: PointMotion, lower: Turning, rotation: RotationMotion
) -> list[Joint]:
    """Return the revolute joint at the platform point, and one about each turn of the platform.

    Where two have one axis they are one: its motion is under the first, the second has none. Where
    the platform tilts all of them are a ball joint.
    """
    if rotation.tilts:
        link = ca.mtimes(d, lower.row), d * lower.rate, d * lower.acceleration
        return ball_joint(point.position, rotation, *link)
    ankle, at = Turning(*(-a for a in lower)), rotation.center(point)
    hinges = []
    for turn in rotation.turns:
        along, apart = ca.dot(d, turn.axis), ca.cross(d, point.position - at)
        one = ca.logic_and(ca.fabs(along) > _PARALLEL, ca.dot(apart, apart) < _COINCIDENT**2)
        sense = ca.if_else(one, along, 0)  # Section 2: where d is along k, U is R
        motion = turn.row, turn.rate, turn.acceleration
        ankle = Turning(*(a + sense * b for a, b in zip(ankle, motion, strict=True)))
        rest = 1 - sense * sense
        hinges.append(Joint("R", turn.axis, at, *(rest * b for b in motion)))
    return [Joint("R", d, point.position, *ankle), *hinges]
