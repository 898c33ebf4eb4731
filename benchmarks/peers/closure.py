"""The closed form of four legs that the peers need around their engine, in numbers and in CasADi.

It takes a pose to the joints of the tree in `tree.py`, and the tree's joint forces to actuator
forces. Written apart from `pteron.equations`: a peer shares no equation with what it is compared
to.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

import pteron

Array = NDArray[np.float64]
"""Floats of any shape."""

Expression = Any
"""A CasADi SX matrix."""


def frame_of(leg: Any) -> Array:
    """Return the axes (3, 3), as columns, of a leg's frame: z along d, or x along a lone slider."""
    if leg.type == "PSS":
        e, bar = np.array(leg.slider_direction), leg.bar_direction
        # Far from along the rod, which is where its joint's hinges would fold.
        z = _across(e) if bar is None else np.array(bar) - (e @ np.array(bar)) * e
        z = z / np.linalg.norm(z)
        return np.column_stack([e, np.cross(z, e), z])
    d = np.array(leg.direction)
    a = _across(d)
    return np.column_stack([a, np.cross(d, a), d])


def _across(d: Array) -> Array:
    """Return a unit vector perpendicular to another."""
    i = int(np.argmax(np.abs(d)))
    a = np.roll(np.eye(3)[i], 1)
    a = a - (a @ d) * d
    return np.asarray(a / np.linalg.norm(a), dtype=float)


@dataclass(frozen=True)
class Closure:
    """A machine with four legs in closed form.

    With c = p + s(phi) the platform point of a leg, three rows give all that the leg sees of it:
    rho = d_bar . (c - r), and u = W (c - r) from R1 to R3 in the leg's plane.

    Parameters
    ----------
    rows : array, shape (3, 3, 4)
        d_bar and the rows of W: row, base axis, leg.
    cosine, sine, rest : array, shape (3, 4)
        The rows times the parts of s - r that go with cos phi, sin phi and 1.
    upper, lower : array, shape (4,)
        lu and ll, m.
    sigma : array, shape (4,)
        The elbows' sides.
    """

    rows: Array
    cosine: Array
    sine: Array
    rest: Array
    upper: Array
    lower: Array
    sigma: Array

    @classmethod
    def of(cls, robot: pteron.Manipulator) -> Closure:
        """Return the closure of one machine."""
        x, y, k = (np.array(axis) for axis in robot.platform.frame)
        rows, cosine, sine, rest = [], [], [], []
        legs: tuple[Any, ...] = robot.legs
        for leg in legs:
            d, e, s = np.array(leg.direction), np.array(leg.e), leg.platform_point
            d_bar = d / (d @ e)
            across = frame_of(leg).T[:2]
            three = np.vstack([d_bar, across - np.outer(across @ e, d_bar)])
            three[np.abs(three) < 1e-15] = 0.0
            rows.append(three)
            cosine.append(three @ (s[0] * x + s[1] * y))
            sine.append(three @ (s[0] * y - s[1] * x))
            rest.append(three @ (s[2] * k - np.array(leg.guide_point)))
        return cls(
            np.stack(rows, axis=-1),
            np.stack(cosine, axis=-1),
            np.stack(sine, axis=-1),
            np.stack(rest, axis=-1),
            np.array([leg.upper_length for leg in legs]),
            np.array([leg.lower_length for leg in legs]),
            np.array([float(leg.elbow) for leg in legs]),
        )

    @cached_property
    def right(self) -> Array:
        """(3, 4): b in R^3 times it is the least F with sum d_bar F = b."""
        return np.asarray(np.linalg.pinv(self.rows[0].T), dtype=float)

    @cached_property
    def null(self) -> Array:
        """(4,): the forces whose sum d_bar F vanishes, so that they only turn the platform."""
        return np.asarray(np.linalg.svd(self.rows[0])[2][-1], dtype=float)

    def in_c(self, unbounded: bool) -> tuple[str, Array]:
        """Return its header, which knows of `unbounded` by a macro, and its numbers.

        They are all of it, (29, 4), in the order of `Closure` in closure.h.
        """
        lu, ll = self.upper, self.lower
        circles = [
            (lu + ll) ** 2,
            (lu - ll) ** 2,
            0.5 * (lu**2 - ll**2),
            lu**2 + ll**2,
            self.sigma,
            1.0 / lu,
            1.0 / (lu * ll),
        ]
        parts = [
            self.rows.reshape(9, 4),
            self.cosine,
            self.sine,
            self.rest,
            np.array(circles),
            self.right,
            self.null[None],
        ]
        header = Path(__file__).with_name("closure.h").read_text(encoding="utf-8")
        return header, np.ascontiguousarray(np.concatenate(parts))

    def joints(self, unbounded: bool) -> ca.Function:
        """Return the function from (pose, velocity, acceleration) to (q, v, a, rows).

        Parameters
        ----------
        unbounded : bool
            Whether q holds the cosine and sine of an angle in the angle's place.

        Returns
        -------
        casadi.Function
            Its outputs are in the tree's order: slider, theta_u and theta_l - theta_u of each leg,
            then the pose. `rows` is what `forces` asks for.
        """
        pose, velocity, acceleration = (ca.SX.sym(name, 4) for name in ("x", "dx", "ddx"))
        cosine, sine = ca.cos(pose[3]), ca.sin(pose[3])
        q, v, a, rows = [], [], [], []
        for i in range(4):
            row = ca.SX(ca.sparsify(ca.DM(self.rows[:, :, i])))
            out = cosine * self.cosine[:, i] + sine * self.sine[:, i]
            turn = cosine * self.sine[:, i] - sine * self.cosine[:, i]
            w = ca.mtimes(row, pose[:3]) + out + self.rest[:, i]
            dw = ca.mtimes(row, velocity[:3]) + turn * velocity[3]
            ddw = ca.mtimes(row, acceleration[:3]) + turn * acceleration[3] - out * velocity[3] ** 2
            l_u, l_l, area = self._links(i, w[1:])
            upper_row, lower_row = l_l / area, -l_u / area
            upper, lower = ca.dot(upper_row, dw[1:]), ca.dot(lower_row, dw[1:])
            drift = ddw[1:] + upper**2 * l_u + lower**2 * l_l
            d_upper, d_lower = ca.dot(upper_row, drift), ca.dot(lower_row, drift)
            straight, across = ca.dot(l_u, l_l), area
            if unbounded:
                both = self.upper[i] * self.lower[i]
                q += [w[0], l_u / self.upper[i], straight / both, across / both]
            else:
                q += [w[0], ca.atan2(l_u[1], l_u[0]), ca.atan2(across, straight)]
            v += [dw[0], upper, lower - upper]
            a += [ddw[0], d_upper, d_lower - d_upper]
            rows += [turn, upper_row, lower_row]
        q += [pose[:3], cosine, sine] if unbounded else [pose]
        outputs = [
            ca.vertcat(*q),
            ca.vertcat(*v, velocity),
            ca.vertcat(*a, acceleration),
            ca.vertcat(*rows),
        ]
        return ca.Function("joints", [pose, velocity, acceleration], outputs)

    def _links(self, i: int, u: Expression) -> tuple[Expression, Expression, Expression]:
        """Return l_u, l_l and (l_u x l_l) . d from u, by Lemma 1."""
        lu, ll = self.upper[i], self.lower[i]
        n2 = ca.dot(u, u)
        root = ca.sqrt(((lu + ll) ** 2 - n2) * (n2 - (lu - ll) ** 2))
        share = 0.5 + 0.5 * (lu**2 - ll**2) / n2
        l_u = share * u + (0.5 * self.sigma[i] * root / n2) * ca.vertcat(-u[1], u[0])
        return l_u, u - l_u, -0.5 * self.sigma[i] * root

    def forces(self) -> ca.Function:
        """Return the function from (tau, rows) to F = J^-T (dq/dx)^T tau."""
        tau, rows = ca.SX.sym("tau", 16), ca.SX.sym("rows", 28)
        force, moment = tau[12:15], tau[15]
        pushes, arms = [], []
        for i in range(4):
            turn, upper_row, lower_row = ca.vertsplit(rows[7 * i : 7 * i + 7], [0, 3, 5, 7])
            slider, upper, elbow = ca.vertsplit(tau[3 * i : 3 * i + 3])
            pull = upper_row * (upper - elbow) + lower_row * elbow
            force += ca.mtimes(ca.SX(ca.sparsify(ca.DM(self.rows[1:, :, i]))).T, pull)
            moment += ca.dot(turn[1:], pull)
            pushes.append(slider)
            arms.append(turn[0])
        push, arm = ca.vertcat(*pushes), ca.vertcat(*arms)
        balance = ca.mtimes(ca.SX(ca.sparsify(ca.DM(self.right.T), 1e-15)), force)
        share = (moment - ca.dot(arm, balance)) / ca.dot(arm, self.null)
        return ca.Function("forces", [tau, rows], [push + balance + self.null * share])
