"""Platforms that only translate, in space (3T) or in a plane (2T): all their points move alike."""

from __future__ import annotations

from typing import ClassVar

import casadi as ca

from pteron.bodies.motion import (
    BodyMotion,
    Expression,
    Moments,
    PointMotion,
    RotationMotion,
    point_rows,
)
from pteron.platforms.motion import PlatformEquations, PlatformMotion


class Translating(PlatformEquations):
    """c = p + s: a leg's point is P's place and a constant vector."""

    motion_name = "3T"
    coordinates: ClassVar[tuple[str, ...]] = ("x", "y", "z")
    freedom_text = "translates in space and does not turn (3T)"

    def motion(
        self, pose: Expression, velocity: Expression, acceleration: Expression
    ) -> PlatformMotion:
        """Return the motion: every point moves as P does."""
        p, dp, ddp = (ca.mtimes(self.directions, v) for v in (pose, velocity, acceleration))
        points = tuple(
            PointMotion(p + offset.a + offset.constant, dp, ddp) for offset in self.offsets
        )
        matrix = ca.vertcat(self.directions, ca.SX(3, len(self.coordinates)))
        zero, axes = ca.SX(3, 1), ca.horzcat(*self.frame)
        x, y, k = self.frame
        row = point_rows(ca.SX.eye(3))
        body = BodyMotion(p, row, ddp, k, ca.SX(1, 6), x, y, zero, zero)
        return PlatformMotion(points, (matrix,) * len(points), RotationMotion(), axes, body, matrix)

    def needs(self, motion: PlatformMotion, gravity: Expression, inertia: Moments) -> Expression:
        """Return the force (m, K) along the pose's lengths required to move the platform."""
        a_g = ca.mtimes(self.directions.T, motion.body.acceleration - gravity)
        return ca.mtimes(a_g, inertia.m)

    def mass_matrix(self, motion: PlatformMotion, inertia: Moments) -> Expression:
        """Return the platform's mass matrix (m, m): mass times the identity."""
        return inertia.m * ca.SX.eye(len(self.coordinates))


class PlanarTranslating(Translating):
    """2T: c = p + s in the plane perpendicular to k."""

    motion_name = "2T"
    coordinates = ("x", "y")
    freedom_text = "moves in a plane and does not turn (2T)"
