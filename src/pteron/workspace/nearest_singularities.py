"""The nearest singular poses, by translation or by rotation alone, with proved lower bounds.

A singular pose is where a function that is smooth in the pose and in its roots vanishes: the square
of a leg's type-I measure, the type-II measure, or the constraint measure. Under translation it is
sought in all of the reach, under rotation in a whole turn; intervals prove how near none is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pteron.arguments import expect
from pteron.equations.machine import closure_of
from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.kinematics import inverse_kinematics, singular_orientations
from pteron.kinematics.architecture import architecture, expect_regular
from pteron.kinematics.evaluate import finite_pose
from pteron.kinematics.sampling import search_ball
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.progress import Progress
from pteron.result import Result
from pteron.shapes import PoseLike
from pteron.workspace.enclosing import enclosing_box
from pteron.workspace.nearest_vanishing import SINGULAR, Nearest, Search
from pteron.workspace.vanishing import Kind, Vanishing

_MOST = 20_000
"""Boxes that the search for each kind and motion examines by default before it ends undecided."""

By = Literal["translation", "rotation"]
"""The motion that leads to the singular pose, alone."""


@dataclass(frozen=True, eq=False, repr=False)
class NearestSingularity(Result):
    """The nearest singular pose of one kind.

    Attributes
    ----------
    kind : {"I", "II", "constraint"}
        Type I: a leg is stretched or folded. Type II: the actuators do not hold the platform.
        Constraint: the legs do not hold its orientation.
    leg : int
        The leg, from 1, of type I; else 0.
    by : {"translation", "rotation"}
        The motion that leads there: the position alone, or the angle alone.
    distance : float
        m or rad; rad too where the platform slides. Infinite where none was found.
    pose : array, shape (m,)
        The singular pose, to rounding: at the edge of a leg's reach the measure feels its root.
        NaN where none was found.
    measure : float
        The value that vanishes there: the type-I measure's square, the type-II or the constraint
        measure.
    lower_bound : float
        No singular pose of this kind is nearer: proved by intervals, in the unit of `distance`.
    """

    kind: Kind
    leg: int
    by: By
    distance: float
    pose: Array
    measure: float
    lower_bound: float

    @property
    def unit(self) -> str:
        """The distance's unit."""
        return "m" if self.by == "translation" else "rad"


def nearest_singularities(
    robot: RobotLike, pose: PoseLike, *, most: int = _MOST, progress: Progress | None = None
) -> tuple[NearestSingularity, ...]:
    """Return the nearest singular poses of each kind, by translation and by rotation alone.

    Only poses in reach of all legs count, and of the robot's working mode; limits of joints do not.
    But an orientation that is singular (type II) at every position counts as such everywhere. Of a
    platform that tilts a rotation's distance is the root of the sum of its angles' squares.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose : array, shape (m,)
        One pose, m and rad.
    most : int
        Boxes after which the search for each is given up; what is proved until then is its
        `lower_bound`. It ends before where that is 0.5 % below the distance.
    progress : callable, optional
        Called with the share of the work that is done, 0 to 1: at once, and after every batch of
        boxes.

    Returns
    -------
    tuple of NearestSingularity
        Those by translation first, the nearest first. A kind of which there is none, which is
        proved, is left out, and constraint singularities where every pose is one, or bars are not
        given.

    Raises
    ------
    UnreachablePose
        If a leg does not reach the pose.
    SingularPose
        If the machine is singular everywhere.
    DataError
        If `most` is below 1.

    Examples
    --------
    >>> import numpy as np
    >>> from pteron.workspace import nearest_singularities
    >>> found = nearest_singularities("quadrupteron", [0.0, 0.0, 0.0, 0.1])
    >>> (turn,) = [one for one in found if one.kind == "II"]
    >>> turn.by, float(np.degrees(turn.pose[3]).round(9))
    ('rotation', 90.0)
    >>> all(0.99 * one.distance < one.lower_bound <= one.distance for one in found)
    True
    """
    report = progress or (lambda share: None)
    report(0.0)
    robot = as_manipulator(robot)
    reference = finite_pose(robot, pose, "pose")
    expect(most >= 1, "most", most, "1 box at least")
    expect_regular(robot)
    inverse_kinematics(robot, reference)
    functions = list(_kinds(robot))
    searches: list[tuple[By, Vanishing]] = []
    if robot.platform.lengths:
        searches += [("translation", vanishing) for vanishing in functions]
    if robot.platform.angles:
        searches += [("rotation", vanishing) for vanishing in functions]
    singularities = []
    for k, (by, vanishing) in enumerate(searches):

        def report_share(share: float, done: int = k) -> None:
            """Report the share of all searches that is done."""
            report((done + share) / len(searches))

        nearest = _search(vanishing, reference, by, most, report_share)
        singularity = _singularity_of(robot, reference, by, vanishing, nearest)
        if np.isfinite(singularity.lower_bound):
            singularities.append(singularity)
    return tuple(
        sorted(singularities, key=lambda s: (s.by == "rotation", s.distance, s.lower_bound))
    )


def _kinds(robot: Manipulator) -> Iterator[Vanishing]:
    """Yield the functions that vanish at singular poses: type I leg by leg, type II, constraint."""
    for i in range(1, robot.joint_count + 1):
        yield Vanishing(robot, "I", i)
    yield Vanishing(robot, "II")
    if architecture(robot).holds:
        yield Vanishing(robot, "constraint")


def _singularity_of(
    robot: Manipulator, reference: Array, by: By, vanishing: Vanishing, nearest: Nearest
) -> NearestSingularity:
    """Return the nearest singularity of a kind, with its distance, m or rad, and lower bound."""
    pose = np.full_like(reference, np.nan) if nearest.pose is None else nearest.pose
    distance = np.inf
    if nearest.pose is not None:
        distance = float(np.linalg.norm((pose - reference)[_varying_coordinates(robot, by)]))
    bound = min(nearest.bound, distance)
    return NearestSingularity(
        vanishing.kind, vanishing.leg, by, distance, pose, nearest.measure, bound
    )


def _varying_coordinates(robot: Manipulator, by: By) -> NDArray[np.intp]:
    """Return the indices of the coordinates that a translation or rotation varies."""
    return np.flatnonzero(robot.platform.angular == (by == "rotation"))


def _search(
    vanishing: Vanishing, reference: Array, by: By, most: int, report: Callable[[float], None]
) -> Nearest:
    """Return the nearest pose at which a function vanishes, by translation or rotation only."""
    robot, moving = vanishing.robot, _varying_coordinates(vanishing.robot, by)
    if by == "translation":
        try:
            box, horizon = enclosing_box(robot, reference, reference, limits=False), np.inf
        except ModelError:  # the reach has no end
            center, radius = search_ball(robot)
            horizon = float(np.linalg.norm(reference[moving] - center)) + radius
            box = reference[moving] + horizon * np.array([[-1.0], [1.0]])
        return Search(vanishing, reference, moving, box, report).run(horizon, most)
    if vanishing.kind == "II" and closure_of(robot).orientation is not None:
        turns = singular_orientations(robot) - reference[moving]
        turns -= 2.0 * np.pi * np.round(turns / (2.0 * np.pi))
        turn = float(turns[np.abs(turns).argmin()])
        pose = reference.copy()
        pose[moving] += turn
        return Nearest(pose, 0.0, abs(turn) * (1.0 - SINGULAR))
    horizon = np.inf if robot.platform.rotation_axes else np.pi
    box = reference[moving] + np.pi * np.array([[-1.0], [1.0]])
    return Search(vanishing, reference, moving, box, report).run(horizon, most)
