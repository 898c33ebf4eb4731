"""The 3T platform, which only translates: all its points move alike."""

from __future__ import annotations

import casadi as ca

from pteron.bodies.motion import BodyMotion, Expression, Moments, PointMotion
from pteron.platforms.motion import PlatformEquations, PlatformMotion


class Translating(PlatformEquations):
    """c = p + s, with s constant."""

    coordinates = ("x", "y", "z")

    def motion(
        self, pose: Expression, velocity: Expression, acceleration: Expression
    ) -> PlatformMotion:
        points = tuple(
            PointMotion(pose + offset.a + offset.still, velocity, acceleration)
            for offset in self.offsets
        )
        matrix = ca.vertcat(ca.SX.eye(3), ca.SX(1, 3))
        rest = ca.SX(3, 1)
        x, y, k = self.frame
        row = ca.horzcat(ca.SX.eye(3), ca.SX(3, 1))
        body = BodyMotion(pose, row, acceleration, k, ca.SX(1, 4), x, y, rest, rest)
        return PlatformMotion(points, (matrix,) * len(points), None, body, matrix)

    def needs(self, motion: PlatformMotion, gravity: Expression, inertia: Moments) -> Expression:
        return ca.mtimes(motion.body.acceleration - gravity, inertia.m)
