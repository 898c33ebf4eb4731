"""Conditions on a pose as smooth rows, with exact slopes by the pose and by the geometry.

The rows are the machine's own functions in which the geometry is an input, so that one compilation
serves a whole search for a better geometry. A row is 0 or more where its condition holds. The
measure of type II is taken with one sign: a region in which it vanishes nowhere has one.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property, lru_cache

import casadi as ca
import numpy as np

from pteron.kernels import TARGETS, Array, Kernel, Port, general_program, geometry_only
from pteron.kernels.c import compiler
from pteron.kernels.targets import FIXED
from pteron.manipulator import Manipulator
from pteron.workspace.conditions import Condition, conditions


class SmoothConditions:
    """The conditions as rows, for all machines with a topology, which differ in geometry."""

    def __init__(self, robot: Manipulator, required: tuple[Condition, ...]) -> None:
        self.sides = (1.0, -1.0) if any(condition.sized for condition in required) else (1.0,)
        """Signs that the type-II measure may have."""
        pose, side = ca.SX.sym("pose", robot.freedom), ca.SX.sym("side")
        size = general_program(robot, "squared_type_i").inputs[0].size
        self._symbols = pose, side, ca.SX.sym("geometry", size)
        rows = {}
        if set(conditions(robot)) <= set(required):
            floors = {c.element: c.floor for c in required if c.what == "squared_type_i"}
            required = tuple(c for c in required if c.what not in ("room", "squared_type_i"))
            rows = self._scaled_rows(robot, floors)
        for condition in required:
            row = self._output(robot, condition.what, condition.output)[condition.element]
            rows[str(condition)] = row * (side if condition.sized else 1.0) - condition.floor
        self.names = tuple(rows)
        self._rows = ca.vertcat(*rows.values())

    def _scaled_rows(self, robot: Manipulator, floors: Mapping[int, float]) -> dict[str, ca.SX]:
        """Return rows of reach and limits, scaled to about 1 for searches.

        Squared type-I measures stand for the edges of reach; limits are shares of half a range.
        """
        squares = self._output(robot, "squared_type_i", "squares")
        joints = self._output(robot, "joint_coordinates", "joints")
        passive = self._output(robot, "passive_room", "shares")
        legs = range(1, len(robot.legs) + 1)
        rows = {f"leg {i}: type-I measure": squares[i - 1] - floors.get(i - 1, 0.0) for i in legs}
        for i, leg in enumerate(robot.legs, start=1):
            if leg.limits is not None:
                low, high = leg.limits
                ends = {"lower": joints[i - 1] - low, "upper": high - joints[i - 1]}
                for end, distance in ends.items():
                    name = f"leg {i}: {leg.joint.noun}'s {end} limit"
                    rows[name] = distance / ((high - low) / 2.0)
        return rows | {
            f"leg {i}: passive joints' limits": share
            for i, share in enumerate(ca.vertsplit(passive), start=1)
            if not share.is_constant()
        }

    def _output(self, robot: Manipulator, what: str, name: str) -> ca.SX:
        """Return an output of a machine's function, by name, as a symbolic column."""
        program = general_program(robot, what)
        inputs = {"geometry": self._symbols[2], "pose": self._symbols[0]}
        inputs["stored"] = ca.SX(ca.DM(FIXED["stored"](robot)))
        outputs = program.function.call([inputs[port.name] for port in program.inputs])
        return ca.vec(ca.densify(outputs[[port.name for port in program.outputs].index(name)]))

    def rows(self, geometry: Array, poses: Array, side: float) -> Array:
        """Return the rows (..., R); NaN where a leg or its joint has no solution."""
        row_values: Array = self._values(poses, geometry=geometry, side=np.array([side]))
        return row_values

    def slopes(
        self, geometry: Array, poses: Array, side: float, *, by_geometry: bool = False
    ) -> tuple[Array, ...]:
        """Return rows (..., R) and d rows / d pose (..., R, m); with d rows / d geometry on demand.

        Slopes are finite everywhere: a row that is NaN, or rises without end, counts as level.
        """
        kernel = self._all_slopes if by_geometry else self._pose_slopes
        rows, *slopes = kernel(poses, geometry=geometry, side=np.array([side]))
        lost = ~np.isfinite(rows)[..., None]
        return rows, *(np.where(lost | ~np.isfinite(part), 0.0, part) for part in slopes)

    @cached_property
    def _values(self) -> Kernel:
        """The compiled rows."""
        return self._kernel("vm" if compiler() is None else "c", "condition_rows", 0)

    @cached_property
    def _pose_slopes(self) -> Kernel:
        """The compiled rows with their Jacobian by the pose."""
        return self._kernel("vm" if compiler() is None else "c", "condition_pose_slopes", 1)

    @cached_property
    def _all_slopes(self) -> Kernel:
        """The compiled rows with their Jacobians by the pose and by the geometry."""
        return self._kernel("vm", "condition_slopes", 2)

    def _kernel(self, target: str, name: str, slopes: int) -> Kernel:
        """Return the rows compiled for a target, with 0 to 2 Jacobians: by pose and by geometry."""
        pose, _, geometry = self._symbols
        variables = (pose, geometry)[:slopes]
        outputs = [self._rows, *(ca.jacobian(self._rows, symbol) for symbol in variables)]
        dense = ca.cse([ca.densify(row).T for row in outputs])
        ports = (
            Port("pose", pose.shape[:1]),
            Port("side", (1,), shared=True),
            Port("geometry", geometry.shape[:1], shared=True),
        )
        output_ports = tuple(
            Port(f"out{k}", row.shape if k else row.shape[:1]) for k, row in enumerate(outputs)
        )
        fixed_inputs = {"side": np.ones(1), "geometry": np.zeros(geometry.shape[0])}
        function = ca.Function(name, list(self._symbols), dense)
        return TARGETS[target](name, function, ports, output_ports, fixed_inputs)


def smooth_conditions(robot: Manipulator, required: tuple[Condition, ...]) -> SmoothConditions:
    """Return the rows of conditions for all machines with a machine's topology."""
    return _cached_conditions(geometry_only(robot), required)


_cached_conditions = lru_cache(maxsize=16)(SmoothConditions)
