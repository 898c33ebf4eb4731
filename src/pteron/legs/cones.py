"""Limits of passive joints: the cone in which a ball joint holds its rod, an elbow's angles."""

from __future__ import annotations

import math
from dataclasses import dataclass

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.bodies.vectors import Vector, number, unit_vector
from pteron.errors import ModelError
from pteron.legs.leg import Passive


@dataclass(frozen=True)
class Cone:
    """The cone in which a ball joint holds the direction of its rod, seen from the joint.

    Parameters
    ----------
    axis : unit vector
        In the frame of the body that carries the socket.
    angle : float
        The greatest angle between axis and rod, rad.
    """

    axis: Vector
    angle: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "axis", unit_vector(self.axis, "axis"))
        object.__setattr__(self, "angle", number(self.angle, "angle"))
        if not 0.0 < self.angle <= math.pi:
            raise ModelError(
                f"angle: {self.angle:g} rad given, one above 0 and up to pi expected; are these "
                "degrees?"
            )


def angle_between(a: Expression, b: Expression) -> Expression:
    """Return the angle between two vectors (3, 1), rad, 0 to pi."""
    return ca.atan2(ca.norm_2(ca.cross(a, b)), ca.dot(a, b))


def cone_limit(
    noun: str, cone: Cone | None, socket: Expression, rod: Expression, length: float
) -> list[Passive]:
    """Return the limit, in a list or [], on a rod's angle to the cone's axis at a ball joint.

    The columns of `socket` (3, 3) are the axes of the body that carries the socket.
    """
    if cone is None:
        return []
    angle = angle_between(ca.mtimes(socket, ca.SX(ca.vertcat(*cone.axis))), rod)
    # The angle has no lower limit: one below zero is never reached.
    return [Passive(noun, "rad", angle, -cone.angle, cone.angle, length, True)]


def joint_limit(
    noun: str,
    unit: str,
    value: Expression,
    limits: tuple[float, float] | None,
    lever: float,
) -> list[Passive]:
    """Return a passive joint with limits in a list; [] if `limits` is None."""
    return [] if limits is None else [Passive(noun, unit, value, *limits, lever)]
