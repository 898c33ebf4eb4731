"""The largest pick-and-place cycle that a machine can do, as a share of the standard size."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from pteron.equations.machine import closure_of
from pteron.errors import ModelError
from pteron.kernels import Array, numeric
from pteron.kinematics import inverse_kinematics
from pteron.kinematics.evaluate import finite_pose
from pteron.kinematics.sampling import holding_sizes
from pteron.kinematics.singularities import best_holding
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion.trajectories.cycle import Cycle, moves
from pteron.shapes import PoseLike
from pteron.workspace import pose_margins
from pteron.workspace.margins import joint_distances

_LEAST_RESERVE = 0.2
"""Least type-I and type-II measure of a cycle's poses; or half of its middle pose's if less."""

TURN = np.pi / 3.0
"""Turn of the platform on its way across in the full cycle, rad."""

_DIRECTIONS = 12
"""Number of horizontal directions tried for the cycle."""

_SAMPLES = 501
"""Poses checked on the path out; the path back is the same."""

_DIP = 1e-4
"""Safety margin between checked poses, in units of the margin, m and rad: more than a margin or a
joint can dip between two of them."""

_STEPS = 1000
"""The scale is a multiple of one thousandth."""

_WORTH = 1.01
"""Factor by which a later direction must allow a larger cycle to be preferred to an earlier one."""


def least_margin(robot: RobotLike, around: PoseLike) -> float:
    """Return the default least singularity margin (no unit) for a cycle about a pose.

    It is 0.2, or half of the margin at the pose if that is less.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    around : array, shape (m,)
        The pose in the middle of the cycle, m and rad.

    Returns
    -------
    float
        Of the margins of `pteron.workspace.pose_margins`, without unit.
    """
    robot = as_manipulator(robot)
    middle = finite_pose(robot, around, "around")
    return min(_LEAST_RESERVE, float(pose_margins(robot, middle).least) / 2.0)


def scaled_to_reach(
    robot: RobotLike,
    around: PoseLike,
    *,
    direction: ArrayLike | None = None,
    turn: float = TURN,
    least: float | None = None,
) -> tuple[float, Array]:
    """Return the scale of the largest pick-and-place cycle about a pose, and its direction.

    The complete cycle stays in reach, keeps the margins of type I and type II (see
    `pteron.workspace.PoseMargins`) at `least` or above, and the joints within their limits. The
    scale is found by bisection, since a smaller cycle stays nearer to the pose in its middle.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    around : array, shape (m,)
        The pose in the middle of the cycle, m and rad.
    direction : array, shape (3,), optional
        Where the cycle goes across; its horizontal part counts, in the plane of a planar machine.
        By default the best of twelve, the platform's x axis where another is hardly better.
    turn : float
        Turn of the platform on its way across, at scale 1, rad; without effect where it does not.
    least : float, optional
        What the margins must keep; by default `least_margin`.

    Returns
    -------
    scale : float
        At most 1, where the cycle is 25 mm high and 305 mm wide; a multiple of 0.001.
    across : array, shape (3,)
        The horizontal unit vector.

    Raises
    ------
    UnreachablePose
        If a leg does not reach the pose.
    ModelError
        If not even the smallest cycle fits.
    DataError
        If the direction is vertical.

    Examples
    --------
    >>> import pteron
    >>> from pteron.motion import scaled_to_reach
    >>> scale, across = scaled_to_reach(pteron.load("tripteron"), [0.0, 0.0, 0.0])
    >>> 0.5 < scale <= 1.0
    True
    """
    robot = as_manipulator(robot)
    middle = finite_pose(robot, around, "around")
    if least is None:
        least = least_margin(robot, middle)
    scale, best = 0, None
    for across, up in moves(robot, direction, _DIRECTIONS):
        cycle = Cycle(robot.platform, middle, across, up, turn, 1.0)
        larger = _largest_scale(robot, cycle, least, int(_WORTH * scale) + 1)
        if larger:
            scale, best = larger, across
    if best is None:
        inverse_kinematics(robot, middle)  # says which leg misses the pose, and by how much
        raise ModelError(
            f"no pick-and-place cycle about pose {middle.tolist()} keeps a margin of {least:g} to "
            "the singularities and the joints' limits; choose a better pose",
            subject=robot.name,
        )
    return scale / _STEPS, best


def _largest_scale(robot: Manipulator, cycle: Cycle, least: float, minimum: int) -> int:
    """Return the largest feasible scale of a cycle, in thousandths; 0 if below `minimum`."""
    way = np.linspace(0.0, 0.5, _SAMPLES)

    def fits(thousandths: int) -> bool:
        """Return whether the cycle at this scale, in thousandths, keeps all margins."""
        return keeps_margin(robot, replace(cycle, scale=thousandths / _STEPS).at(way)[0], least)

    if minimum > _STEPS or not fits(minimum):
        return 0
    if fits(_STEPS):
        return _STEPS
    most = range(_STEPS - minimum)
    return _STEPS - bisect_left(most, True, lo=1, key=lambda less: fits(_STEPS - less))


def keeps_margin(robot: Manipulator, poses: Array, least: float) -> bool:
    """Return whether all poses (K, m) keep singularity margins >= `least`, and joint limits."""
    type_i = numeric(robot, "reach")(poses)[1]
    if not (type_i >= least + _DIP).all():  # NaN, out of reach, compares false
        return False
    if closure_of(robot).vanishes() is not False or robot.platform.angles:
        shares = holding_sizes(robot, poses) / best_holding(robot)
        if not (shares >= least + _DIP).all():
            return False
    actuated = joint_distances(robot, numeric(robot, "joint_coordinates")(poses)[0])
    passive = numeric(robot, "passive_room")(poses)[1]
    return bool((actuated >= _DIP).all() and (passive >= _DIP).all())
