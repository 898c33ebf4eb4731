"""Drive forces where there are more legs than coordinates: null space, forces within limits."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pteron.errors import DataError
from pteron.extras import import_extra
from pteron.kernels import Array
from pteron.kinematics.evaluate import evaluate_kernel
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.shapes import OnFailure, PoseLike

_INFEASIBLE, _OPTIMAL = -1, 1
"""Exit flags of DAQP."""

_TOLERANCES = {"primal_tol": 1e-12, "dual_tol": 1e-12}
"""How far bounds may be missed, relative to the greatest; DAQP's own 1e-6 would show in forces."""

_WITHIN = 1e-9
"""Share of its limit by which a force may exceed it: rounding."""


def null_space(robot: RobotLike, pose: PoseLike, *, on_failure: OnFailure = "raise") -> Array:
    """Return a basis of the drive forces that cancel, so that the platform feels nothing.

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
    array, shape (..., n, n - m)
        Orthonormal columns N with J^T N = 0, N at a slider and N m at a crank; without columns
        where the machine has as many legs as coordinates.

    Raises
    ------
    UnreachablePose
        If a leg does not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I), or the actuators do not hold the platform
        (type II).

    Examples
    --------
    >>> import pteron
    >>> pteron.dynamics.null_space("delta-redundant", [0.0, 0.0, -0.6]).round(3).ravel()
    array([ 0.5, -0.5,  0.5, -0.5])
    """
    machine = as_manipulator(robot)
    # The status of a function that needs the platform to be held.
    evaluate_kernel(machine, "condition", on_failure, pose)
    rows: Array = evaluate_kernel(machine, "jacobian", on_failure, pose)
    return _null_spaces(rows)


def _null_spaces(rows: Array) -> Array:
    """Return orthonormal columns (..., n, n - m) across those of J (..., n, m); NaN where J is.

    The first element of each column that is not small is positive.
    """
    n, m = rows.shape[-2:]
    good = np.isfinite(rows).all(axis=(-2, -1))
    columns = np.full((*rows.shape[:-2], n, n - m), np.nan)
    columns[good] = np.linalg.svd(rows[good])[0][..., m:]
    first = (np.abs(columns) > 1e-6).argmax(axis=-2)[..., None, :]
    return np.asarray(columns * np.sign(np.take_along_axis(columns, first, axis=-2)))


class _Limits(NamedTuple):
    """Bounds of forces (n,), and what they are shared by, (n,)."""

    low: Array
    high: Array
    strengths: Array
    reference: Array


def forces_within_limits(
    robot: Manipulator, pose: PoseLike, forces: Array, drive_loads: Array, on_failure: OnFailure
) -> Array:
    """Return drive forces (..., n) that are nearest to the reference within the drives' limits.

    `forces` move the platform in the same way, and are the nearest without limits; `drive_loads`,
    which the drives need besides, are included in both.

    Raises
    ------
    DataError
        If no forces within limits move the platform so.
    """
    greatest, strengths = np.array(robot.greatest_forces), np.array(robot.drive_strengths)
    own_reference = robot.distribution and robot.distribution.reference
    reference = np.zeros(len(strengths)) if own_reference is None else np.array(own_reference)
    beyond = np.argwhere((np.abs(forces) > (1.0 + _WITHIN) * greatest).any(axis=-1))
    if not len(beyond):
        return forces
    rows: Array = evaluate_kernel(robot, "jacobian", "nan", pose)
    rows, drive_loads = (
        np.broadcast_to(array, (*forces.shape[:-1], *array.shape[-k:]))
        for array, k in ((rows, 2), (drive_loads, 1))
    )
    shared = forces.copy()
    for place in map(tuple, beyond.tolist()):
        moving = forces[place] - drive_loads[place]
        ends = -greatest - drive_loads[place], greatest - drive_loads[place]
        nearest = _nearest_forces(rows[place], moving, _Limits(*ends, strengths, reference))
        if nearest is None and on_failure == "raise":
            text = ", ".join(f"{force:.4g}" for force in forces[place])
            index = str(list(place)) if place else ""
            raise DataError(
                f"pose{index}: no drive forces within max_force move the platform so; those of "
                f"least norm are {text}; ask for less acceleration or load"
            )
        shared[place] = np.nan if nearest is None else nearest + drive_loads[place]
    return shared


def _nearest_forces(rows: Array, forces: Array, limits: _Limits) -> Array | None:
    """Return the forces (n,) within limits that act as the given ones; None if there are none.

    They are F + C N z, with C the strengths and N the null space of J^T C. The given forces being
    the nearest without limits, |z| is to be least: a quadratic program of n - m unknowns.
    """
    daqp: Any = import_extra("limits", "daqp", "forces within limits need DAQP")
    directions = _null_spaces(limits.strengths[:, None] * rows)
    internal = limits.strengths[:, None] * directions
    size = internal.shape[1]
    bounds = np.ascontiguousarray(limits.high - forces), np.ascontiguousarray(limits.low - forces)
    linear = directions.T @ ((forces - limits.reference) / limits.strengths)
    scale = float(np.abs(bounds).max())
    z, _, flag, _ = daqp.solve(
        *(np.eye(size), linear / scale, np.ascontiguousarray(internal)),
        *(bound / scale for bound in bounds),
        np.zeros(len(forces), dtype=np.intc),
        **_TOLERANCES,
    )
    if flag == _INFEASIBLE:
        return None
    if flag != _OPTIMAL:
        raise RuntimeError(f"DAQP ended with {flag}")
    return np.asarray(forces + internal @ (scale * z))
