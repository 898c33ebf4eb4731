"""`geometric_sensitivities`: derivatives of the pose by a machine's dimensions, its joints held."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from pteron.bodies.vectors import Vector, cross, dot
from pteron.dynamics.joint_space import solve_rates
from pteron.equations.machine import numbers
from pteron.equations.variations import arc_number, slope_matrix, slope_terms, variations
from pteron.kernels import Array, general_program, layout_of
from pteron.kinematics import twist
from pteron.kinematics.evaluate import evaluate_kernel, finite_rows
from pteron.legs.kind import LegKind
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.result import Result
from pteron.shapes import OnFailure, PoseLike
from pteron.tolerances import ROUNDING


@dataclass(frozen=True, eq=False, repr=False)
class Sensitivities(Result):
    """Derivatives of the pose by a machine's dimensions.

    Attributes
    ----------
    names : tuple of str
        Names of the dimensions: "leg 1: upper_length", "leg 1: guide_point x", "leg 2: direction
        about y", "platform: center z".
    roles : tuple of {"point", "length", "angle"}
        The role of each.
    units : tuple of str
        The unit of each, m or rad; m/rad for points of a platform that slides.
    matrix : array, shape (..., m, p)
        d pose / d dimension, with the position of the platform's point P.
    tool : array, shape (..., m, p)
        The same, with the position of the tool's centre point.
    """

    ROWS = "names roles units slopes:1"

    names: tuple[str, ...]
    roles: tuple[str, ...]
    units: tuple[str, ...]
    matrix: Array
    tool: Array

    @property
    def slopes(self) -> Array:
        """The derivatives of the pose by the dimensions, (p, ... m): a row for each dimension."""
        columns: Array = np.moveaxis(self.matrix, -1, 0)
        return columns.reshape(len(self.names), -1)


def geometric_sensitivities(
    robot: RobotLike, pose: PoseLike, *, on_failure: OnFailure = "raise"
) -> Sensitivities:
    """Return the derivatives of the pose by every geometric dimension, joints held fixed.

    With joint coordinates q(x, g) and dimensions g, held joints give J dx + (dq/dg) dg = 0. A
    direction has two tilt angles, about base axes made perpendicular to it; other directions of the
    leg that are perpendicular to it are tilted with it, and may be turned about it. Angles out of a
    planar machine's plane and between a leg's parallel axes are left out: they would strain the
    machine or tilt its platform, which a pose cannot express. The point and the axes about which a
    platform turns are included, as in `calibrate`: turns of these axes are about those of the
    platform's frame.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose : array, shape (..., m)
        The poses, m and rad.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    Sensitivities

    Raises
    ------
    UnreachablePose
        If a leg does not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I), or the actuators do not hold the platform
        (type II).

    Examples
    --------
    >>> import numpy as np
    >>> from pteron.indices import geometric_sensitivities
    >>> found = geometric_sensitivities("orthoglide", [0.0, 0.0, 0.0])
    >>> longer = found.names.index("leg 1: lower_length")
    >>> np.abs(found.matrix[:, longer]).round(6)
    array([1., 0., 0.])
    """
    robot = as_manipulator(robot)
    poses = finite_rows(robot, pose, "pose", on_failure)
    manipulability: Array = evaluate_kernel(robot, "manipulability", on_failure, poses)
    rows: Array = evaluate_kernel(robot, "jacobian", on_failure, poses)
    dimensions = list(_dimensions(robot))
    names, roles, units, directions = zip(*dimensions, strict=True)
    flat = poses.reshape(-1, robot.freedom)
    solvable = np.isfinite(np.reshape(manipulability, -1))
    derivatives = np.full((len(flat), robot.freedom, len(names)), np.nan)
    if solvable.any():
        slopes = _slopes(layout_of(robot))
        geometry = np.tile(np.array(numbers(robot))[:, None], (1, int(solvable.sum())))
        slope_columns = np.array(slopes.map(geometry.shape[1])(geometry, flat[solvable].T))
        geometry_slopes = slope_columns.reshape(robot.joint_count, -1, len(geometry)).swapaxes(0, 1)
        jacobian = rows.reshape(-1, robot.joint_count, robot.freedom)[solvable]
        changes = geometry_slopes @ np.array(directions).T
        derivatives[solvable] = -solve_rates(jacobian, changes, robot.drive_strengths)
    matrix = derivatives.reshape((*poses.shape[:-1], *derivatives.shape[1:]))
    return Sensitivities(names, roles, units, matrix, tool_pose_changes(robot, poses, matrix))


@lru_cache(maxsize=64)
def _slopes(robot: Manipulator) -> ca.Function:
    """Return the CasADi function of geometry and pose: dq/dg (n, G), joint coordinates' slopes."""
    function = general_program(robot, "joint_coordinates").function
    geometry, pose = function.sx_in()
    joints = function(geometry, pose)
    return ca.Function("slopes", [geometry, pose], [ca.densify(ca.jacobian(joints, geometry))])


def tool_arm(robot: Manipulator, poses: Array) -> Array:
    """Return the vector (..., 3), m, from P to the tool's centre point in the base frame."""
    _, axes = robot.platform.placement(poses)
    return np.asarray(np.array(robot.platform.tool) @ axes)


def tool_pose_changes(robot: Manipulator, poses: Array, errors: Array) -> Array:
    """Return pose changes (..., m, K) at P converted to those of the tool's centre point."""
    if not robot.platform.angles or not any(robot.platform.tool):
        return errors
    platform, turning = robot.platform, robot.platform.angular
    arm = tool_arm(robot, poses)
    if platform.axis_angle is None:
        turns = twist(robot, poses[..., None, :], np.eye(robot.freedom))[..., 3:]
        levers = np.cross(turns, arm[..., None, :]) @ platform.directions.T
    else:
        lever = np.cross(np.array(platform.axis), arm) @ platform.directions.T
        levers = turning[:, None] * lever[..., None, :]
    tool_changes = errors.copy()
    tool_changes[..., ~turning, :] += levers.mT @ errors
    return tool_changes


_Dimension = tuple[str, str, str, Array]


def _dimensions(robot: Manipulator) -> Iterator[_Dimension]:
    """Yield name, role, unit and geometry change (G,) of every dimension of the machine."""
    size, start = len(numbers(robot)), 0
    point_unit = robot.platform.kind.point_unit
    for i, leg in enumerate(robot.legs, start=1):
        starts: dict[str, int] = {}
        for quantity in leg.quantities:
            starts[quantity.name] = start
            start += len(quantity.value)
        for name in ("platform_point", "fixed_offset"):
            starts[name] = start
            start += 3
        for name, role, changes in _leg_dimensions(leg):
            direction = np.zeros(size)
            for key, change in changes.items():
                direction[starts[key] : starts[key] + len(change)] = change
            unit = "rad" if role == "angle" else "m"
            if name.startswith("platform_point"):
                unit = point_unit
            yield f"leg {i}: {name}", role, unit, direction
    yield from _platform_dimensions(robot)


def _platform_dimensions(robot: Manipulator) -> Iterator[_Dimension]:
    """Yield name, role, unit and geometry change of the platform's own dimensions."""
    changes = [change for change in variations(robot) if change.leg < 0]
    directions = slope_matrix(robot, changes, slope_terms(robot, changes), np.array(numbers(robot)))
    for change, direction in zip(changes, directions.T, strict=True):
        role = "angle" if change.group == "directions" else "point"
        joint = " about " if role == "angle" else " "
        yield (
            f"platform: {change.key}{joint}{'xyz'[change.axis or 0]}",
            role,
            change.unit,
            direction,
        )


def _leg_dimensions(leg: LegKind) -> Iterator[tuple[str, str, dict[str, tuple[float, ...]]]]:
    """Yield name, role and changed quantities of every dimension of a leg."""
    units = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
    for quantity in leg.quantities:
        if quantity.role == "length":
            yield quantity.name, "length", {quantity.name: (1.0,)}
    for name, key in leg.every_key().items():
        if key.role == "angle":
            tangent = math.tan(0.5 * getattr(leg, name))
            yield name, "angle", {arc_number(name): (0.5 * (1.0 + tangent * tangent),)}
    points = [q.name for q in leg.quantities if q.role == "point"] + ["platform_point"]
    points += ["fixed_offset"] if any(leg.fixed_offset) else []
    for name in points:
        for letter, unit in units.items():
            yield f"{name} {letter}", "point", {name: unit}
    vectors: dict[str, Vector] = {
        q.name: (float(q.value[0]), float(q.value[1]), float(q.value[2]))
        for q in leg.quantities
        if q.role in ("direction", "normal")
    }
    directions = [q.name for q in leg.quantities if q.role == "direction"]
    if not directions:  # a ram's pose depends on points alone
        return
    first, *others = directions
    tilted_along = [name for name, v in vectors.items() if abs(dot(v, vectors[first])) < ROUNDING]
    if leg.plane_normal is None:
        yield from _tilts(first, [first, *tilted_along], vectors)
    for name in others:
        if name in tilted_along:
            turn_change = cross(vectors[first], vectors[name])
            yield f"{name} about {first}", "angle", {name: turn_change}
        else:
            yield from _tilts(name, [name], vectors)


def _tilts(
    name: str, moved: list[str], vectors: dict[str, Vector]
) -> Iterator[tuple[str, str, dict[str, tuple[float, ...]]]]:
    """Yield the two tilts of a direction: name, role and changed quantities of each."""
    v = np.array(vectors[name])
    for k in sorted(np.argsort(np.abs(v), kind="stable")[:2]):
        axis = np.eye(3)[k] - v[k] * v
        if np.linalg.norm(axis) == 0.0:
            continue
        axis /= np.linalg.norm(axis)
        changes = {key: tuple(float(x) for x in np.cross(axis, vectors[key])) for key in moved}
        yield f"{name} about {'xyz'[k]}", "angle", changes
