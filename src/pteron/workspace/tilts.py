"""The largest tilt at a position, and the largest ball of positions at a tilt: found, proved."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.metadata import version

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.arguments import expect, expect_share
from pteron.bodies.vectors import PARALLEL_TOLERANCE, dot
from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.kernels.program_cache import cached_result
from pteron.kinematics.evaluate import finite_pose
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.platforms import Platform
from pteron.progress import Progress
from pteron.renamed import former_attribute
from pteron.result import Result
from pteron.shapes import PoseLike
from pteron.workspace.conditions import Condition, conditions, keeps
from pteron.workspace.largest_proved import largest_proved
from pteron.workspace.proofs import Proof
from pteron.workspace.regions import Region
from pteron.workspace.volume import expect_places

_SAMPLES = 4096
"""Poses of a region by which its size is found before it is proved; a third on its rim."""

_HALVINGS = 40
"""Bisections of the size."""

_SHARES = 20
"""Most times that the size is made smaller by the tolerance until it is proved, or refused."""

_MOST = math.pi / 2.0
"""Greatest tilt of the search, rad: beyond it the angles of a pose are singular."""


@dataclass(frozen=True)
class TiltedBall:
    """All poses within a distance of a position, tilted by at most an angle to any side.

    The tilt is the angle between the platform's z and its direction at angles zero: of roll and
    pitch cos(tilt) = cos(roll) cos(pitch). The yaw, where the pose has one, stays.

    Parameters
    ----------
    center : array, shape (m,)
        The pose in its middle, m and rad; its roll and pitch do not count.
    radius : float
        m; of machines whose pose has no lengths 0.
    tilt : float
        Greatest tilt, rad, below pi / 2.
    lengths, angles : tuple of int
        Where the lengths, and the two angles that tilt it, stand in a pose.
    """

    center: tuple[float, ...]
    radius: float
    tilt: float
    lengths: tuple[int, ...]
    angles: tuple[int, int]

    def __post_init__(self) -> None:
        expect(0.0 <= self.radius < math.inf, "radius", f"{self.radius:g} m", "0 or more")
        expect(0.0 <= self.tilt < _MOST, "tilt", f"{self.tilt:g} rad", "one from 0 to below pi/2")
        expect(np.isfinite(self.center).all(), "center", self.center, "finite numbers")

    @property
    def box(self) -> Array:
        """Least and greatest pose (2, m)."""
        box = np.array([self.center, self.center])
        box[:, list(self.lengths)] += np.array([[-self.radius], [self.radius]])
        box[:, list(self.angles)] = np.array([[-self.tilt], [self.tilt]])
        return box

    def holds(self, poses: Array) -> NDArray[np.bool_]:
        """Return which poses (..., m) lie in the region."""
        away = poses[..., self.lengths] - np.array(self.center)[list(self.lengths)]
        level = np.cos(poses[..., self.angles]).prod(axis=-1)
        near = (away * away).sum(axis=-1) <= self.radius**2
        return np.asarray(near & (level >= math.cos(self.tilt)))

    def misses(self, low: Array, high: Array) -> NDArray[np.bool_]:
        """Return which boxes with corners (B, m) are certain not to meet the region."""
        center = np.array(self.center)[list(self.lengths)]
        ahead, behind = low[:, self.lengths] - center, center - high[:, self.lengths]
        nearest = np.maximum(np.maximum(ahead, behind), 0.0)
        slack = 1e-12 * (1.0 + self.radius)
        far = np.linalg.norm(nearest, axis=-1) > self.radius + slack
        least = np.maximum(np.maximum(low[:, self.angles], -high[:, self.angles]), 0.0)
        return np.asarray(far | (np.cos(least).prod(axis=-1) < math.cos(self.tilt) - 1e-12))

    sampled = former_attribute("sampled", "sample_poses")

    def sample_poses(self) -> Array:
        """Return poses (K, m) spread over the region, a third of them on its boundary."""
        free = len(self.lengths) + 2
        shares = _sobol_points(free)
        tilt = self.tilt * np.sqrt(shares[:, 0])
        tilt[: _SAMPLES // 3] = self.tilt
        azimuth = 2.0 * np.pi * shares[:, 1]
        poses = np.broadcast_to(np.array(self.center), (_SAMPLES, len(self.center))).copy()
        poses[:, self.angles] = tilt_angles(tilt, azimuth)
        if self.lengths:
            away = 2.0 * shares[:, 2:] - 1.0
            size = np.linalg.norm(away, axis=1, keepdims=True)
            inside = away / np.maximum(size, 1.0)
            inside[_SAMPLES // 3 : 2 * _SAMPLES // 3] /= np.linalg.norm(
                inside[_SAMPLES // 3 : 2 * _SAMPLES // 3], axis=1, keepdims=True
            )
            poses[:, self.lengths] += self.radius * inside
        return poses


@dataclass(frozen=True)
class OrientedRegion:
    """Poses at the places of a region, at all orientations of a range.

    The tilt is the angle between the platform's z axis and its direction at angles zero: its cosine
    is the product of the cosines of the two angles that tilt the platform.

    Parameters
    ----------
    places : Region
        The places, at one orientation.
    low, high : tuple of float
        Least and greatest angles of the pose, rad; those that tilt the platform come first.
    tilt : float, optional
        Greatest tilt, rad, of a platform that tilts.
    """

    places: Region
    low: tuple[float, ...]
    high: tuple[float, ...]
    tilt: float | None = None

    @property
    def box(self) -> Array:
        """Least and greatest pose of the box around the region (2, m)."""
        box = self.places.box.copy()
        box[:, -len(self.low) :] = self.low, self.high
        return box

    def holds(self, poses: Array) -> NDArray[np.bool_]:
        """Return whether poses (..., m) lie in the region."""
        return self.places.holds(self._level(poses)) & ~self._turned_away(poses, poses, 0.0)

    def misses(self, low: Array, high: Array) -> NDArray[np.bool_]:
        """Return for boxes with corners (B, m) whether each certainly lies outside the region."""
        apart = self.places.misses(self._level(low), self._level(high))
        return apart | self._turned_away(low, high, 1e-12)

    def onto_cone(self, poses: Array) -> None:
        """Reduce angles of poses (..., m) that tilt the platform too far, to the greatest tilt."""
        if self.tilt is not None:
            first, second = np.moveaxis(poses[..., -len(self.low) :][..., :2], -1, 0)
            azimuths = np.arctan2(-np.sin(first) * np.cos(second), np.sin(second))
            leans = np.arccos(np.cos(first) * np.cos(second))
            leans = np.minimum(leans, (1.0 - 1e-9) * self.tilt)
            poses[..., -len(self.low) :][..., :2] = tilt_angles(leans, azimuths)

    def _level(self, poses: Array) -> Array:
        """Return poses (..., m) with the angles at which the region of places is defined."""
        level = poses.copy()
        level[..., -len(self.low) :] = self.places.box[0, -len(self.low) :]
        return level

    def _turned_away(self, low: Array, high: Array, slack: float) -> NDArray[np.bool_]:
        """Return whether boxes (..., m) hold no orientation of the range, up to a slack."""
        first, last = low[..., -len(self.low) :], high[..., -len(self.low) :]
        away = ((first > self.high) | (last < self.low)).any(axis=-1)
        if self.tilt is None:
            return np.asarray(away)
        least = np.clip(0.0, first[..., :2], last[..., :2])
        return np.asarray(away | (np.cos(least).prod(axis=-1) < np.cos(self.tilt) - slack))


def tilt_angles(tilt: Array | float, azimuth: Array) -> Array:
    """Return the two angles (..., 2) that tilt a platform towards an azimuth, rad."""
    # z' = (sin(tilt) cos(azimuth), ..): the second angle by its x, the first by what is left.
    across, along = np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth)
    return np.stack([np.arctan2(-along, np.cos(tilt)), np.arcsin(across)], axis=-1)


@dataclass(frozen=True, eq=False, repr=False)
class LargestTilt(Result):
    """The largest tilt, or ball, that is proved to lie in the workspace.

    Attributes
    ----------
    tilt : float
        rad: to every side, at every place of the ball.
    radius : float
        Of the ball of places, m.
    region : TiltedBall
        Both.
    proof : Proof
        The proof.
    """

    tilt: float
    radius: float
    region: TiltedBall
    proof: Proof = field(repr=False)


@lru_cache(maxsize=4)
def _sobol_points(count: int) -> Array:
    """Return scrambled Sobol points (_SAMPLES, count), cached on disk.

    SciPy's statistics are slow to import.
    """

    def draw() -> Array:
        """Return scrambled Sobol points (_SAMPLES, count) in the unit cube."""
        return np.asarray(scipy.stats.qmc.Sobol(count, seed=0).random(_SAMPLES))

    return cached_result(("sobol", count, _SAMPLES, version("scipy")), (), draw)


def largest_tilt(
    robot: RobotLike,
    pose: PoseLike,
    *,
    radius: float = 0.0,
    tolerance: float = 5e-3,
    given: tuple[Condition, ...] | None = None,
    progress: Progress | None = None,
) -> LargestTilt:
    """Return the largest tilt, to every side at a position, proved to lie in the workspace.

    Parameters
    ----------
    robot : Manipulator, name or path
        A machine whose platform tilts, in its working mode.
    pose : array, shape (m,)
        The place and the yaw, m and rad; its roll and pitch do not count.
    radius : float
        At every place within this distance, m.
    tolerance : float
        By which share it may be smaller than the one that sampling found, so that it is proved.
    given : tuple of Condition, optional
        The conditions on a pose; by default `conditions(robot)`: reach and limits.
    progress : callable, optional
        Called with the share of the work that is done, 0 to 1: at once, and after each step.

    Returns
    -------
    LargestTilt

    Raises
    ------
    DataError
        If the radius is negative, or the tolerance no share between 0 and 1.
    ModelError
        If the platform does not tilt by two angles, or the level pose does not serve.
    """
    report = progress or (lambda share: None)
    report(0.0)
    robot, reference = _expect_tilting(robot, pose)

    def sizes(tilt: float) -> tuple[float, float]:
        """Return the radius, m, and the tilt, rad, of a region with this tilt."""
        return radius, tilt

    return _largest_region(robot, reference, _MOST, tolerance, given, sizes, report)


def largest_ball(
    robot: RobotLike,
    pose: PoseLike,
    *,
    tilt: float = 0.0,
    tolerance: float = 5e-3,
    given: tuple[Condition, ...] | None = None,
    progress: Progress | None = None,
) -> LargestTilt:
    """Return the largest ball of positions that all allow every tilt up to an angle.

    Parameters
    ----------
    robot : Manipulator, name or path
        A machine whose platform tilts and moves, in its working mode.
    pose : array, shape (m,)
        The ball's centre and the yaw, m and rad; its roll and pitch do not count.
    tilt : float
        The tilt that is reached to every side, rad.
    tolerance, given, progress
        As for `largest_tilt`.

    Returns
    -------
    LargestTilt

    Raises
    ------
    DataError
        If the tilt is negative or a right angle, or the tolerance no share between 0 and 1.
    ModelError
        If the platform does not tilt and move, or the centre does not serve at that tilt.
    """
    report = progress or (lambda share: None)
    report(0.0)
    robot, reference = _expect_tilting(robot, pose)
    expect_places(robot, "it only turns")
    reach = sum(leg.size for leg in robot.legs)

    def sizes(radius: float) -> tuple[float, float]:
        """Return the radius, m, and the tilt, rad, of a region with this radius."""
        return radius, tilt

    return _largest_region(robot, reference, reach, tolerance, given, sizes, report)


def has_level_axes(platform: Platform) -> bool:
    """Return whether the axes of a platform, if it has two, are level and at right angles."""
    return not platform.second_axis or (
        abs(dot(platform.axis, platform.second_axis)) <= PARALLEL_TOLERANCE
        and max(abs(platform.axis[2]), abs(platform.second_axis[2])) <= PARALLEL_TOLERANCE
    )


def _expect_tilting(robot: RobotLike, pose: PoseLike) -> tuple[Manipulator, Array]:
    """Return the machine and the pose (m,); raise if the platform cannot tilt to every side."""
    machine = as_manipulator(robot)
    platform = machine.platform
    upright = has_level_axes(platform)
    tilts = platform.tilts
    if not tilts or not upright:
        raise ModelError(
            f"a {platform.motion} platform has no tilt to every side"
            + ("" if tilts else "; this is about platforms that tilt")
            + ("" if upright else ": its axes are not level and at right angles"),
            subject=machine.name,
        )
    return machine, finite_pose(machine, pose, "pose")


def _largest_region(
    robot: Manipulator,
    reference: Array,
    most: float,
    tolerance: float,
    own_conditions: tuple[Condition, ...] | None,
    sizes: Callable[[float], tuple[float, float]],
    report: Callable[[float], None],
) -> LargestTilt:
    """Return the largest proved region of positions and tilts, of sizes up to `most`."""
    expect_share("tolerance", tolerance)
    required = conditions(robot) if own_conditions is None else own_conditions
    angular = np.flatnonzero(robot.platform.angular)
    lengths = tuple(np.flatnonzero(~robot.platform.angular).tolist())
    angles = int(angular[0]), int(angular[1])

    def region(size: float) -> TiltedBall:
        """Return the region of positions and tilts of a size (radius or tilt)."""
        radius, tilt = sizes(size)
        return TiltedBall(tuple(reference.tolist()), radius, tilt, lengths, angles)

    if not keeps(robot, required, region(0.0).sample_poses()).all():
        raise ModelError(
            f"not even the middle, pose {region(0.0).sample_poses()[-1].tolist()}, serves",
            subject=robot.name,
        )
    shares = ((1.0 - tolerance) ** k for k in range(1, _SHARES + 1))
    size, proof = largest_proved(
        robot,
        required,
        region,
        lambda size: region(size).sample_poses(),
        most,
        _HALVINGS,
        shares,
        report,
    )
    if not proof.holds:
        raise ModelError(
            f"nothing is proved about pose {reference.tolist()}: {proof}", subject=robot.name
        )
    radius, tilt = sizes(size)
    return LargestTilt(tilt, radius, region(size), proof)
