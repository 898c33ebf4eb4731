"""Conversion of poses to positions and rotations, and of their rates to twists, and back.

A rotation is a matrix (..., 3, 3) that takes vectors of the platform's frame to the base frame, or
a quaternion (..., 4), scalar last, or tilt and torsion (..., 3).
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from pteron.errors import DataError
from pteron.kernels import Array, as_array, numeric
from pteron.kernels.functions import ANGLES
from pteron.kinematics.evaluate import (
    evaluate_kernel,
    expect_choice,
    finite_rows,
    no_place,
    place,
    singular_angles,
)
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.platforms.nearest_pose import nearest_pose
from pteron.shapes import Matrices, OnFailure, PerCoordinate, PoseLike, Vectors
from pteron.tolerances import ROOT_OF_ROUNDING

RotationForm = Literal["matrix", "quaternion", "tilt-torsion"]
"""The forms in which a rotation is written."""

_SHAPES: dict[str, tuple[int, ...]] = {"matrix": (3, 3), "quaternion": (4,), "tilt-torsion": (3,)}


def position_of(robot: RobotLike, pose: PoseLike) -> Vectors:
    """Return the positions (..., 3), m, of the platform's reference point P in the base frame.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose : array, shape (..., m)
        The poses, m and rad.

    Returns
    -------
    array, shape (..., 3)
        m; NaN where a tripod's planes allow no such pose.

    Examples
    --------
    >>> import pteron
    >>> pteron.kinematics.position_of("wrist", [0.1, 0.2, 0.3])
    array([0.  , 0.  , 0.12])
    """
    robot = as_manipulator(robot)
    return robot.platform.placement(finite_rows(robot, pose, "pose"))[0]


def rotation_of(robot: RobotLike, pose: PoseLike, *, form: RotationForm = "matrix") -> Array:
    """Return the platform's rotation at a pose: a matrix, a quaternion or tilt and torsion.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose : array, shape (..., m)
        The poses, m and rad.
    form : {"matrix", "quaternion", "tilt-torsion"}
        A matrix; a quaternion (x, y, z, w), as SciPy and ROS have it, with w >= 0; or (azimuth,
        tilt, torsion) of R = Rz(azimuth) Ry(tilt) Rz(torsion - azimuth) in the platform's frame at
        angles zero, of which the azimuth is 0 where the platform is level.

    Returns
    -------
    array, shape (..., 3, 3), (..., 4) or (..., 3)
        NaN where a tripod's planes allow no such pose.

    Examples
    --------
    >>> import numpy as np, pteron
    >>> pose = [0, 0, 2.0, 0, 0, np.pi / 2]
    >>> pteron.rotation_of("stewart", pose, form="quaternion").round(4) + 0.0
    array([0.    , 0.    , 0.7071, 0.7071])
    """
    robot = as_manipulator(robot)
    _expect_form(form)
    matrix = np.swapaxes(robot.platform.placement(finite_rows(robot, pose, "pose"))[1], -1, -2)
    if form == "matrix":
        return np.ascontiguousarray(matrix)
    if form == "tilt-torsion":
        return _tilt_torsion(_frame_at_zero(robot) @ matrix)
    return _quaternion(matrix)


def pose_of(
    robot: RobotLike,
    position: ArrayLike,
    rotation: ArrayLike,
    *,
    form: RotationForm = "matrix",
    on_failure: OnFailure = "raise",
) -> PerCoordinate:
    """Return the poses (..., m) with a position of P and a rotation, which broadcast.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    position : array, shape (..., 3)
        P in the base frame, m.
    rotation : array, shape (..., 3, 3), (..., 4) or (..., 3)
        The platform's rotation, written as `form` says; see `rotation_of`.
    form : {"matrix", "quaternion", "tilt-torsion"}
        How it is written. A quaternion may have any length but 0.
    on_failure : {"raise", "nan"}
        Whether what the motion cannot have raises, or gives NaN.

    Returns
    -------
    array, shape (..., m)
        m and rad. Where the angles are singular, at a pitch (ry) of +-90 degrees, roll (rx) is 0.

    Raises
    ------
    DataError
        If a matrix is no rotation, or the platform's motion has no such position and rotation: by
        more than 1e-7 m or rad.

    Examples
    --------
    >>> import numpy as np, pteron
    >>> turn = [0, 0, 1, 1]
    >>> pteron.pose_of("stewart", [0.0, 0.1, 2.0], turn, form="quaternion").round(4) + 0.0
    array([0.    , 0.1   , 2.    , 0.    , 0.    , 1.5708])
    """
    robot = as_manipulator(robot)
    _expect_form(form)
    expect_choice(on_failure)
    positions = as_array(position, "position", (3,))
    rotations = as_array(rotation, "rotation", _SHAPES[form])
    matrix = _matrix(robot, rotations, form)
    lead = np.broadcast_shapes(positions.shape[:-1], matrix.shape[:-2])
    positions, matrix = (
        np.broadcast_to(positions, (*lead, 3)),
        np.broadcast_to(matrix, (*lead, 3, 3)),
    )
    skewed = np.abs(np.swapaxes(matrix, -1, -2) @ matrix - np.eye(3)).max(axis=(-1, -2))
    skewed = np.where(np.linalg.det(matrix) > 0.0, skewed, np.inf)
    pose = nearest_pose(robot.platform, positions, matrix)
    nearest_position, axes = robot.platform.placement(pose)
    distance = np.linalg.norm(nearest_position - positions, axis=-1)
    turned = np.linalg.norm(axes @ matrix - np.eye(3), axis=(-1, -2)) / np.sqrt(2.0)
    good = (
        (skewed <= ROOT_OF_ROUNDING) & (distance <= ROOT_OF_ROUNDING) & (turned <= ROOT_OF_ROUNDING)
    )
    if good.all():
        return pose
    if on_failure == "nan":
        return np.where(good[..., None], pose, np.nan)
    index = tuple(int(i) for i in np.argwhere(~good)[0])
    numbers = np.isfinite(positions[index]).all() and np.isfinite(matrix[index]).all()
    if not numbers:
        raise DataError(f"{place('position', index)}, rotation: finite numbers expected")
    if np.isnan(distance[index]):
        raise no_place(index)
    if not skewed[index] <= ROOT_OF_ROUNDING:
        raise DataError(
            f"{place('rotation', index)}: no rotation: its columns are no unit vectors at right "
            "angles that turn by the right hand"
        )
    angle = 2.0 * np.arcsin(min(turned[index] / 2.0, 1.0))
    raise DataError(
        f"{place('position', index)}, rotation: a {robot.platform.motion} platform cannot have "
        f"them: {_difference_text(distance[index], angle)} from the "
        f"nearest pose, {', '.join(robot.coordinates)} = "
        f"{', '.join(f'{v:.4g}' for v in pose[index] + 0.0)}"
    )


def twist(
    robot: RobotLike, pose: PoseLike, velocity: PoseLike, *, on_failure: OnFailure = "raise"
) -> Array:
    """Return the twist of the platform: the velocity of P, then the angular velocity.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose, velocity : array, shape (..., m)
        The poses and their derivatives with respect to time; m, rad and s.
    on_failure : {"raise", "nan"}
        Whether a pose that a tripod's planes do not allow raises, or gives NaN.

    Returns
    -------
    array, shape (..., 6)
        (v, omega) in the base frame, m/s and rad/s.

    Raises
    ------
    UnreachablePose
        If a tripod's planes do not allow a pose.

    Examples
    --------
    >>> import pteron
    >>> pteron.twist("stewart", [0, 0, 2.0, 0, 0, 0], [0.1, 0, 0, 0, 0, 0.5]) + 0.0
    array([0.1, 0. , 0. , 0. , 0. , 0.5])
    """
    twists: Array = evaluate_kernel(robot, "twist", on_failure, pose, velocity)
    is_missing = np.isnan(twists).any(axis=-1)
    if on_failure == "raise" and is_missing.any():
        index = tuple(int(i) for i in np.argwhere(is_missing)[0])
        raise no_place(index)
    return twists


def velocity_of(
    robot: RobotLike, pose: PoseLike, twist: ArrayLike, *, on_failure: OnFailure = "raise"
) -> PerCoordinate:
    """Return the pose's time derivative (..., m) for a twist of the platform (..., 6).

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose : array, shape (..., m)
        The poses, m and rad.
    twist : array, shape (..., 6)
        (v, omega) of P in the base frame, m/s and rad/s.
    on_failure : {"raise", "nan"}
        Whether a twist that the motion cannot have, or a pose with singular angles, raises, or
        gives NaN.

    Returns
    -------
    array, shape (..., m)
        m/s and rad/s.

    Raises
    ------
    DataError
        If the platform cannot move so: by more than 1e-7 m/s or rad/s.
    SingularPose
        If the pose's angles are singular, which the machine need not be.

    Examples
    --------
    >>> import pteron
    >>> pteron.kinematics.velocity_of("stewart", [0, 0, 2.0, 0, 0, 0], [0.1, 0, 0, 0, 0, 0.5]) + 0.0
    array([0.1, 0. , 0. , 0. , 0. , 0.5])
    """
    robot = as_manipulator(robot)
    expect_choice(on_failure)
    if robot.platform.slides:
        raise DataError(
            "twist: phi slides the halves of this platform, of which no twist of P tells"
        )
    poses = finite_rows(robot, pose, "pose", on_failure)
    twists = as_array(twist, "twist", (6,), columns=())
    velocity, infeasible, _ = numeric(robot, "velocity_of_twist")(poses, twists)
    poses = np.broadcast_to(poses, (*velocity.shape[:-1], robot.freedom))
    infeasible_sizes = [
        np.linalg.norm(part, axis=-1) for part in (infeasible[..., :3], infeasible[..., 3:])
    ]
    size = ROOT_OF_ROUNDING * np.maximum(1.0, np.abs(twists).max(axis=-1))
    known = robot.platform.angle_measures(poses) > ANGLES
    good = known & (infeasible_sizes[0] <= size) & (infeasible_sizes[1] <= size)
    if good.all():
        return np.asarray(velocity)
    if on_failure == "nan":
        return np.where(good[..., None], velocity, np.nan)
    index = tuple(int(i) for i in np.argwhere(~good)[0])
    if not np.isfinite(np.broadcast_to(twists, (*good.shape, 6))[index]).all():
        raise DataError(f"{place('twist', index)}: finite numbers expected")
    if np.isnan(velocity[index]).any() and np.isnan(infeasible_sizes[0][index]):
        raise no_place(index)
    if not known[index]:
        raise singular_angles(robot, poses[index], index)
    speed, turning = (size[index] for size in infeasible_sizes)
    remainder = _difference_text(speed, turning, "/s")
    raise DataError(
        f"{place('twist', index)}: a {robot.platform.motion} platform cannot move so at this pose: "
        f"{remainder} are left of it"
    )


def twist_jacobian(
    robot: RobotLike, pose: PoseLike, *, on_failure: OnFailure = "raise"
) -> Matrices:
    """Return the Jacobian (..., n, 6) against the platform's twist: joint rates = A @ twist.

    Unlike the rows of `jacobian`, which refer to the pose's derivative, these rows do not depend on
    the choice of angles and their singularities: row i is (g, s x g), with g the derivative by the
    velocity of the leg's platform point and s the vector from P to that point.

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
    array, shape (..., n, 6)
        Of a platform that does not tilt the part of each row that its motion can have.

    Raises
    ------
    UnreachablePose
        If a leg whose row depends on the pose does not reach it.
    SingularPose
        If such a leg is stretched or folded (type I).

    Examples
    --------
    >>> import pteron
    >>> pteron.kinematics.twist_jacobian("tripteron", [0.0, 0.0, 0.0])
    array([[1., 0., 0., 0., 0., 0.],
           [0., 1., 0., 0., 0., 0.],
           [0., 0., 1., 0., 0., 0.]])
    """
    return evaluate_kernel(robot, "twist_jacobian", on_failure, pose)


def _expect_form(form: str) -> None:
    """Raise unless `form` is a known form of rotations."""
    if form not in _SHAPES:
        raise DataError(f"form: {form!r} is none of {', '.join(_SHAPES)}")


def _frame_at_zero(robot: Manipulator) -> Array:
    """Return the platform's axes (3, 3), one a row, at angles zero, in the base frame."""
    return np.array(robot.platform.frame)


def _difference_text(length: float, angle: float, per: str = "") -> str:
    """Return a length and an angle as text, without a part that is mere rounding."""
    parts = [(length, f"{length:.3g} m{per}"), (angle, f"{angle:.3g} rad{per}")]
    return " and ".join(text for size, text in parts if size > ROOT_OF_ROUNDING)


def _matrix(robot: Manipulator, rotations: Array, form: RotationForm) -> Array:
    """Return rotations given in a form as matrices (..., 3, 3)."""
    if form == "matrix":
        return rotations
    if form == "quaternion":
        length = np.linalg.norm(rotations, axis=-1, keepdims=True)
        x, y, z, w = np.moveaxis(rotations / np.where(length > 0.0, length, np.nan), -1, 0)
        rows = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
        ]
        return _stack_rows(rows)
    azimuth, tilt, torsion = np.moveaxis(rotations, -1, 0)
    ca, sa, ct, st = np.cos(azimuth), np.sin(azimuth), np.cos(tilt), np.sin(tilt)
    cg, sg = np.cos(torsion - azimuth), np.sin(torsion - azimuth)
    rows = [
        [ca * ct * cg - sa * sg, -ca * ct * sg - sa * cg, ca * st],
        [sa * ct * cg + ca * sg, -sa * ct * sg + ca * cg, sa * st],
        [-st * cg, st * sg, ct],
    ]
    return _frame_at_zero(robot).T @ _stack_rows(rows)


def _stack_rows(rows: list[list[Array]]) -> Array:
    """Return a matrix (..., j, k) from rows of arrays (...), broadcast."""
    return np.stack([np.stack(np.broadcast_arrays(*row), axis=-1) for row in rows], axis=-2)


def _tilt_torsion(matrix: Array) -> Array:
    """Return (azimuth, tilt, torsion) (..., 3), rad, of rotation matrices (..., 3, 3)."""
    x, y, z = matrix[..., 0, 2], matrix[..., 1, 2], matrix[..., 2, 2]
    sine, cosine = matrix[..., 1, 0] - matrix[..., 0, 1], matrix[..., 0, 0] + matrix[..., 1, 1]
    parts = np.arctan2(y, x), np.arctan2(np.hypot(x, y), z), np.arctan2(sine, cosine)
    return np.stack(parts, axis=-1)


def _quaternion(matrix: Array) -> Array:
    """Return quaternions (x, y, z, w), w >= 0, of rotation matrices (..., 3, 3): (..., 4).

    The largest of the four components is computed by a square root, the others as quotients by it.
    """
    trace = np.trace(matrix, axis1=-2, axis2=-1)
    diagonal = np.diagonal(matrix, axis1=-2, axis2=-1)
    squares = np.concatenate([1.0 + 2.0 * diagonal - trace[..., None], 1.0 + trace[..., None]], -1)
    products = np.empty((*matrix.shape[:-2], 4, 4))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        products[..., i, j] = products[..., j, i] = matrix[..., i, j] + matrix[..., j, i]
        products[..., i, 3] = products[..., 3, i] = matrix[..., k, j] - matrix[..., j, k]
    for i in range(4):
        products[..., i, i] = squares[..., i]
    largest = np.where(np.isnan(squares), 0.0, squares).argmax(axis=-1)
    row = np.take_along_axis(products, largest[..., None, None], axis=-2)[..., 0, :]
    quaternions = row / np.linalg.norm(row, axis=-1, keepdims=True)
    return np.asarray(np.where(quaternions[..., 3:] < 0.0, -quaternions, quaternions) + 0.0)
