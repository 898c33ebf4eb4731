"""`time_optimal`: the fastest motion along a path within limits of joints, drives, tool (TOPP-RA).

Along a path x(s) speeds are linear in s', and accelerations and the drives' forces in s'' and s'^2:
a u + b x + c <= 1 with u = s'' and x = s'^2, for each limit at each s. TOPP-RA (Pham and Pham,
2018, IEEE Transactions on Robotics 34(3)) finds the largest x everywhere by small linear programs.

Viscous friction is proportional to s' = sqrt(x), which is not linear in x. Where it opposes the
drive, a tangent of the root bounds it from above; where it helps to brake, a chord from rest to a
largest speed bounds it from below. Both are close near the speeds of the pass before, for which
they are made. Dry friction has the sign of the joint's motion: where it opposes the drive it counts
in full, where it helps without Stribeck's part, which a joint in motion does not have.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from pteron.errors import DataError, ModelError, PteronError
from pteron.extras import import_extra
from pteron.kernels import Array
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion.motion import Motion
from pteron.motion.trajectories.acceleration_profile import Profile
from pteron.motion.trajectories.checks import check_path
from pteron.motion.trajectories.demand import demand, demand_between
from pteron.motion.trajectories.limit_rows import LimitRows, limit_rows
from pteron.motion.trajectories.limits import MotionLimits, limits_of
from pteron.motion.trajectories.path import Path
from pteron.motion.trajectories.time_law import STEP, limit_motion, stretch_times
from pteron.motion.trajectories.time_polynomials import Progress, polynomial
from pteron.motion.trajectories.timed_path import timed_path
from pteron.motion.trajectories.tool import Curve

_GRID = 400
"""Grid intervals along a stretch between two rests."""

_EVEN = 0.3
"""Share of the grid that is spaced evenly."""

_PASSES = 4
"""Passes over a stretch, each with tighter limits where the pass before exceeded one."""

_AHEAD = (math.inf, 4.0, 2.0, 1.4, 1.2, 1.1, 1.05)
"""Bounds of s'^2 in first passes, which viscous friction needs, over that of the pass before: the
smaller the bound, the closer the chord."""

_SLOWER = (1.0, 0.5, 0.25, 0.1)
"""Starting speeds of these passes, over the quintic's, tried in turn: a slower start needs less
friction to brake."""

_FASTEST = 1e6
"""Greatest s'^2, in units of stretch and of its time by the quintic."""

_SPREAD = 4.0
"""Samples over which, before and after, a jump of the acceleration is spread."""

_SHARE = 0.02
"""Greatest value of that time, as a share of a stretch's time."""

_SPARE = 1e-3
"""Share of a limit that is kept as a margin between samples."""

_LOOK = 2001
"""Points of a stretch at which its limits are checked."""

_NOTHING = 1e-6
"""Coefficients below this are set to zero for the solver, which cannot tell them from zero;
the limits are checked with them afterwards."""

_SLOWEST = 1e-4
"""Share of the largest s'^2 below which no tangent of its root is taken."""


@dataclass(frozen=True, eq=False, repr=False)
class TimeOptimal(Motion):
    """A motion along a path in nearly the shortest time.

    Attributes
    ----------
    bound : float
        Duration by TOPP-RA with jumps of the acceleration, s. The motion takes longer, as jumps are
        spread over time and limits are kept between samples too.
    polynomial : float
        Duration of the quintic along the same path within the same limits, s.
    """

    bound: float
    polynomial: float


def time_optimal(
    robot: RobotLike, path: Path, limits: MotionLimits | None = None, *, step: float = STEP
) -> TimeOptimal:
    """Return the fastest motion along a path that keeps the limits.

    The motion rests where the path does. The acceleration is continuous: its jumps are spread over
    a few samples. The limits are also checked at ten times as many samples.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine; the forces that its drives need for themselves count.
    path : Path
        The path, such as `line_path` returns.
    limits : MotionLimits, optional
        Limits of joints, drives and tool; by default those of the machine's drives.
    step : float
        Time between samples, s.

    Returns
    -------
    TimeOptimal

    Raises
    ------
    UnreachablePose, SingularPose
        If a pose of the path is out of reach or singular; see `check_path`.
    DataError
        If nothing limits the acceleration.
    ModelError
        If the drives cannot hold the machine somewhere on the path, or toppra is missing.

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
    if not motion_limits.bounds_acceleration:
        raise DataError(
            "nothing limits the acceleration: neither a limit given nor the drives' max_force; "
            "give a limit of force or of acceleration"
        )
    toppra = import_extra("motion", "toppra", "time-optimal motion needs toppra", PteronError)
    check_path(robot, path)
    slow = stretch_times(robot, path, polynomial("quintic"), motion_limits)
    stretches = [
        _fastest_law(robot, path, j, motion_limits, slow[j], step, toppra) for j in range(len(slow))
    ]
    course = timed_path(
        path,
        [stretch.duration for stretch in stretches],
        [stretch.progress for stretch in stretches],
    )
    motion = limit_motion(robot, course, motion_limits, step)
    parts = motion.time, motion.pose, motion.velocity, motion.acceleration
    return TimeOptimal(*parts, sum(stretch.bound for stretch in stretches), sum(slow))


class _Stretch(NamedTuple):
    """The time law of a stretch between two rests, with its duration and TOPP-RA's `bound`, s."""

    progress: Callable[[Array], tuple[Array, Array, Array]]
    duration: float
    bound: float
    slower: float
    """Factor by which it must be slowed to keep its limits; 1 where it does."""


def _fastest_law(
    robot: Manipulator,
    path: Path,
    j: int,
    limits: MotionLimits,
    unit: float,
    step: float,
    toppra: Any,
) -> _Stretch:
    """Return the fastest time law of part j of a path, between two rests, and its motion."""
    begin, end = path.rests[j : j + 2]
    # Denser towards the rests, where the motion is slow; TOPP-RA loses digits on a denser grid.
    even = np.linspace(0.0, 1.0, _GRID + 1)
    grid = _EVEN * even + (1.0 - _EVEN) * (0.5 - 0.5 * np.cos(np.pi * even))

    def states(share: Array) -> Curve:
        """Return poses (T, m) and two derivatives by the share (0 to 1) of this path part."""
        pose, first, second = path.at(begin + (end - begin) * share)
        return pose, (end - begin) * first, (end - begin) ** 2 * second

    rows = limit_rows(demand(robot, *states(grid)), limits, unit)
    squares = _first_pass(toppra, rows, grid)
    bound = Profile.from_squares(grid, squares).duration
    attempts: list[_Stretch] = []
    margin, most = np.full_like(rows.c, 1.0 - _SPARE), rows.most
    for _ in range(_PASSES):
        tighter = rows._replace(c=rows.c + 1.0 - margin, most=most)
        squares = _solve_pass(toppra, tighter, grid, squares, _AHEAD[-1])
        profile = Profile.from_squares(grid, squares)
        spread = min(_SPREAD * step / unit, _SHARE * profile.duration)
        progress = profile.smooth(spread)
        # Limits are tightened by what the spread motion exceeds them.

        def evaluate_law(tau: Array, progress: Progress = progress) -> Curve:
            """Return poses (T, m) and two derivatives by path share at duration shares (T,)."""
            return states(progress(tau)[0])

        tau, needs, _ = demand_between(robot, evaluate_law, np.linspace(0.0, 1.0, _LOOK))
        _, rate, gain = progress(tau)
        stretched_duration = profile.duration + 2.0 * spread
        x, u = (rate / stretched_duration) ** 2, gain / stretched_duration**2
        local_rows = limit_rows(needs, limits, unit)
        usage = local_rows.usage(u, x)
        speed_usage = x / local_rows.most
        slower = max(1.0, float(usage.max(initial=0.0)) ** 0.5, float(speed_usage.max()) ** 0.5)
        attempts.append(_Stretch(progress, stretched_duration * unit, bound * unit, slower))
        if slower <= 1.0:
            break
        ranges = _ranges_near(tau * stretched_duration - spread, profile.time, 2.0 * spread)
        margin = np.minimum(
            margin, margin - 1.05 * np.maximum(_largest_in_ranges(ranges, usage - 1.0), 0.0)
        )
        most = most / np.maximum(_largest_in_ranges(ranges, speed_usage[:, None])[:, 0], 1.0)
    return min(attempts, key=lambda attempt: attempt.duration * attempt.slower)


def _first_pass(toppra: Any, rows: LimitRows, grid: Array) -> Array:
    """Return x = s'^2 (K,) on the grid of s, by TOPP-RA started from the quintic's speeds."""
    share, rate, _ = polynomial("quintic")(np.linspace(0.0, 1.0, _LOOK))
    quintic = np.interp(grid, share, rate) ** 2
    if not rows.v.any():
        return _solve_pass(toppra, rows, grid, quintic, math.inf)
    for slower in _SLOWER:
        squares = slower**2 * quintic
        try:
            for ahead in _AHEAD:
                squares = _solve_pass(toppra, rows, grid, squares, ahead)
        except ModelError:
            if slower == _SLOWER[-1]:
                raise
        else:
            break
    return squares


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


def _solve_pass(
    toppra: Any, rows: LimitRows, grid: Array, last_squares: Array, ahead: float
) -> Array:
    """Return x = s'^2 (K,) on the grid of s, by TOPP-RA, from the previous pass's solution.

    With viscous friction x is at most `ahead` times its previous value: there the linearisation
    ends.
    """
    most = np.minimum(rows.most, _FASTEST)
    a, b, c = rows.a.copy(), rows.b.copy(), rows.c.copy()
    if rows.v.any():
        chord = np.maximum(last_squares, _SLOWEST * last_squares.max())[:, None]
        most = np.minimum(most, ahead * chord[:, 0])
        # sqrt(x) <= sqrt(at) / 2 + x / (2 sqrt(at)), and for x <= top: sqrt(x) >= x / sqrt(top).
        against = rows.v > 0.0
        top = most[:, None]
        b += np.where(against, rows.v / (2.0 * np.sqrt(chord)), rows.v / np.sqrt(top))
        c += np.where(against, rows.v * np.sqrt(chord) / 2.0, 0.0)
    for part in (a, b):
        part[np.abs(part) < _NOTHING] = 0.0
    limit = toppra.constraint.LinearConstraint()
    limit.identical = True
    count = rows.a.shape[1]
    bounds = np.stack([np.zeros_like(most), most], axis=-1)
    parameters = toppra.constraint.linear_constraint.canlinear_colloc_to_interpolate(
        a, b, c, np.eye(count), np.ones(count), bounds, None, grid, identical=True
    )
    *lines, x_bounds, u_bounds = parameters
    limit.compute_constraint_params = lambda *_: (*lines, u_bounds, x_bounds)
    line = toppra.SplineInterpolator([0.0, 1.0], [[0.0], [1.0]])
    solver = toppra.algorithm.TOPPRA([limit], line, gridpoints=grid, solver_wrapper="seidel")
    _, rates, _ = solver.compute_parameterization(0.0, 0.0)
    if rates is None or not np.isfinite(rates).all():
        raise ModelError("TOPP-RA finds no motion along the path; give other limits")
    return np.asarray(rates, dtype=float) ** 2
