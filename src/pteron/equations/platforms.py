"""The platform: how its pose and its motion move the points that the legs carry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca

from pteron.equations.geometry import Expression, Geometry, along


@dataclass(frozen=True)
class PointMotion:
    """A platform point: c, c', c'' and the lever k x s of the angle phi (None for 3T)."""

    position: Expression
    velocity: Expression
    acceleration: Expression
    lever: Expression | None

    @property
    def matrix(self) -> Expression:
        """C = dc/dx: [1 | k x s] for 3T1R, 1 for 3T."""
        identity = ca.SX.eye(3)
        return identity if self.lever is None else ca.horzcat(identity, self.lever)


class Turn(NamedTuple):
    """unit cos(phi), unit sin(phi) and their first and second derivatives with respect to time.

    The platform's lengths are multiples of `unit`; see `Geometry.unit`.
    """

    unit: Expression

    cosine: Expression
    sine: Expression
    cosine_rate: Expression
    sine_rate: Expression
    cosine_acceleration: Expression
    sine_acceleration: Expression

    @classmethod
    def of(
        cls, unit: Expression, phi: Expression, rate: Expression, acceleration: Expression
    ) -> Turn:
        """Return the turn of a platform at the angle phi."""
        cosine, sine = ca.cos(phi), ca.sin(phi)
        rate1, rate2, acceleration = unit * rate, unit * rate * rate, unit * acceleration
        return cls(
            unit,
            unit * cosine,
            unit * sine,
            -(rate1 * sine),
            rate1 * cosine,
            -(acceleration * sine + rate2 * cosine),
            acceleration * cosine - rate2 * sine,
        )


@dataclass(frozen=True)
class PlatformMotion:
    """The platform's state: the points of the legs, and what its own inertia answers to."""

    points: tuple[PointMotion, ...]
    acceleration: Expression
    """p'', of the reference point P."""
    turn: Turn | None
    angular_acceleration: Expression | None


def platform_motion(
    geometry: Geometry, pose: Expression, velocity: Expression, acceleration: Expression
) -> PlatformMotion:
    """Return the motion of the platform and of its points: s = R(phi) s0, c = p + s."""
    p, dp, ddp = pose[0:3], velocity[0:3], acceleration[0:3]
    if not geometry.turns:
        offsets = (
            geometry.x0 * leg.s0[0] + geometry.y0 * leg.s0[1] + geometry.k * leg.s0[2]
            for leg in geometry.legs
        )
        points = tuple(PointMotion(p + s, dp, ddp, None) for s in offsets)
        return PlatformMotion(points, ddp, None, None)
    turn = Turn.of(geometry.unit, pose[3], velocity[3], acceleration[3])
    points = tuple(
        _turning_point(p, dp, ddp, turn, *offset_in_units(geometry, i))
        for i in range(len(geometry.legs))
    )
    return PlatformMotion(points, ddp, turn, acceleration[3])


def resting_offset(geometry: Geometry, i: int) -> tuple[Expression, Expression, Expression]:
    """Return A, B and the constant part of s = A cos(phi) + B sin(phi) + constant, for leg i."""
    s0 = geometry.legs[i].s0
    a = geometry.x0 * s0[0] + geometry.y0 * s0[1]
    b = geometry.y0 * s0[0] - geometry.x0 * s0[1]
    return a, b, geometry.k * s0[2]


def offset_in_units(geometry: Geometry, i: int) -> tuple[Expression, Expression, Expression]:
    """Return A / unit, B / unit and the constant part of s, for leg i."""
    a, b, constant = resting_offset(geometry, i)
    return a / geometry.unit, b / geometry.unit, constant


def _turning_point(
    p: Expression,
    dp: Expression,
    ddp: Expression,
    turn: Turn,
    a: Expression,
    b: Expression,
    constant: Expression,
) -> PointMotion:
    return PointMotion(
        p + along(a, turn.cosine) + along(b, turn.sine) + constant,
        dp + along(a, turn.cosine_rate) + along(b, turn.sine_rate),
        ddp + along(a, turn.cosine_acceleration) + along(b, turn.sine_acceleration),
        along(b, turn.cosine) - along(a, turn.sine),
    )
