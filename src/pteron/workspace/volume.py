"""The reach at constant orientation: its bounding box, and its volume (planar: area)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.arguments import expect, expect_to_fit
from pteron.errors import ModelError
from pteron.kernels import Array, numeric
from pteron.kinematics.evaluate import finite_pose
from pteron.kinematics.sampling import search_ball
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.result import Result
from pteron.shapes import PoseLike, Seed
from pteron.tolerances import ROUNDING
from pteron.workspace.boxes import vary_coordinates
from pteron.workspace.margins import distance_to_limits

_SAMPLES = 20_000
"""Random positions, some of which are in reach, that the search for the box begins with."""

_STARTS = 5
"""Positions, the best ones, from which an optimiser goes on."""

_FRONT = 100
"""Positions kept in each round of the search for a side of the box: those furthest towards it.
Twenty times as many are drawn about them."""

_ROUNDS = 24
"""Rounds of the search for a side."""

_SPREAD = 0.2
"""Standard deviation of the draws in the first round, over the size of the machine."""

_NEARER = 0.75
"""Factor on that deviation from round to round."""

_FAR = 1e3
"""Value for no limit, m: the optimiser wants finite numbers."""

_ENDLESS = 100.0
"""A path this many times the machine's size that stays in reach has no end."""

_SLACK = 1e-8
"""Metres by which the optimiser may overstep a bound."""

_BACK = 101
"""Positions tested between the optimiser's start and its result, if that oversteps a bound."""

_OPTIONS = {"ftol": 1e-10, "maxiter": 200}
"""Options of the optimiser SLSQP."""


@dataclass(frozen=True, eq=False, repr=False)
class ReachVolume(Result):
    """The set of positions of P in reach at one orientation, within the joints' limits.

    The tool's centre point reaches the same set, moved by where it is from P.

    Attributes
    ----------
    volume : float
        An estimate; of a planar machine it is an area.
    standard_error : float
        Standard error of the estimate.
    unit : {"m^3", "m^2"}
        Unit of both.
    box : array, shape (2, k)
        Least and greatest of each of the pose's k lengths in reach, m.
    count : int
        Number of random positions in the box that the estimate rests on.
    """

    volume: float
    standard_error: float
    unit: str
    box: Array
    count: int


def expect_places(robot: Manipulator, instead: str) -> None:
    """Raise ModelError, with a clause on what to do instead, if a platform only rotates."""
    if not robot.platform.lengths:
        raise ModelError(
            f"a {robot.platform.motion} platform has no places to move to: {instead}",
            subject=robot.name,
        )


def bounding_box(robot: RobotLike, pose: PoseLike) -> Array:
    """Return the box that bounds all positions in reach at the orientation of a pose.

    Random positions in reach are moved to each side: at first at random, ever nearer about those
    that are furthest, as limits leave corners and edges; then as far as the side allows.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose : array, shape (m,)
        Gives the orientation, and where the search starts; m and rad.

    Returns
    -------
    array, shape (2, k)
        Least and greatest x, y and, in space, z; m.

    Raises
    ------
    ModelError
        If no position is in reach at this orientation, or the reach has no end.

    Examples
    --------
    >>> import pteron
    >>> from pteron.workspace import bounding_box
    >>> bounding_box(pteron.load("tripteron"), [0.0, 0.0, 0.0]).round(3)
    array([[-0.17, -0.17, -0.17],
           [ 0.3 ,  0.3 ,  0.3 ]])
    """
    robot = as_manipulator(robot)
    reference = finite_pose(robot, pose, "pose")
    count = len(robot.platform.lengths)

    def depths(p: Array) -> Array:
        """Return the distances (..., C), m, of positions inside every bound; negative outside."""
        at = vary_coordinates(reference, p)
        limits = distance_to_limits(robot, at)
        return np.concatenate([numeric(robot, "reach")(at)[0], np.minimum(limits, _FAR)], axis=-1)

    center, radius = search_ball(robot)
    rng = np.random.default_rng(0)
    positions = center + radius * rng.uniform(-1.0, 1.0, (_SAMPLES, count))
    positions = np.vstack([positions, reference[:count]])
    inside = depths(positions).min(axis=-1)
    # Where next to nothing is in reach, the deepest positions are moved inside first.
    starts = positions[np.argsort(-inside)[:_STARTS]]
    if not (inside > ROUNDING).any():
        starts = np.array([deepest(depths, start) for start in starts])
        starts = starts[depths(starts).min(axis=-1) > ROUNDING]
        if not len(starts):
            raise ModelError(
                "no position is in reach of all legs, within the joints' limits, at the "
                f"orientation of pose {reference.tolist()}",
                subject=robot.name,
            )
    inside_positions = np.vstack(
        [positions[inside > ROUNDING], starts[depths(starts).min(axis=-1) > ROUNDING]]
    )
    if any(
        (depths(inside_positions + way).min(axis=-1) > ROUNDING).any()
        for way in _endless_translations(robot, radius)
    ):
        raise ModelError(
            "the reach has no end: the guides let the platform move along them for ever; give the "
            "legs limits",
            subject=robot.name,
        )
    sides = np.empty((2, count))
    for axis in range(count):
        for side, sign in enumerate((1.0, -1.0)):
            objective = sign * np.eye(count)[axis]
            front = _front(depths, inside_positions, objective, radius, rng)
            sides[side, axis] = sign * min(_furthest(depths, p, objective) for p in front[:_STARTS])
    return sides


def _endless_translations(robot: Manipulator, size: float) -> Iterator[Array]:
    """Yield translations along the guides, far longer than the machine."""
    for leg in robot.legs:
        if leg.reach_bound is not None and leg.reach_bound.line is not None:
            way = _ENDLESS * size * (robot.platform.directions @ leg.reach_bound.line)
            yield from (way, -way)


def deepest(depths: Callable[[Array], Array], start: Array) -> Array:
    """Return a position with locally greatest distance inside every bound, from any start."""
    solution = scipy.optimize.minimize(
        lambda v: -v[-1],
        np.append(start, float(depths(start).min())),
        method="SLSQP",
        constraints={"type": "ineq", "fun": lambda v: depths(v[:-1]) - v[-1]},
        options=_OPTIONS,
    )
    return np.asarray(solution.x[:-1])


def _front(
    depths: Callable[[Array], Array],
    inside: Array,
    objective: Array,
    size: float,
    rng: np.random.Generator,
) -> Array:
    """Return positions inside every bound with small objective . p, the least first."""
    spread = _SPREAD * size
    for _ in range(_ROUNDS):
        inside = inside[np.argsort(inside @ objective)[:_FRONT]]
        tried = np.repeat(inside, 20 * _FRONT // len(inside), axis=0)
        tried = tried + spread * rng.normal(size=tried.shape)
        inside = np.vstack([inside, tried[depths(tried).min(axis=-1) > ROUNDING]])
        spread *= _NEARER
    return inside[np.argsort(inside @ objective)]


def _furthest(depths: Callable[[Array], Array], start: Array, objective: Array) -> float:
    """Return the least objective . p inside every bound, by SLSQP from a position inside."""
    solution = scipy.optimize.minimize(
        lambda p: float(objective @ p),
        start,
        jac=lambda p: objective,
        method="SLSQP",
        constraints={"type": "ineq", "fun": depths},
        options=_OPTIONS,
    )
    way = start + np.linspace(1.0, 0.0, _BACK)[:, None] * (solution.x - start)
    inside = depths(way).min(axis=-1) > -_SLACK
    # At the rim of a leg's reach its joint may have no coordinate, and so no limit.
    inside[:-1] &= inside[1:]
    return float(objective @ way[inside.argmax()])


def reach_volume(
    robot: RobotLike, pose: PoseLike, *, count: int = 50_000, seed: Seed = 0
) -> ReachVolume:
    """Return the volume in reach at the orientation of a pose, by Monte Carlo integration.

    A planar machine has an area instead.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose : array, shape (m,)
        Gives the orientation, and where the search for the box starts; m and rad.
    count : int
        Number of random positions.
    seed : int
        Seed of the random numbers.

    Returns
    -------
    ReachVolume

    Raises
    ------
    ModelError
        If no position is in reach at this orientation.
    DataError
        If there are no samples.
    """
    robot = as_manipulator(robot)
    expect(count >= 1, "count", count, "at least 1")
    expect_to_fit("count", count, 4.0 * count * robot.freedom)
    reference = finite_pose(robot, pose, "pose")
    box = bounding_box(robot, reference)
    size = (count, len(box[0]))
    poses = vary_coordinates(reference, np.random.default_rng(seed).uniform(box[0], box[1], size))
    margin = numeric(robot, "reach")(poses)[0]
    share = float((np.minimum(margin, distance_to_limits(robot, poses)).min(axis=-1) >= 0.0).mean())
    box_volume = float(np.prod(box[1] - box[0]))
    error = box_volume * float(np.sqrt(share * (1.0 - share) / count))
    return ReachVolume(share * box_volume, error, f"m^{size[1]}", box, count)
