"""Kernel of joint coordinates and their derivatives (slopes) by pose and geometry.

The geometry, in the order of `equations.machine.numbers`, is an input: calibration changes it, and
evaluates the slopes in exact arithmetic for the rank of measurements.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import accumulate

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.equations.machine import Machine
from pteron.kernels.choice import TieredKernel, tiered_kernel
from pteron.kernels.program_cache import Program, cached_program
from pteron.kernels.programs import geometry_only
from pteron.manipulator import Manipulator, RobotLike


def slopes_program(robot: RobotLike) -> Program:
    """Return the program of joint coordinates' derivatives by geometry, for a topology.

    The inputs are `geometry` and `pose`. The outputs are `joints` (n,); `jacobian` (n, m), their
    derivatives by the pose; `slopes` (n, k), each leg's derivatives by the numbers of the geometry
    that `slope_columns` returns; `twists` (6, m), the platform's twist per pose rate; `place` (3,),
    the position of P; `axes` (3, 3), the columns of the platform's rotation. If planes hold the
    platform, or it turns about a point or axes that are part of the geometry, a further output is
    `shifts` (6, k): its twist at a fixed pose per change of the geometry.
    """
    layout = geometry_only(robot)
    return cached_program(_key(layout), lambda: _build_program(layout))


def slopes_kernel(robot: RobotLike) -> TieredKernel:
    """Return the kernel of joint coordinates' derivatives by geometry, see `slopes_program`."""
    return _kernel(geometry_only(robot))


def slope_columns(robot: Manipulator) -> list[range]:
    """Return, for each leg, the geometry indices by which its coordinate is differentiated.

    All legs have equally many indices: those of a shorter leg include some of its neighbour's,
    whose derivatives are zero. If planes hold the platform, every leg's coordinate depends on all
    legs; it also depends on the point or axes about which the platform turns, if these are part of
    the geometry.
    """
    sizes = [sum(len(q.value) for q in leg.quantities) + 6 for leg in robot.legs]
    total, most = sum(sizes), max(sizes)
    if robot.platform.turning_keys:
        total += 9 + sum(len(vector) for vector in robot.platform.quantities.values())
    if robot.platform.planes or robot.platform.turning_keys:
        return [range(total)] * len(sizes)
    starts = (min(start, total - most) for start in accumulate(sizes[:-1], initial=0))
    return [range(start, start + most) for start in starts]


@lru_cache(maxsize=16)
def _kernel(layout: Manipulator) -> TieredKernel:
    """Return the kernel of derivatives by geometry of a topology, cached."""
    return tiered_kernel(_key(layout), lambda: _build_program(layout))


def _key(layout: Manipulator) -> tuple[str, Manipulator]:
    """Return the cache key of the derivatives by geometry of a topology."""
    return "geometry_slopes", layout


def _build_program(layout: Manipulator) -> Program:
    """Build the program of joint coordinates and their derivatives by pose and geometry."""
    machine, geometry = Machine.symbolic(layout)
    pose = ca.SX.sym("pose", layout.freedom)
    state = machine.state(pose)
    joints = ca.vertcat(*(leg.coordinate for leg in state.legs))
    slopes = ca.jacobian(joints, geometry)
    parts = [slopes[i, list(part)] for i, part in enumerate(slope_columns(layout))]
    outputs: dict[str, Expression] = {
        "joints": joints,
        "jacobian": ca.jacobian(joints, pose),
        "slopes": ca.vertcat(*parts),
        "twists": state.platform.twist_rows,
        "place": state.platform.body.position,
        "axes": state.platform.axes,
    }
    if layout.platform.planes or layout.platform.turning_keys:
        axes = ca.horzsplit(state.platform.axes)
        count = slope_columns(layout)[0].stop
        point_slopes = ca.jacobian(state.platform.body.position, geometry)[:, :count]
        axis_slopes = [ca.jacobian(axis, geometry)[:, :count] for axis in axes]
        pairs = zip(axes, axis_slopes, strict=True)
        outputs["shifts"] = ca.vertcat(
            point_slopes, sum(ca.mtimes(ca.skew(a), da) for a, da in pairs) / 2
        )
    inputs = {"geometry": geometry, "pose": pose}
    return Program.from_named_expressions("geometry_slopes", inputs, outputs, shared=("geometry",))
