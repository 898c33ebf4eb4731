"""Platforms that turn about any axis: 3T3R, 3T2R, and 3R and 2R about a centre that stays.

R is a product of turns by one angle of the pose each, about axes that move with those before.
`tripod` has the platform 1T2R, whose other coordinates follow from these.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

import casadi as ca
import numpy as np

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
    """R (3, 3), relative to the platform frame at angles zero."""
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
    """Return R = Rot(a_1, angle_1) Rot(a_2, angle_2) ..., with angular velocity and acceleration.

    With u_i the axis a_i rotated by the preceding angles: omega = sum u_i angle_i', and alpha = sum
    u_i angle_i'' + omega_(i-1) x u_i angle_i', omega_(i-1) being the preceding partial sum.
    """
    matrix, omega, alpha = ca.SX.eye(3), ca.SX(3, 1), ca.SX(3, 1)
    turned_axes = []
    for a, (c, s), rate, growth in zip(axes, angles, rates, accelerations, strict=True):
        u = ca.mtimes(matrix, a)
        alpha = alpha + u * growth + ca.cross(omega, u) * rate
        omega = omega + u * rate
        turn = c * ca.SX.eye(3) + s * ca.skew(a) + (1 - c) * ca.mtimes(a, a.T)
        matrix = ca.mtimes(matrix, turn)
        turned_axes.append(u)
    return Rotation(matrix, ca.horzcat(*turned_axes), omega, alpha)


class Tilting(PlatformEquations):
    """c = p + R s0: a leg's point from P's place, any rotation and its platform point.

    R is the product of the angles' turns, about the axes that the platform's frame has at angles
    zero, times that frame.

    The legs' rows and forces stand against quasi-velocities: the twist (v, omega) of a 3T3R
    platform, omega of a 3R platform. They have none of the angles' singularities at +-90 degrees.
    """

    kinds = SpatialInertia.kinds
    wrench_columns = ("fx", "fy", "fz", "mx", "my", "mz")
    tilts, arm_axes, angle_range = True, "xyz", 0.5 * np.pi
    order: ClassVar[tuple[str, ...]]
    """The angles' coordinates, in the order in which their turns follow each other."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.based: Tilting | None = None
        """The platform in the base's axes, if vectors here are in the platform's axes."""
        self.zero = ca.horzcat(*self.frame)
        """(3, 3): the platform's axes at angles zero."""
        self.arms = [ca.mtimes(self.zero, s) for s in self.points]
        """R s0 at angles zero."""

    def axes_by_angle(self) -> dict[str, Expression]:
        """Return the rotation axis (3, 1) of each angle, at angles zero, by the angle's name."""
        x, y, k = self.frame
        return {"roll": x, "rx": x, "pitch": y, "ry": y, "yaw": k, "rz": k}

    def pose_rotation(
        self, pose: Expression, velocity: Expression, acceleration: Expression, sign: int = 1
    ) -> Rotation:
        """Return the platform's rotation at a pose, with angular velocity and acceleration.

        With `sign` -1 it is the inverse rotation, by the negative angles in reverse order.
        """
        places = [self.coordinates.index(name) for name in self.order][::sign]
        axes = self.axes_by_angle()
        turned = rotation(
            [axes[name] for name in self.order][::sign],
            [(ca.cos(pose[i]), sign * ca.sin(pose[i])) for i in places],
            [sign * velocity[i] for i in places],
            [sign * acceleration[i] for i in places],
        )
        columns = [places.index(i) for i in sorted(places)]
        return turned._replace(axes=turned.axes[:, columns])

    def motion(
        self, pose: Expression, velocity: Expression, acceleration: Expression
    ) -> PlatformMotion:
        """Return the motion of a platform whose quasi-velocities are the twist of P."""
        if self.based is not None:
            to_own_axes, turned = self.based.rotation_in_own_axes(pose, velocity, acceleration)
            rates = (ca.mtimes(to_own_axes, v[:3]) for v in (velocity, acceleration))
            place = PointMotion(ca.SX(3, 1), *rates)
        else:
            turned = self.pose_rotation(pose, velocity, acceleration)
            place = PointMotion(pose[:3], velocity[:3], acceleration[:3])
        return self.assemble_motion(place, turned, ca.SX.eye(6), turned.axes)

    def change_to_platform_axes(
        self, pose: Expression
    ) -> tuple[PlatformEquations, Expression] | None:
        """Return the platform in its own axes, and these axes (3, 3).

        The result is None if P does not translate.
        """
        if "x" not in self.coordinates:
            return None
        in_own_frame = type(self)(
            ca.horzsplit(ca.SX.eye(3)), self.points, self.fixed, self.quantities
        )
        in_own_frame.based, zero = self, ca.SX.zeros(len(self.coordinates))
        return in_own_frame, self.rotation_in_own_axes(pose, zero, zero)[0].T

    def rotation_in_own_axes(
        self, pose: Expression, velocity: Expression, acceleration: Expression
    ) -> tuple[Expression, Rotation]:
        """Return the matrix (3, 3) from base to platform axes, and the rotation in the latter."""
        back, to_own_axes = self.pose_rotation(pose, velocity, acceleration, -1), self.zero.T
        turning, growth = (-ca.mtimes(to_own_axes, v) for v in (back.turning, back.growth))
        return (
            ca.mtimes(to_own_axes, back.matrix),
            Rotation(ca.SX.eye(3), ca.mtimes(to_own_axes, back.axes), turning, growth),
        )

    def assemble_motion(
        self, place: PointMotion, turned: Rotation, twist: Expression, angular: Expression | None
    ) -> PlatformMotion:
        """Return the platform's motion from that of P and a rotation.

        `twist` (6, m) maps the quasi-velocities to (v, omega); `angular` maps the angles' rates to
        quasi-velocities, None where these are the pose's rates.
        """
        p, dp, ddp = place
        _, _, w, dw = turned
        points, shifts = [], []
        swing = ca.skew(dw) + ca.mtimes(w, w.T) - ca.dot(w, w) * ca.SX.eye(3)
        axes = ca.mtimes(turned.matrix, self.zero)
        # For six points with z = 0, the axes' accelerations cost less than each point's.
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
            RotationMotion(turns, axes=turned.axes),
            axes,
            body,
            twist,
            SpatialMotion(axes, ddp, w, dw),
            tuple(shifts),
            angular,
        )

    def moments(self, rows: Sequence[Expression]) -> SpatialMoments:
        """Return the platform's spatial mass moments from rows (1, K) of its parameters."""
        return spatial_moments(rows)

    def needs(
        self, motion: PlatformMotion, gravity: Expression, inertia: SpatialMoments
    ) -> Expression:
        """Return the generalized force (m, K) required to move the platform itself."""
        return ca.mtimes(motion.matrix.T, ca.vertcat(*self.needed_wrench(motion, gravity, inertia)))

    def needed_wrench(
        self, motion: PlatformMotion, gravity: Expression, inertia: SpatialMoments
    ) -> tuple[Expression, Expression]:
        """Return force and moment about P, (3, K) each, required to move the platform itself."""
        assert motion.spatial is not None
        return needed_twist_wrench(motion.spatial, inertia, gravity)

    def mass_matrix(self, motion: PlatformMotion, inertia: SpatialMoments) -> Expression:
        """Return the mass matrix (m, m) in the quasi-velocities."""
        twist_mass = twist_mass_matrix(motion.axes, inertia)
        return ca.mtimes(motion.matrix.T, ca.mtimes(twist_mass, motion.matrix))

    def mass_moment(self, motion: PlatformMotion, inertia: SpatialMoments) -> Expression:
        """Return the platform's mass times centre of mass, (3, K), kg m, in the base frame."""
        moment = ca.mtimes(motion.axes, inertia.h)
        return ca.mtimes(motion.body.position, inertia.m) + moment

    def add_point_masses(
        self, inertia: SpatialMoments, masses: Sequence[Expression]
    ) -> SpatialMoments:
        """Return the platform's mass moments with point masses (1, K) added at its points."""
        return inertia.with_points(self.points, masses)

    def generalized_forces(self, motion: PlatformMotion, wrench: Expression) -> Expression:
        """Return the generalized forces (m, K) along quasi-velocities of a wrench (6, K)."""
        return ca.mtimes(motion.matrix.T, wrench)

    def constraint(self, motion: PlatformMotion) -> Expression:
        """Return 1, the best constraint measure: the pose has all freedoms of the platform."""
        return ca.SX(1)  # there are none


class RollPitchYaw(Tilting):
    """3T3R: R = Rz(yaw) Ry(pitch) Rx(roll)."""

    motion_name = "3T3R"
    coordinates, spin_angle = ("x", "y", "z", "roll", "pitch", "yaw"), "yaw"
    freedom_text = "translates and turns in space any way (3T3R)"
    order = ("yaw", "pitch", "roll")
    joints = ("x", "y", "z", *order)


class TurnsXYZ(Tilting):
    """3T3R: R = Rx(rx) Ry(ry) Rz(rz)."""

    motion_name = "3T3R"
    coordinates, spin_angle = ("x", "y", "z", "rx", "ry", "rz"), "rz"
    freedom_text = "translates and turns in space any way (3T3R)"
    order = ("rx", "ry", "rz")


class _Centred(Tilting):
    """A platform whose point P stays at `center`, on a joint there."""

    motion_name = "3R"
    on_legs_alone, has_center, point_is_free = False, True, False
    freedom_text = "turns any way about a centre that stays (3R)"

    def motion(
        self, pose: Expression, velocity: Expression, acceleration: Expression
    ) -> PlatformMotion:
        """Return the motion of a platform whose point P stays at `center`."""
        turned = self.pose_rotation(pose, velocity, acceleration)
        zero = ca.SX(3, 1)
        place = PointMotion(self.quantities["center"], zero, zero)
        twist = ca.vertcat(ca.SX(3, 3), ca.SX.eye(3))
        return self.assemble_motion(place, turned, twist, turned.axes)


class CentredRollPitchYaw(_Centred):
    """3R: R = Rz(yaw) Ry(pitch) Rx(roll) about a ball joint."""

    coordinates, spin_angle = ("roll", "pitch", "yaw"), "yaw"
    order = joints = ("yaw", "pitch", "roll")


class CentredXYZ(_Centred):
    """3R: R = Rx(rx) Ry(ry) Rz(rz) about a ball joint."""

    coordinates, spin_angle = ("rx", "ry", "rz"), "rz"
    order = ("rx", "ry", "rz")


class _TwoAxes(Tilting):
    """A platform with R = Rot(axis, alpha) Rot(second_axis, beta)."""

    has_second_axis = True
    order = ("alpha", "beta")

    def axes_by_angle(self) -> dict[str, Expression]:
        """Return the rotation axes (3, 1) of alpha and beta, at angles zero, by these names."""
        return {"alpha": self.quantities["first_axis"], "beta": self.quantities["second_axis"]}


class FiveFreedoms(_TwoAxes):
    """3T2R: P moves freely; the quasi-velocities are the pose's rates."""

    motion_name = "3T2R"
    hold_rotation = True
    coordinates = joints = ("x", "y", "z", "alpha", "beta")
    freedom_text = "translates in space and turns about two axes (3T2R)"

    def motion(
        self, pose: Expression, velocity: Expression, acceleration: Expression
    ) -> PlatformMotion:
        """Return the motion of a platform whose point P moves freely."""
        turned = self.pose_rotation(pose, velocity, acceleration)
        place = PointMotion(pose[:3], velocity[:3], acceleration[:3])
        return self.assemble_motion(place, turned, ca.diagcat(ca.SX.eye(3), turned.axes), None)

    def change_to_platform_axes(self, pose: Expression) -> None:
        """Return None: its legs have directions in the base frame."""


class Universal(_TwoAxes, _Centred):
    """2R: R = Rot(axis, alpha) Rot(second_axis, beta) about a universal joint."""

    motion_name = "2R"
    coordinates = ("alpha", "beta")
    freedom_text = "turns about two axes through a centre that stays (2R)"

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        if (offset := self.quantities.get("axis_offset")) is not None:
            self.axis_distance = ca.norm_2(ca.cross(self.quantities["first_axis"], offset))

    def motion(
        self, pose: Expression, velocity: Expression, acceleration: Expression
    ) -> PlatformMotion:
        """Return the motion of a platform whose P stays, or turns about the first axis."""
        turned = self.pose_rotation(pose, velocity, acceleration)
        center, offset = self.quantities["center"], self.quantities.get("axis_offset")
        zero = ca.SX(3, 1)
        if offset is None:
            twist = ca.vertcat(ca.SX(3, 2), turned.axes)
            return self.assemble_motion(PointMotion(center, zero, zero), turned, twist, None)
        a, cos, sin = self.quantities["first_axis"], ca.cos(pose[0]), ca.sin(pose[0])
        axial = a * ca.dot(a, offset)
        arm = cos * (offset - axial) + sin * ca.cross(a, offset)
        lever = ca.cross(a, arm)
        place = PointMotion(
            center + axial + arm,
            lever * velocity[0],
            lever * acceleration[0] - arm * (velocity[0] * velocity[0]),
        )
        twist = ca.vertcat(ca.horzcat(lever, zero), turned.axes)
        return self.assemble_motion(place, turned, twist, None)
