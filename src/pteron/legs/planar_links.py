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
from pteron.tolerances import EXACT

_PARALLEL = 1.0 - 1e-12
"""Cosine between d and the platform's axis k above which their revolute joints coincide."""


class LinkRotation(NamedTuple):
    """A link's rotation about d: its row (1, 6) in (c', omega), theta' and theta''."""

    row: Expression
    rate: Expression
    acceleration: Expression

    def relative_to(self, other: LinkRotation) -> LinkRotation:
        """Return this link's angle rate and acceleration relative to another link's."""
        return LinkRotation(*(a - b for a, b in zip(self, other, strict=True)))


def link_body(
    reference: tuple[Expression, Expression, Expression],
    d: Expression,
    plane: Expression,
    x: Expression,
    turning: LinkRotation,
) -> BodyMotion:
    """Return a planar link's motion from its reference point, x axis (2, 1) and rotation."""
    y = quarter_turn(x)  # Fig. 3
    acceleration, square = turning.acceleration, turning.rate * turning.rate
    vectors = (x, y, acceleration * y - square * x, -acceleration * x - square * y)
    base_vectors = (ca.mtimes(plane, vector) for vector in vectors)
    return BodyMotion(*reference, d, turning.row, *base_vectors)


def lower_link_body(
    point: PointMotion, d: Expression, plane: Expression, x: Expression, turning: LinkRotation
) -> BodyMotion:
    """Return the motion of a planar link whose reference point is the platform point."""
    rides = point.position, point_rows(ca.SX.eye(3)), point.acceleration  # Fig. 3, origin on R3
    return link_body(rides, d, plane, x, turning)


def last_joints(
    d: Expression, point: PointMotion, lower: LinkRotation, rotation: RotationMotion
) -> list[Joint]:
    """Return the revolute joint at the platform point, then one for each platform rotation axis.

    Two joints about one axis count as one: the first has its motion, the second none. If the
    platform tilts, all of them are a ball joint.
    """
    if rotation.tilts:
        link = ca.mtimes(d, lower.row), d * lower.rate, d * lower.acceleration
        return ball_joint(point.position, rotation, *link)
    ankle, at = LinkRotation(*(-a for a in lower)), rotation.center(point)
    hinges = []
    for turn in rotation.turns:
        cosine, offset = ca.dot(d, turn.axis), ca.cross(d, point.position - at)
        is_shared = ca.logic_and(ca.fabs(cosine) > _PARALLEL, ca.dot(offset, offset) < EXACT**2)
        sense = ca.if_else(is_shared, cosine, 0)  # Section 2: where d is along k, U is R
        motion = turn.row, turn.rate, turn.acceleration
        ankle = LinkRotation(*(a + sense * b for a, b in zip(ankle, motion, strict=True)))
        remainder = 1 - sense * sense
        hinges.append(Joint("R", turn.axis, at, *(remainder * b for b in motion)))
    return [Joint("R", d, point.position, *ankle), *hinges]
