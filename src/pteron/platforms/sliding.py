"""The platform of an I4 robot: two halves that slide along each other, by phi times a length.

A rack and a pinion turn the tool by phi as the halves slide. The halves do not turn.
"""

from __future__ import annotations

import casadi as ca

from pteron.bodies.motion import (
    BodyMotion,
    Expression,
    Moments,
    PointMotion,
    RotationMotion,
    point_rows,
)
from pteron.platforms.motion import Offset, PlatformEquations, PlatformMotion


class Sliding(PlatformEquations):
    """The equations of a sliding platform: a leg's point is c = p + t0 + phi v.

    v is the leg's platform point, m/rad, t0 its fixed offset, m.

    The first moment of the halves is phi times (m gamma_x, m gamma_y), kg m/rad, and I is the sum
    of m v^2 of what slides and of the inertia of what turns, kg m^2: both per radian.
    """

    motion_name = "3T1R"
    coordinates = ("x", "y", "z", "phi")
    slides, point_is_free, point_unit = True, False, "m/rad"
    axis_angle = spin_angle = "phi"
    freedom_text = (
        "translates in space and turns its tool, as two halves of it slide (3T1R, Schoenflies "
        "motion)"
    )

    def offset(self, s: Expression, t: Expression) -> Offset:
        """Return the offset of a platform point: s slides with phi, t stays."""
        x0, y0, _ = self.frame
        return Offset(x0 * s[0] + y0 * s[1], ca.SX(3, 1), t)

    def motion(
        self, pose: Expression, velocity: Expression, acceleration: Expression
    ) -> PlatformMotion:
        """Return the motion: points slide by phi along their offsets, the axes do not rotate."""
        p, dp, ddp = (v[:3] for v in (pose, velocity, acceleration))
        phi, rate, growth = pose[3], velocity[3], acceleration[3]
        points, matrices = [], []
        for v, _, constant in self.offsets:
            points.append(PointMotion(p + constant + v * phi, dp + v * rate, ddp + v * growth))
            matrices.append(self._matrix(v))
        x0, y0, k = self.frame
        # The axes of the halves' first moment do not rotate; its size is proportional to phi.
        grows = x0 * phi, y0 * phi, x0 * growth, y0 * growth
        body = BodyMotion(p, point_rows(ca.SX.eye(3)), ddp, k, ca.SX(1, 6), *grows)
        at_p, axes = self._matrix(ca.SX(3, 1)), ca.horzcat(*self.frame)
        return PlatformMotion(
            tuple(points), tuple(matrices), RotationMotion((), phi), axes, body, at_p
        )

    def _matrix(self, way: Expression) -> Expression:
        """Return the matrix (6, 4) from pose rates to a point's velocity.

        The point slides by `way` (3, 1), m, per rad of phi.
        """
        return ca.blockcat([[ca.SX.eye(3), way], [ca.SX(3, 3), ca.SX(3, 1)]])

    def _moment(self, inertia: Moments) -> Expression:
        """Return the first moment of the sliding halves (3, K), kg m per rad of phi."""
        x0, y0, _ = self.frame
        return ca.mtimes(x0, inertia.hx) + ca.mtimes(y0, inertia.hy)

    def needs(self, motion: PlatformMotion, gravity: Expression, inertia: Moments) -> Expression:
        """Return the force and the moment along phi (4, K) required to move the platform."""
        a_g, growth = motion.body.acceleration - gravity, ca.dot(self.frame[0], motion.body.ddx)
        h = self._moment(inertia)
        force = ca.mtimes(a_g, inertia.m) + h * growth
        return ca.vertcat(force, ca.mtimes(a_g.T, h) + growth * inertia.i)

    def mass_matrix(self, motion: PlatformMotion, inertia: Moments) -> Expression:
        """Return the mass matrix (4, 4) of a platform with sliding halves."""
        h = self._moment(inertia)
        return ca.blockcat([[inertia.m * ca.SX.eye(3), h], [h.T, inertia.i]])
