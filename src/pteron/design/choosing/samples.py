"""Sample poses and cycles of a job, relative to the middle of its workspace, for a kind."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from pteron.design.choosing.job import CycleTable, Job
from pteron.errors import DataError
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.motion import Path, line_path, there_and_back
from pteron.motion.trajectories.time_polynomials import polynomial

_ALONG = 4
"""Poses along each side of a box."""

_ROUND = 12
"""Poses round a cylinder."""

_DIRECTIONS = 4
"""Directions of a cycle in half a turn."""

_IN_CYCLE = 49
"""Samples of a cycle."""

_SHARES = np.linspace(1.0, 0.0, 21)
"""Shares of the way to a corner at which a cycle is tried."""

_INSIDE = 1e-9
"""Metres by which a cycle may leave the workspace."""


@dataclass(frozen=True)
class Places:
    """A cycle at all its places and in all its directions.

    Attributes
    ----------
    name : str
        The cycle's name.
    path : Path
        As it is given, from the middle.
    shifts, turns : array, shape (B, 3) and (B,)
        Where its points' origin is, m, and by how much it is turned, rad.
    states : tuple of array, shape (B, K, m)
        Poses from the middle, velocities and accelerations at even times, if it takes 1 s.
    duration : float or None
        s; None: as fast as the motors can.
    dwell : float
        s.
    """

    name: str
    path: Path
    shifts: Array
    turns: Array
    states: tuple[Array, Array, Array]
    duration: float | None
    dwell: float

    def words(self, k: int) -> str:
        """Return place k in words."""
        at = ", ".join(f"{1e3 * x:+.0f}" for x in self.shifts[k])
        return f"{self.name} at ({at}) mm, turned by {np.degrees(self.turns[k]):.0f} deg"


def sample_poses(job: Job, robot: Manipulator, along: int = _ALONG) -> Array:
    """Return poses (N, m) over the workspace and its orientations, from its middle."""
    count = len(robot.platform.lengths)
    places, turns = _positions(job, along), _orientations(job, robot)
    found = np.zeros((len(turns), len(places), robot.freedom))
    found[..., :count] = places[:, :count]
    found[..., count:] = turns[:, None]
    return found.reshape(-1, robot.freedom)


def half_sides(job: Job) -> Array:
    """Return half the sides (3,) of the box about the workspace, m."""
    space = job.workspace
    if space.poses is not None:
        return np.asarray(0.5 * np.ptp(_wide(space.poses), axis=0))
    if space.radius is not None and space.height is not None:
        return np.array([space.radius, space.radius, space.height / 2.0])
    assert space.size is not None  # one of three shapes
    return np.asarray(0.5 * _wide([space.size])[0])


def _wide(rows: object) -> Array:
    """Return rows of two or three numbers with three."""
    found = np.asarray(rows, dtype=float)
    return np.pad(found, ((0, 0), (0, 3 - found.shape[1])))


def _positions(job: Job, along: int) -> Array:
    space, half = job.workspace, half_sides(job)
    if space.poses is not None:
        given = _wide(space.poses)
        return np.asarray(given - 0.5 * (given.min(axis=0) + given.max(axis=0)))
    line = np.linspace(-1.0, 1.0, along)
    upright = line if half[2] else np.zeros(1)
    if space.radius is None:
        return np.array(list(product(line, line, upright))) * half
    turns = 2.0 * np.pi * np.arange(_ROUND) / _ROUND
    circle = [(0.0, 0.0), *((np.cos(a), np.sin(a)) for a in turns)]
    circle += [(0.5 * x, 0.5 * y) for x, y in circle[1::3]]
    return np.array([(x, y, z) for x, y in circle for z in upright]) * half


def _orientations(job: Job, robot: Manipulator) -> Array:
    """Return angles (A, a) of the platform that the workspace asks for."""
    count = len(robot.platform.angles)
    found = [np.zeros(count)]
    space = job.workspace
    if space.turn is not None:
        found = [np.append(np.zeros(count - 1), turn) for turn in (*space.turn, *_zero(space.turn))]
    if space.tilt is not None:
        sides = [-space.tilt, 0.0, space.tilt]
        found = [np.array([a, b, one[-1]]) for one in found for a, b in product(sides, sides)]
    return np.array(found)


def _zero(turn: tuple[float, float]) -> list[float]:
    return [0.0] if turn[0] < 0.0 < turn[1] else []


def cycles_of(job: Job, robot: Manipulator) -> list[Places]:
    """Return the cycles of a job for machines of a kind.

    Raises
    ------
    DataError
        If a cycle does not fit into the workspace, at any place and in any direction.
    """
    return [_placed(job, robot, cycle, k) for k, cycle in enumerate(job.cycles, start=1)]


def _placed(job: Job, robot: Manipulator, cycle: CycleTable, k: int) -> Places:
    count, name = len(robot.platform.lengths), cycle.name or f"cycle {k}"
    points = np.zeros((len(cycle.points), robot.freedom))
    given = _wide([point[:3] for point in cycle.points])
    points[:, :count] = given[:, :count]
    path: Path = line_path(robot, points, cycle.corner)
    path = there_and_back(path) if cycle.back else path
    pose, velocity, acceleration = _timed(path, np.linspace(0.0, 1.0, _IN_CYCLE))
    kept = list(_fitting(job, pose[:, :count], cycle.anywhere))
    if not kept:
        size = " x ".join(f"{1e3 * x:.0f}" for x in np.ptp(given, axis=0))
        room = " x ".join(f"{2e3 * x:.0f}" for x in half_sides(job))
        raise DataError(f"cycles[{k}]: {size} mm does not fit into the workspace of {room} mm")
    shifts, turns = np.array([s for s, _ in kept]), np.array([t for _, t in kept])
    states: list[Array] = []
    for part in (pose, velocity, acceleration):
        every = np.tile(part, (len(kept), 1, 1))
        every[..., :2] = np.einsum("bij,kj->bki", _plane(turns), part[:, :2])
        states.append(every)
    states[0][..., :count] += shifts[:, None, :count]
    return Places(
        name, path, shifts, turns, (states[0], states[1], states[2]), cycle.duration, cycle.dwell
    )


def _plane(turns: Array) -> Array:
    c, s = np.cos(turns), np.sin(turns)
    return np.moveaxis(np.array([[c, -s], [s, c]]), -1, 0)


def _fitting(job: Job, points: Array, anywhere: bool) -> Iterator[tuple[Array, float]]:
    """Yield shifts and turns that keep a path (K, k) in the workspace: its outermost places."""
    half = half_sides(job)
    path = _wide(points)
    angles = np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS if anywhere else [0.0]
    for turn in angles:
        turned = path.copy()
        turned[:, :2] = path[:, :2] @ _plane(np.array([turn]))[0].T
        low, high = -half - turned.min(axis=0), half - turned.max(axis=0)
        ends = [
            sorted({a, b}) if b > a else [0.5 * (a + b)] for a, b in zip(low, high, strict=True)
        ]
        shifts = np.array(list(product(*ends))) if anywhere else np.zeros((1, 3))
        for shift in shifts:
            # Of a cylinder the corner of its box is outside: as far towards it as can be.
            for share in _SHARES:
                if _holds(job, half, turned + share * shift):
                    yield share * shift, float(turn)
                    break


def _holds(job: Job, half: Array, points: Array) -> bool:
    space = job.workspace
    inside = (np.abs(points) <= half + _INSIDE).all()
    if space.radius is not None:
        inside &= (np.linalg.norm(points[:, :2], axis=1) <= space.radius + _INSIDE).all()
    return bool(inside)


def _timed(path: Path, times: Array) -> tuple[Array, Array, Array]:
    """Return states (K, m) at times (K,) of 0 to 1: quintics between rests."""
    ends = np.array(path.rests)
    spans = np.sqrt(np.diff(ends))
    knots = np.concatenate([[0.0], np.cumsum(spans) / spans.sum()])
    j = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(spans) - 1)
    span, length = np.diff(knots)[j], np.diff(ends)[j]
    share, rate, gain = polynomial("quintic")((times - knots[j]) / span)
    pose, first, second = path.at(ends[j] + length * share)
    speed, rise = (length * rate / span)[:, None], (length * gain / span**2)[:, None]
    return pose, first * speed, second * speed**2 + first * rise
