"""The closed form of a Delta that the peers need around their engine, in CasADi.

It takes a pose to the joints of the tree in `tree.py`: crank, and the two hinges of the universal
joint at its end; and the tree's joint forces to actuator torques. As in `closure.py`, no equation
is shared with `pteron.equations`. For C and C++ it is printed as a header.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

import pteron
from peers.closure import Array, Expression, plane

_ROWS = 8
"""How many numbers of a leg its projection needs."""

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
"""What closure.h offers to the peers, for the functions that CasADi prints."""


@dataclass(frozen=True)
class RodLeg:
    """What the closed form needs of a crank and its rod.

    Parameters
    ----------
    frame : array, shape (3, 3)
        Two axes of the crank's plane and d, as columns.
    offset : array, shape (3,)
        From the crank's axis to the platform point where p is zero, in that frame, m.
    crank, rod : float
        Their lengths, m.
    sigma : float
        The elbow's side.
    """

    frame: Array
    offset: Array
    crank: float
    rod: float
    sigma: float

    @classmethod
    def of(cls, leg: Any, axes: Array) -> RodLeg:
        """Return it for an R-S-S leg; the platform's axes are columns."""
        frame = plane(leg)
        frame[np.abs(frame) < 1e-15] = 0.0
        offset = frame.T @ (axes @ np.array(leg.platform_point) - np.array(leg.guide_point))
        offset[np.abs(offset) < 1e-15] = 0.0
        return cls(frame, offset, leg.upper_length, leg.lower_length, float(leg.elbow))

    def joints(
        self, pose: Expression, velocity: Expression, acceleration: Expression
    ) -> tuple[list[Expression], list[Expression], list[Expression], list[Expression]]:
        """Return cosines and sines of the angles, rates, their rates, and what `pull` asks for."""
        into = ca.SX(ca.sparsify(ca.DM(self.frame.T)))
        x, y, z = ca.vertsplit(ca.mtimes(into, pose) + self.offset)
        vx, vy, vz = ca.vertsplit(ca.mtimes(into, velocity))
        ax, ay, az = ca.vertsplit(ca.mtimes(into, acceleration))

        # Crank (ux, uy) and rod (bx, by, z): where the rod's ball meets the crank's circle.
        n2 = x * x + y * y
        twice = n2 + z * z + (self.crank**2 - self.rod**2)
        root = self.sigma * ca.sqrt(4.0 * self.crank**2 * n2 - twice * twice)
        half = 0.5 / n2
        ux, uy = half * (twice * x - root * y), half * (twice * y + root * x)
        bx, by = x - ux, y - uy
        area = -0.5 * root  # (l_u x b) . d

        # The crank's rate, then the rod's end against the other.
        crank = (bx * vx + by * vy + z * vz) / area
        wx, wy = vx + crank * uy, vy - crank * ux
        square = crank * crank
        pull = bx * ax + by * ay + z * az + wx * wx + wy * wy + vz * vz
        d_crank = (pull + square * (bx * ux + by * uy)) / area
        dwx, dwy = ax + d_crank * uy + square * ux, ay - d_crank * ux + square * uy

        # The rod's angles: in the crank's plane, and out of it.
        h2 = bx * bx + by * by
        per_h = ca.sqrt(h2) / h2
        per_h2 = per_h * per_h
        turn, tilt = (bx * wy - by * wx) * per_h2, -vz * per_h
        d_turn = (bx * dwy - by * dwx - 2.0 * turn * (bx * wx + by * wy)) * per_h2
        d_tilt = -(az + z * tilt * tilt) * per_h

        straight = ux * bx + uy * by
        angles = [
            *(ux / self.crank, uy / self.crank),
            *(straight * per_h / self.crank, area * per_h / self.crank),
            *(h2 * per_h / self.rod, -z / self.rod),
        ]
        rows = [bx, by, z, area, -by * per_h2, bx * per_h2, 1.0 + straight * per_h2, -per_h]
        return (
            angles,
            [crank, turn - crank, tilt],
            [d_crank, d_turn - d_crank, d_tilt],
            rows,
        )

    def pull(
        self, tau: Expression, rows: Expression
    ) -> tuple[Expression, Expression, Expression, Expression]:
        """Return the crank's own torque, (l_u x b) . d, the rod b, and the force on the platform.

        Rod and force are in the base frame.
        """
        bx, by, z, area, mx, my, share, tilted = ca.vertsplit(rows)
        crank, turn, tilt = ca.vertsplit(tau)
        out = ca.SX(ca.sparsify(ca.DM(self.frame)))
        rod = ca.mtimes(out, ca.vertcat(bx, by, z))
        force = ca.mtimes(out, ca.vertcat(turn * mx, turn * my, tilt * tilted))
        return crank - turn * share, area, rod, force


@dataclass(frozen=True)
class RodClosure:
    """The closed form of a Delta.

    Parameters
    ----------
    legs : tuple of RodLeg
        Its three legs.
    """

    legs: tuple[RodLeg, ...]

    @classmethod
    def of(cls, robot: pteron.Manipulator) -> RodClosure:
        """Return the closure of one machine."""
        axes = np.column_stack(robot.platform.frame)
        return cls(tuple(RodLeg.of(leg, axes) for leg in robot.legs))

    def joints(self, unbounded: bool) -> ca.Function:
        """Return the function from (pose, velocity, acceleration) to (q, v, a, rows).

        Parameters
        ----------
        unbounded : bool
            Whether q holds the cosine and sine of an angle in the angle's place.

        Returns
        -------
        casadi.Function
            Its outputs are in the tree's order: the three angles of each leg, then the pose.
        """
        motion = [ca.SX.sym(name, 3) for name in ("x", "dx", "ddx")]
        found: list[list[Expression]] = [[], [], [], []]
        for leg in self.legs:
            angles, *others = leg.joints(*motion)
            if not unbounded:
                pairs = zip(angles[::2], angles[1::2], strict=True)
                angles = [ca.atan2(sine, cosine) for cosine, sine in pairs]
            for total, part in zip(found, (angles, *others), strict=True):
                total += part
        q, v, a, rows = found
        outputs = [ca.vertcat(*part, moved) for part, moved in zip((q, v, a), motion, strict=True)]
        return ca.Function("joints", motion, [*outputs, ca.vertcat(*rows)])

    def forces(self) -> ca.Function:
        """Return the function from (tau, rows) to F = J^-T (dq/dx)^T tau."""
        tau, rows = ca.SX.sym("tau", 12), ca.SX.sym("rows", _ROWS * 3)
        force, own, areas, rods = tau[9:], [], [], []
        for i, leg in enumerate(self.legs):
            of_leg = rows[_ROWS * i : _ROWS * (i + 1)]
            torque, area, rod, pull = leg.pull(tau[3 * i : 3 * i + 3], of_leg)
            own.append(torque)
            areas.append(area)
            rods.append(rod)
            force += pull
        # J = diag(1 / area) A with the rods in A's rows; A^-T by cross products.
        across = [ca.cross(rods[i - 2], rods[i - 1]) for i in range(3)]
        half = 0.5 / ca.dot(rods[0], across[0])
        forces = [
            torque + 2.0 * area * (half * ca.dot(force, normal))
            for torque, area, normal in zip(own, areas, across, strict=True)
        ]
        return ca.Function("forces", [tau, rows], [ca.vertcat(*forces)])

    def in_c(self, unbounded: bool) -> tuple[str, Array]:
        """Return a header with both functions, and the numbers that it does not hold: none."""
        joints, forces = self.joints(unbounded), self.forces()
        q, v, _, rows = (joints.size1_out(i) for i in range(4))
        with tempfile.TemporaryDirectory() as folder:
            generator = ca.CodeGenerator("closed_form.h", {"with_export": False})
            generator.add(joints)
            generator.add(forces)
            text = Path(generator.generate(f"{folder}/")).read_text(encoding="utf-8")
        # CasADi prints functions that -fPIC keeps from being inlined.
        for function in ("casadi_real casadi_sq(", "int joints(", "int forces("):
            text = text.replace(f"\n{function}", f"\nstatic inline {function}")
        sizes = f"M = 3, NQ = {q}, NV = {v}, ROWS = {rows}"
        return text + _INTERFACE.replace("SIZES", sizes), np.zeros(1)
