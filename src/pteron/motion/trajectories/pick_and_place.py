"""`pick_and_place`: the standard cycle of 25, 305 and 25 mm, out and back, as a motion in time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pteron.arguments import expect, expect_to_fit
from pteron.errors import DataError
from pteron.kernels import Array
from pteron.kinematics.evaluate import finite_pose
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion.motion import Motion
from pteron.motion.trajectories.cycle import Cycle, moves
from pteron.motion.trajectories.cycle_path import CyclePath
from pteron.motion.trajectories.path import BackPath
from pteron.motion.trajectories.scaling import TURN, scaled_to_reach
from pteron.shapes import PoseLike
from pteron.workspace import home_pose

PEAK_ACCELERATION = 10.0
"""Largest acceleration of the tool's centre point where no duration is given, m/s^2."""

_ZOOMS = 4
"""Grid refinements of the search for the peak acceleration, each 1/500 as wide as the last."""


@dataclass(frozen=True, eq=False, repr=False)
class PickAndPlace(Motion):
    """A pick-and-place cycle: up, across and down, and the same path back.

    Attributes
    ----------
    scale : float
        Factor on the standard cycle's 25 mm and 305 mm, and on the turn.
    across, up : array, shape (3,)
        Unit vectors of the moves, in the base frame.
    turn : float
        By how much the platform turns on its way across, rad, the scale included.
    cycle : Cycle
        The cycle over one unit of time.
    """

    scale: float
    across: Array
    up: Array
    turn: float
    cycle: Cycle


def pick_and_place(
    robot: RobotLike,
    around: PoseLike | None = None,
    *,
    scale: float | None = None,
    duration: float | None = None,
    samples: int = 481,
    direction: ArrayLike | None = None,
    turn: float = TURN,
    peak: float = PEAK_ACCELERATION,
    least: float | None = None,
) -> PickAndPlace:
    """Return the standard pick-and-place cycle: 25 mm up, 305 mm across, 25 mm down, and back.

    It is the path of the tool's centre point, `platform.tool`; P moves accordingly. Up is opposite
    to gravity, or along the platform's axis without gravity. A planar machine performs the cycle in
    its plane: up is then opposite to gravity's component there or, in a horizontal plane,
    perpendicular to across. Each move is a quintic in time; the moves overlap, so that the corners
    are round. The platform rests at both ends.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    around : array, shape (m,), optional
        The pose in the middle of the cycle, m and rad; by default `pteron.workspace.home_pose`.
    scale : float, optional
        Factor on the cycle's size, taken as it is; by default the largest up to 1 that
        `scaled_to_reach` finds.
    duration : float, optional
        Of the cycle, out and back, s; by default what gives the peak acceleration.
    samples : int
        Number of samples; an odd number includes the turning point. Between few samples
        `Motion.at` leaves the path, of which `cycle.at` returns every point.
    direction : array, shape (3,), optional
        Where the cycle goes across; see `scaled_to_reach`.
    turn : float
        Turn of the platform on its way across, at scale 1, rad; without effect where it does not.
    peak : float
        Largest acceleration of the tool's centre point, m/s^2, where no duration is given; of a
        platform that tilts, that and the acceleration as it turns of a point as far from P as the
        farthest platform point, as the root of the sum of squares.
    least : float, optional
        Reserve that the cycle keeps, where no scale is given; see `scaled_to_reach`.

    Returns
    -------
    PickAndPlace

    Raises
    ------
    UnreachablePose
        If no scale is given and a leg does not reach the pose.
    ModelError
        If no scale is given and not even the smallest cycle fits.
    DataError
        If a number is not positive, or the direction has no horizontal part, in the plane of a
        planar machine.

    Examples
    --------
    >>> from pteron.motion import pick_and_place
    >>> cycle = pick_and_place("tripteron", duration=1.0, samples=5)
    >>> cycle.time, bool((cycle.pose[0] == cycle.pose[-1]).all())
    (array([0.  , 0.25, 0.5 , 0.75, 1.  ]), True)
    """
    robot = as_manipulator(robot)
    for name, number in {"scale": scale, "duration": duration, "peak": peak}.items():
        if number is not None and not (np.isfinite(number) and number > 0.0):
            raise DataError(f"{name}: {number} given, a number above 0 expected")
    expect(samples >= 2, "samples", samples, "at least 2")
    expect_to_fit("samples", samples, 10.0 * samples * robot.freedom)
    middle = home_pose(robot) if around is None else finite_pose(robot, around, "around")
    if scale is None:
        scale, direction = scaled_to_reach(
            robot, middle, direction=direction, turn=turn, least=least
        )
    across, up = moves(robot, direction, 1)[0]
    angle = turn if robot.platform.angles else 0.0
    cycle = Cycle(robot.platform, middle, across, up, angle, scale)
    if duration is None:
        # Accelerations go with 1 / duration^2.
        duration = float(np.sqrt(_peak_acceleration(cycle, farthest_point(robot)) / peak))
    tau = np.linspace(0.0, 1.0, samples)
    pose, first, second = cycle.at(tau)
    return PickAndPlace(
        duration * tau,
        pose,
        first / duration,
        second / duration**2,
        scale,
        across,
        up,
        scale * angle,
        cycle,
    )


def cycle_path(found: PickAndPlace) -> BackPath:
    """Return the path of a pick-and-place cycle, out and back, without its time.

    Parameters
    ----------
    found : PickAndPlace
        The cycle.

    Returns
    -------
    Path
        It rests at both ends; `time_optimal` goes it fastest.

    Examples
    --------
    >>> import pteron
    >>> from pteron.motion import cycle_path, pick_and_place
    >>> path = cycle_path(pick_and_place(pteron.load("tripteron"), [0.0, 0.0, 0.0]))
    >>> len(path.rests)
    3
    """
    return BackPath(CyclePath(found.cycle))


def farthest_point(robot: Manipulator) -> float:
    """Return the greatest distance of a platform point from P, m."""
    return max(float(np.linalg.norm(leg.platform_point)) for leg in robot.legs)


def _peak_acceleration(cycle: Cycle, radius: float) -> float:
    """Return the largest acceleration, m/s^2, of a tool cycle that takes one second."""
    low, high = 0.0, 0.5
    for _ in range(_ZOOMS):
        tau = np.linspace(low, high, 1001)
        sizes = np.linalg.norm(cycle.acceleration(tau, radius), axis=-1)
        highest = int(sizes.argmax())
        low, high = tau[max(highest - 1, 0)], tau[min(highest + 1, 1000)]
    return float(sizes[highest])
