"""The cycles of a job at their outermost places and in several directions, for a kind of machine.

Places are those of the tool's centre point, from the middle of the workspace.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np

from pteron.design.job import Job
from pteron.design.kinds import angle_counts
from pteron.design.requirement_tables import ToolCycleTable
from pteron.design.workspace_samples import (
    INSIDE,
    angles_of_directions,
    pad_to_xyz,
    platform_curve,
    tilts,
    turn_angles,
)
from pteron.errors import DataError
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.motion import Path, line_path, return_path
from pteron.motion.trajectories.time_polynomials import polynomial
from pteron.motion.trajectories.timed_path import timed_path
from pteron.motion.trajectories.tool import Curve

_DIRECTIONS = 4
"""Number of directions of a cycle in half a turn."""

_PLACES = 64
"""Greatest number of places of a cycle in a search."""

_IN_CYCLE, _IN_CYCLE_LAST = 49, 129
"""Samples of a cycle in the search, and in the final check: peaks at a rounded corner are short."""

_SHARES = np.linspace(1.0, 0.0, 21)
"""Shares of the shift to a corner that are tried until the cycle fits."""


@dataclass(frozen=True)
class Places:
    """A cycle at its outermost places and in several directions.

    Attributes
    ----------
    name : str
        The cycle's name.
    robot : Manipulator
        A machine of the kind, with its tool.
    path : Path
        The given path of the tool, from the middle of the workspace.
    shifts, turns : array, shape (B, m) and (B,)
        The B shifts of the path, m and rad, and its turns, rad.
    duration : float or None
        Duration of the path, s; None: as short as the motors allow.
    dwell : float
        Rest after the path, s.
    share : float
        Share of this cycle in a duty cycle of all; 0 where each counts alone.
    anywhere : bool
        Whether it may be at other places and in other directions.
    samples : int
        Number of samples in time.
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
        """Return the cycle's name with place k, its shift in mm and turn in degrees, as text."""
        shift, count = self.shifts[k], len(self.robot.platform.lengths)
        at = ", ".join(f"{1e3 * x:+.0f}" for x in shift[:count])
        angles = zip(self.robot.coordinates[count:], np.degrees(shift[count:]), strict=True)
        tilts = "".join(f", {name} {angle:+.0f} deg" for name, angle in angles if angle)
        return f"{self.name} at ({at}) mm{tilts}, turned by {np.degrees(self.turns[k]):.0f} deg"

    def spread_places(self) -> Places:
        """Return the cycle at `_PLACES` evenly chosen places, as many as a search evaluates."""
        indices = np.unique(np.linspace(0, len(self.turns) - 1, _PLACES).round().astype(int))
        return self.select_places(indices)

    def select_places(self, indices: Array) -> Places:
        """Return the cycle restricted to the places with these indices."""
        return replace(self, shifts=self.shifts[indices], turns=self.turns[indices])

    def both_ways(self) -> Places:
        """Return these places with their mirror images (turned by pi) and more time samples."""
        fine = replace(self, samples=_IN_CYCLE_LAST)
        if not self.anywhere:
            return fine
        opposite = self.shifts.copy()
        opposite[:, : min(2, len(self.robot.platform.lengths))] *= -1.0
        turns = np.append(self.turns, self.turns + np.pi)
        return replace(fine, shifts=np.vstack([self.shifts, opposite]), turns=turns)

    @cached_property
    def states(self) -> Curve:
        """Poses about the middle, velocities, accelerations (B, K, m), for a duration of 1 s.

        The tool moves from rest to rest by quintics, all with the same greatest acceleration.
        """
        spans = np.sqrt(np.diff(self.path.rests)).tolist()
        timed = timed_path(self.path, spans, [polynomial("quintic")] * len(spans))
        return self.curves(*timed.curve(np.linspace(0.0, 1.0, self.samples)))

    def curves(self, *curve: Array) -> Curve:
        """Return poses of P and two derivatives (B, K, m) for a tool curve, at each of B places."""
        parts: list[Array] = []
        for part in curve:
            every = np.tile(part, (len(self.turns), 1, 1))
            every[..., :2] = np.einsum("bij,kj->bki", _plane(self.turns), part[:, :2])
            parts.append(every)
        parts[0] += self.shifts[:, None]
        return platform_curve(self.robot, *parts)


def cycles_of(job: Job, robot: Manipulator) -> list[Places]:
    """Return each cycle of a job with the places in the workspace where it fits.

    Raises
    ------
    DataError
        If a cycle does not fit into the workspace, at any place and in any direction.
    """
    return [_cycle_places(job, robot, cycle, k) for k, cycle in enumerate(job.cycles, start=1)]


def _cycle_places(job: Job, robot: Manipulator, cycle: ToolCycleTable, k: int) -> Places:
    """Return a cycle with all shifts and turns at which it fits the workspace; raise if none."""
    name = cycle.name or f"cycle {k}"
    points = np.zeros((len(cycle.points), robot.freedom))
    rows = np.array(cycle.points)
    points[:, : job.lengths] = rows[:, : job.lengths]
    points[:, len(robot.platform.lengths) :] = _platform_angles(robot, rows[:, job.lengths :])
    # The path is that of the tool, which is at P of this machine.
    bare = replace(robot, platform=replace(robot.platform, tool=(0.0, 0.0, 0.0)))
    path: Path = line_path(bare, points, cycle.corner)
    path = return_path(path) if cycle.back else path
    poses = path.at(np.linspace(0.0, path.length, _IN_CYCLE))[0]
    fitting = list(_fitting_shifts(job, robot, poses, cycle.anywhere))
    if not fitting:
        size = " x ".join(
            f"{1e3 * x:.0f}" for x in np.ptp(pad_to_xyz(rows[:, : job.lengths]), axis=0)
        )
        room = " x ".join(f"{2e3 * x:.0f}" for x in job.workspace.half)
        where = "" if cycle.anywhere else " where it is (anywhere = false)"
        raise DataError(
            f"cycles[{k}]: {size} mm does not fit into the workspace of {room} mm{where}"
        )
    shifts, turns = np.array([s for s, _ in fitting]), np.array([t for _, t in fitting])
    times = cycle.duration, cycle.dwell, cycle.share or 0.0
    return Places(name, robot, path, shifts, turns, *times, cycle.anywhere)


def neighbour_places(job: Job, cycle: Places, chosen: Iterable[int], part: float) -> Places:
    """Return a cycle at the `chosen` places and at their neighbours in shift and turn.

    A neighbour is turned by `part` of the angle between directions, or shifted by `part` of half
    the workspace or of the range of turns.
    """
    half, count = job.workspace.half, len(cycle.robot.platform.lengths)
    poses = cycle.path.at(np.linspace(0.0, cycle.path.length, _IN_CYCLE))[0]
    path, last, neighbours = pad_to_xyz(poses[:, :count]), poses[:, -1], []
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
        turned = _turn_path(path, turn)
        limits[:, :count] = (
            (-half - turned.min(axis=0))[:count],
            (half - turned.max(axis=0))[:count],
        )
        if (limits[0] > limits[1] + INSIDE).any():
            continue
        shifts = cycle.shifts[k] + (ways if cycle.anywhere else 0.0 * ways[:1])
        for shift in np.unique(np.fmax(np.fmin(shifts, limits[1]), limits[0]), axis=0):
            if (share := _share(job, turned, pad_to_xyz([shift[:count]])[0])) is not None:
                neighbours.append((np.append(share * shift[:count], shift[count:]), turn))
    return replace(
        cycle,
        shifts=np.array([s for s, _ in neighbours]),
        turns=np.array([t for _, t in neighbours]),
    )


def _platform_angles(robot: Manipulator, angles: Array) -> Array:
    """Return platform angles (K, a), rad, of a cycle's: none, a turn, or roll, pitch and yaw.

    A platform with two angles takes the direction of its z axis from roll and pitch.
    """
    count, stated = len(robot.platform.angles), angles.shape[1]
    if angle_counts(robot.platform) == (2, 0):
        rpy = np.column_stack([angles[:, :-1], np.zeros((len(angles), 4 - max(stated, 1)))])
        roll, pitch = rpy[:, :2].T
        way = [np.cos(roll) * np.sin(pitch), -np.sin(roll), np.cos(roll) * np.cos(pitch)]
        return angles_of_directions(robot, np.column_stack(way))
    every, shared = np.zeros((len(angles), count)), min(count, stated)
    every[:, count - shared :] = angles[:, stated - shared :]
    return every


def _plane(turns: Array) -> Array:
    """Return the rotation matrices (2, 2, K) of turns (K,) in rad."""
    c, s = np.cos(turns), np.sin(turns)
    return np.moveaxis(np.array([[c, -s], [s, c]]), -1, 0)


def _turn_path(path: Array, turn: float) -> Array:
    """Return points (K, 3) turned by `turn` rad about the vertical axis."""
    return np.column_stack([path[:, :2] @ _plane(np.array([turn]))[0].T, path[:, 2]])


def _fitting_shifts(
    job: Job, robot: Manipulator, poses: Array, anywhere: bool
) -> Iterator[tuple[Array, float]]:
    """Yield (shift (m,), turn in rad) of the outermost places at which a path (K, m) fits."""
    half, count = job.workspace.half, len(robot.platform.lengths)
    path = pad_to_xyz(poses[:, :count])
    directions = np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS if anywhere else [0.0]
    angles_of_path = poses[:, count:]
    around = (
        list(_angles(job, robot, angles_of_path))
        if anywhere and angles_of_path.size
        else [np.zeros(angles_of_path.shape[1])]
    )
    for turn in directions:
        turned = _turn_path(path, turn)
        low, high = -half - turned.min(axis=0), half - turned.max(axis=0)
        ends = [
            sorted({a, b}) if b > a else [0.5 * (a + b)] for a, b in zip(low, high, strict=True)
        ]
        shifts = np.array(list(product(*ends))) if anywhere else np.zeros((1, 3))
        for shift in shifts:
            if (share := _share(job, turned, shift)) is not None:
                place = (share * shift)[:count]
                yield from ((np.append(place, angles), float(turn)) for angles in around)


def _angles(job: Job, robot: Manipulator, angles: Array) -> Iterator[Array]:
    """Yield shifts (a,), rad, of a cycle's angles: to each end of the turn, to each tilt.

    A cycle whose poses tilt keeps its own tilts.
    """
    tilting, turning = angle_counts(robot.platform)
    tilted = np.zeros((1, angles.shape[1])) if angles[:, :tilting].any() else tilts(job, robot)
    last, ends = angles[:, -1], {0.0}
    if job.workspace.turn is not None and turning:
        ends = {job.workspace.turn[0] - last.min(), job.workspace.turn[1] - last.max()}
    for end in sorted(ends):
        yield from turn_angles(tilted, float(end))


def _share(job: Job, path: Array, shift: Array) -> float | None:
    """Return the largest share (0 to 1) of a shift at which a path (K, 3) fits; None if none.

    The corners of the box around a cylinder lie outside it; the path is shifted towards them as far
    as it fits.
    """
    space, half = job.workspace, job.workspace.half
    for share in _SHARES:
        points = path + share * shift
        inside = (np.abs(points) <= half + INSIDE).all()
        if space.radius is not None:
            inside &= (np.linalg.norm(points[:, :2], axis=1) <= space.radius + INSIDE).all()
        if inside:
            return float(share)
    return None
