"""Washout: the accelerations and turns of a vehicle as a motion of its simulator's platform.

A classical washout (L. D. Reid, M. A. Nahon, UTIAS Report 296, 1985): the platform follows quick
accelerations by moving and lasting ones by tilting, so that a part of gravity replaces them, and it
always returns to the middle. Its poses are then compressed into a box of poses that is proved to
lie in the workspace.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.arguments import checked_arguments, expect
from pteron.errors import DataError, ModelError
from pteron.kernels import Array
from pteron.kinematics.evaluate import finite_pose
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion.motion import Motion, interpolate_columns
from pteron.motion.trajectories.replay import rows_of
from pteron.shapes import Columns, PoseLike
from pteron.tables import Table
from pteron.tolerances import SAME
from pteron.workspace import Box, Proof, conditions, home_pose
from pteron.workspace.conditions import Condition
from pteron.workspace.largest_proved import largest_proved

COLUMNS = ("t", "ax", "ay", "az", "wx", "wy", "wz")
"""The columns of a vehicle's motion: s; accelerations without gravity, m/s^2, and angular rates,
rad/s, both in its own axes: x ahead, y to the left, z up."""

_GRAVITY = 9.81
"""Gravity, m/s^2: a lasting acceleration over it is the sine of the tilt."""

_DAMPING = 1.0
"""Damping ratio of the filters: critical."""

_ROOM = 3.0
"""Greatest size of the box, over the range of the uncompressed motion."""

_SAMPLES, _HALVINGS = 2048, 8
"""Number of random poses of the box, and of bisections, for its size before the proof."""

_STEP = 0.01
"""Longest step, s, of the motion: a third of the shortest time constant, 1/30 s, of the filters."""

_MANY = 5_000_000
"""Most samples of a motion."""

_WITHIN = 0.999
"""Share of the box to which samples are compressed, so that the curve between them has room."""

_REFINED = 6
"""Times that steps are halved where the curve between them would leave the box."""

_TRIES = 30
"""Sizes for which a proof is tried, each nine tenths of the one before; if none is proved, the cue
is refused."""


@checked_arguments
@dataclass(frozen=True)
class Washout:
    """The filters of a washout.

    Parameters
    ----------
    scale : float
        Share of the vehicle's accelerations and rates that is shown.
    translation : float
        Cut-off, rad/s, of the high-pass filter of accelerations, by which the platform moves.
    return_speed : float
        Cut-off, rad/s, of the filter that returns the platform to the middle.
    tilting : float
        Cut-off, rad/s, of the low-pass filter of accelerations, by which the platform tilts.
    tilt_rate : float
        Greatest rate of that tilt, rad/s: people do not notice one below some 0.05.
    rotation : float
        Cut-off, rad/s, of the high-pass filter of the vehicle's turns, by which the platform turns.
    smoothing : float
        Cut-off, rad/s, of the low-pass filter of the platform's turns.
    """

    scale: float = 0.5
    translation: float = 2.5
    return_speed: float = 0.25
    tilting: float = 2.0
    tilt_rate: float = 0.05
    rotation: float = 0.7
    smoothing: float = 30.0

    def __post_init__(self) -> None:
        for name, setting in vars(self).items():
            expect(0.0 < setting < np.inf, name, repr(setting), "a number above 0")


@dataclass(frozen=True, eq=False, repr=False)
class Cue(Motion):
    """A motion of the platform that reproduces a vehicle's, within a proved box of poses.

    Attributes
    ----------
    region : Box
        The box of poses that the motion stays in.
    proof : Proof
        The proof that all poses of the box lie in the workspace.
    pressed : float
        The largest share of a coordinate's uncompressed motion that compression removed, 0 to 1.
    """

    region: Box
    proof: Proof = field(repr=False)
    pressed: float


def cue(
    robot: RobotLike,
    table: str | Path | Table | Columns,
    *,
    washout: Washout | None = None,
    pose: PoseLike | None = None,
    type_ii: float = 0.0,
) -> Cue:
    """Return the motion of a simulator's platform that reproduces a vehicle's, within its box.

    Parameters
    ----------
    robot : Manipulator, name or path
        A machine whose platform moves and turns freely (3T3R), x ahead, y to the left, z up.
    table : path, Table or mapping
        The vehicle's motion: t, ax, ay, az, wx, wy, wz; see `COLUMNS`.
    washout : Washout, optional
        The filters.
    pose : array, shape (m,), optional
        The middle, to which it returns; by default the home pose.
    type_ii : float
        Least type-II measure in the box.

    Returns
    -------
    Cue
        The motion, at the times of the table where these have even steps of at most 0.01 s; else
        at even steps, finer where it would leave the box between samples.

    Raises
    ------
    ModelError
        If the platform does not move freely, or no box about the middle is proved.
    DataError
        If a column is missing, or times do not ascend; if the motion is too long, or so rough that
        no steps keep it in the box.
    """
    robot = as_manipulator(robot)
    if not robot.platform.moves_freely:
        raise ModelError(
            f"a {robot.platform.motion} platform shows no vehicle's motion, which has six "
            "coordinates; take a 3T3R one",
            subject=robot.name,
        )
    middle = home_pose(robot) if pose is None else finite_pose(robot, pose, "pose")
    rows = rows_of(table, COLUMNS)
    time, *columns = rows.numbers(COLUMNS).T
    if len(time) < 2 or not (np.diff(time) > 0.0).all():
        raise DataError(f"{rows.source}: t: two or more times expected that ascend, in seconds")
    samples = np.array(columns).T
    even = _even_times(time - time[0], rows.source)
    demand = _filter_motion(
        even, interpolate_columns(time - time[0], samples, even), washout or Washout()
    )
    region, proof = _box(robot, middle, np.abs(demand[0]).max(axis=0), type_ii)
    half = 0.5 * np.ptp(region.box, axis=0)
    parts = _compress(demand, _WITHIN * half)
    for _ in range(_REFINED):
        if (_control_points(even, parts) <= half).all():
            break
        even = np.linspace(0.0, even[-1], 2 * len(even) - 1)
        demand = _filter_motion(
            even, interpolate_columns(time - time[0], samples, even), washout or Washout()
        )
        parts = _compress(demand, _WITHIN * half)
    else:
        raise DataError(
            f"{rows.source}: accelerations so rough that the motion leaves its box between samples "
            f"of {even[1]:.2g} s; smooth them, or lower the scale"
        )
    removed_shares = 1.0 - np.abs(parts[0]).max(axis=0) / np.maximum(
        np.abs(demand[0]).max(axis=0), 1e-12
    )
    is_moved = np.abs(demand[0]).max(axis=0) > 1e-9
    pressed = float(np.max(removed_shares[is_moved], initial=0.0))
    return Cue(even, middle + parts[0], parts[1], parts[2], region, proof, pressed)


def _even_times(time: Array, source: str) -> Array:
    """Return equidistant times, at most `_STEP` apart, from 0 to the last sample's time, s."""
    steps = np.diff(time)
    count = len(time)
    if np.ptp(steps) > SAME * steps.mean() or steps.mean() > _STEP:
        count = int(np.ceil(time[-1] / min(float(np.median(steps)), _STEP))) + 1
    if count > _MANY:
        raise DataError(f"{source}: {time[-1]:.4g} s make {count} samples, at most {_MANY} serve")
    return np.linspace(0.0, time[-1], count)


def _control_points(time: Array, parts: Array) -> Array:
    """Return the absolute Bernstein coefficients (6, T - 1, 6) of a motion between samples.

    The curve between two samples lies in the convex hull of its six coefficients.
    """
    step = np.diff(time)[:, None]
    (a, va, aa), (b, vb, ab) = parts[:, :-1], parts[:, 1:]
    first, last = step * va / 5.0, step * vb / 5.0
    bends = step**2 * aa / 20.0, step**2 * ab / 20.0
    points = a, a + first, a + 2.0 * first + bends[0], b - 2.0 * last + bends[1], b - last, b
    return np.abs(points)


def _filter_motion(time: Array, vehicle_motion: Array, washout: Washout) -> Array:
    """Return the simulator's motion, its limits ignored, and two derivatives (3, T, 6).

    The array is (3, T, 6), in m, rad and s.
    """
    accelerations, rates = (
        washout.scale * part for part in (vehicle_motion[:, :3], vehicle_motion[:, 3:])
    )
    w, s = washout.translation, washout.smoothing
    resonance = [1.0, 2.0 * _DAMPING * w, w * w]
    quick = np.polymul(resonance, [1.0, washout.return_speed])
    translations = [_filter_signal(time, a, [1.0, 0.0], quick) for a in accelerations.T]
    # On a level platform g acts along z, on a tilted one a part of it ahead or to the side.
    tilt_accelerations = [
        _filter_signal(
            time, a, [1.0], [1 / washout.tilting**2, 2 * _DAMPING / washout.tilting, 1.0]
        )[0]
        for a in (accelerations[:, 1], -accelerations[:, 0])
    ]
    w = washout.rotation
    turns = [
        _filter_signal(
            time, r, [1.0, 0.0], np.polymul([1.0, 2.0 * _DAMPING * w, w * w], [1 / s, 1.0])
        )
        for r in rates.T
    ]
    for angle, a in enumerate(tilt_accelerations):
        target = np.arcsin(np.clip(a / _GRAVITY, -0.9, 0.9))
        steps = washout.tilt_rate * np.diff(time)
        tilt = np.zeros(len(time))
        for k, most in enumerate(steps):
            tilt[k + 1] = tilt[k] + np.clip(target[k + 1] - tilt[k], -most, most)
        turns[angle] += _filter_signal(time, tilt, [1.0], [1 / s**2, 2 / s, 1.0])
    return np.moveaxis(np.array([*translations, *turns]), 0, -1)


def _filter_signal(
    time: Array, signal: Array, numerator: Sequence[float], denominator: Any
) -> Array:
    """Return a linear filter's output and two derivatives (3, T), for a signal (T,)."""
    return np.array(
        [
            scipy.signal.lsim(
                (np.polymul(numerator, [1.0] + [0.0] * order), denominator), signal, time
            )[1]
            for order in range(3)
        ]
    )


def _compress(demand: Array, half: Array) -> Array:
    """Return x / (1 + (x / L)^6)^(1 / 6) of x (T, 6), which stays within L, and its derivatives."""
    x, dx, ddx = demand
    share = x / half
    compression = 1.0 + share**6
    slope = compression ** (-7.0 / 6.0)
    bend = -7.0 * share**5 * slope / compression / half
    return np.array([x * compression ** (-1.0 / 6.0), slope * dx, slope * ddx + bend * dx * dx])


def _box(robot: Manipulator, middle: Array, demand: Array, type_ii: float) -> tuple[Box, Proof]:
    """Return a box of poses about the middle, and the proof that it lies in the workspace.

    Its sides are proportional to the ranges of the motion `demand` before compression.
    """
    required: tuple[Condition, ...] = conditions(robot, type_ii=type_ii)
    least = 1e-3 * max(float(demand.max()), 1e-3)
    ways = np.random.default_rng(0).uniform(-1.0, 1.0, (_SAMPLES, len(middle)))
    ways[: _SAMPLES // 2] = np.sign(ways[: _SAMPLES // 2])
    half, shares = np.maximum(demand, least), (0.9**k for k in range(1, _TRIES))

    def region(size: float) -> Box:
        """Return the box about the middle that is `size` times the half sides."""
        return Box(tuple(middle - size * half), tuple(middle + size * half))

    size, proof = largest_proved(
        robot, required, region, lambda size: middle + size * half * ways, _ROOM, _HALVINGS, shares
    )
    if not proof.holds:
        raise ModelError(
            f"no box of poses about {middle.round(6).tolist()} is proved to serve: {proof}; give "
            "another middle",
            subject=robot.name,
        )
    return region(size), proof
