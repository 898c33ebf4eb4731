"""What must hold at a pose of any design of a machine's topology, as smooth rows with gradients.

The rows are those of the machine's own functions in which the geometry is an input, so that one
compilation serves a whole search. A row is 0 or more where its condition holds: first the squared
type-I measure of every leg less its floor's square, finite also out of reach; then each joint's
distance from its ends of way over half its way; passive joints' likewise; and the type-II measure,
of one sign, less its floor, unless that is 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from pteron.kernels import TARGETS, Array, Kernel, Port, bare, general_program
from pteron.kernels.c import compiler
from pteron.manipulator import Manipulator


@dataclass(frozen=True)
class Conditions:
    """The rows of one topology.

    Attributes
    ----------
    names : tuple of str
        What each row says, in words.
    values : Kernel
        Poses (..., m) and a sign (1,) of the type-II measure to rows (..., R).
    pose_slopes : Kernel
        The same to rows (..., R) and d rows / d pose (..., R, m).
    slopes : Kernel
        The same to rows (..., R), d rows / d geometry (..., R, G) and d rows / d pose (..., R, m).
    """

    names: tuple[str, ...]
    values: Kernel
    pose_slopes: Kernel
    slopes: Kernel

    def rows(self, geometry: Array, poses: Array, side: float) -> Array:
        """Return the rows (..., R); NaN where a leg does not reach and its joint has no place."""
        found: Array = self.values(poses, geometry=geometry, side=np.array([side]))
        return found

    def derivatives(self, geometry: Array, poses: Array, side: float) -> tuple[Array, Array, Array]:
        """Return rows (..., R) and their derivatives by geometry and pose; finite everywhere.

        A row that is NaN counts as kept, at 1 and level: a row before it says what is wrong.
        """
        rows, by_geometry, by_pose = self.slopes(poses, geometry=geometry, side=np.array([side]))
        lost = ~np.isfinite(rows)
        rows = np.where(lost, 1.0, rows)
        lost = lost[..., None]
        return (
            rows,
            np.where(lost, 0.0, np.nan_to_num(by_geometry)),
            np.where(lost, 0.0, np.nan_to_num(by_pose)),
        )


def conditions_of(robot: Manipulator, type_i: float, type_ii: float) -> Conditions:
    """Return the conditions of a machine's topology, with floors of the two measures."""
    return _built(bare(robot), type_i, type_ii)


@lru_cache(maxsize=16)
def _built(robot: Manipulator, type_i: float, type_ii: float) -> Conditions:
    parts = {
        what: general_program(robot, what).function
        for what in ("squared_type_i", "joint_coordinates", "passive_room", "type_ii")
    }
    geometry = ca.SX.sym("geometry", parts["type_ii"].size1_in(0))
    pose, side = ca.SX.sym("pose", robot.freedom), ca.SX.sym("side")
    squares, joints, shares, measure = (
        ca.vec(part.call([geometry, pose])[0]) for part in parts.values()
    )
    rows = list(ca.vertsplit(squares - type_i**2))
    names = [f"leg {i}: type-I measure" for i in range(1, robot.freedom + 1)]
    for i, (leg, q) in enumerate(zip(robot.legs, ca.vertsplit(joints), strict=True), start=1):
        if leg.limits is not None:
            low, high = leg.limits
            half = (high - low) / 2.0
            rows += [(q - low) / half, (high - q) / half]
            names += [f"leg {i}: {leg.joint.noun}'s {end} limit" for end in ("lower", "upper")]
    for i, share in enumerate(ca.vertsplit(shares), start=1):
        if not share.is_constant():
            rows.append(share)
            names.append(f"leg {i}: passive joints' limits")
    if type_ii > 0.0:
        rows.append(side * measure - type_ii)
        names.append("type-II measure")
    stacked = ca.vertcat(*rows)
    slopes = [ca.jacobian(stacked, symbol) for symbol in (geometry, pose)]
    ports = (
        Port("pose", (robot.freedom,)),
        Port("side", (1,), shared=True),
        Port("geometry", geometry.shape[:1], shared=True),
    )
    fixed = {"side": np.ones(1), "geometry": np.zeros(geometry.shape[0])}

    def kernel(target: str, name: str, *outputs: ca.SX) -> Kernel:
        dense = ca.cse([ca.densify(output).T for output in outputs])
        function = ca.Function(name, [pose, side, geometry], dense)
        found = tuple(
            Port(f"out{k}", output.shape if k else output.shape[:1])
            for k, output in enumerate(outputs)
        )
        return TARGETS[target](name, function, ports, found, fixed)

    fast = "vm" if compiler() is None else "c"
    return Conditions(
        tuple(names),
        kernel(fast, "design_rows", stacked),
        kernel("vm", "design_pose_slopes", stacked, slopes[1]),
        kernel("vm", "design_slopes", stacked, *slopes),
    )
