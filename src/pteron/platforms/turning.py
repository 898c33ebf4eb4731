"""Platforms that translate and turn about their axis k: 3T1R (Schoenflies motion), 2T1R."""

from __future__ import annotations

from typing import ClassVar

import casadi as ca

from pteron.bodies.motion import AngleMotion, BodyMotion, Expression, Moments, PointMotion
from pteron.platforms.motion import PlatformEquations, PlatformMotion


class Turning(PlatformEquations):
    """c = p + R(phi) s0, with R a rotation about k."""

    coordinates: ClassVar[tuple[str, ...]] = ("x", "y", "z", "phi")

    def motion(
        self, pose: Expression, velocity: Expression, acceleration: Expression
    ) -> PlatformMotion:
        p, dp, ddp = (ca.mtimes(self.directions, v[:-1]) for v in (pose, velocity, acceleration))
        angle = AngleMotion(self.frame[2], pose[-1], velocity[-1], acceleration[-1])
        points, matrices = [], []
        for a, b, still in self.offsets:
            s, lever, dds = _turned(a, b, angle)
            points.append(PointMotion(p + s + still, dp + lever * angle.rate, ddp + dds))
            matrices.append(self._matrix(lever))
        x0, y0, k = self.frame
        x, y, ddx = _turned(x0, y0, angle)
        ddy = _turned(y0, -x0, angle)[2]
        row = ca.horzcat(ca.SX.eye(3), ca.SX(3, 1))
        body = BodyMotion(p, row, ddp, k, ca.SX([[0, 0, 0, 1]]), x, y, ddx, ddy)
        at_p = self._matrix(ca.SX(3, 1))
        return PlatformMotion(tuple(points), tuple(matrices), angle, body, at_p)

    def _matrix(self, lever: Expression) -> Expression:
        """Return d (c, phi)/dx (4, m) of a point with this k x s."""
        still = ca.SX(1, self.directions.shape[1])
        return ca.vertcat(ca.horzcat(self.directions, lever), ca.horzcat(still, 1))

    def needs(self, motion: PlatformMotion, gravity: Expression, inertia: Moments) -> Expression:
        body, angle = motion.body, motion.angle
        assert angle is not None
        a_g = body.acceleration - gravity
        # The first moment h turns with the platform: h, k x h and h''.
        x0, y0, _ = self.frame
        h0 = ca.mtimes(x0, inertia.hx) + ca.mtimes(y0, inertia.hy)
        dh0 = ca.mtimes(y0, inertia.hx) - ca.mtimes(x0, inertia.hy)
        _, dh, ddh = _turned(h0, dh0, angle)
        force = ca.mtimes(a_g, inertia.m) + ddh
        moment = ca.mtimes(a_g.T, dh) + angle.acceleration * inertia.i
        return ca.vertcat(ca.mtimes(self.directions.T, force), moment)


class PlanarTurning(Turning):
    """The same in the plane across k."""

    coordinates = ("x", "y", "phi")


def _turned(
    a: Expression, b: Expression, angle: AngleMotion
) -> tuple[Expression, Expression, Expression]:
    """Return s = a cos(phi) + b sin(phi), k x s and s'' = k x s phi'' - s phi'^2, b being k x a."""
    c, s = ca.cos(angle.angle), ca.sin(angle.angle)
    turned, lever = a * c + b * s, b * c - a * s
    return turned, lever, lever * angle.acceleration - turned * (angle.rate * angle.rate)
