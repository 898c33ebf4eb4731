"""Random poses in reach, away from singularities."""

from __future__ import annotations

import numpy as np

from pteron.arguments import expect_to_fit
from pteron.errors import DataError
from pteron.kinematics.architecture import expect_regular
from pteron.kinematics.measure_floors import usual_floors
from pteron.kinematics.sampling import draw_poses
from pteron.manipulator import RobotLike, as_manipulator
from pteron.shapes import Poses, Seed


def random_poses(
    robot: RobotLike,
    count: int,
    *,
    seed: Seed | np.random.Generator = 0,
    type_i: float | None = None,
    type_ii: float | None = None,
    limits: bool = True,
) -> Poses:
    """Return poses drawn at random, in reach and away from singularities, (count, m).

    Poses are uniform in position and orientation, within a box that holds nearly all poses in
    reach. Passive joints and the platform's angle keep their limits; the actuated joints need not.
    For a platform that tilts, angles are drawn within their limits, or within 0.5 rad of 0 without
    limits, and actuated joints keep their limits too. If fewer than one in a thousand of the poses
    drawn are in reach, a random walk finds the region in reach.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    count : int
        Number of poses.
    seed : int or numpy Generator
        Seed, or source, of the random numbers.
    type_i : float, optional
        Least type-I measure of every leg: 0 where it is singular, 1 at best. By default 0.1 where
        at least a tenth of the poses in reach have as much; else their median, so that no machine
        is refused for its proportions.
    type_ii : float, optional
        Least type-II measure of the machine; by default 0.1 or the median likewise, of the poses
        with that type-I measure. A number that is given is kept as it is.
    limits : bool
        Whether limits are kept as said above, or none are.

    Returns
    -------
    array, shape (count, m)
        m and rad.

    Raises
    ------
    DataError
        If the count is no whole number, or negative.
    ModelError
        If the legs have next to no common reach; or if too few poses have the measures given, with
        the greatest that was met.
    SingularPose
        If the machine is singular at every pose, unless `type_ii` is 0.

    Examples
    --------
    >>> import pteron
    >>> pteron.random_poses(pteron.load("quadrupteron"), 5).shape
    (5, 4)
    """
    robot = as_manipulator(robot)
    if count < 0:
        raise DataError(f"count: {count} given, 0 or more expected")
    expect_to_fit("count", count, 4.0 * count * robot.freedom)
    if type_ii is None or type_ii > 0.0:
        expect_regular(robot)
    least = usual_floors(robot, type_i, type_ii, limits)
    rng = np.random.default_rng(seed)
    return draw_poses(robot, count, rng, *least, limits=limits)
