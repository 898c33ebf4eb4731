"""The home pose: where a machine has the best margin to singularities and limits.

The margin counts turning of the platform as a loss. Among poses of nearly equal margin a simple one
is taken: level, on an axis of symmetry, with little joint travel, in round numbers.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from itertools import product

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.errors import ModelError
from pteron.kernels import Array, bare
from pteron.kernels.kept import kept_result
from pteron.kinematics import inverse_kinematics, random_poses, singular_orientations
from pteron.kinematics.sampling import search_ball
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.shapes import Numbers
from pteron.workspace.margins import pose_margins
from pteron.workspace.unreachable import beyond_limits, nowhere

_DRAWN = 200
"""Random poses that the search starts from."""

_MEASURES = 0.3, 0.02, 0.0
"""Least type-I and type-II measures of these poses, tried in turn; 0 where reach is small."""

_STARTS = 12
"""Random poses, the best ones, that are improved by a local search."""

_LEVELLED = 4
"""The best of these, made level, that are improved by another."""

_STEPS = (0.02, 0.2)
"""Size of a local search's first simplex: m and rad."""

_METRES = (0.1, 0.05, 0.01, 0.001)
"""Round numbers that the pose is rounded to, coarsest first, m."""

_DEGREES = (30.0, 15.0, 5.0, 1.0)
"""The same of angles, degrees."""

_WORTH = 0.99
"""Share of the best margin from which on a simpler pose is preferred."""

_AXIS = 0.1
"""Share of the best margin from which on a pose on the axis of a machine's symmetry is
preferred."""

_LEVEL = 0.75
"""Share of the best margin from which on a level pose of a platform that tilts is preferred."""

_SAME = 1e-9
"""Differences of margins that are rounding."""

_MIDDLE = 0.9
"""The share that the middle between equals must have: from there the machine moves every way."""


def home_pose(robot: RobotLike) -> Array:
    """Return the pose with the best margin, rounded where that costs next to nothing.

    The margin is the smallest of the type-I and type-II measures and of the joints' margins
    (see `PoseMargins`) and, where the platform turns, of what is left of half a turn from 0: a
    machine seldom works the wrong way round. A random search with a fixed seed finds it, and Nelder
    and Mead's method refines it. The result is always the same for the same machine.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.

    Returns
    -------
    array, shape (m,)
        m and rad. Its margin is at least 98 % of the best one found. Of equals it is the one whose
        sliders are nearest to their guide points, and cranks to their zero; or the middle between
        them, if that has 90 %. A platform that tilts is level, all its angles 0, if the best level
        pose has 75 %. Of a machine that a turn about the platform's axis leaves as it is, it is on
        that axis, if the best place there has 10 %.

    Raises
    ------
    ModelError
        If no pose is in reach of all legs and within the joints' limits.
    SingularPose
        If the machine is singular at every pose.

    Examples
    --------
    >>> import pteron
    >>> from pteron.workspace import home_pose
    >>> home_pose(pteron.load("quadrupteron"))
    array([0., 0., 0., 0.])
    """
    robot = as_manipulator(robot)
    # Neither bodies nor drives matter; a refusal tells the name.
    return np.array(_stored(replace(bare(robot), name=robot.name)))


@lru_cache(maxsize=256)
def _stored(robot: Manipulator) -> tuple[float, ...]:
    """Return the home pose that was worked out before, in another process too, or a new one."""
    key, packages = ("home_pose", bare(robot)), ("kinematics", "workspace")
    return kept_result(key, packages, lambda: tuple(_best(robot).tolist()))


def _best(robot: Manipulator) -> Array:
    singular_orientations(robot)  # refuses a machine that is singular everywhere
    drawn = _random_poses(robot)
    order = np.argsort(-_worth(robot, drawn), kind="stable")
    refined = np.array([_refined(robot, drawn[i]) for i in order[:_STARTS]])
    margins = _worth(robot, refined)
    most = float(margins.max())
    if most <= 0.0:
        reached = ~np.isnan(inverse_kinematics(robot, refined, on_failure="nan")).any(axis=-1)
        raise beyond_limits(robot, np.concatenate([refined[reached], drawn]))
    level = _level(robot, refined)
    worth = np.asarray(_worth(robot, level))
    if worth.max(initial=0.0) >= _LEVEL * most:
        refined, drawn, margins, most = level, drawn * ~robot.platform.angular, worth, worth.max()
    # Zero says where the joints are meant to be, where nothing else tells.
    equals = refined[margins >= _WORTH * most]
    best = _least_travel(robot, equals)
    middle = _distinct(equals, _steps(robot, *_STEPS)).mean(axis=0)
    if _worth(robot, middle) >= _MIDDLE * most:
        best = middle
    on_axis = _on_axis(robot, np.concatenate([refined, drawn]))
    worth = np.asarray(_worth(robot, on_axis))
    if worth.max(initial=0.0) >= _AXIS * most:
        best = _least_travel(robot, on_axis[worth >= _WORTH * worth.max()])
    least = _WORTH * float(_worth(robot, best))
    for k in range(robot.freedom if robot.platform.tilts else 0):
        middle = np.where(np.arange(robot.freedom) == k, 0.0, best)
        best = middle if _worth(robot, middle) >= least else best
    for metres, degrees in product(_METRES, _DEGREES):
        step = _steps(robot, metres, np.radians(degrees))
        rounded: Array = np.round(best / step) * step + 0.0  # -0.0 becomes 0.0
        if _worth(robot, rounded) >= least:
            return rounded
    return best


def _random_poses(robot: Manipulator) -> Array:
    first, *less = _MEASURES
    with suppress(ModelError):
        return random_poses(robot, _DRAWN, type_i=first, type_ii=first)
    try:
        one = random_poses(robot, 1, type_i=0.0, type_ii=0.0)
    except ModelError:
        raise nowhere(robot) from None
    for least in less:
        with suppress(ModelError):
            return random_poses(robot, _DRAWN, type_i=least, type_ii=least)
    return one


def _least_travel(robot: Manipulator, poses: Array) -> Array:
    """Return the pose whose joints are nearest to zero."""
    travel = np.abs(inverse_kinematics(robot, poses)).max(axis=-1)
    nearest: Array = poses[travel.argmin()]
    return nearest


def _level(robot: Manipulator, poses: Array) -> Array:
    """Return locally best poses whose angles are all 0; none where the platform does not tilt."""
    moved = ~robot.platform.angular
    level = poses * moved
    if not robot.platform.tilts:
        return poses[:0]
    if moved.any():
        order = np.argsort(-np.asarray(_worth(robot, level)), kind="stable")
        level = np.array([_refined(robot, level[i], moved) for i in order[:_LEVELLED]])
    return level


def _on_axis(robot: Manipulator, poses: Array) -> Array:
    """Return poses (K, m) moved onto the axis of the machine's symmetry; none if it has none.

    A symmetry is a turn about the platform's axis after which each leg stands where another stood:
    the margins are the same then.
    """
    center, _ = search_ball(robot)
    directions, axis = robot.platform.directions, np.array(robot.platform.axis)
    lengths, count = len(center), len(robot.legs)
    if robot.platform.tilts and poses[:, robot.platform.angular].any():
        return poses[:0]  # the turn would turn their angles too
    beside, along = poses[:, :lengths] - center, directions @ axis
    # Legs of a hexapod may stand in pairs, or in two halves.
    folds = [count, *(k for k in (3, 2) if k < count)] if robot.platform.tilts else [count]
    for fold in folds:
        turn = scipy.spatial.transform.Rotation.from_rotvec(2.0 * np.pi / fold * axis).as_matrix()
        images = poses.copy()
        images[:, :lengths] = center + beside @ (directions @ turn @ directions.T).T
        if np.allclose(_worth(robot, images), _worth(robot, poses), rtol=0.0, atol=_SAME):
            images[:, :lengths] = center + np.outer(beside @ along, along)
            return images
    return poses[:0]


def _distinct(poses: Array, apart: Array) -> Array:
    """Return the poses (K, m) but for those that are near one before them."""
    near = np.asarray((np.abs(poses[:, None] - poses) <= apart).all(axis=-1))
    return poses[[not near[i, :i].any() for i in range(len(poses))]]


def _worth(robot: Manipulator, poses: Array) -> Numbers:
    """Return the least margin (...), which is 0 at most where the platform is turned back."""
    least = pose_margins(robot, poses).least
    turned = np.abs(poses[..., robot.platform.angular]) / np.pi
    return np.asarray(np.minimum(least, 1.0 - turned.max(axis=-1, initial=0.0)))


def _steps(robot: Manipulator, metres: float, radians: float) -> Array:
    """Return a step of each of the pose's coordinates."""
    return np.where(robot.platform.angular, radians, metres)


def _refined(robot: Manipulator, start: Array, moved: NDArray[np.bool_] | None = None) -> Array:
    """Return the pose of a locally best margin, by moving those coordinates that are marked."""
    free = np.ones(len(start), dtype=bool) if moved is None else moved

    def pose(values: Array) -> Array:
        whole = start.copy()
        whole[free] = values
        return whole

    first = start[free]
    simplex = np.vstack([first, first + np.diag(_steps(robot, *_STEPS)[free])])
    found = scipy.optimize.minimize(
        lambda values: -float(_worth(robot, pose(values))),
        first,
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "xatol": 1e-5, "fatol": 1e-6, "maxiter": 500},
    )
    return pose(found.x)
