"""A rod between two ball joints, or parallel rods: data, motion, joints and couples of any leg."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass

import casadi as ca

from pteron.bodies.inertia import RodInertia
from pteron.bodies.motion import BodyMotion, Expression, PointMotion, RotationMotion, point_rows
from pteron.bodies.vectors import Vector, parallel
from pteron.legs.ball_end import ball_joint
from pteron.legs.cones import Cone, cone_limit
from pteron.legs.kind import LegKind
from pteron.legs.leg import Joint, LegMotion, Passive


@dataclass(frozen=True)
class RodLeg(LegKind):
    """The data of a leg that ends in a rod, or in parallel rods."""

    lower_length: float
    lower: RodInertia
    rods: int = 2
    bar_direction: Vector | None = None
    tip_cone: Cone | None = None
    platform_cone: Cone | None = None
    bar_length: float | None = None

    @abstractmethod
    def tip_axes(self, motion: LegMotion) -> Expression:
        """Return the axes, as columns (3, 3), of the body that carries the rod's first end."""

    def free_axes(self, axis: Vector | None) -> tuple[Vector, ...]:
        """Return the axes of platform rotations that the rods leave free; `axis` is the platform's.

        Parallel rods keep the direction of the bar at their ends, on a hinge where the platform
        turns; a single rod keeps none. Without a bar direction in the file only `axis` is
        known to be free.
        """
        if self.rods == 1:
            return (1, 0, 0), (0, 1, 0), (0, 0, 1)
        return tuple(v for v in (self.bar, axis) if v is not None)

    def couples(self, motion: LegMotion, axis: Vector | None) -> list[Expression] | None:
        """Return, in a list, the couple that parallel rods transmit (3, 1), 1 or less.

        Its length is the sine of the angle between bar and rod, 0 where the parallelogram is flat.
        The rods transmit no couple about themselves. None where the bar's direction is not known.
        """
        if self.rods == 1:
            return []
        return None if self.bar is None else [self.rod_couple(motion) / self.lower_length]

    def passive_joints(
        self, motion: LegMotion, zero_axes: Expression, axes: Expression
    ) -> list[Passive]:
        """Return the ball joints at the rod's ends that have limit cones.

        The columns of `axes` are the platform's axes, those of `zero_axes` the axes at phi = 0. The
        bars of parallel rods do not turn, nor do platform parts with a fixed offset.
        """
        rod, length = motion.links[1], self.lower_length
        assert rod is not None
        socket = axes if self.rods == 1 and not any(self.fixed_offset) else zero_axes
        tip = self.tip_axes(motion)
        return [
            *cone_limit("rod at its tip", self.tip_cone, tip, rod, length),
            *cone_limit("rod at the platform", self.platform_cone, socket, -rod, length),
        ]

    def rod_couple(self, motion: LegMotion) -> Expression:
        """Return the couple (3, 1) of parallel rods, normal to their plane; zero for a single rod.

        A bar whose direction is not known is taken along the leg's first passive joint.
        """
        if self.rods == 1:
            return ca.SX(3, 1)
        bar = motion.chain[1].axis if self.bar is None else ca.SX(list(self.bar))
        return ca.cross(bar, motion.links[1])

    def unlikely_values(self, axis: Vector | None) -> Iterator[str]:
        """Yield a warning if parallel rods would keep their end of the platform from turning.

        The file does not say whether their bar is on a hinge at the platform point; on an
        articulated platform it is, where the fixed offset begins.
        """
        x, y, _ = self.platform_point
        alone = self.rods == 1 or any(self.fixed_offset) or x == y == 0.0
        if axis is None or alone or (self.bar_direction and parallel(self.bar_direction, axis)):
            return
        yield (
            "platform_point: turns with phi, but parallel rods keep their bar from turning: is the "
            "bar on a hinge there? What does not turn belongs in fixed_offset"
        )


def rod_body(point: PointMotion, n: Expression, ddn: Expression, swing: Expression) -> BodyMotion:
    """Return a rod's motion from its unit vector n, n'' and the matrix `swing` (3, 6) of n'.

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
    preceding: Joint | None = None,
    body: str = "l",
) -> list[Joint]:
    """Return the universal joints at a rod's two ends, then hinges of the platform's rotation.

    The joints are about d, and about d x n, at both ends. Hinges about each axis of the platform's
    rotation follow; if the platform tilts, the joint at c is a ball joint.

    With n' = omega x n and omega = alpha' d + beta' e, e = d x n / |d x n|: alpha' = n'.(d x n) /
    |d x n|^2 and beta' = - n'.d / |d x n|. `direction` is n, n' and n''; `swing` (3, 6) is
    the row of n'; `preceding` is a joint about d that rotates the tip's body, such as a crank's.
    `body` is the rod's letter.
    """
    c, (n, dn, ddn) = point.position, direction
    normal, turning = ca.cross(d, n), ca.cross(d, dn)
    square = ca.dot(normal, normal)
    size, growth = ca.sqrt(square), ca.dot(normal, turning) / square
    alpha, beta = ca.dot(dn, normal) / square, -ca.dot(dn, d) / size
    about_d = (
        ca.mtimes(normal.T, swing) / square,
        alpha,
        ca.dot(ddn, normal) / square - 2 * alpha * growth,
    )
    about_e = (-ca.mtimes(d.T, swing) / size, beta, -ca.dot(ddn, d) / size - beta * growth)
    knee = about_d
    if preceding is not None:
        knee = tuple(a - b for a, b in zip(about_d, preceding[3:6], strict=True))
    axis = normal / size
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
