"""The closed form that the peers need around their engine, leg by leg, in CasADi.

For machines with legs R-S-S, P-S-S, R-R-R and U-P-S; `tilting_closure` has platforms that tilt. It
takes a pose to the joints of the tree in `tree.py`, and the tree's joint forces to actuator forces.
As in `closure.py`, no equation is shared with `pteron.equations`. For C and C++ it is printed as a
header.
"""

from __future__ import annotations

import tempfile
from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import casadi as ca
import numpy as np

import pteron
from peers.closure import Array, Expression, frame_of
from pteron.kernels.passes import optimise_function

__all__ = ["KINDS", "LegClosure", "printed", "sparse"]

_INTERFACE = """
#include <stddef.h>

enum { SIZES };

typedef struct {
    char nothing;
} Closure;

typedef struct {
    double rows[ROWS];
} Legs;

static inline void before(const Closure *c, const double *pose, const double *velocity,
                          const double *acceleration, double *q, double *v, double *a,
                          Legs *legs) {
    const double *given[] = {pose, velocity, acceleration};
    double *found[] = {q, v, a, legs->rows};
    (void)c;
    joints(given, found, NULL, NULL, 0);
}

static inline void after(const Closure *c, const Legs *legs, const double *tau, double *torques) {
    const double *given[] = {tau, legs->rows};
    double *found[] = {torques};
    (void)c;
    forces(given, found, NULL, NULL, 0);
}
"""
"""C functions of closure.h, which call those that CasADi prints."""

Point = tuple[Expression, Expression, Expression]
"""w = c - r, w' and w'', each (3, 1), in the leg's frame."""


class Joints(NamedTuple):
    """A leg's joints in the tree: an angle's coordinate is its cosine and its sine."""

    coordinates: list[Expression]
    rates: list[Expression]
    accelerations: list[Expression]
    rows: list[Expression]
    """The rows that `pull` takes."""


class Pull(NamedTuple):
    """A leg's joint forces as forces on the platform."""

    own: Expression
    """At the actuated joint."""
    force: Expression
    """On the platform point, (3, 1), in the leg's frame."""
    divisor: Expression
    """b . g, the last link times what the actuated joint moves its tip by."""
    link: Expression
    """b, (3, 1), in the leg's frame; only what of it counts."""


@dataclass(frozen=True)
class Leg(ABC):
    """A leg in closed form.

    Parameters
    ----------
    frame : array, shape (3, 3)
        Its axes as columns, in the base frame: those of the tree.
    out : tuple of array, shape (3,)
        In that frame, from the guide point to the platform point where p is zero: the parts that go
        with cos phi, sin phi and 1, m.
    crank, rod : float
        Lengths, m.
    sigma : float
        The elbow's side.
    """

    frame: Array
    out: tuple[Array, Array, Array]
    crank: float
    rod: float
    sigma: float

    sizes: ClassVar[tuple[int, int]]
    """Numbers of its joints and of its rows."""

    @classmethod
    def of(cls, leg: Any, platform: Any) -> Leg:
        """Return it for a leg under a platform."""
        frame = frame_of(leg)
        x, y, k = (np.array(axis) for axis in platform.frame)
        s = leg.platform_point
        still = k * s[2] + np.array(leg.fixed_offset) - np.array(leg.guide_point)
        turning = x * s[0] + y * s[1], y * s[0] - x * s[1]
        if platform.tilts:
            still, turning = still - k * s[2], (np.zeros(3), np.zeros(3))
        elif not platform.turns:
            still, turning = still + turning[0], (np.zeros(3), np.zeros(3))
        a, b, rest = (_clean(frame.T @ v) for v in (*turning, still))
        crank = getattr(leg, "upper_length", 0.0)
        rod = getattr(leg, "lower_length", 0.0)
        return cls(_clean(frame), (a, b, rest), crank, rod, float(leg.elbow))

    @abstractmethod
    def joints(self, point: Point) -> Joints:
        """Return the tree's joints."""

    @abstractmethod
    def pull(self, tau: Expression, rows: Expression) -> Pull:
        """Return what its joint forces come to; `rows` are those of `joints`."""


class RSS(Leg):
    """A crank about z and a rod, with a universal joint between them."""

    sizes = 3, 8

    def joints(self, point: Point) -> Joints:
        (x, y, z), (vx, vy, vz), (ax, ay, az) = (ca.vertsplit(v) for v in point)
        ux, uy, bx, by, area = _triangle(x, y, z, self.crank, self.rod, self.sigma)
        crank = (bx * vx + by * vy + z * vz) / area
        wx, wy, square = vx + crank * uy, vy - crank * ux, crank * crank
        straight = ux * bx + uy * by
        pull = bx * ax + by * ay + z * az + wx * wx + wy * wy + vz * vz + square * straight
        d_crank = pull / area
        dwx, dwy = ax + d_crank * uy + square * ux, ay - d_crank * ux + square * uy
        rod = _Rod(self.rod, (bx, by, z), (wx, wy, vz), (dwx, dwy, az))
        per = 1.0 / self.crank
        cosine, sine = straight * per * rod.per_h, area * per * rod.per_h
        return Joints(
            [ux * per, uy * per, cosine, sine, *rod.tilted],
            [crank, rod.turn - crank, rod.tilt],
            [d_crank, rod.d_turn - d_crank, rod.d_tilt],
            [bx, by, z, area, *rod.row, 1.0 + straight * rod.per_h2, rod.per_h],
        )

    def pull(self, tau: Expression, rows: Expression) -> Pull:
        bx, by, z, area, mx, my, share, per_h = ca.vertsplit(rows)
        crank, turn, tilt = ca.vertsplit(tau)
        force = ca.vertcat(turn * mx, turn * my, -tilt * per_h)
        return Pull(crank - turn * share, force, area, ca.vertcat(bx, by, z))


class PSS(Leg):
    """A slider along x and a rod, with a universal joint between them."""

    sizes = 3, 6

    def joints(self, point: Point) -> Joints:
        (x, y, z), (vx, vy, vz), (ax, ay, az) = (ca.vertsplit(v) for v in point)
        bx = self.sigma * ca.sqrt(self.rod**2 - y * y - z * z)
        rate = vx + (y * vy + z * vz) / bx
        wx = vx - rate
        d_rate = ax + (y * ay + z * az + wx * wx + vy * vy + vz * vz) / bx
        rod = _Rod(self.rod, (bx, y, z), (wx, vy, vz), (ax - d_rate, ay, az))
        angles = [bx * rod.per_h, y * rod.per_h, *rod.tilted]
        return Joints(
            [x - bx, *angles],
            [rate, rod.turn, rod.tilt],
            [d_rate, rod.d_turn, rod.d_tilt],
            [bx, y, z, *rod.row, rod.per_h],
        )

    def pull(self, tau: Expression, rows: Expression) -> Pull:
        bx, by, z, mx, my, per_h = ca.vertsplit(rows)
        slide, turn, tilt = ca.vertsplit(tau)
        force = ca.vertcat(turn * mx, turn * my, -tilt * per_h)
        return Pull(slide - turn * mx, force, bx, ca.vertcat(bx, by, z))


class RRR(Leg):
    """A crank and a link that turn about z."""

    sizes = 2, 6

    def joints(self, point: Point) -> Joints:
        (x, y, _), (vx, vy, _), (ax, ay, _) = (ca.vertsplit(v) for v in point)
        ux, uy, bx, by, area = _triangle(x, y, 0.0, self.crank, self.rod, self.sigma)
        per_area, per_square = 1.0 / area, 1.0 / self.rod**2
        crank = (bx * vx + by * vy) * per_area
        lower = -(ux * vx + uy * vy) * per_area
        dx = ax + crank * crank * ux + lower * lower * bx
        dy = ay + crank * crank * uy + lower * lower * by
        d_crank, d_lower = (bx * dx + by * dy) * per_area, -(ux * dx + uy * dy) * per_area
        straight, both = ux * bx + uy * by, 1.0 / (self.crank * self.rod)
        return Joints(
            [ux / self.crank, uy / self.crank, straight * both, area * both],
            [crank, lower - crank],
            [d_crank, d_lower - d_crank],
            [bx, by, area, -by * per_square, bx * per_square, 1.0 + straight * per_square],
        )

    def pull(self, tau: Expression, rows: Expression) -> Pull:
        bx, by, area, mx, my, share = ca.vertsplit(rows)
        crank, turn = ca.vertsplit(tau)
        force = ca.vertcat(turn * mx, turn * my, 0)
        return Pull(crank - turn * share, force, area, ca.vertcat(bx, by, 0))


class UPS(Leg):
    """A cylinder on a universal joint that turns about z, then about y, and a piston along x."""

    sizes = 3, 6

    def joints(self, point: Point) -> Joints:
        (x, y, z), (vx, vy, vz), (ax, ay, az) = (ca.vertsplit(v) for v in point)
        h2, flat = x * x + y * y, x * vx + y * vy
        h, square = ca.sqrt(h2), h2 + z * z
        length = ca.sqrt(square)
        per_h, per = 1.0 / h, 1.0 / length
        per_h2, per2 = per_h * per_h, per * per
        turn, dh = (x * vy - y * vx) * per_h2, flat * per_h
        tilt, rate = (z * dh - h * vz) * per2, (flat + z * vz) * per
        ddh = (x * ax + y * ay) * per_h + h * turn * turn
        d_turn = ((x * ay - y * ax) - 2.0 * turn * flat) * per_h2
        d_tilt = (z * ddh - h * az - 2.0 * length * rate * tilt) * per2
        speed = vx * vx + vy * vy + vz * vz - rate * rate
        return Joints(
            [x * per_h, y * per_h, h * per, -z * per, length],
            [turn, tilt, rate],
            [d_turn, d_tilt, (x * ax + y * ay + z * az + speed) * per],
            [x, y, z, per_h, per2, length],
        )

    def pull(self, tau: Expression, rows: Expression) -> Pull:
        x, y, z, per_h, per2, length = ca.vertsplit(rows)
        turn, tilt, slide = ca.vertsplit(tau)
        about, across = turn * per_h * per_h, tilt * per2
        out = across * z * per_h
        force = ca.vertcat(out * x - about * y, out * y + about * x, -across / per_h)
        return Pull(slide, force, length, ca.vertcat(x, y, z))


KINDS: dict[str, type[Leg]] = {"RSS": RSS, "PSS": PSS, "RRR": RRR, "UPS": UPS}


@dataclass(frozen=True)
class LegClosure:
    """The closed form of a machine.

    Parameters
    ----------
    legs : tuple of Leg
        Its legs.
    axes : array, shape (3, l)
        The base axes that the pose's lengths count along, as columns.
    turns : bool
        Whether the pose has an angle.
    carried : bool
        Whether the tree has the platform's own joints.
    """

    legs: tuple[Leg, ...]
    axes: Array
    turns: bool
    carried: bool

    @classmethod
    def of(cls, robot: pteron.Manipulator, carried: bool = True) -> LegClosure:
        """Return the closure of one machine."""
        platform = robot.platform
        legs = tuple(KINDS[leg.type].of(leg, platform) for leg in robot.legs)
        return cls(legs, _clean(platform.directions.T), platform.turns, carried)

    def joints(self, unbounded: bool) -> ca.Function:
        """Return the function from (pose, velocity, acceleration) to (q, v, a, rows).

        Parameters
        ----------
        unbounded : bool
            Whether q holds the cosine and sine of an angle in the angle's place.

        Returns
        -------
        casadi.Function
            Its outputs are in the tree's order: the joints of each leg, then the pose.
        """
        motion = [ca.SX.sym(name, len(self.legs)) for name in ("x", "dx", "ddx")]
        cosine, sine = self._angle(motion[0])
        pose = motion[0]
        if self.turns and unbounded:
            pose = ca.vertcat(pose[:-1], cosine, sine)
        found: list[list[Expression]] = [[], [], [], []]
        for leg in self.legs:
            coordinates, *others = leg.joints(self._point(leg, motion, cosine, sine))
            if not unbounded:
                # What comes before the angles' pairs is a slider's.
                first = len(coordinates) % 2
                pairs = zip(coordinates[first::2], coordinates[first + 1 :: 2], strict=True)
                coordinates = [*coordinates[:first], *(ca.atan2(s, c) for c, s in pairs)]
            for total, part in zip(found, (coordinates, *others), strict=True):
                total += part
        *joints, rows = found
        if self.carried:
            for part, moved in zip(joints, (pose, *motion[1:]), strict=True):
                part.append(moved)
        # The rows of a platform that turns end with its cosine and sine.
        rows += [cosine, sine] if self.turns else []
        outputs = [ca.vertcat(*part) for part in (*joints, rows)]
        return optimise_function(ca.Function("joints", motion, outputs))

    def _angle(self, pose: Expression) -> tuple[Expression, Expression]:
        return (ca.cos(pose[-1]), ca.sin(pose[-1])) if self.turns else (ca.SX(1), ca.SX(0))

    def _point(
        self, leg: Leg, motion: list[Expression], cosine: Expression, sine: Expression
    ) -> Point:
        """Return the motion of a leg's platform point in the leg's frame."""
        into = sparse(leg.frame.T @ self.axes)
        lengths = self.axes.shape[1]
        w, dw, ddw = (ca.mtimes(into, v[:lengths]) for v in motion)
        a, b, still = (sparse(v) for v in leg.out)
        if self.turns:
            rate, acceleration = motion[1][-1], motion[2][-1]
            turned, lever = a * cosine + b * sine, b * cosine - a * sine
            dw = dw + lever * rate
            ddw = ddw + lever * acceleration - turned * (rate * rate)
            w = w + turned
        return w + still, dw, ddw

    def forces(self) -> ca.Function:
        """Return the function from (tau, rows) to F = J^-T (dq/dx)^T tau."""
        n, lengths = len(self.legs), self.axes.shape[1]
        joints, sizes = ([leg.sizes[k] for leg in self.legs] for k in (0, 1))
        tau = ca.SX.sym("tau", sum(joints) + n * self.carried)
        rows = ca.SX.sym("rows", sum(sizes) + 2 * self.turns)
        load = tau[sum(joints) :] if self.carried else ca.SX(n, 1)
        cosine, sine = ca.vertsplit(rows[-2:]) if self.turns else (ca.SX(1), ca.SX(0))
        pulls, columns = [], []
        for i, leg in enumerate(self.legs):
            own = tau[sum(joints[:i]) : sum(joints[: i + 1])]
            pull = leg.pull(own, rows[sum(sizes[:i]) : sum(sizes[: i + 1])])
            matrix = sparse(self.axes.T @ leg.frame)
            if self.turns:
                lever = sparse(leg.out[1]) * cosine - sparse(leg.out[0]) * sine
                matrix = ca.vertcat(matrix, lever.T)
            load = load + ca.mtimes(matrix, pull.force)
            pulls.append(pull)
            columns.append(ca.mtimes(matrix, pull.link))
        # J = B^-1 A with the divisors in B and the links in A's rows.
        held = _held(columns, load, lengths)
        found = [pull.own + pull.divisor * held[i] for i, pull in enumerate(pulls)]
        return optimise_function(ca.Function("forces", [tau, rows], [ca.vertcat(*found)]))

    def in_c(self, unbounded: bool) -> tuple[str, Array]:
        """Return a header with both functions, and the numbers that it does not hold: none."""
        joints, forces = self.joints(unbounded), self.forces()
        q, v, _, rows = (joints.size1_out(i) for i in range(4))
        text = printed([joints, forces])
        sizes = f"M = {len(self.legs)}, NQ = {q}, NV = {v}, ROWS = {rows}"
        return text + _INTERFACE.replace("SIZES", sizes), np.zeros(1)


def printed(functions: list[ca.Function]) -> str:
    """Return C functions that CasADi prints."""
    with tempfile.TemporaryDirectory() as folder:
        generator = ca.CodeGenerator("closed_form.h", {"with_export": False})
        for function in functions:
            generator.add(function)
        text = Path(generator.generate(f"{folder}/")).read_text(encoding="utf-8")
    # CasADi prints functions that -fPIC keeps from being inlined.
    for name in ("casadi_real casadi_sq(", *(f"int {function.name()}(" for function in functions)):
        text = text.replace(f"\n{name}", f"\nstatic inline {name}")
    return text


class _Rod:
    """A rod on a universal joint that turns about z, then about y: from b, b' and b''."""

    def __init__(
        self,
        length: float,
        b: tuple[Expression, ...],
        db: tuple[Expression, ...],
        ddb: tuple[Expression, ...],
    ) -> None:
        (bx, by, z), (wx, wy, wz), (dwx, dwy, dwz) = b, db, ddb
        h2 = bx * bx + by * by
        h = ca.sqrt(h2)
        self.per_h = 1.0 / h
        self.per_h2 = self.per_h * self.per_h
        self.turn = (bx * wy - by * wx) * self.per_h2
        self.tilt = -wz * self.per_h
        sweep = bx * dwy - by * dwx - 2.0 * self.turn * (bx * wx + by * wy)
        self.d_turn = sweep * self.per_h2
        self.d_tilt = -(dwz + z * self.tilt * self.tilt) * self.per_h
        self.tilted = [h / length, -z / length]
        self.row = [-by * self.per_h2, bx * self.per_h2]


def _triangle(
    x: Expression, y: Expression, z: Any, crank: float, rod: float, sigma: float
) -> tuple[Expression, ...]:
    """Return crank and rod in the crank's plane, and (l_u x b) . d: ball meets circle."""
    n2 = x * x + y * y
    twice = n2 + z * z + (crank**2 - rod**2)
    root = sigma * ca.sqrt(4.0 * crank**2 * n2 - twice * twice)
    half = 0.5 / n2
    ux, uy = half * (twice * x - root * y), half * (twice * y + root * x)
    return ux, uy, x - ux, y - uy, -0.5 * root


def _held(columns: list[Expression], load: Expression, lengths: int) -> Expression:
    """Return f with sum columns f = load; a last row is of moments where they are as many more."""
    forces = [column[:lengths] for column in columns]
    if lengths == 2 and len(columns) == 2:
        (a, b), (c, d) = (ca.vertsplit(force) for force in forces)
        x, y = ca.vertsplit(load)
        per = 1.0 / (a * d - b * c)
        return ca.vertcat((x * d - y * c) * per, (a * y - b * x) * per)
    if lengths == 3 and len(columns) == 3:
        across = [ca.cross(forces[i - 2], forces[i - 1]) for i in range(3)]
        per = 1.0 / ca.dot(forces[0], across[0])
        return ca.vertcat(*(ca.dot(load, normal) * per for normal in across))
    # The forces alone leave one combination free, which the moment settles.
    *held, last = columns
    some = _held([force[:lengths] for force in held], load[:lengths], lengths)
    free = _held([force[:lengths] for force in held], -last[:lengths], lengths)
    arms = ca.vertcat(*(column[-1] for column in held))
    share = (load[-1] - ca.dot(arms, some)) / (last[-1] + ca.dot(arms, free))
    return ca.vertcat(some + share * free, share)


def _clean(array: Array) -> Array:
    """Return an array with what is rounding taken for zero."""
    return np.where(np.abs(array) < 1e-15, 0.0, array)


def sparse(array: Array) -> Expression:
    """Return numbers as an expression that knows its zeros."""
    return ca.SX(ca.sparsify(ca.DM(_clean(array))))
