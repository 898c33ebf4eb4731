"""Motions along a path or curve of poses in a given duration, or in the shortest within limits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from pteron.arguments import expect
from pteron.errors import DataError
from pteron.kernels import Array
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion.motion import Motion
from pteron.motion.trajectories.checks import check_path
from pteron.motion.trajectories.demand import (
    curve_rate,
    demand,
    demand_between,
    most_rate,
    peaks,
)
from pteron.motion.trajectories.limits import MotionLimits, limits_of
from pteron.motion.trajectories.path import TURN, Path, path_corners, path_weights
from pteron.motion.trajectories.path_nodes import path_nodes
from pteron.motion.trajectories.time_polynomials import PolynomialLaw, Progress, polynomial
from pteron.motion.trajectories.timed_path import Timed, timed_path
from pteron.motion.trajectories.tool import Curve

STEP = 1e-3
"""Time between the samples of a motion, s, where no step is given and the path is smooth enough."""

_OFF = 1e-4
"""Share of a path's extent by which a motion may leave it between samples. Chosen: 0.03 mm on the
standard cycle, where steps of 1 ms leave it by less than a nanometre."""

_SLOWED = 1.004
"""Factor by which a motion without a step may be slowed before it gets twice as many samples."""

_FINEST = 256
"""Samples in `STEP`, at most, where no step is given."""

_MOST = 10_000_000
"""Most samples of a motion; a longer one is refused."""

_LOOK = 2001
"""Points of a motion from which its shortest duration is computed, and at which a given one is
checked."""

KEPT = 1.0 + 1e-9
"""Share of a limit up to which it counts as kept, for rounding."""

_FINER = 10
"""Points at which a finished motion is checked, for each of its samples."""

_TRIES = 8
"""Most times that a motion is slowed until it keeps its limits; but for rounding, once or twice
suffice."""


def shortest(
    robot: RobotLike,
    curve: Callable[[Array], Curve],
    limits: MotionLimits,
    step: float | None = None,
) -> Motion:
    """Return the motion along a curve of poses in the shortest time that keeps the limits.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    curve : callable
        From tau (T,) in [0, 1] to poses (T, m) and two derivatives by tau.
    limits : MotionLimits
        At least one.
    step : float, optional
        Time between samples, s; by default 1 ms, or a whole fraction of it where the curve needs
        more samples.

    Returns
    -------
    Motion

    Raises
    ------
    DataError
        If there is no limit, or between samples that are `step` apart the motion leaves the curve.
    ModelError
        If the drives cannot hold the machine somewhere on the curve.
    """
    robot = as_manipulator(robot)
    rate = curve_rate(robot, curve(np.linspace(0.0, 1.0, _LOOK)), limits)
    if not np.isfinite(rate):
        raise _no_limit_error()
    return limit_motion(robot, Timed(curve, 1.0 / rate), limits, step)


def time_curve(
    robot: Manipulator,
    curve: Callable[[Array], Curve],
    duration: float | None,
    limits: MotionLimits,
    step: float | None = None,
) -> Motion:
    """Return the motion along a curve of poses in `duration` s, or in the shortest time."""
    if duration is None:
        return shortest(robot, curve, limits, step)
    course = Timed(curve, expect_time("duration", duration))
    _expect_kept(robot, course, limits)
    return _sample_closely(robot, course, step)


def _no_limit_error() -> DataError:
    """Return the error that neither a duration nor a limit determines the motion's time."""
    return DataError(
        "neither a duration nor a limit that the motion meets is given, and the machine's drives "
        "have none; give a duration, or limits such as speed and acceleration of the joints"
    )


def polynomial_motion(
    robot: RobotLike,
    path: Path,
    *,
    duration: float | None = None,
    limits: MotionLimits | None = None,
    law: PolynomialLaw = "quintic",
    step: float | None = None,
) -> Motion:
    """Return the motion along a path with a polynomial time law between each two rests.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    path : Path
        Such as `line_path` makes.
    duration : float, optional
        Of the whole, s, shared among the stretches between rests as their shortest ones are; by
        default the shortest that keeps the limits, each stretch its own.
    limits : MotionLimits, optional
        Of joints, drives and tool; by default those of the machine's drives.
    law : {"quintic", "seventh"}
        The polynomial's degree; see `polynomial`.
    step : float, optional
        Time between samples, s, at most; by default 1 ms, or a whole fraction of it where corners
        need more samples.

    Returns
    -------
    Motion
        It keeps the limits between its samples too.

    Raises
    ------
    UnreachablePose, SingularPose
        If the machine cannot go the path; see `check_path`.
    DataError
        If the duration is too short for the limits, or neither it nor a limit is given, or between
        samples that are `step` apart the motion leaves the path.
    ModelError
        If the drives cannot hold the machine somewhere on the path.

    Examples
    --------
    >>> import pteron
    >>> from pteron.motion import limits_of, line_path, polynomial_motion
    >>> robot = pteron.load("tripteron")
    >>> path = line_path(robot, [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]])
    >>> polynomial_motion(robot, path, limits=limits_of(robot, acceleration=5.0)).duration
    0.34
    """
    robot = as_manipulator(robot)
    check_path(robot, path)
    motion_limits = limits_of(robot) if limits is None else limits
    sizes = np.diff(path.rests)
    # Where nothing limits a motion the stretches have the same peak acceleration.
    times = StretchTimes(tuple(path.rests), [float(np.sqrt(size)) for size in sizes])
    if motion_limits.is_limited:
        times = stretch_times(robot, path, polynomial(law), motion_limits)
    elif duration is None:
        raise _no_limit_error()
    laws = [polynomial(law)] * len(times.durations)
    course = timed_path(path, times.durations, laws, times.rests)
    if duration is None:
        return limit_motion(robot, course, motion_limits, step)
    expect_time("duration", duration)
    slowed_course = course.slow_down(duration / course.duration)
    if motion_limits.is_limited:
        _expect_kept(robot, slowed_course, motion_limits, course.duration)
    return _sample_closely(robot, slowed_course, step)


class StretchTimes(NamedTuple):
    """Arc lengths s, m, at which a motion along a path rests, and the durations between, s."""

    rests: tuple[float, ...]
    durations: list[float]


def stretch_times(
    robot: Manipulator, path: Path, law: Progress, limits: MotionLimits
) -> StretchTimes:
    """Return the shortest duration of each part of a path between rests within the limits.

    A rounded corner at which stopping takes less time than passing it is a rest too.
    """
    rests, durations = [0.0], []
    for begin, end in zip(path.rests[:-1], path.rests[1:], strict=True):
        stretch = _Stretch(robot, path, law, limits, begin, end)
        stops = [begin, *(s for s in path_corners(path) if begin < s < end), end]
        through = [begin, end], [stretch.shortest(begin, end)]
        stopping = _stops_that_save_time(stretch, stops) if len(stops) > 2 else through
        places, times = min(through, stopping, key=lambda way: sum(way[1]))
        rests += places[1:]
        durations += times
    return StretchTimes(tuple(rests), durations)


class _Stretch:
    """The demand of a path between two rests, by which its parts are timed."""

    def __init__(
        self,
        robot: Manipulator,
        path: Path,
        law: Progress,
        limits: MotionLimits,
        begin: float,
        end: float,
    ) -> None:
        self._robot, self._law, self._limits = robot, law, limits
        self._tau = np.linspace(0.0, 1.0, 10 * _LOOK)
        self._shares = law(self._tau)[0]
        even = begin + (end - begin) * self._shares[::10]
        self._s = np.union1d(even, path_nodes(path, robot.platform, begin, end))
        self._poses, first, second = path.at(self._s)
        self._needs = demand(robot, self._poses, first, second)

    def shortest(self, begin: float, end: float) -> float:
        """Return the shortest duration, s, of the time law from rest at s to rest, m."""
        first, last = np.searchsorted(self._s, [begin, end])
        last = max(last + 1, first + 2)
        share = np.clip((self._s[first:last] - begin) / (end - begin), 0.0, 1.0)
        _, rate, gain = self._law(np.interp(share, self._shares, self._tau))
        size = end - begin
        needs = self._needs.between(first, last).by_parameter(size * rate, size * gain)
        most = most_rate(self._robot, needs, self._limits, self._poses[first:last])
        if not np.isfinite(most):
            raise _no_limit_error()
        return 1.0 / most


def _stops_that_save_time(
    stretch: _Stretch, stops: Sequence[float]
) -> tuple[list[float], list[float]]:
    """Return those of the stops, m, at which a stop is quicker, and the durations between, s."""
    rests, durations = [stops[0]], []
    here = stops[1]
    duration = stretch.shortest(rests[-1], here)
    for there in stops[2:]:
        passing = stretch.shortest(rests[-1], there)
        onward = stretch.shortest(here, there)
        if passing <= duration + onward:
            duration = passing
        else:
            rests.append(here)
            durations.append(duration)
            duration = onward
        here = there
    return [*rests, here], [*durations, duration]


def _expect_kept(
    robot: Manipulator, course: Timed, limits: MotionLimits, shortest: float | None = None
) -> None:
    """Raise if a motion is too fast for the limits; the error names the worst limit."""
    curve = course.at(np.linspace(0.0, course.duration, _LOOK))
    if curve_rate(robot, curve, limits, 1.0) * KEPT >= 1.0:
        return
    worst = max(peaks(robot, *curve, limits), key=lambda peak: peak.share)
    if worst.share <= KEPT:  # a motor's curve allows more than its lines
        return
    least = shortest or course.duration / curve_rate(robot, curve, limits)
    raise DataError(
        f"duration: {course.duration:.4g} s given, too short: {worst.phrase()}; the shortest that "
        f"keeps every limit is {least:.4g} s"
    )


def limit_motion(
    robot: Manipulator,
    course: Timed,
    limits: MotionLimits,
    step: float | None,
    longest: float = STEP,
) -> Motion:
    """Return the motion along a timed curve, slowed down until it keeps the limits everywhere.

    The limits are checked at ten times as many samples as the motion has, and where joints reverse.

    The duration is a multiple of the step; the course is slowed by the factor by which it exceeds a
    limit. Without a step it is at most `longest`, and so short that the motion stays on the curve.
    """
    if step is not None:
        return _slow_to_limits(robot, course, limits, step)
    count, best = max(1, int(np.ceil(STEP / longest))), None
    while True:
        try:
            motion = _slow_to_limits(robot, course, limits, STEP / count)
        except DataError:
            if count >= _FINEST:
                raise
        else:
            # Samples that are too far apart show as a motion that is slowed.
            least = _SLOWED * course.duration + STEP / count
            if motion.duration <= least or count >= _FINEST:
                return motion
            if best is not None and motion.duration * _SLOWED > best.duration:
                return min(motion, best, key=lambda one: one.duration)
            best = motion
        count *= 2


def _slow_to_limits(robot: Manipulator, course: Timed, limits: MotionLimits, step: float) -> Motion:
    """Return the motion with samples `step` apart; raise if that suits neither path nor limits."""
    for _ in range(_TRIES):
        count = max(1, int(np.ceil(course.duration / expect_time("step", step) - 1e-9)))
        course = course.slow_down(count * step / course.duration)
        motion = sample_curve(course.at, count * step, step)
        _expect_on_curve(robot, motion, course, step)
        fine = np.linspace(0.0, motion.duration, _FINER * count + 1)
        _, needs, poses = demand_between(robot, motion.at, fine)
        rate = most_rate(robot, needs, limits, poses, 1.0)
        if rate * KEPT >= 1.0:
            return motion
        course = course.slow_down(1.0 / rate)
    raise DataError(
        f"step: {step:g} s suits no motion of {course.duration:.3g} s along this path: between "
        "samples it exceeds the limits however slow it is; give a tenth of it, or none"
    )


def _sample_closely(robot: Manipulator, course: Timed, step: float | None) -> Motion:
    """Return a motion's samples, so close that between them it stays on its curve."""
    count = 1
    while True:
        spacing = STEP / count if step is None else step
        motion = sample_curve(course.at, course.duration, spacing)
        try:
            _expect_on_curve(robot, motion, course, spacing)
        except DataError:
            if step is not None or count >= _FINEST:
                raise
            count *= 2
        else:
            return motion


def _expect_on_curve(robot: Manipulator, motion: Motion, course: Timed, step: float) -> None:
    """Raise if between its samples a motion leaves its curve."""
    weights = path_weights(robot.platform)
    middles = 0.5 * (motion.time[1:] + motion.time[:-1])
    exact = course.at(middles)[0]
    errors = np.linalg.norm((motion.at(middles)[0] - exact) * weights, axis=-1)
    extent = float(np.linalg.norm(np.ptp(np.vstack([motion.pose, exact]), axis=0) * weights))
    error = float(errors.max())
    if error > _OFF * extent:
        raise DataError(
            f"step: between samples {step:g} s apart the motion leaves its path by "
            f"{1e3 * error:.3g} mm (an angle of 1 rad counts as {TURN:g} m); give a shorter one, "
            "or none"
        )


def sample_curve(states: Callable[[Array], Curve], duration: float, step: float = STEP) -> Motion:
    """Return a motion sampled from 0 to `duration` s at equal steps of at most `step` s.

    `states` takes times (T,), s, and returns pose, velocity and acceleration, (T, m) each.
    """
    count = expect_time("duration", duration) / expect_time("step", step)
    if count > _MOST:
        raise DataError(
            f"step: {step:g} s gives {count:.0f} samples in {duration:g} s; at most {_MOST} are "
            "served"
        )
    time = np.linspace(0.0, duration, max(1, int(np.ceil(count - 1e-9))) + 1)
    return Motion(time, *states(time))


def expect_time(name: str, seconds: float) -> float:
    """Return a time in s; raise unless it is finite and above 0."""
    expect(np.isfinite(seconds) and seconds > 0.0, name, seconds, "a time above 0 s")
    return seconds
