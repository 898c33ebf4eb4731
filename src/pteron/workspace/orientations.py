"""The volume of the workspace as a function of the platform's angle, in each working mode."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pteron.errors import DataError, ModelError
from pteron.kernels import Array
from pteron.kinematics.evaluate import finite_pose
from pteron.manipulator import RobotLike, as_manipulator, working_modes
from pteron.manipulator.variants import elbows_of
from pteron.result import Result
from pteron.shapes import PoseLike
from pteron.workspace.paving import paving


@dataclass(frozen=True, eq=False, repr=False)
class VolumesOverAngles(Result):
    """The volume of the workspace at each of several orientations, in each of several modes.

    Attributes
    ----------
    angles : array, shape (A,)
        The platform's angle, rad.
    elbows : tuple of tuple of int
        The S working modes: the signs, 1 or -1, of the legs' branches.
    inner, outer : array, shape (S, A)
        Proved lower and upper bounds on the volume, in `unit`; 0 where no position is in reach.
    unit : {"m^3", "m^2"}
        Unit of both.
    """

    ROWS = "angles inner_volumes:1 outer_volumes:1"

    angles: Array
    elbows: tuple[tuple[int, ...], ...]
    inner: Array
    outer: Array
    unit: str

    @property
    def inner_volumes(self) -> Array:
        """`inner`, a row for each angle."""
        return self.inner.T

    @property
    def outer_volumes(self) -> Array:
        """`outer`, a row for each angle."""
        return self.outer.T


def volumes_over_angles(
    robot: RobotLike,
    pose: PoseLike,
    angles: ArrayLike,
    *,
    tolerance: float = 0.1,
    modes: bool = False,
) -> VolumesOverAngles:
    """Return proved bounds on the volume of the workspace at several orientations.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine, whose platform turns.
    pose : array, shape (m,)
        A pose of the machine, m and rad; its angle does not matter.
    angles : array, shape (A,)
        The platform's angle, rad.
    tolerance : float
        Greatest gap between the bounds, as a share of the inner one.
    modes : bool
        Whether all working modes are evaluated, or the machine's own alone.

    Returns
    -------
    VolumesOverAngles

    Raises
    ------
    ModelError
        If the platform does not turn, or the reach has no end.
    DataError
        If the angles are not a row of finite numbers.

    Examples
    --------
    >>> from pteron.workspace import volumes_over_angles
    >>> found = volumes_over_angles("3-prr", [0.0, 0.0, 0.0], [0.0, 0.5], tolerance=0.2)
    >>> found.inner.shape, found.unit
    ((1, 2), 'm^2')
    """
    robot = as_manipulator(robot)
    reference = finite_pose(robot, pose, "pose")
    if robot.platform.axis_angle is None:
        raise ModelError("the platform does not turn: it has one orientation", subject=robot.name)
    angle_row = np.asarray(angles, dtype=float)
    if angle_row.ndim != 1 or not len(angle_row) or not np.isfinite(angle_row).all():
        raise DataError("angles: a row of finite numbers expected, rad")
    machines = working_modes(robot) if modes else (robot,)
    pavings = [
        [
            paving(machine, np.where(robot.platform.angular, angle, reference), tolerance=tolerance)
            for angle in angle_row
        ]
        for machine in machines
    ]
    inner, outer = (
        np.array([[getattr(paving_of_mode, name) for paving_of_mode in row] for row in pavings])
        for name in ("inner_volume", "outer_volume")
    )
    elbows = tuple(map(elbows_of, machines))
    return VolumesOverAngles(angle_row, elbows, inner, outer, pavings[0][0].unit)
