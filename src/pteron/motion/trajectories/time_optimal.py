"""`time_optimal`: the fastest motion along a path within limits of joints, drives and tool.

Along a path x(s) speeds are linear in s', and accelerations and the drives' forces in s'' and s'^2:
a u + b x + c <= 1 with u = s'' and x = s'^2, for each limit at each s. `squared_rates` finds the
largest x on nodes that are dense where the path bends.

Viscous friction is proportional to s' = sqrt(x), which is not linear in x. Where it opposes the
drive, a tangent of the root bounds it from above; where it helps to brake, a chord from rest to a
largest speed bounds it from below, until the speeds change little from pass to pass and a tangent
serves. Both are close near the speeds of the pass before, for which they are made. Dry friction has
the sign of the joint's motion: where it opposes the drive it counts in full, where it helps without
Stribeck's part, which a joint in motion does not have.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pteron.errors import DataError
from pteron.kernels import Array
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion.motion import Motion, interpolate
from pteron.motion.trajectories.acceleration_profile import Profile
from pteron.motion.trajectories.checks import check_path
from pteron.motion.trajectories.demand import demand, demand_between, expect_strength
from pteron.motion.trajectories.limit_rows import POLYGON_SHARE, LimitRows, limit_rows
from pteron.motion.trajectories.limits import MotionLimits, limits_of
from pteron.motion.trajectories.path import Path
from pteron.motion.trajectories.path_nodes import path_nodes
from pteron.motion.trajectories.squared_rates import squared_rates
from pteron.motion.trajectories.time_law import STEP, expect_time, limit_motion, stretch_times
from pteron.motion.trajectories.time_polynomials import Progress, polynomial
from pteron.motion.trajectories.timed_path import timed_path
from pteron.motion.trajectories.tool import Curve

_INTERVALS = 400, 800, 1600
"""Intervals of nodes along a part of a path between two rests, before those that bend are halved;
more are taken where half as many change the duration too much."""

_ERROR = 4e-3
"""Share of the duration that is too much."""

_PASSES = 6
"""Passes over a stretch, each with tighter limits where the pass before exceeded one."""

_AHEAD = (math.inf, 4.0, 2.0, 1.4, 1.1, None, None)
"""Bounds of s'^2 in first passes, which viscous friction needs, over that of the pass before: the
smaller the bound, the closer the chord. The last passes take tangents, which are exact in the
end."""

_SLOWEST = 1e-4
"""Share of the largest s'^2 below which no tangent of its root is taken."""

_STEEP = 1.8
"""Most viscous friction at which a tangent is taken, as a share of what the drive has left at rest:
below 2 the tangent leaves it some of that."""

_SPREAD = 2.0
"""Samples over which, before and after, a jump of the acceleration is spread. Chosen: between
samples the motion exceeds a limit by less than 1 % of the jump."""

_SHARE = 3e-3
"""Greatest value of that time, as a share of a stretch's time, which it prolongs by twice that."""

_MOST_SHARE = 0.02
"""Greatest value of that share where the samples that are asked for are coarse."""

_DIP = 0.5
"""Greatest value of that time, as a share of the time in which the path is slowest at a corner."""

_LEAST_SHARE = 1e-4
"""Least value of that time, as a share of a stretch's time: a smaller corner is passed more slowly
than it might be."""

_CLOSE = 1.008
"""Duration over that with jumps of acceleration which is near enough."""

_FAR = 1.2
"""Load over limit beyond which a stretch is slowed there, rather than its limits tightened."""

_DENSE = 1.5
"""Samples in the time over which a jump is spread, at least."""

_SURE = 3.0
"""Factor on the change of the duration with half as many nodes, by which the shortest duration is
less at most. Errors of first order need 1; chosen: on 36 machines and 648 paths the error is up to
2.6 times the change, where switches lie between nodes."""

_CHECKED = 8
"""Places of each interval of nodes at which the limits are checked. Chosen: with half as many, a
limit is exceeded by 2.6 % at the beginning of a corner."""

_SHORT = 0.2
"""Share of a sample within which an interval of nodes is passed if the path bends there: such bends
are checked between samples too."""

_FINER = 10
"""Points at which such a bend is checked, for each sample."""

_SPARE = 1e-3
"""Share of a limit that is kept as a margin between samples."""

_LOOK = 801
"""Instants of a stretch, evenly apart, at which its time law is evaluated beside its nodes."""


@dataclass(frozen=True, eq=False, repr=False)
class TimeOptimal(Motion):
    """A motion along a path in nearly the shortest time.

    Attributes
    ----------
    bound : float
        Duration, s, that no motion along the path within the limits falls below, were its
        acceleration to jump. The motion takes longer, as jumps are spread over time and limits are
        kept between samples too. It is the computed duration less three times what halving the
        number of nodes changes in it.
    polynomial : float
        Duration of the quintic along the same path within the same limits, s.
    """

    bound: float
    polynomial: float


def time_optimal(
    robot: RobotLike, path: Path, limits: MotionLimits | None = None, *, step: float | None = None
) -> TimeOptimal:
    """Return the fastest motion along a path that keeps the limits.

    The motion rests where the path does. The acceleration is continuous: its jumps are spread over
    a few samples. The limits are also checked at ten times as many samples. It takes at most some
    2 % longer than a motion whose acceleration jumps.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine; the forces that its drives need for themselves count.
    path : Path
        The path, such as `line_path` returns.
    limits : MotionLimits, optional
        Limits of joints, drives and tool; by default those of the machine's drives.
    step : float, optional
        Time between samples, s; by default 1 ms, or a whole fraction of it where the motion is
        short or corners are small. With coarse samples the motion takes longer.

    Returns
    -------
    TimeOptimal

    Raises
    ------
    UnreachablePose, SingularPose
        If a pose of the path is out of reach or singular; see `check_path`.
    DataError
        If nothing limits the acceleration, or between samples that are `step` apart the motion
        leaves the path.
    ModelError
        If the drives cannot hold the machine somewhere on the path, or overcome its friction.

    Examples
    --------
    >>> import pteron
    >>> from pteron.motion import limits_of, line_path, polynomial_motion, time_optimal
    >>> robot = pteron.load("tripteron")
    >>> path = line_path(robot, [[0.0, 0.0, 0.0], [0.1, 0.05, 0.0], [0.1, 0.0, 0.1]], 0.02)
    >>> limits = limits_of(robot, force=60.0, speed=1.0)
    >>> slower = polynomial_motion(robot, path, limits=limits)
    >>> time_optimal(robot, path, limits).duration < slower.duration
    True
    """
    robot = as_manipulator(robot)
    motion_limits = limits_of(robot) if limits is None else limits
    if step is not None:
        expect_time("step", step)
    if not motion_limits.bounds_acceleration:
        raise DataError(
            "nothing limits the acceleration: neither a limit given nor the drives' max_force; "
            "give a limit of force or of acceleration"
        )
    check_path(robot, path)
    quintic = sum(stretch_times(robot, path, polynomial("quintic"), motion_limits).durations)
    stretches = [
        _fastest_law(robot, path, j, motion_limits, step) for j in range(len(path.rests) - 1)
    ]
    course = timed_path(
        path,
        [stretch.duration for stretch in stretches],
        [stretch.progress for stretch in stretches],
    )
    finest = min(stretch.spread for stretch in stretches) / _DENSE
    motion = limit_motion(robot, course, motion_limits, step, finest)
    parts = motion.time, motion.pose, motion.velocity, motion.acceleration
    return TimeOptimal(*parts, sum(stretch.bound for stretch in stretches), quintic)


class _Stretch(NamedTuple):
    """The time law of a stretch between two rests, with its duration, s."""

    progress: Progress
    duration: float
    spread: float
    """Time before and after a jump of the acceleration over which it is spread, s."""
    slower: float
    """Factor by which it must be slowed to keep its limits; 1 where it does."""
    bound: float = math.nan
    """Duration that no time law falls below, s."""

    @property
    def slowed_duration(self) -> float:
        """The duration at which it keeps its limits, s."""
        return self.duration * self.slower


class _Part(NamedTuple):
    """A part of a path between two rests, with its limits by its share s (0 to 1)."""

    robot: Manipulator
    limits: MotionLimits
    states: Callable[[Array], Curve]
    """Returns poses (T, m) and two derivatives by the share."""
    grid: Array
    rows: LimitRows
    """The limits at the nodes of the grid."""
    places: Array
    """Shares at which the limits are checked, with those at which joints reverse."""
    place_rows: LimitRows


def _fastest_law(
    robot: Manipulator, path: Path, j: int, limits: MotionLimits, step: float | None
) -> _Stretch:
    """Return the fastest time law of part j of a path, between two rests."""
    for intervals in _INTERVALS:
        part = _part_of_path(robot, path, j, limits, intervals)
        squares = _fastest_squares(part.rows, part.grid)
        profile = Profile.from_squares(part.grid, squares)
        error = _duration_error(part, profile)
        if error <= _ERROR * profile.duration:
            break
    bound = profile.duration - _SURE * error
    if math.isfinite(limits.tool_acceleration):
        bound *= POLYGON_SHARE**0.5
    spread = min(_SPREAD * (step or STEP), _SHARE * profile.duration, _DIP * _shortest_dip(profile))
    least = _LEAST_SHARE * profile.duration
    if step is not None:
        least = max(least, min(step / _DENSE, _MOST_SHARE * profile.duration))
    attempts: list[_Stretch] = []
    while True:
        spread = max(spread, least)
        laws = _smooth_laws(part, squares, spread, step or spread / _DENSE)
        attempts += (law._replace(bound=bound) for law in laws)
        best = min(attempts, key=lambda attempt: attempt.slowed_duration)
        if best.slowed_duration <= _CLOSE * profile.duration or spread <= least:
            return best
        spread *= 0.5


def _part_of_path(
    robot: Manipulator, path: Path, j: int, limits: MotionLimits, intervals: int
) -> _Part:
    """Return part j of a path with its limits; raise if a drive cannot hold the machine there."""
    begin, end = path.rests[j : j + 2]

    def states(share: Array) -> Curve:
        """Return poses (T, m) and two derivatives by the share (0 to 1) of this path part."""
        pose, first, second = path.at(begin + (end - begin) * share)
        return pose, (end - begin) * first, (end - begin) ** 2 * second

    grid = (path_nodes(path, robot.platform, begin, end, intervals) - begin) / (end - begin)
    shares = np.arange(_CHECKED) / _CHECKED
    places = np.append(grid[:-1, None] + np.diff(grid)[:, None] * shares, grid[-1])
    places, needs, poses = demand_between(robot, states, places)
    expect_strength(robot, needs, limits, poses)
    place_rows = limit_rows(needs, limits)
    at_nodes = np.searchsorted(places, grid)
    rows = LimitRows(*(matrix[at_nodes] for matrix in place_rows))
    return _Part(robot, limits, states, grid, rows, places, place_rows)


def _duration_error(part: _Part, profile: Profile) -> float:
    """Return by how much a part's duration, s, changes with half as many nodes.

    Changes of either sign count, interval by interval.
    """
    half = np.unique(np.append(np.arange(0, len(part.grid), 2), len(part.grid) - 1))
    rows = LimitRows(*(matrix[half] for matrix in part.rows))
    coarse = Profile.from_squares(part.grid[half], _fastest_squares(rows, part.grid[half]))
    return float(np.abs(np.diff(coarse.time) - np.diff(profile.time[half])).sum())


def _shortest_dip(profile: Profile) -> float:
    """Return the least time, s, in which a profile's speed at a minimum changes by itself."""
    rate, gain = profile.rate, np.abs(profile.gain)
    dips = np.flatnonzero((rate[1:-1] < rate[:-2]) & (rate[1:-1] <= rate[2:])) + 1
    steepest = np.maximum(gain[dips - 1], gain[dips])
    return float((rate[dips] / steepest).min(initial=math.inf))


def _smooth_laws(part: _Part, squares: Array, spread: float, step: float) -> Iterator[_Stretch]:
    """Yield time laws whose jumps of acceleration are spread, each with limits tighter by need."""
    margin, most = np.full_like(part.rows.c, 1.0 - _SPARE), part.rows.most
    for _ in range(_PASSES):
        tighter = part.rows._replace(most=most)
        squares = _viscous_pass(tighter, part.grid, squares, margin=margin)
        profile = Profile.from_squares(part.grid, squares)
        progress, duration = profile.smooth(spread), profile.duration + 2.0 * spread
        x, u, times = _rates_at(profile, progress, spread, part.places)
        usage, speed_usage = part.place_rows.usage(u, x), x / part.place_rows.most
        if between := _usage_between_samples(part, profile, progress, spread, step):
            order = np.argsort(np.concatenate([times, between[0]]), kind="stable")
            times, usage, speed_usage = (
                np.concatenate(both)[order]
                for both in zip((times, usage, speed_usage), between, strict=True)
            )
        slower = max(1.0, float(usage.max(initial=0.0)) ** 0.5, float(speed_usage.max()) ** 0.5)
        yield _Stretch(progress, duration, spread, slower)
        if slower <= 1.0:
            break
        # Limits are tightened by what the spread motion exceeds them.
        ranges = _ranges_near(times, profile.time, 2.0 * spread)
        excess = _largest_in_ranges(ranges, usage)
        margin = np.minimum(margin, margin - 1.05 * np.maximum(excess - 1.0, 0.0))
        speed_excess = _largest_in_ranges(ranges, speed_usage[:, None])[:, 0]
        far = np.maximum(excess.max(axis=1, initial=0.0), speed_excess)
        most = np.where(far > _FAR, np.minimum(most, squares), most) / np.where(
            far > _FAR, far, np.maximum(speed_excess, 1.0)
        )


def _usage_between_samples(
    part: _Part, profile: Profile, progress: Progress, spread: float, step: float
) -> tuple[Array, Array, Array] | None:
    """Return times (T,), load / limit (T, R) and x / its limit of a sampled motion; None: smooth.

    It is the motion between samples `step` apart where the path bends between two of them.
    """
    spans = np.diff(profile.time)
    bends = np.flatnonzero(spans < _SHORT * step)
    if not len(bends):
        return None
    duration = profile.duration + 2.0 * spread
    near = np.floor((profile.time[bends] + spread) / step)
    starts = np.unique(np.add.outer(near, np.arange(-1.0, 3.0)))
    starts = np.concatenate([starts, starts - 0.5]) * step  # samples may lie otherwise in the end
    starts = starts[(starts >= 0.0) & (starts <= duration - step)]
    ends = np.stack([starts, starts + step])
    s, rate, gain = progress(ends.ravel() / duration)
    pose, first, second = part.states(s)
    rate, gain = rate[:, None] / duration, gain[:, None] / duration**2
    velocity, acceleration = first * rate, second * rate**2 + first * gain
    instants, fine = np.array([0.0, step]), np.linspace(0.0, step, _FINER + 1)
    curves = []
    for k in range(len(starts)):
        pair = [k, k + len(starts)]
        samples = instants, pose[pair], velocity[pair], acceleration[pair]
        curves.append(interpolate(samples, fine))
    needs = demand(part.robot, *(np.concatenate(parts) for parts in zip(*curves, strict=True)))
    rows = limit_rows(needs, part.limits)
    times = np.add.outer(starts - spread, fine).ravel()
    order = np.argsort(times, kind="stable")
    one = np.ones(len(times))
    usage, speed_usage = rows.usage(0.0 * one, one), 1.0 / rows.most
    return times[order], usage[order], speed_usage[order]


def _rates_at(
    profile: Profile, progress: Progress, spread: float, places: Array
) -> tuple[Array, Array, Array]:
    """Return s'^2, s'' and the time of a profile, smoothed by `progress`, at s (K,)."""
    duration = profile.duration + 2.0 * spread
    inner = profile.time + spread
    instants = np.concatenate(
        [inner, 0.5 * (inner[1:] + inner[:-1]), inner - spread, inner + spread]
    )
    tau = np.unique(np.concatenate([instants / duration, np.linspace(0.0, 1.0, _LOOK)]))
    s, rate, gain = progress(tau)
    s = np.maximum.accumulate(s)
    x = np.interp(places, s, (rate / duration) ** 2)
    return (
        x,
        np.interp(places, s, gain / duration**2),
        np.interp(places, s, tau * duration - spread),
    )


def _fastest_squares(rows: LimitRows, grid: Array) -> Array:
    """Return the largest x = s'^2 (K,) on the grid of s within limits, friction included."""
    squares = squared_rates(rows, grid)
    if rows.v.any():
        for ahead in _AHEAD:
            squares = _viscous_pass(rows, grid, squares, ahead)
    return squares


def _viscous_pass(
    rows: LimitRows,
    grid: Array,
    last_squares: Array,
    ahead: float | None = None,
    margin: Array | float = 1.0,
) -> Array:
    """Return the largest x = s'^2 (K,) with viscous friction linear about the pass before.

    Where it helps to brake, it is on a chord from rest to `ahead` times the previous x, which then
    bounds x, or on the tangent.
    """
    if not rows.v.any():
        return squared_rates(rows, grid, margin)
    last_squares = np.maximum(last_squares, _SLOWEST * last_squares.max())
    with np.errstate(divide="ignore"):
        steep = np.where(rows.v > 0.0, _STEEP * (1.0 - rows.c) / rows.v, math.inf)
    # A tangent: sqrt(x) <= rate / 2 + x / (2 rate).
    rate = np.minimum(np.sqrt(last_squares)[:, None], steep)
    slope, start, most = 0.5 / rate, 0.5 * rate, rows.most
    if ahead is not None:
        # A chord: sqrt(x) >= x / sqrt(most) for x <= most.
        most = np.minimum(most, ahead * last_squares)
        helps = rows.v < 0.0
        slope = np.where(helps, 1.0 / np.sqrt(most)[:, None], slope)
        start = np.where(helps, 0.0, start)
    linear = rows._replace(b=rows.b + rows.v * slope, c=rows.c + rows.v * start, most=most)
    return squared_rates(linear, grid, margin)


def _ranges_near(times: Array, nodes: Array, span: float) -> Array:
    """Return for each node (K,) the index range (2, K) of the times (T,) within `span` of it.

    A range is the first index and the last one + 1; all times count between distant nodes.
    """
    first = np.searchsorted(times, nodes - span)
    last = np.searchsorted(times, nodes + span)
    # Between distant nodes all times count.
    first[1:] = np.minimum(first[1:], np.searchsorted(times, nodes[:-1]))
    last[:-1] = np.maximum(last[:-1], np.searchsorted(times, nodes[1:]))
    return np.array([np.minimum(first, len(times) - 1), np.maximum(last, first + 1)])


def _largest_in_ranges(ranges: Array, quantities: Array) -> Array:
    """Return the largest of the values (T, R) in each index range (2, K): (K, R)."""
    return np.array([quantities[a:b].max(axis=0) for a, b in ranges.T])
