"""Cone, hinges and plane of legs that end in a ball joint at a tilting platform."""

from __future__ import annotations

from typing import Any

import casadi as ca

from pteron.bodies.motion import Expression, HeldPlane, RotationMotion
from pteron.bodies.vectors import Vector
from pteron.legs.cones import Cone, cone_limit
from pteron.legs.leg import Joint, LegMotion, Passive


def every_axis() -> tuple[Vector, ...]:
    """Return three axes that span the rotations of a ball joint."""
    return (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


@property  # type: ignore[misc]
def held_plane(leg: Any) -> HeldPlane:
    """The plane through the guide point in which a planar leg keeps its platform point."""
    return HeldPlane(leg.d, leg.r)


def ball_cone(
    cone: Cone | None, motion: LegMotion, socket: Expression, length: float
) -> list[Passive]:
    """Return the angle between a leg's last link and the platform's socket, with its cone as limit.

    The columns of `socket` (3, 3) are the platform's axes in the base frame; `length`, m, is that
    of the link.
    """
    link = motion.links[1]
    assert link is not None
    return cone_limit("link at the platform", cone, socket, -link, length)


def ball_joint(
    c: Expression,
    rotation: RotationMotion,
    row: Expression,
    rate: Expression,
    acceleration: Expression,
) -> list[Joint]:
    """Return the ball joint at c as hinges about the axes of the platform's turns.

    `row` (3, 6), `rate` and `acceleration` (3, 1) are the angular velocity of the leg's last link,
    against which the platform turns.
    """
    return [
        Joint(
            "R",
            turn.axis,
            c,
            turn.row - ca.mtimes(turn.axis.T, row),
            turn.rate - ca.dot(turn.axis, rate),
            turn.acceleration - ca.dot(turn.axis, acceleration),
        )
        for turn in rotation.turns
    ]
