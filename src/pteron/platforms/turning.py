"""Platforms that translate and turn about their axis k: 3T1R (Schoenflies motion), 2T1R."""

from __future__ import annotations

from typing import ClassVar

import casadi as ca

from pteron.bodies.motion import (
    BodyMotion,
    Expression,
    Moments,
    PointMotion,
    RotationMotion,
    Turn,
    point_rows,
)
from pteron.platforms.motion import PlatformEquations, PlatformMotion


class Turning(PlatformEquations):
    """c = p + R(phi) s0 + t0: P's place, a turn about k and a leg's platform point.

    R(phi) = Rot(k, phi) R0 takes vectors of the platform's frame to the base frame; R0 is that
    frame at phi = 0, whose columns are `frame`.
    """

    motion_name = "3T1R"
    coordinates: ClassVar[tuple[str, ...]] = ("x", "y", "z", "phi")
    axis_angle = spin_angle = "phi"
    freedom_text = "translates in space and turns about one axis (3T1R, Schoenflies motion)"

    def motion(
        self, pose: Expression, velocity: Expression, acceleration: Expression
    ) -> PlatformMotion:
        """Return the motion: P translates and the points turn about k."""
        p, dp, ddp = (ca.mtimes(self.directions, v[:-1]) for v in (pose, velocity, acceleration))
        x0, y0, k = self.frame
        turn = Turn(k, velocity[-1], acceleration[-1])
        rotation = RotationMotion((turn,), pose[-1])
        points, matrices = [], []
        for a, b, constant in self.offsets:
            s, lever, dds = _rotate_offset(a, b, rotation)
            points.append(PointMotion(p + s + constant, dp + lever * turn.rate, ddp + dds))
            matrices.append(self._matrix(lever))
        x, y, ddx = _rotate_offset(x0, y0, rotation)
        ddy = _rotate_offset(y0, -x0, rotation)[2]
        body = BodyMotion(p, point_rows(ca.SX.eye(3)), ddp, k, turn.row, x, y, ddx, ddy)
        at_p, axes = self._matrix(ca.SX(3, 1)), ca.horzcat(x, y, k)
        return PlatformMotion(tuple(points), tuple(matrices), rotation, axes, body, at_p)

    def _matrix(self, lever: Expression) -> Expression:
        """Return the matrix (6, m) from pose rates to (v, omega) of a point, `lever` = k x s."""
        zero = ca.SX(3, self.directions.shape[1])
        return ca.blockcat([[self.directions, lever], [zero, self.frame[2]]])

    def needs(self, motion: PlatformMotion, gravity: Expression, inertia: Moments) -> Expression:
        """Return the force along the lengths and the moment about k (m, K) to move the platform."""
        a_g = motion.body.acceleration - gravity
        _, dh, ddh = self._first_moment(motion, inertia)
        force = ca.mtimes(a_g, inertia.m) + ddh
        moment = ca.mtimes(a_g.T, dh) + motion.rotation.turns[0].acceleration * inertia.i
        return ca.vertcat(ca.mtimes(self.directions.T, force), moment)

    def mass_matrix(self, motion: PlatformMotion, inertia: Moments) -> Expression:
        """Return the platform's mass matrix (m, m) in its pose coordinates."""
        coupling = ca.mtimes(self.directions.T, self._first_moment(motion, inertia)[1])
        masses = inertia.m * ca.SX.eye(self.directions.shape[1])
        return ca.blockcat([[masses, coupling], [coupling.T, inertia.i]])

    def _first_moment(
        self, motion: PlatformMotion, inertia: Moments
    ) -> tuple[Expression, Expression, Expression]:
        """Return the first moment h (3, K), kg m, with k x h and h''."""
        x0, y0, _ = self.frame
        h0 = ca.mtimes(x0, inertia.hx) + ca.mtimes(y0, inertia.hy)
        dh0 = ca.mtimes(y0, inertia.hx) - ca.mtimes(x0, inertia.hy)
        return _rotate_offset(h0, dh0, motion.rotation)


class PlanarTurning(Turning):
    """2T1R: c = p + R(phi) s0 + t0 in the plane perpendicular to k."""

    motion_name = "2T1R"
    coordinates = ("x", "y", "phi")
    freedom_text = "moves and turns in a plane (2T1R)"


def _rotate_offset(
    a: Expression, b: Expression, rotation: RotationMotion
) -> tuple[Expression, Expression, Expression]:
    """Return s = a cos(phi) + b sin(phi), k x s and s'' = k x s phi'' - s phi'^2, b being k x a."""
    (turn,) = rotation.turns
    c, s = ca.cos(rotation.angle), ca.sin(rotation.angle)
    rotated, lever = a * c + b * s, b * c - a * s
    return rotated, lever, lever * turn.acceleration - rotated * (turn.rate * turn.rate)
