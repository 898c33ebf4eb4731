"""The 3T1R platform, which translates and turns about its axis k (Schoenflies motion)."""

from __future__ import annotations

import casadi as ca

from pteron.bodies.motion import AngleMotion, BodyMotion, Expression, Moments, PointMotion
from pteron.platforms.motion import Load, PlatformEquations, PlatformMotion


class Turning(PlatformEquations):
    """c = p + R(phi) s0, with R a rotation about k."""

    coordinates = ("x", "y", "z", "phi")

    def motion(
        self, pose: Expression, velocity: Expression, acceleration: Expression
    ) -> PlatformMotion:
        p, dp, ddp = pose[:3], velocity[:3], acceleration[:3]
        rate, second = velocity[3], acceleration[3]
        c, s = ca.cos(pose[3]), ca.sin(pose[3])
        # cos(phi) and sin(phi) and their derivatives with respect to time.
        dc, ds = -(rate * s), rate * c
        ddc, dds = -(second * s + rate * rate * c), second * c - rate * rate * s
        points, matrices = [], []
        for a, b, still in self.offsets:
            points.append(
                PointMotion(
                    p + a * c + b * s + still, dp + a * dc + b * ds, ddp + a * ddc + b * dds
                )
            )
            lever = b * c - a * s  # k x s
            matrices.append(_matrix(lever))
        x0, y0, k = self.frame
        x, y = x0 * c + y0 * s, y0 * c - x0 * s
        body = BodyMotion(
            p,
            ca.horzcat(ca.SX.eye(3), ca.SX(3, 1)),
            ddp,
            ca.horzcat(ca.SX(3, 3), k),
            x,
            y,
            x0 * ddc + y0 * dds,
            y0 * ddc - x0 * dds,
        )
        angle = AngleMotion(k, pose[3], rate, second)
        return PlatformMotion(tuple(points), tuple(matrices), angle, body, ca.SX.eye(4))

    def load(self, i: int, force: Expression) -> Load:
        a, b, _ = self.offsets[i]
        f = force[:3, :]
        return Load(f, ca.mtimes(b.T, f), -ca.mtimes(a.T, f), force[3, :])

    def needs(self, motion: PlatformMotion, gravity: Expression, inertia: Moments) -> Load:
        body, angle = motion.body, motion.angle
        assert angle is not None
        x0, y0, _ = self.frame
        a_g = body.acceleration - gravity
        # h = R(phi) h0, the platform's first moment, and k x h.
        h0 = ca.mtimes(x0, inertia.hx) + ca.mtimes(y0, inertia.hy)
        dh0 = ca.mtimes(y0, inertia.hx) - ca.mtimes(x0, inertia.hy)
        c, s = ca.cos(angle.angle), ca.sin(angle.angle)
        square = angle.rate * angle.rate
        ddc, dds = -(angle.acceleration * s + square * c), angle.acceleration * c - square * s
        return Load(
            ca.mtimes(a_g, inertia.m) + ddc * h0 + dds * dh0,
            ca.mtimes(a_g.T, dh0),
            -ca.mtimes(a_g.T, h0),
            angle.acceleration * inertia.i,
        )

    def given(self, wrench: Expression) -> Load:
        none = ca.SX(1, wrench.shape[1])
        return Load(wrench[:3, :], none, none, wrench[3, :])

    def wrench(self, load: Load, motion: PlatformMotion) -> Expression:
        assert motion.angle is not None
        c, s = ca.cos(motion.angle.angle), ca.sin(motion.angle.angle)
        return ca.vertcat(load.force, c * load.cosine + s * load.sine + load.moment)


def _matrix(lever: Expression) -> Expression:
    return ca.vertcat(ca.horzcat(ca.SX.eye(3), lever), ca.SX([[0, 0, 0, 1]]))
