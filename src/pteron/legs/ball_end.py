"""Parts of legs that end in a ball joint at the platform: R-R-S, P-R-S, R-P-S and rods.

The axes about which the ball joint leaves the platform free, its limit (the cone), and its
equivalent hinges; of planar legs also the plane in which they keep their platform point.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from pteron.bodies.motion import Expression, HeldPlane, RotationMotion
from pteron.bodies.vectors import Vector
from pteron.legs.cones import Cone, cone_limit
from pteron.legs.leg import Joint, LegMotion, Passive


def every_axis() -> tuple[Vector, ...]:
    """Return three orthogonal unit vectors: a ball joint lets the platform turn about any axis."""
    return (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


@property  # type: ignore[misc]
def held_plane(leg: Any) -> HeldPlane:
    """Return the plane that a leg's platform point never leaves, through its guide point.

    It is normal to the leg's direction `d` and contains its guide point `r`.
    """
    return HeldPlane(leg.d, leg.r)


def ball_cone(
    cone: Cone | None, motion: LegMotion, socket: Expression, length: float
) -> list[Passive]:
    """Return the limit of the ball joint at the platform as a list; [] if `cone` is None.

    The limit is on the angle, rad, between the link that ends at the platform (`length`, m) and the
    axis of `cone`, in the platform's frame. The columns of `socket` (3, 3) are the platform's axes
    in the base frame.
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
    """Return hinges that together equal a ball joint at c (3, 1), m, one for each platform turn.

    Each hinge is about the axis of one of the platform's turns; its rate is that turn's relative to
    the leg's last link. `rate` (3, 1), rad/s, and `acceleration` (3, 1), rad/s^2, are the link's
    angular velocity and acceleration; `row` (3, 6) are the derivatives of the angular velocity by
    (c', omega).
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
