"""The platform of a tripod, 1T2R: its legs keep its three points in planes that stand upright.

x, y and the yaw follow from z, roll and pitch. Plane i has the normal n_i and the point r_i; s_i
leads from P to its platform point, k is the platform's axis. With l = (n2 x n3, n3 x n1, n1 x n2).k
the sum of l_i n_i vanishes, and with it x and y from the sum of l_i n_i.(p + s_i - r_i) = 0, which
leaves A cos(yaw) + B sin(yaw) = C.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from pteron.bodies.motion import Expression, HeldPlane, PointMotion
from pteron.platforms.motion import PlatformMotion
from pteron.platforms.tilting import Tilting, rotation


class Tripod(Tilting):
    """c = p + R s0 with R = Rz(yaw) Ry(pitch) Rx(roll), where the planes fix x, y and yaw.

    The yaw is the one of two that is nearest to 0 where the platform is level; the forces of the
    planes do no work.
    """

    motion_name = "1T2R"
    keeps_points_in_planes, point_is_free = True, False
    coordinates = ("z", "roll", "pitch")
    freedom_text = "moves along its axis and tilts to every side (1T2R), a tripod's"
    order = ("yaw", "pitch", "roll")
    joints = ("x", "y", "z", *order)

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.planes: Sequence[HeldPlane] = self.quantities["planes"]
        k = self.frame[2]
        normals = [plane.normal for plane in self.planes]
        pairs = [(1, 2), (2, 0), (0, 1)]
        self.weights = [ca.dot(ca.cross(normals[i], normals[j]), k) for i, j in pairs]
        """l."""
        horizontal = ca.horzcat(*self.frame[:2])
        flat = [ca.mtimes(horizontal.T, n) for n in normals]
        (a, b), (_, c) = (ca.horzsplit(row) for row in ca.vertsplit(sum(n @ n.T for n in flat)))
        inverse = ca.blockcat([[c, -b], [-b, a]]) / (a * c - b * b)
        self.plane_responses = [ca.mtimes(horizontal, ca.mtimes(inverse, n)) for n in flat]
        """(3, 1) a leg: P moves by the sum of them times n_i . v_i if plane i moves by v_i."""

    def _yaw(self, level: Expression) -> tuple[Expression, Expression]:
        """Return cosine and sine of the yaw that follows from roll and pitch (`level`, (3, 3))."""
        k = self.frame[2]
        a, b, c = ca.SX(0), ca.SX(0), ca.SX(0)
        for weight, (n, r), arm in zip(self.weights, self.planes, self.arms, strict=True):
            u = ca.mtimes(level, arm)
            a, b = a + weight * ca.dot(n, u), b - weight * ca.dot(ca.cross(n, u), k)
            c = c + weight * ca.dot(n, r)
        square = a * a + b * b
        root = self.quantities["side"] * ca.sqrt(square - c * c)
        return (a * c + b * root) / square, (b * c - a * root) / square

    def motion(
        self, pose: Expression, velocity: Expression, acceleration: Expression
    ) -> PlatformMotion:
        """Return the motion of a platform whose x, y and yaw follow from z, roll and pitch."""
        x0, y0, k = self.frame
        (z, roll, pitch), (_, *rates), (ddz, *growths) = (
            ca.vertsplit(v) for v in (pose, velocity, acceleration)
        )
        turns = [(ca.cos(pitch), ca.sin(pitch)), (ca.cos(roll), ca.sin(roll))]
        zero = ca.SX(0)
        level = rotation((y0, x0), turns, (zero, zero), (zero, zero)).matrix
        turns = [self._yaw(level), *turns]
        axes = (k, y0, x0)
        at_rest = rotation(axes, turns, (zero,) * 3, (zero,) * 3)
        arms = [ca.mtimes(at_rest.matrix, arm) for arm in self.arms]
        normals = [plane.normal for plane in self.planes]
        # The planes constrain the sum of l_i s_i x n_i . omega to 0, which determines yaw'.
        trios = zip(self.weights, arms, normals, strict=True)
        yaw_constraint = sum(weight * ca.cross(s, n) for weight, s, n in trios)
        about = ca.horzsplit(at_rest.axes)  # yaw, pitch, roll
        shares = [
            -ca.dot(yaw_constraint, u) / ca.dot(yaw_constraint, about[0])
            for u in (about[2], about[1])
        ]
        spin = ca.horzcat(
            ca.SX(3, 1), about[2] + shares[0] * about[0], about[1] + shares[1] * about[0]
        )
        twist = ca.vertcat(self._carried_velocity(arms, spin) + ca.horzcat(k, ca.SX(3, 2)), spin)
        first = shares[0] * rates[0] + shares[1] * rates[1]
        # Second order: with the centripetal terms of the points' acceleration.
        rates = (first, rates[1], rates[0])
        bias = rotation(axes, turns, rates, (zero,) * 3)
        w = bias.turning
        swings = [ca.cross(bias.growth, s) + ca.cross(w, ca.cross(w, s)) for s in arms]
        trios = zip(self.weights, normals, swings, strict=True)
        drift = -sum(weight * ca.dot(n, v) for weight, n, v in trios) / ca.dot(
            yaw_constraint, about[0]
        )
        second = shares[0] * growths[0] + shares[1] * growths[1] + drift
        turned = rotation(axes, turns, rates, (second, growths[1], growths[0]))
        dw = turned.growth
        accelerations = [ca.cross(dw, s) + ca.cross(w, ca.cross(w, s)) for s in arms]
        triples = zip(self.planes, arms, self.plane_responses, strict=True)
        place = sum(v * ca.dot(n, r - s) for (n, r), s, v in triples) + z * k
        triples = zip(normals, accelerations, self.plane_responses, strict=True)
        ddp = ddz * k - sum(v * ca.dot(n, a) for n, a, v in triples)
        dp = ca.mtimes(twist[:3, :], velocity)
        return self.assemble_motion(PointMotion(place, dp, ddp), turned, twist, None)

    def plane_wrenches(self, motion: PlatformMotion) -> Expression:
        """Return the unit wrenches (3, 6) about P by which the planes hold their points."""
        normals = [plane.normal.T for plane in self.planes]
        pairs = zip(normals, motion.point_twists, strict=True)
        return ca.vertcat(*(ca.mtimes(n, shift[:3, :]) for n, shift in pairs))

    def constraint(self, motion: PlatformMotion) -> Expression:
        """Return the constraint measure of x, y and yaw, 1 at best: 0 at a constraint singularity.

        It is the determinant of the planes' forces and moments about k, divided by its upper bound.
        """
        x, y, k = self.frame
        rows = self.plane_wrenches(motion)
        flat = ca.horzcat(*(ca.mtimes(rows[:, :3], v) for v in (x, y)), ca.mtimes(rows[:, 3:], k))
        center = sum(self.points) / len(self.points)
        square = sum(ca.dot(s - center, s - center) for s in self.points)
        return ca.dot(flat[:, 0], ca.cross(flat[:, 1], flat[:, 2])) / (1.5 * ca.sqrt(square))

    def _carried_velocity(self, arms: Sequence[Expression], spin: Expression) -> Expression:
        """Return the velocity of P (3, m) that keeps the points in their planes during `spin`."""
        total = ca.SX(3, spin.shape[1])
        for (n, _), s, v in zip(self.planes, arms, self.plane_responses, strict=True):
            total = total - ca.mtimes(v, ca.mtimes(ca.cross(s, n).T, spin))
        return total
