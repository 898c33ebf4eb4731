"""The sliding platform of an I4: two half-nacelles, whose distance along each other is phi.

A rack and a pinion turn the tool by phi as the halves slide. Nothing that the legs carry turns.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from pteron.bodies.motion import AngleMotion, BodyMotion, Expression, Moments, PointMotion
from pteron.platforms.motion import Offset, PlatformEquations, PlatformMotion


class Sliding(PlatformEquations):
    """c = p + t0 + phi v, v being the platform point, in m/rad, in a frame that does not turn.

    The first moment of the halves is phi times (m gamma_x, m gamma_y), kg m/rad, and I is the sum
    of m v^2 of what slides and of the inertia of what turns, kg m^2: both per radian.
    """

    coordinates = ("x", "y", "z", "phi")
    slides = True

    def __init__(
        self,
        frame: Sequence[Expression],
        platform_points: Sequence[Expression],
        fixed_offsets: Sequence[Expression],
    ) -> None:
        super().__init__(frame, platform_points, fixed_offsets)
        x0, y0, _ = frame
        self.offsets = [
            Offset(x0 * v[0] + y0 * v[1], ca.SX(3, 1), t)
            for v, t in zip(platform_points, fixed_offsets, strict=True)
        ]

    def motion(
        self, pose: Expression, velocity: Expression, acceleration: Expression
    ) -> PlatformMotion:
        p, dp, ddp = (v[:3] for v in (pose, velocity, acceleration))
        phi, rate, growth = pose[3], velocity[3], acceleration[3]
        points, matrices = [], []
        for v, _, still in self.offsets:
            points.append(PointMotion(p + still + v * phi, dp + v * rate, ddp + v * growth))
            rows = ca.horzcat(ca.SX.eye(3), v)
            matrices.append(ca.vertcat(rows, ca.SX([[0, 0, 0, 1]])))
        k = self.frame[2]
        row = ca.horzcat(ca.SX.eye(3), ca.SX(3, 1))
        body = BodyMotion(p, row, ddp, k, ca.SX([[0, 0, 0, 1]]))
        angle = AngleMotion(k, phi, rate, growth)
        eye = ca.SX.eye(4)
        return PlatformMotion(tuple(points), tuple(matrices), angle, body, eye, hinged=False)

    def _moment(self, inertia: Moments) -> Expression:
        """Return the first moment per radian (3, K)."""
        x0, y0, _ = self.frame
        return ca.mtimes(x0, inertia.hx) + ca.mtimes(y0, inertia.hy)

    def needs(self, motion: PlatformMotion, gravity: Expression, inertia: Moments) -> Expression:
        assert motion.angle is not None
        a_g, growth = motion.body.acceleration - gravity, motion.angle.acceleration
        h = self._moment(inertia)
        force = ca.mtimes(a_g, inertia.m) + h * growth
        return ca.vertcat(force, ca.mtimes(a_g.T, h) + growth * inertia.i)

    def needed_wrench(
        self, motion: PlatformMotion, gravity: Expression, inertia: Moments
    ) -> tuple[Expression, Expression]:
        """Return what it needs, but for the spin of the tool, which I does not tell from slides."""
        assert motion.angle is not None
        h, a_g = self._moment(inertia), motion.body.acceleration - gravity
        force = ca.mtimes(a_g, inertia.m) + h * motion.angle.acceleration
        return force, ca.cross(h * motion.angle.angle, a_g)

    def wrench_matrix(self, motion: PlatformMotion, gravity: Expression) -> Expression:
        return -self.needs(motion, gravity, Moments(*ca.vertsplit(ca.SX.eye(4))))

    def mass_matrix(self, motion: PlatformMotion, inertia: Moments) -> Expression:
        h = self._moment(inertia)
        upper = ca.horzcat(inertia.m * ca.SX.eye(3), h)
        return ca.vertcat(upper, ca.horzcat(h.T, inertia.i))

    def mass_moment(self, motion: PlatformMotion, inertia: Moments) -> Expression:
        assert motion.angle is not None
        return (
            ca.mtimes(motion.body.position, inertia.m) + self._moment(inertia) * motion.angle.angle
        )
