"""`pose_error`: errors of the tool's pose from errors of joints, backlash and tolerances."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from pteron.arguments import checked_arguments
from pteron.dynamics.joint_space import rate_matrix
from pteron.errors import DataError
from pteron.indices.sensitivities import geometric_sensitivities, tool_pose_changes
from pteron.kernels import Array
from pteron.kinematics.evaluate import evaluate_kernel, finite_rows
from pteron.manipulator import RobotLike, as_manipulator
from pteron.result import Result
from pteron.shapes import Numbers, OnFailure, PerCoordinate, PoseLike


@checked_arguments
@dataclass(frozen=True)
class Tolerances:
    """Tolerances of a machine: each number is a limit (+-) about the nominal value, or a deviation.

    Parameters
    ----------
    joints : float or sequence of float
        Errors of the joints, m or rad: one for all, or one a leg.
    backlash : float or sequence of float
        The whole play of a drive at its joint, m or rad; half of it counts to either side.
    point, length, angle : float
        Tolerance of every dimension of that role, m and rad; see `geometric_sensitivities`.
    named : mapping of str to float
        Tolerances of dimensions by their names, in place of these.
    """

    joints: float | Sequence[float] = 0.0
    backlash: float | Sequence[float] = 0.0
    point: float = 0.0
    length: float = 0.0
    angle: float = 0.0
    named: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False, repr=False)
class PoseError(Result):
    """Errors of the tool's pose.

    Attributes
    ----------
    worst : array, shape (..., m)
        The most that each coordinate may be off, m and rad: the sum of all sizes.
    deviation : array, shape (..., m)
        Its standard deviation, where tolerances are those of independent errors: the root of the
        sum of their squares.
    position : array, shape (...)
        Standard deviation of the position as a whole, m.
    names : tuple of str
        Sources of the errors: the joints by their names, then dimensions.
    parts : array, shape (..., m, p)
        The error of each to first order; the sign is that of a positive error.
    """

    ROWS = "position worst:1 deviation:1"

    worst: PerCoordinate
    deviation: PerCoordinate
    position: Numbers
    names: tuple[str, ...]
    parts: Array


def pose_error(
    robot: RobotLike, pose: PoseLike, tolerances: Tolerances, *, on_failure: OnFailure = "raise"
) -> PoseError:
    """Return the errors of the tool's pose caused by tolerances, to first order.

    J.-P. Merlet, Journal of Mechanical Design 128 (2006) 199-206.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose : array, shape (..., m)
        The poses, m and rad.
    tolerances : Tolerances
        The tolerances.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    PoseError

    Raises
    ------
    DataError
        If a tolerance is negative, of another number of legs, or of no such name.
    UnreachablePose
        If a leg does not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I), or the actuators do not hold the platform
        (type II).

    Examples
    --------
    >>> from pteron.indices import Tolerances, pose_error
    >>> found = pose_error("orthoglide", [0.0, 0.0, 0.0], Tolerances(joints=1e-5, length=2e-5))
    >>> (found.worst * 1e6).round(3)
    array([30., 30., 30.])
    """
    robot = as_manipulator(robot)
    poses = finite_rows(robot, pose, "pose", on_failure)
    sensitivities = geometric_sensitivities(robot, poses, on_failure=on_failure)
    rows: Array = evaluate_kernel(robot, "jacobian", on_failure, poses)
    solvable = np.isfinite(sensitivities.matrix).all(axis=(-2, -1))
    inverse_jacobian = np.full(rows.mT.shape, np.nan)
    inverse_jacobian[solvable] = rate_matrix(rows[solvable], robot.drive_strengths)
    joints = _expand_tolerances(tolerances.joints, "joints", robot.joint_count)
    joints = joints + 0.5 * _expand_tolerances(tolerances.backlash, "backlash", robot.joint_count)
    unknown = sorted(set(tolerances.named) - set(sensitivities.names))
    if unknown:
        raise DataError(
            f"named: {robot.name} has no dimension {unknown[0]!r}; "
            f"geometric_sensitivities(robot, pose).names has them: {sensitivities.names[0]!r}, ..."
        )
    sizes = [
        tolerances.named.get(name, getattr(tolerances, role))
        for name, role in zip(sensitivities.names, sensitivities.roles, strict=True)
    ]
    tolerance_sizes = np.concatenate([joints, _expand_tolerances(sizes, "tolerances", len(sizes))])
    parts = (
        np.concatenate(
            [tool_pose_changes(robot, poses, inverse_jacobian), sensitivities.tool], axis=-1
        )
        * tolerance_sizes
    )
    deviation = np.sqrt((parts**2).sum(axis=-1))
    lengths = len(robot.platform.lengths)
    return PoseError(
        np.abs(parts).sum(axis=-1),
        deviation,
        np.asarray(np.linalg.norm(deviation[..., :lengths], axis=-1)),
        (*robot.joint_names, *sensitivities.names),
        parts,
    )


def _expand_tolerances(setting: float | Sequence[float], name: str, count: int) -> Array:
    """Return tolerances as an array (count,), >= 0, from one number or `count` numbers."""
    sizes = np.asarray(setting, dtype=float)
    if sizes.shape not in ((), (count,)):
        raise DataError(f"{name}: {sizes.shape} given, one number or {count} expected")
    if not (sizes >= 0.0).all():
        raise DataError(f"{name}: {sizes.min():g} given, 0 or more expected")
    return np.broadcast_to(sizes, (count,))
