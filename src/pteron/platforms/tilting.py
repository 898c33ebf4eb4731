"""Platforms that turn about any axis: 3T3R, and 3R and 2R about a centre that stays.

R is a product of turns by one angle of the pose each, about axes that move with those before.
`tripod` has the platform 1T2R, whose other coordinates follow from these.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

import casadi as ca

from pteron.bodies.inertia import SpatialInertia
from pteron.bodies.motion import (
    BodyMotion,
    Expression,
    PointMotion,
    RotationMotion,
    Turn,
    point_rows,
)
from pteron.bodies.spatial import (
    SpatialMoments,
    SpatialMotion,
    needed_twist_wrench,
    spatial_moments,
    twist_mass_matrix,
)
from pteron.platforms.motion import PlatformEquations, PlatformMotion


class Rotation(NamedTuple):
    """A rotation by angles one after the other, to second order."""

    matrix: Expression
    """R (3, 3), but for the platform frame at angles zero."""
    axes: Expression
    """E (3, k): omega = E angles'."""
    turning: Expression
    """omega, (3, 1)."""
    growth: Expression
    """alpha = omega', (3, 1)."""


def rotation(
    axes: Sequence[Expression],
    angles: Sequence[tuple[Expression, Expression]],
    rates: Sequence[Expression],
    accelerations: Sequence[Expression],
) -> Rotation:
    """Return R = Rot(a_1, angle_1) Rot(a_2, angle_2) ..., angles given by cosine and sine.

    With u_i the axis a_i as those before have turned it: omega = sum u_i angle_i', and alpha = sum
    u_i angle_i'' + omega_(i-1) x u_i angle_i', omega_(i-1) being the sum before.
    """
    matrix, omega, alpha = ca.SX.eye(3), ca.SX(3, 1), ca.SX(3, 1)
    moved = []
    for a, (c, s), rate, growth in zip(axes, angles, rates, accelerations, strict=True):
        u = ca.mtimes(matrix, a)
        alpha = alpha + u * growth + ca.cross(omega, u) * rate
        omega = omega + u * rate
        turn = c * ca.SX.eye(3) + s * ca.skew(a) + (1 - c) * ca.mtimes(a, a.T)
        matrix = ca.mtimes(matrix, turn)
        moved.append(u)
    return Rotation(matrix, ca.horzcat(*moved), omega, alpha)


class Tilting(PlatformEquations):
    """c = p + R s0: a leg's point from P's place, any rotation and its platform point.

    R is the product of the angles' turns, about the axes that the platform's frame has at angles
    zero, times that frame.

    The legs' rows and forces stand against quasi-velocities: the twist (v, omega) of a 3T3R
    platform, omega of a 3R platform. They have none of the angles' singularities at +-90 degrees.
    """

    kinds = SpatialInertia.kinds
    wrench_columns = ("fx", "fy", "fz", "mx", "my", "mz")
    order: ClassVar[tuple[str, ...]]
    """The angles' coordinates, in the order in which their turns follow each other."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.based: Tilting | None = None
        """The same along the base's axes, where vectors are along the platform's."""
        self.zero = ca.horzcat(*self.frame)
        """(3, 3): the platform's axes at angles zero."""
        self.arms = [ca.mtimes(self.zero, s) for s in self.points]
        """R s0 at angles zero."""

    def turn_axes(self) -> list[Expression]:
        """Return the axes of the turns at angles zero, in the order of `order`."""
        x, y, k = self.frame
        known = {"roll": x, "rx": x, "pitch": y, "ry": y, "yaw": k, "rz": k}
        return [known[name] for name in self.order]

    def rotated(
        self, pose: Expression, velocity: Expression, acceleration: Expression, sign: int = 1
    ) -> Rotation:
        """Return the rotation of a pose; the columns of E are in the order of the coordinates.

        With sign -1 it is the base's against the platform, whose rates are those of -angles.
        """
        places = [self.coordinates.index(name) for name in self.order][::sign]
        found = rotation(
            self.turn_axes()[::sign],
            [(ca.cos(pose[i]), sign * ca.sin(pose[i])) for i in places],
            [sign * velocity[i] for i in places],
            [sign * acceleration[i] for i in places],
        )
        columns = [places.index(i) for i in sorted(places)]
        return found._replace(axes=found.axes[:, columns])

    def motion(
        self, pose: Expression, velocity: Expression, acceleration: Expression
    ) -> PlatformMotion:
        if self.based is not None:
            into, turned = self.based.turned_back(pose, velocity, acceleration)
            rates = (ca.mtimes(into, v[:3]) for v in (velocity, acceleration))
            place = PointMotion(ca.SX(3, 1), *rates)
        else:
            turned = self.rotated(pose, velocity, acceleration)
            place = PointMotion(pose[:3], velocity[:3], acceleration[:3])
        return self.moved(place, turned, ca.SX.eye(6), turned.axes)

    def in_own_axes(self, pose: Expression) -> tuple[PlatformEquations, Expression] | None:
        if "x" not in self.coordinates:
            return None
        own = type(self)(ca.horzsplit(ca.SX.eye(3)), self.points, self.fixed, self.more)
        own.based, rest = self, ca.SX.zeros(len(self.coordinates))
        return own, self.turned_back(pose, rest, rest)[0].T

    def turned_back(
        self, pose: Expression, velocity: Expression, acceleration: Expression
    ) -> tuple[Expression, Rotation]:
        """Return the matrix of vectors along the platform's axes, and its rotation along them."""
        back, own = self.rotated(pose, velocity, acceleration, -1), self.zero.T
        turning, growth = (-ca.mtimes(own, v) for v in (back.turning, back.growth))
        return (
            ca.mtimes(own, back.matrix),
            Rotation(ca.SX.eye(3), ca.mtimes(own, back.axes), turning, growth),
        )

    def moved(
        self, place: PointMotion, turned: Rotation, twist: Expression, angular: Expression | None
    ) -> PlatformMotion:
        """Return the motion of P and of a rotation.

        `twist` (6, m) is what the quasi-velocities make of (v, omega); `angular` is their block
        against the angles' rates, None where the quasi-velocities are the pose's.
        """
        p, dp, ddp = place
        _, _, w, dw = turned
        points, shifts = [], []
        swing = ca.skew(dw) + ca.mtimes(w, w.T) - ca.dot(w, w) * ca.SX.eye(3)
        axes = ca.mtimes(turned.matrix, self.zero)
        # Of six points that have but x and y, the axes' accelerations cost less than each point's.
        flat = len(self.points) == 6 and all(s[2].is_zero() for s in self.points)
        pulled = ca.mtimes(swing, axes[:, :2])
        for arm, s0 in zip(self.arms, self.points, strict=True):
            s = ca.mtimes(turned.matrix, arm)
            dds = ca.mtimes(pulled, s0[:2]) if flat else ca.mtimes(swing, s)
            points.append(PointMotion(p + s, dp + ca.cross(w, s), ddp + dds))
            shifts.append(ca.blockcat([[ca.SX.eye(3), -ca.skew(s)], [ca.SX(3, 3), ca.SX.eye(3)]]))
        x, y, _ = ca.horzsplit(axes)
        ddx, ddy = (ca.cross(dw, v) + ca.cross(w, ca.cross(w, v)) for v in (x, y))
        spin = ca.horzcat(ca.SX(3, 3), ca.SX.eye(3))
        body = BodyMotion(p, point_rows(ca.SX.eye(3)), ddp, ca.SX.eye(3), spin, x, y, ddx, ddy)
        turns = tuple(
            Turn(ca.SX.eye(3)[:, i], w[i], dw[i])  # about the base frame's axes
            for i in range(3)
        )
        return PlatformMotion(
            tuple(points),
            tuple(ca.mtimes(shift, twist) for shift in shifts),
            RotationMotion(turns),
            axes,
            body,
            twist,
            SpatialMotion(axes, ddp, w, dw),
            tuple(shifts),
            angular,
        )

    def moments(self, rows: Sequence[Expression]) -> SpatialMoments:
        return spatial_moments(rows)

    def needs(
        self, motion: PlatformMotion, gravity: Expression, inertia: SpatialMoments
    ) -> Expression:
        return ca.mtimes(motion.matrix.T, ca.vertcat(*self.needed_wrench(motion, gravity, inertia)))

    def needed_wrench(
        self, motion: PlatformMotion, gravity: Expression, inertia: SpatialMoments
    ) -> tuple[Expression, Expression]:
        assert motion.spatial is not None
        return needed_twist_wrench(motion.spatial, inertia, gravity)

    def mass_matrix(self, motion: PlatformMotion, inertia: SpatialMoments) -> Expression:
        whole = twist_mass_matrix(motion.axes, inertia)
        return ca.mtimes(motion.matrix.T, ca.mtimes(whole, motion.matrix))

    def mass_moment(self, motion: PlatformMotion, inertia: SpatialMoments) -> Expression:
        moment = ca.mtimes(motion.axes, inertia.h)
        return ca.mtimes(motion.body.position, inertia.m) + moment

    def carrying(self, inertia: SpatialMoments, masses: Sequence[Expression]) -> SpatialMoments:
        return inertia.with_points(self.points, masses)

    def applied(self, motion: PlatformMotion, wrench: Expression) -> Expression:
        return ca.mtimes(motion.matrix.T, wrench)


class RollPitchYaw(Tilting):
    """3T3R: R = Rz(yaw) Ry(pitch) Rx(roll)."""

    coordinates = ("x", "y", "z", "roll", "pitch", "yaw")
    order = ("yaw", "pitch", "roll")
    joints = ("x", "y", "z", *order)


class TurnsXYZ(Tilting):
    """3T3R: R = Rx(rx) Ry(ry) Rz(rz)."""

    coordinates = ("x", "y", "z", "rx", "ry", "rz")
    order = ("rx", "ry", "rz")


class _Centred(Tilting):
    """A platform whose point P stays at `center`, on a joint there."""

    on_legs_alone = False

    def motion(
        self, pose: Expression, velocity: Expression, acceleration: Expression
    ) -> PlatformMotion:
        turned = self.rotated(pose, velocity, acceleration)
        still = ca.SX(3, 1)
        place = PointMotion(self.more["center"], still, still)
        return self.moved(place, turned, *self.basis(turned))

    def basis(self, turned: Rotation) -> tuple[Expression, Expression | None]:
        """Return the matrix (6, k) of the quasi-velocities, and their block against the rates."""
        return ca.vertcat(ca.SX(3, 3), ca.SX.eye(3)), turned.axes


class CentredRollPitchYaw(_Centred):
    """3R: R = Rz(yaw) Ry(pitch) Rx(roll) about a ball joint."""

    coordinates = ("roll", "pitch", "yaw")
    order = joints = ("yaw", "pitch", "roll")


class CentredXYZ(_Centred):
    """3R: R = Rx(rx) Ry(ry) Rz(rz) about a ball joint."""

    coordinates = ("rx", "ry", "rz")
    order = ("rx", "ry", "rz")


class Universal(_Centred):
    """2R: R = Rot(axis, alpha) Rot(second_axis, beta) about a universal joint."""

    coordinates = ("alpha", "beta")
    order = ("alpha", "beta")

    def turn_axes(self) -> list[Expression]:
        return [self.more["first_axis"], self.more["second_axis"]]

    def basis(self, turned: Rotation) -> tuple[Expression, Expression | None]:
        return ca.vertcat(ca.SX(3, 2), turned.axes), None
