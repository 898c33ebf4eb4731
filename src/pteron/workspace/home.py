"""The home pose: where a machine has the best margin to singularities and limits.

The margin counts turning of the platform as a loss. Among poses of nearly equal margin a simple one
is taken: on the side of its base where its axis points, level, on an axis of symmetry, with little
joint travel, in round numbers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import numpy as np

from pteron.errors import ModelError
from pteron.kernels import Array, geometry_only
from pteron.kernels.program_cache import cached_result
from pteron.kinematics import inverse_kinematics, singular_orientations
from pteron.kinematics.singularities import best_holding
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.result import Result
from pteron.tolerances import ROUNDING
from pteron.workspace.holding import expect_regular
from pteron.workspace.home_search import (
    FIRST_STEPS,
    distinct_poses,
    home_margins,
    pose_steps,
    refine_poses,
    tilting_angles,
)
from pteron.workspace.home_starts import (
    axis_poses,
    grid_poses,
    mid_range_poses,
    random_box_poses,
    sides,
)
from pteron.workspace.margins import pose_margins
from pteron.workspace.reach_errors import limits_error, why_unreachable
from pteron.workspace.simplest_pose import ON_AXIS, simplest_pose

_STARTS = 8
"""Best poses of each kind, on each side of the base, that are improved by a local search."""

_NEAR = 200
"""Number of best candidates from which distinct starts, and poses for the axis, are taken."""


_SIDE = 0.5
"""Share of the best margin from which on the side of the base along the platform's axis is
preferred, where no leg has an elbow whose side would tell: images of plane figures have equal
margins, and of others a little less or more."""

_BRANCHED_SIDE = 0.95
"""The same where elbows tell: what stands on their other side by design has less than half of its
margin there, and images that differ by less, as those of sliders on level guides, none at all."""

_BETWEEN = 101
"""Poses tested between one side of the base and the other: mirror images have a singularity, or
none in reach, between them; elsewhere the platform goes from one to the other."""

_ALIKE = 0.5
"""Greatest difference of angles, rad, of poses that may be mirror images: those of level ones have
none, and of others what a local search leaves."""

_ENDS = 4
"""Poses on each side between which a path across the base is tested."""


@dataclass(frozen=True, eq=False, repr=False)
class HomePoses(Result):
    """The home of a machine, and its image on the other side of the base.

    Attributes
    ----------
    pose : tuple of float
        The home pose, m and rad.
    mirror : tuple of float or None
        The best pose on the other side of the base, if its margin is at least half of the best, or
        95 % where elbows tell the side.
    named : bool
        Whether the machine's file names its home.
    """

    pose: tuple[float, ...]
    mirror: tuple[float, ...] | None
    named: bool = False


def home_pose(robot: RobotLike) -> Array:
    """Return the pose with the best margin, rounded where that costs little of it.

    A machine's file may name it (`[home] pose`). Else the margin decides, the smallest of the
    type-I and type-II measures and of the joints' margins (see `PoseMargins`) and, where the
    platform turns, of what is left of half a turn from 0: a machine seldom works the wrong way
    round. The search begins at level poses on the platform's axis and at joints in the middle of
    their ranges, and Nelder and Mead's method improves the best. The result is always the same for
    the same machine, and of a machine of another size the same in proportion.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.

    Returns
    -------
    array, shape (m,)
        m and rad. Where both sides of the base have poses with at least half of the best margin, or
        95 % of it where legs have elbows, and no straight way leads from one to the other, it is on
        the side along the platform's axis, or against gravity of a machine that moves in a plane
        across it; `home_poses` returns the other too. Its margin is at least 98 % of the best
        one found there. Of equals it is the one whose sliders are nearest to their guide points,
        and cranks to their zero; or the middle between them, if that has 90 %. A platform that
        tilts is level, all its angles 0, if the best level pose has 75 %. Of a machine that a turn
        about the platform's axis leaves as it is, it is on that axis, if the best place there has
        10 %.

    Raises
    ------
    ModelError
        If no pose is in reach of all legs and within the joints' limits, or if the file's is not.
    SingularPose
        If the machine is singular at every pose.

    Examples
    --------
    >>> import pteron
    >>> from pteron.workspace import home_pose
    >>> home_pose(pteron.load("quadrupteron"))
    array([0., 0., 0., 0.])
    """
    return np.array(home_poses(robot).pose)


def home_poses(robot: RobotLike) -> HomePoses:
    """Return the home pose and its image on the other side of the base, if there is one.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.

    Returns
    -------
    HomePoses

    Examples
    --------
    >>> from pteron.workspace import home_poses
    >>> home_poses("stewart").mirror is None
    True
    """
    robot = as_manipulator(robot)
    if robot.home is not None:
        expect_usable(robot, np.array(robot.home))
        expect_regular(robot, np.array(robot.home))
        return HomePoses(robot.home, None, named=True)
    # Neither bodies nor drives matter; a refusal tells the name.
    return HomePoses(*_cached_home_poses(replace(geometry_only(robot), name=robot.name)))


def expect_usable(robot: Manipulator, pose: Array) -> None:
    """Raise ModelError where a file's home pose (m,) is out of reach or beyond limits."""
    least = float(home_margins(robot, pose[None])[0])
    if least <= ROUNDING:
        margins = pose_margins(robot, pose)
        legs = np.minimum(margins.type_i, margins.joints)
        where = f"leg {int(legs.argmin()) + 1} is out of reach or beyond a limit there"
        if legs.min() > 0.0:
            where = "the drives do not hold the platform there (type II), or it is turned back"
            if any(leg.couples_vary for leg in robot.legs):
                where = "the platform is not held there (type-II or constraint singularity)"
        raise ModelError(
            f"home.pose: {pose.tolist()}: {where}; give a pose in reach, within limits, or leave "
            "[home] out",
            subject=robot.name,
        )


@lru_cache(maxsize=256)
def _cached_home_poses(robot: Manipulator) -> tuple[tuple[float, ...], tuple[float, ...] | None]:
    """Return both home poses, from the cache on disk if they are there."""
    key, packages = ("home_poses", geometry_only(robot)), ("dynamics", "kinematics", "workspace")
    return cached_result(key, packages, lambda: _both_sides(robot))


def _both_sides(robot: Manipulator) -> tuple[tuple[float, ...], tuple[float, ...] | None]:
    """Return the home pose, and the best one on the base's other side if it is mirrored."""
    singular_orientations(robot)  # refuses a machine that is singular everywhere
    try:
        best_holding(robot)
    except ModelError:
        raise why_unreachable(robot) from None
    candidates = _candidates(robot)
    starts = _starts(robot, candidates)
    refined = np.concatenate([_refine_level_starts(robot, starts), refine_poses(robot, starts)])
    margins = home_margins(robot, refined)
    most = float(margins.max())
    if most <= 0.0:
        reachable = ~np.isnan(inverse_kinematics(robot, refined, on_failure="nan")).any(axis=-1)
        raise (
            limits_error(robot, refined[reachable]) if reachable.any() else why_unreachable(robot)
        )
    side = sides(robot, refined)
    if not _are_mirrored(robot, refined, margins, side):
        home = simplest_pose(robot, refined, candidates[:_NEAR])
        expect_regular(robot, home)
        return tuple(home.tolist()), None
    candidate_sides = sides(robot, candidates)
    poses = []
    for sign in (1.0, -1.0):
        nearby = candidates[candidate_sides == sign][:_NEAR]
        poses.append(simplest_pose(robot, refined[side == sign], nearby))
    expect_regular(robot, poses[0])
    return tuple(poses[0].tolist()), tuple(poses[1].tolist())


def _are_mirrored(robot: Manipulator, poses: Array, margins: Array, side: Array) -> bool:
    """Return whether good poses (K, m) lie on both sides of the base, without a path across."""
    branched = any(len(leg.sign_choices()) > 1 for leg in robot.legs)
    most = margins.max()
    good = margins >= (_BRANCHED_SIDE if branched else _SIDE) * most
    above, below = (poses[good & (side == sign)] for sign in (1.0, -1.0))
    angular = robot.platform.angular
    pairs = [
        (start, end)
        for start, end in product(above[:_ENDS], below[:_ENDS])
        if (np.abs(start - end)[angular] <= _ALIKE).all()
    ]
    if any(_leads(robot, start, end, ON_AXIS * most) for start, end in pairs):
        return False
    return bool(pairs) or (not branched and len(above) > 0 and len(below) > 0)


def _leads(robot: Manipulator, start: Array, end: Array, least: float) -> bool:
    """Return whether all poses on the line between two poses (m,) keep a margin above `least`."""
    line = np.linspace(start, end, _BETWEEN)
    return bool((home_margins(robot, line) > least).all())


def _candidates(robot: Manipulator) -> Array:
    """Return the initial candidates (K, m) of the search, best first, closed forms foremost."""
    on_axis = axis_poses(robot)
    worth = home_margins(robot, on_axis)
    mid_range = mid_range_poses(robot, on_axis[np.argsort(-worth, kind="stable")])
    others = np.concatenate([mid_range, grid_poses(robot), random_box_poses(robot)])
    poses, worth = np.concatenate([on_axis, others]), np.append(worth, home_margins(robot, others))
    candidates: Array = poses[np.argsort(-worth, kind="stable")]
    return candidates


def _starts(robot: Manipulator, candidates: Array) -> Array:
    """Return the best candidates on each side of the base, level and not, far apart."""
    side = sides(robot, candidates)
    level = ~candidates[:, robot.platform.angular].any(axis=-1)
    starts = []
    for sign, flat in product((1.0, 0.0, -1.0), (True, False)):
        on_side = candidates[(side == sign) & (level == flat)][:_NEAR]
        starts.append(distinct_poses(on_side, pose_steps(robot, *FIRST_STEPS))[:_STARTS])
    return np.concatenate(starts)


def has_exact_home(robot: Manipulator) -> bool:
    """Return whether home is defined by itself: in the file, or as the level pose."""
    return robot.home is not None or bool(tilting_angles(robot).any())


def _refine_level_starts(robot: Manipulator, starts: Array) -> Array:
    """Return level poses with locally best margins, from the level starts among (S, m).

    There are none of a platform that does not tilt: all its starts are improved as they are.
    """
    tilting = tilting_angles(robot)
    if not tilting.any() or tilting.all():
        return starts[:0]
    return refine_poses(robot, starts[~starts[:, tilting].any(axis=-1)], ~tilting)
