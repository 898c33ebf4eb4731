"""Cueing: a vehicle's motion as its simulator's platform shows it, within a proved box of poses.

The filters of `pteron.motion.washout` turn the vehicle's motion into the platform's, whose poses
are then compressed into a box that is proved to lie in the workspace. The box's middle is where the
largest box of the motion's proportions fits.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pteron.errors import DataError, ModelError
from pteron.kernels import Array
from pteron.kinematics.evaluate import finite_pose
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion.motion import Motion, interpolate_columns
from pteron.motion.trajectories.replay import rows_of
from pteron.motion.washout import Washout, WashoutFilter, compress
from pteron.shapes import Columns, PoseLike
from pteron.tables import Table
from pteron.tolerances import SAME
from pteron.workspace import Box, Proof, conditions, home_pose
from pteron.workspace.conditions import Condition, keeps
from pteron.workspace.largest_proved import largest_proved

SAMPLE = ("ax", "ay", "az", "wx", "wy", "wz")
"""The columns of a vehicle's motion: accelerations without gravity, m/s^2, and angular rates,
rad/s, both in its own axes: x ahead, y to the left, z up."""

COLUMNS = ("t", *SAMPLE)
"""The columns of a table of it: the time, s, and the motion."""

_ROOM = 3.0
"""Greatest size of the box, over the range of the uncompressed motion: compression removes less
than 0.03 % of a motion that takes a third of its box."""

_SAMPLES, _HALVINGS = 2048, 8
"""Number of random poses of the box, and of bisections, for its size before the proof."""

_STEP = 0.01
"""Longest step, s, of the motion: a third of the shortest time constant, 1/30 s, of the filters."""

_MANY = 5_000_000
"""Most samples of a motion."""

_GAP, _STEPS = 1.0, 20.0
"""A gap between samples that is longer than both, s and median steps, is refused: vehicles brake
and turn within a second, and what is interpolated across it would be invented."""

WITHIN = 0.999
"""Share of the box to which samples are compressed, so that the curve between them has room."""

_REFINED = 6
"""Times that steps are halved where the curve between them would leave the box."""

_SIZE_HALVINGS = 10
"""Bisections of a box's size in the search of its middle: to 0.1 % of the greatest size."""

_SHARE, _TRIES = 0.94, 30
"""Share of the size by samples for which a proof is tried first (at 0.97 that of Reachy Mini's head
is not decided), and number of tries, each nine tenths of the one before; if none is proved, the cue
is refused."""

_FIRST, _LAST, _BETTER = 0.25, 2e-3, 1.005
"""The search of the box's middle: first and last step, in mean leg sizes, and the factor by which
the box must grow for a step to be taken."""


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
    resampling : str
        How the table's times differ from the motion's, in words; empty where they are the same.
    """

    region: Box
    proof: Proof = field(repr=False)
    pressed: float
    resampling: str = ""

    @property
    def center(self) -> Array:
        """The pose (m,) at the middle of the box, to which the platform returns."""
        return np.asarray(self.region.box.mean(axis=0))


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
        The middle, to which it returns; by default the place, with the home pose's orientation,
        about which the largest box of the motion's proportions fits.
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
        If a column is missing, times do not ascend or have a gap; if the motion is too long, or so
        rough that no steps keep it in the box.
    """
    robot = as_manipulator(robot)
    expect_free_platform(robot)
    rows = rows_of(table, COLUMNS)
    time, *columns = rows.numbers(COLUMNS).T
    _check_times(time, rows)
    time, samples, filters = time - time[0], np.array(columns).T, washout or Washout()
    even, resampling = _even_times(time, rows.source)
    demand = _filter_samples(filters, time, samples, even)
    region, proof = prove_box(robot, np.abs(demand[0]).max(axis=0), pose, type_ii)
    half = 0.5 * np.ptp(region.box, axis=0)
    parts = compress(demand, WITHIN * half)
    for _ in range(_REFINED):
        if (_control_points(even, parts) <= half).all():
            break
        even = np.linspace(0.0, even[-1], 2 * len(even) - 1)
        demand = _filter_samples(filters, time, samples, even)
        parts = compress(demand, WITHIN * half)
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
    middle = region.box.mean(axis=0)
    return Cue(even, middle + parts[0], parts[1], parts[2], region, proof, pressed, resampling)


def expect_free_platform(robot: Manipulator) -> None:
    """Raise ModelError unless the platform moves and turns freely."""
    if not robot.platform.moves_freely:
        raise ModelError(
            f"a {robot.platform.motion} platform shows no vehicle's motion, which has six "
            "coordinates; take a 3T3R one",
            subject=robot.name,
        )


def _check_times(time: Array, rows: Table) -> None:
    """Raise DataError unless there are two or more times that ascend without a long gap."""
    steps = np.diff(time)
    if len(time) < 2 or not (steps > 0.0).all():
        place = rows.place(int(np.argmin(steps > 0.0)) + 1) if len(steps) else rows.source
        raise DataError(f"{place}: t: two or more times expected that ascend, in seconds")
    longest = int(steps.argmax())
    if steps[longest] > max(_GAP, _STEPS * float(np.median(steps))):
        raise DataError(
            f"{rows.place(longest + 1)}: t: a gap of {steps[longest]:.3g} s before this row, from "
            f"{time[longest]:.6g} s; at most {_GAP:g} s can be interpolated: cut the motion there "
            "into two files"
        )


def _even_times(time: Array, source: str) -> tuple[Array, str]:
    """Return even times, at most `_STEP` apart, from 0 to the last one, s; why, in words."""
    steps, count, text = np.diff(time), len(time), ""
    median = float(np.median(steps))
    is_uneven = bool(np.ptp(steps) > SAME * steps.mean())
    if is_uneven or median > _STEP:
        count = int(np.ceil(time[-1] / min(median, _STEP))) + 1
        lost = int((np.rint(steps / median) - 1.0).clip(0.0).sum())
        spread = f"{1e3 * steps.min():.3g} to {1e3 * steps.max():.3g} ms"
        text = f"time stamps {spread if is_uneven else f'{1e3 * median:.3g} ms'} apart"
        text += f" ({lost} missing)" * (is_uneven and lost > 0)
        text += f", interpolated linearly to steps of {1e3 * time[-1] / (count - 1):.3g} ms"
    if count > _MANY:
        raise DataError(f"{source}: {time[-1]:.4g} s make {count} samples, at most {_MANY} serve")
    return np.linspace(0.0, time[-1], count), text


def _filter_samples(washout: Washout, time: Array, samples: Array, even: Array) -> Array:
    """Return the unlimited motion (3, T, 6) at even times, of samples (R, 6) at times (R,)."""
    return WashoutFilter(washout, float(even[1])).run(interpolate_columns(time, samples, even))


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


def prove_box(
    robot: Manipulator, demand: Array, pose: PoseLike | None = None, type_ii: float = 0.0
) -> tuple[Box, Proof]:
    """Return a box of poses in proportion to a motion's ranges (6,), and its proof.

    Its middle is the pose, or by default the place where the largest such box fits.

    Raises
    ------
    ModelError
        If no box about the middle is proved.
    """
    required: tuple[Condition, ...] = conditions(robot, type_ii=type_ii)
    half = np.maximum(demand, 1e-3 * max(float(demand.max()), 1e-3))
    # Half of the sample poses are corners of the box.
    ways = np.random.default_rng(0).uniform(-1.0, 1.0, (_SAMPLES, robot.freedom))
    ways[: _SAMPLES // 2] = np.sign(ways[: _SAMPLES // 2])
    if pose is None:
        middle = _search_center(robot, required, half, ways[_SAMPLES // 2 - 64 :][:128])
    else:
        middle = finite_pose(robot, pose, "pose")

    def region(size: float) -> Box:
        """Return the box about the middle that is `size` times the half sides."""
        return Box(tuple(middle - size * half), tuple(middle + size * half))

    size, proof = largest_proved(
        robot,
        required,
        region,
        lambda size: middle + size * half * ways,
        _ROOM,
        _HALVINGS,
        (_SHARE * 0.9**k for k in range(_TRIES)),
    )
    if not proof.holds:
        raise ModelError(
            f"no box of poses about {middle.round(6).tolist()} is proved to serve: {proof}; give "
            "another middle",
            subject=robot.name,
        )
    box = region(size)
    if not np.ptp(box.box, axis=0).all():
        raise ModelError(
            f"the box of poses about {middle.round(6).tolist()} that serves is a point: there is "
            "no room for the motion; give another middle, and a pivot near the platform, in m",
            subject=robot.name,
        )
    return box, proof


def _search_center(
    robot: Manipulator, required: tuple[Condition, ...], half: Array, ways: Array
) -> Array:
    """Return the pose, oriented as at home, about which the largest box fits, by its samples.

    A compass search from the home pose: a step along lengths or across them that lets the box grow
    is taken, the best one, and steps halve where none does. The size is a minimum over conditions,
    whose ridges steps along the lengths alone would not follow.
    """
    middle = home_pose(robot)
    reach = float(np.mean([leg.size or 1.0 for leg in robot.legs]))

    def box_sizes(centers: Array) -> Array:
        """Return the sizes (C,) up to which all samples of the boxes keep the conditions."""
        low, high = np.zeros(len(centers)), np.full(len(centers), _ROOM)
        for _ in range(_SIZE_HALVINGS):
            size = 0.5 * (low + high)
            poses = centers[:, None] + size[:, None, None] * half * ways
            fits = keeps(robot, required, poses).all(axis=-1)
            low, high = np.where(fits, size, low), np.where(fits, high, size)
        return low

    lengths = np.flatnonzero(~robot.platform.angular)
    moves = np.array(list(itertools.product((-1.0, 0.0, 1.0), repeat=len(lengths))))
    steps = moves[np.abs(moves).any(axis=1)] @ np.eye(robot.freedom)[lengths]
    size, step = float(box_sizes(middle[None])[0]), _FIRST * reach
    while step > _LAST * reach and size < _ROOM / _BETTER:
        centers = middle + step * steps
        sizes = box_sizes(centers)
        best = int(np.argmax(sizes))
        if sizes[best] > _BETTER * size:
            middle, size = centers[best], float(sizes[best])
        else:
            step *= 0.5
    return middle
