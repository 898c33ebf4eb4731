"""Sample poses and cycles of a job, relative to the middle of its workspace, for a kind.

Places are those of the tool's centre point: where the platform turns, P moves against it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.design.choosing.job import Job
from pteron.design.choosing.job_tables import CycleTable
from pteron.errors import DataError
from pteron.kernels import Array
from pteron.kinematics import pose_of
from pteron.manipulator import Manipulator
from pteron.motion import Path, line_path, there_and_back
from pteron.motion.trajectories.time_polynomials import polynomial
from pteron.motion.trajectories.tool import Curve, pose_motion, tool_motion

_ALONG, _ALONG_TILTED = 4, 3
"""Poses along each side of a box; where it is met at several tilts."""

_ROUND = 12
"""Poses round a cylinder."""

_RIM = 6
"""Directions round the rim of a cone of tilts."""

_DIRECTIONS = 4
"""Directions of a cycle in half a turn."""

_PLACES = 64
"""Most places of a cycle that a search looks at."""

_IN_CYCLE, _IN_CYCLE_LAST = 49, 129
"""Samples of a cycle, in a search and at last: peaks at a rounded corner are short."""

_SHARES = np.linspace(1.0, 0.0, 21)
"""Shares of the way to a corner at which a cycle is tried."""

_INSIDE = 1e-9
"""Metres or radians by which a cycle or a place may leave the workspace."""

_ROUNDS = 4
"""Halvings of the distance at which worse places are looked for about the worst."""


@dataclass(frozen=True)
class Places:
    """A cycle at its outermost places and in several directions.

    Attributes
    ----------
    name : str
        The cycle's name.
    robot : Manipulator
        Of the kind, with its tool.
    path : Path
        That of the tool, as it is given, from the middle.
    shifts, turns : array, shape (B, m) and (B,)
        Where its points' origin is, m and rad, and by how much it is turned, rad.
    duration : float or None
        s; None: as fast as the motors can.
    dwell : float
        s.
    share : float
        How often it is done in a duty cycle of all; 0 where each counts by itself.
    anywhere : bool
        Whether it may be at other places and in other directions.
    samples : int
        In time.
    """

    name: str
    robot: Manipulator
    path: Path
    shifts: Array
    turns: Array
    duration: float | None
    dwell: float
    share: float
    anywhere: bool = True
    samples: int = _IN_CYCLE

    def words(self, k: int) -> str:
        """Return place k in words."""
        shift, count = self.shifts[k], len(self.robot.platform.lengths)
        at = ", ".join(f"{1e3 * x:+.0f}" for x in shift[:count])
        angles = zip(self.robot.coordinates[count:], np.degrees(shift[count:]), strict=True)
        told = "".join(f", {name} {angle:+.0f} deg" for name, angle in angles if angle)
        return f"{self.name} at ({at}) mm{told}, turned by {np.degrees(self.turns[k]):.0f} deg"

    def some(self) -> Places:
        """Return it at no more places than a search looks at, evenly chosen."""
        chosen = np.unique(np.linspace(0, len(self.turns) - 1, _PLACES).round().astype(int))
        return self.at(chosen)

    def at(self, chosen: Array) -> Places:
        """Return it at some of its places."""
        return replace(self, shifts=self.shifts[chosen], turns=self.turns[chosen])

    def both_ways(self) -> Places:
        """Return it, finer in time, at its places and, turned round, at those opposite."""
        fine = replace(self, samples=_IN_CYCLE_LAST)
        if not self.anywhere:
            return fine
        opposite = self.shifts.copy()
        opposite[:, : min(2, len(self.robot.platform.lengths))] *= -1.0
        turns = np.append(self.turns, self.turns + np.pi)
        return replace(fine, shifts=np.vstack([self.shifts, opposite]), turns=turns)

    @cached_property
    def states(self) -> Curve:
        """Poses from the middle, velocities and accelerations (B, K, m), if it takes 1 s."""
        curve = _timed(self.path, np.linspace(0.0, 1.0, self.samples))
        return self.moved(*curve)

    def moved(self, *curve: Array) -> Curve:
        """Return poses of the tool (K, m) and two derivatives as P's (B, K, m), at all places."""
        parts: list[Array] = []
        for part in curve:
            every = np.tile(part, (len(self.turns), 1, 1))
            every[..., :2] = np.einsum("bij,kj->bki", _plane(self.turns), part[:, :2])
            parts.append(every)
        parts[0] += self.shifts[:, None]
        return _of_platform(self.robot, *parts)


def _of_platform(robot: Manipulator, *curve: Array) -> Curve:
    """Return places of the tool from the middle, and two derivatives, as those of P."""
    pose, first, second = pose_motion(robot.platform, *curve)
    rest = np.zeros((1, robot.freedom))
    return pose + tool_motion(robot.platform, rest, rest, rest)[0], first, second


def with_tool_in_the_middle(robot: Manipulator, angles: Array) -> Array:
    """Return poses (A, m) from the middle at which P is elsewhere, but the tool is there."""
    found = np.zeros((len(angles), robot.freedom))
    found[:, len(robot.platform.lengths) :] = angles
    return _of_platform(robot, found, np.zeros_like(found), np.zeros_like(found))[0]


def sample_poses(job: Job, robot: Manipulator, along: int | None = None) -> Array:
    """Return poses (N, m) over the workspace and its orientations, from its middle."""
    return _poses_at(job, robot, _places(job, robot, along or _along(job)))


def about_the_worst(
    job: Job,
    robot: Manipulator,
    values_of: Callable[[Array], Array],
    along: int | None = None,
    keep: int = 1,
    besides: Array | None = None,
) -> tuple[Array, Array]:
    """Return the least of each column of values (C,), and the poses where they are (C, m).

    `values_of` gives the values (B, C) at poses (B, m), which are from the middle. They are taken
    at `sample_poses`, and then ever nearer about those that are worst in a column, `keep` of each:
    what is worst near a singularity is worst in a valley that samples miss. Poses `besides` those
    of the workspace count as they are.
    """
    along, count, space = along or _along(job), len(robot.platform.lengths), job.workspace
    places = _places(job, robot, along)
    values = values_of(_poses_at(job, robot, places))
    steps = np.zeros(robot.freedom)
    steps[:count] = half_sides(job)[:count] / (along - 1)
    if space.tilt is not None:
        steps[count : count + 2] = 0.5 * space.tilt
    if space.turn is not None and space.directions is None:
        steps[-1] = 0.25 * (space.turn[1] - space.turn[0])
    if space.poses is not None:
        steps[:count] = 0.0
    ways = _ways(steps, count)
    for _ in range(_ROUNDS if steps.any() else 0):
        worst = np.unique(np.argsort(values, axis=0)[:keep])
        near = (places[worst][:, None] + steps * ways).reshape(-1, robot.freedom)
        places = _into(job, near, count)
        values = values_of(_poses_at(job, robot, places))
        steps /= 2.0
    poses = _poses_at(job, robot, places)
    if besides is not None and len(besides):
        poses, values = np.vstack([poses, besides]), np.vstack([values, values_of(besides)])
    return values.min(axis=0), poses[values.argmin(axis=0)]


def _ways(steps: Array, count: int) -> Array:
    """Return the neighbours of a place (W, m), in steps: any, but if it tilts in part of it."""
    several = [(-1.0, 0.0, 1.0) if step else (0.0,) for step in steps]
    if not steps[count:-1].any():
        return np.array(list(product(*several)))
    still = [(0.0,)] * len(steps)
    parts = (several[:count] + still[count:], still[:count] + several[count:])
    return np.unique(np.vstack([list(product(*part)) for part in parts]), axis=0)


def _into(job: Job, places: Array, count: int) -> Array:
    """Return places (N, m) brought into the workspace where they are outside."""
    space, half, found = job.workspace, half_sides(job)[:count], places.copy()
    if space.poses is None:
        found[:, :count] = np.clip(found[:, :count], -half, half)
    if space.radius is not None:
        found[:, :2] = _within(found[:, :2], space.radius)
    if space.tilt is not None:
        found[:, count : count + 2] = _within(found[:, count : count + 2], space.tilt)
    if space.turn is not None and space.directions is None:
        found[:, -1] = np.clip(found[:, -1], *space.turn)
    return np.unique(found, axis=0)


def _within(points: Array, radius: float) -> Array:
    """Return points (N, 2) drawn into a circle."""
    shares = np.minimum(1.0, radius / np.maximum(np.hypot(*points.T), 1e-12))
    return np.asarray(points * shares[:, None])


def _along(job: Job) -> int:
    return _ALONG_TILTED if job.workspace.tilts else _ALONG


def _places(job: Job, robot: Manipulator, along: int) -> Array:
    """Return places (N, m): of the tool from the middle, and angles of the platform.

    Of a cone of tilts the angles are how far the platform leans to x and to y, and its turn.
    """
    points = _positions(job, along)[:, : len(robot.platform.lengths)]
    angles = orientations(job, robot)
    if job.workspace.tilt is not None:
        leans = [(*lean, turn) for turn in _turns(job) for lean in _leans(job.workspace.tilt)]
        angles = np.array(leans)
    return np.hstack([np.tile(points, (len(angles), 1)), np.repeat(angles, len(points), axis=0)])


def _poses_at(job: Job, robot: Manipulator, places: Array) -> Array:
    count = len(robot.platform.lengths)
    angles = places[:, count:]
    if job.workspace.tilt is not None:
        angles = _leaning(robot, angles[:, :2])
        angles[:, -1] += places[:, -1]
    found = with_tool_in_the_middle(robot, angles)
    found[:, :count] += places[:, :count]
    return found


def half_sides(job: Job) -> Array:
    """Return half the sides (3,) of the box about the workspace, m."""
    return job.workspace.half


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


def orientations(job: Job, robot: Manipulator) -> Array:
    """Return angles (A, a) of the platform that the workspace asks for; tilts at each turn."""
    return np.concatenate([_turned(tilts(job, robot), angle) for angle in _turns(job)])


def _turns(job: Job) -> list[float]:
    turn = job.workspace.turn
    return [0.0] if turn is None else [*([0.0] if turn[0] < 0.0 < turn[1] else []), *turn]


def tilts(job: Job, robot: Manipulator) -> Array:
    """Return angles (A, a) of the tilts: of a cone those of its middle and round its rim."""
    space, count = job.workspace, len(robot.platform.angles)
    if space.tilt is not None:
        return _leaning(robot, _leans(space.tilt))
    if space.directions is None:
        return np.zeros((1, count))
    given = np.array(space.directions)
    given /= np.linalg.norm(given, axis=1, keepdims=True)
    away = np.linalg.norm(given[:, :2], axis=1, keepdims=True)
    angle = np.arctan2(away, given[:, 2:])
    return _leaning(robot, given[:, :2] / np.where(away > 0.0, away, 1.0) * angle)


def _leans(tilt: float) -> Array:
    """Return leans (L, 2) to x and y, rad: none, and round the rim of a cone."""
    rim = 2.0 * np.pi * np.arange(_RIM) / _RIM
    return np.vstack([np.zeros((1, 2)), tilt * np.c_[np.cos(rim), np.sin(rim)]])


def _leaning(robot: Manipulator, leans: Array) -> Array:
    """Return the angles (L, a) of a platform that leans to x and y (L, 2): the shortest turn."""
    vectors = np.c_[-leans[:, 1], leans[:, 0], np.zeros(len(leans))]
    matrices = scipy.spatial.transform.Rotation.from_rotvec(vectors).as_matrix()
    return np.array(pose_of(robot, np.zeros(3), matrices)[:, -len(robot.platform.angles) :])


def _turned(angles: Array, turn: float) -> Array:
    """Return angles (A, a) turned further about the upright."""
    if not angles.shape[1]:
        return angles
    return np.asarray(angles + turn * np.eye(angles.shape[1])[-1])


def cycles_of(job: Job, robot: Manipulator) -> list[Places]:
    """Return the cycles of a job for machines of a kind.

    Raises
    ------
    DataError
        If a cycle does not fit into the workspace, at any place and in any direction.
    """
    return [_placed(job, robot, cycle, k) for k, cycle in enumerate(job.cycles, start=1)]


def _placed(job: Job, robot: Manipulator, cycle: CycleTable, k: int) -> Places:
    name = cycle.name or f"cycle {k}"
    points = np.zeros((len(cycle.points), robot.freedom))
    given = np.array(cycle.points)
    points[:, : job.lengths] = given[:, : job.lengths]
    angles = given[:, job.lengths :]
    points[:, robot.freedom - angles.shape[1] :] = angles
    # The path is that of the tool, which of this machine is P.
    bare = replace(robot, platform=replace(robot.platform, tool=(0.0, 0.0, 0.0)))
    path: Path = line_path(bare, points, cycle.corner)
    path = there_and_back(path) if cycle.back else path
    poses = path.at(np.linspace(0.0, path.length, _IN_CYCLE))[0]
    kept = list(_fitting(job, robot, poses, cycle.anywhere))
    if not kept:
        size = " x ".join(f"{1e3 * x:.0f}" for x in np.ptp(_wide(given[:, : job.lengths]), axis=0))
        room = " x ".join(f"{2e3 * x:.0f}" for x in half_sides(job))
        where = "" if cycle.anywhere else " where it is (anywhere = false)"
        raise DataError(
            f"cycles[{k}]: {size} mm does not fit into the workspace of {room} mm{where}"
        )
    shifts, turns = np.array([s for s, _ in kept]), np.array([t for _, t in kept])
    times = cycle.duration, cycle.dwell, cycle.share or 0.0
    return Places(name, robot, path, shifts, turns, *times, cycle.anywhere)


def near_places(job: Job, cycle: Places, chosen: Iterable[int], part: float) -> Places:
    """Return a cycle at neighbours of some of its places, which they may be themselves.

    A neighbour is turned by a part of the angle between directions, or shifted by that part of
    half the workspace or of the range of turns.
    """
    half, count = half_sides(job), len(cycle.robot.platform.lengths)
    poses = cycle.path.at(np.linspace(0.0, cycle.path.length, _IN_CYCLE))[0]
    path, last, found = _wide(poses[:, :count]), poses[:, -1], []
    limits = np.full((2, cycle.robot.freedom), np.nan)
    steps = np.zeros(cycle.robot.freedom)
    steps[:count] = part * half[:count]
    if job.workspace.turn is not None:
        low, high = job.workspace.turn
        steps[-1] = part * (high - low)
        limits[:, -1] = low - last.min(), high - last.max()
    ways = np.vstack([np.zeros_like(steps), np.diag(steps), -np.diag(steps)])
    for k, way in product(chosen, (-1.0, 0.0, 1.0) if cycle.anywhere else (0.0,)):
        turn = float(cycle.turns[k] + way * part * np.pi / _DIRECTIONS)
        turned = path.copy()
        turned[:, :2] = path[:, :2] @ _plane(np.array([turn]))[0].T
        limits[:, :count] = (
            (-half - turned.min(axis=0))[:count],
            (half - turned.max(axis=0))[:count],
        )
        if (limits[0] > limits[1] + _INSIDE).any():
            continue
        shifts = cycle.shifts[k] + (ways if cycle.anywhere else 0.0 * ways[:1])
        for shift in np.unique(np.fmax(np.fmin(shifts, limits[1]), limits[0]), axis=0):
            shares = (s for s in _SHARES if _holds(job, half, turned + s * _wide([shift[:count]])))
            if (share := next(shares, None)) is not None:
                found.append((np.append(share * shift[:count], shift[count:]), turn))
    return replace(
        cycle, shifts=np.array([s for s, _ in found]), turns=np.array([t for _, t in found])
    )


def _plane(turns: Array) -> Array:
    c, s = np.cos(turns), np.sin(turns)
    return np.moveaxis(np.array([[c, -s], [s, c]]), -1, 0)


def _fitting(
    job: Job, robot: Manipulator, poses: Array, anywhere: bool
) -> Iterator[tuple[Array, float]]:
    """Yield shifts (m,) and turns of a path (K, m): its outermost places in the workspace."""
    half, count = half_sides(job), len(robot.platform.lengths)
    path = _wide(poses[:, :count])
    directions = np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS if anywhere else [0.0]
    own = poses[:, count:]
    around = list(_angles(job, robot, own)) if anywhere and own.size else [np.zeros(own.shape[1])]
    for turn in directions:
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
                    place = (share * shift)[:count]
                    yield from ((np.append(place, angles), float(turn)) for angles in around)
                    break


def _angles(job: Job, robot: Manipulator, angles: Array) -> Iterator[Array]:
    """Yield angles (a,) by which a cycle's may be shifted: to the ends of the turn, to each tilt.

    A cycle that tilts by itself keeps its tilts.
    """
    own = np.zeros((1, angles.shape[1])) if angles[:, :-1].any() else tilts(job, robot)
    last, ends = angles[:, -1], {0.0}
    if job.workspace.turn is not None:
        ends = {job.workspace.turn[0] - last.min(), job.workspace.turn[1] - last.max()}
    for end in sorted(ends):
        yield from _turned(own, float(end))


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
