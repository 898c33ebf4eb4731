"""The closed form that the peers need around their engine, of a platform that turns about any axis.

For hexapods of legs U-P-S, P-S-S and R-S-S whose poses are roll, pitch and yaw about the base's
axes. The platform is a free body of the tree: its place and quaternion, its twist in its own frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.linalg import lu  # type: ignore[import-untyped]

import pteron
from peers.closure import Array, Expression
from peers.leg_closure import KINDS, LegClosure, sparse
from peers.library import Missing
from pteron.kernels.passes import optimise_function

__all__ = ["TiltingClosure"]


@dataclass(frozen=True)
class TiltingClosure(LegClosure):
    """The closed form of a hexapod.

    Parameters
    ----------
    points : array, shape (6, 3)
        The platform points, in the platform's frame.
    order : tuple of int
        The rows of the balance of forces and moments, as Gauss pivots them at the home pose.
    """

    points: Array
    order: tuple[int, ...]

    @classmethod
    def of(cls, robot: pteron.Manipulator, carried: bool = True) -> TiltingClosure:
        """Return the closure of one hexapod."""
        platform = robot.platform
        if platform.angle_order != "rpy" or not np.array_equal(platform.frame, np.eye(3)):
            raise ValueError(f"{robot.name}: the peers have roll, pitch, yaw in the base's frame")
        legs = tuple(KINDS[leg.type].of(leg, platform) for leg in robot.legs)
        points = np.array([leg.platform_point for leg in robot.legs])
        rows = pteron.kinematics.twist_jacobian(robot, pteron.random_poses(robot, 1, seed=0)[0])
        order = tuple(int(i) for i in lu(rows.T, p_indices=True)[0].argsort())
        return cls(legs, np.eye(3), True, carried, points, order)

    def joints(self, unbounded: bool) -> ca.Function:
        """Return the function from (pose, velocity, acceleration) to (q, v, a, rows)."""
        if not unbounded:
            raise Missing("its peer is not written for platforms that tilt")
        motion = [ca.SX.sym(name, 6) for name in ("x", "dx", "ddx")]
        rotation, quaternion = _turned(motion[0][3:])
        (roll, pitch, _), (da, db, dc) = (ca.vertsplit(v[3:]) for v in motion[:2])
        sa, ca_, sb, cb = ca.sin(roll), ca.cos(roll), ca.sin(pitch), ca.cos(pitch)
        rates = ca.vertcat(
            ca.horzcat(1, 0, -sb), ca.horzcat(0, ca_, cb * sa), ca.horzcat(0, -sa, cb * ca_)
        )
        own = ca.mtimes(rates, motion[1][3:])
        bend = ca.vertcat(
            -cb * db * dc,
            -sa * da * db + (cb * ca_ * da - sb * sa * db) * dc,
            -ca_ * da * db - (cb * sa * da + sb * ca_ * db) * dc,
        )
        own_rate = ca.mtimes(rates, motion[2][3:]) + bend
        omega, alpha = ca.mtimes(rotation, own), ca.mtimes(rotation, own_rate)
        found: list[list[Expression]] = [[], [], [], []]
        arms = []
        for leg, s0 in zip(self.legs, self.points, strict=True):
            s = ca.mtimes(rotation, sparse(s0))
            turn = ca.cross(omega, s)
            moved = (s, turn, ca.cross(alpha, s) + ca.cross(omega, turn))
            into = sparse(leg.frame.T)
            w, *others = (ca.mtimes(into, v[:3] + d) for v, d in zip(motion, moved, strict=True))
            parts = leg.joints((w + sparse(leg.out[2]), *others))
            for total, part in zip(found, parts, strict=True):
                total += part
            arms.append(s)
        velocity = ca.mtimes(rotation.T, motion[1][:3])
        acceleration = ca.mtimes(rotation.T, motion[2][:3]) - ca.cross(own, velocity)
        *joints, rows = found
        joints[0] += [motion[0][:3], quaternion]
        joints[1] += [velocity, own]
        joints[2] += [acceleration, own_rate]
        outputs = [ca.vertcat(*part) for part in (*joints, [*rows, *arms, ca.vec(rotation)])]
        return optimise_function(ca.Function("joints", motion, ca.cse(outputs)))

    def forces(self) -> ca.Function:
        """Return the function from (tau, rows) to the actuator forces."""
        joints, sizes = ([leg.sizes[k] for leg in self.legs] for k in (0, 1))
        tau = ca.SX.sym("tau", sum(joints) + 6)
        rows = ca.SX.sym("rows", sum(sizes) + 27)
        *own, load = ca.vertsplit(tau, [0, *np.cumsum(joints).tolist(), sum(joints) + 6])
        *given, arms, turned = ca.vertsplit(
            rows, [0, *np.cumsum(sizes).tolist(), sum(sizes) + 18, sum(sizes) + 27]
        )
        rotation = ca.reshape(turned, 3, 3)
        force, moment = (ca.mtimes(rotation, part) for part in (load[:3], load[3:]))
        pulls, columns = [], []
        for leg, s, *parts in zip(self.legs, ca.vertsplit(arms, 3), own, given, strict=True):
            pull = leg.pull(*parts)
            frame = sparse(leg.frame)
            push, link = ca.mtimes(frame, pull.force), ca.mtimes(frame, pull.link)
            force, moment = force + push, moment + ca.cross(s, push)
            pulls.append(pull)
            columns.append(ca.vertcat(link, ca.cross(s, link)))
        held = _solved(ca.horzcat(*columns), ca.vertcat(force, moment), self.order)
        found = [pull.own + pull.divisor * held[i] for i, pull in enumerate(pulls)]
        return optimise_function(ca.Function("forces", [tau, rows], [ca.cse(ca.vertcat(*found))]))


def _turned(angles: Expression) -> tuple[Expression, Expression]:
    """Return the rotation by roll, pitch and yaw, and its quaternion, the scalar last."""
    (a, b, c), (p, q, r) = ca.vertsplit(ca.cos(angles)), ca.vertsplit(ca.sin(angles))
    rotation = ca.vertcat(
        ca.horzcat(c * b, c * q * p - r * a, c * q * a + r * p),
        ca.horzcat(r * b, r * q * p + c * a, r * q * a - c * p),
        ca.horzcat(-q, b * p, b * a),
    )
    (a, b, c), (p, q, r) = (ca.vertsplit(f(0.5 * angles)) for f in (ca.cos, ca.sin))
    parts = p * b * c - a * q * r, a * q * c + p * b * r, a * b * r - p * q * c
    return rotation, ca.vertcat(*parts, a * b * c + p * q * r)


def _solved(matrix: Expression, right: Expression, order: tuple[int, ...]) -> Expression:
    """Return x with matrix x = right, by Gauss with pivots in this order of rows."""
    rows = [ca.horzsplit(ca.horzcat(matrix, right)[i, :]) for i in order]
    for k in range(len(rows)):
        per = 1.0 / rows[k][k]
        rows[k] = [entry * per for entry in rows[k]]
        for i in range(k + 1, len(rows)):
            rows[i] = [v - rows[i][k] * u for v, u in zip(rows[i], rows[k], strict=True)]
    found: list[Expression] = []
    for row in reversed(rows):
        known = zip(row[len(rows) - len(found) : -1], found, strict=True)
        found.insert(0, row[-1] - sum(v * x for v, x in known))
    return ca.vertcat(*found)
