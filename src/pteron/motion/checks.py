"""Whether a machine can go a way at all: its reach, its joints' limits, and singularities between.

The way is a continuous one: its measures are followed between samples too, so that it does not jump
over a place where it fails.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pteron.equations.machine import closure_of
from pteron.errors import DataError, SingularPose, UnreachablePose
from pteron.kernels import Array, numeric
from pteron.kernels.functions import TYPE_I, TYPE_II
from pteron.kinematics.singularities import is_singular_everywhere, singular_everywhere
from pteron.manipulator import Manipulator
from pteron.motion.demand import told_pose
from pteron.motion.motion import Motion
from pteron.motion.path import Path, poses_of

_SAMPLES = 1001
"""Poses of a path that are looked at before its measures are followed between them."""

_VALLEYS = 3
"""How many of a measure's lowest places are looked into more closely."""

_FINER = 33
_ZOOMS = 4
"""Each time the place of a least value is known 16 times as well."""

_HALVINGS = 50

_ROUNDING = 1e-9
"""m, or rad, by which a joint may be beyond its limit: a pose on it is within."""

_Poses = Callable[[Array], Array]
_Place = Callable[[float], str]


def check_path(robot: Manipulator, path: Path) -> None:
    """Refuse a path that the machine cannot go.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    path : Path
        Such as `line_path` makes.

    Raises
    ------
    UnreachablePose
        If it leaves a leg's reach, or the limits of an actuated or a passive joint; the message
        says where, by how much, and which leg.
    SingularPose
        If it comes to a singularity of type I, or crosses one of type II.
    """
    s, _ = poses_of(path, _SAMPLES)
    check_way(robot, lambda at: path.at(at)[0], s, lambda at: f"the path, {path.place(at)}")


def check_motion(robot: Manipulator, motion: Motion) -> None:
    """Refuse a motion that the machine cannot do, as `check_path` does; it says at what time.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    motion : Motion
        Any motion of its platform.

    Raises
    ------
    DataError
        If the motion has another number of coordinates than the machine.
    UnreachablePose, SingularPose
        As `check_path`.
    """
    if motion.pose.shape[-1] != robot.freedom:
        raise DataError(
            f"motion: poses of {motion.pose.shape[-1]} numbers given, {robot.freedom} expected: "
            f"{' '.join(robot.coordinates)}"
        )
    check_way(
        robot, lambda at: motion.at(at)[0], motion.time, lambda at: f"the motion, at {at:.4g} s"
    )


def check_way(robot: Manipulator, poses: _Poses, marks: Array, place: _Place) -> None:
    """Refuse a way of poses (K, m) at a parameter (K,); `marks` are where it is looked at first."""
    if is_singular_everywhere(robot):
        raise singular_everywhere(robot)
    _check_reach(robot, poses, marks, place)
    _check_limits(robot, poses, marks, place)
    _check_type_ii(robot, poses, marks, place)


def _check_reach(robot: Manipulator, poses: _Poses, marks: Array, place: _Place) -> None:
    def squares(at: Array) -> Array:
        found: Array = np.nan_to_num(numeric(robot, "squared_type_i")(poses(at))[0], nan=-1.0)
        return found

    found = _first_below(squares, marks, TYPE_I**2)
    if found is None:
        return
    at, i, _ = found
    pose = poses(np.array([at]))[0]
    where = f"{place(at)}, pose {told_pose(pose)}"
    lengths = np.linspace(marks[0], marks[-1], _SAMPLES)
    missed = -float(np.nanmin(numeric(robot, "reach")(poses(lengths))[0][:, i]))
    leg = robot.legs[i]
    if missed <= _ROUNDING:
        raise SingularPose(
            f"{where}: singular for leg {i + 1}: {leg.singular_text} (type I); take another path",
            kind="I",
            measure=float(np.sqrt(max(found[2], 0.0))),
            index=(),
            leg=i + 1,
        )
    raise UnreachablePose(
        f"{where}: leaves the reach of leg {i + 1}, which misses the way beyond by up to "
        f"{missed:.3g} m: {leg.reach_text}; take another path",
        leg=i + 1,
        shortfall=missed,
        index=(),
    )


def _check_limits(robot: Manipulator, poses: _Poses, marks: Array, place: _Place) -> None:
    low, high = np.array([leg.limits or (-np.inf, np.inf) for leg in robot.legs]).T

    def room(at: Array) -> Array:
        q = numeric(robot, "joint_coordinates")(poses(at))[0]
        return np.asarray(np.minimum(q - low, high - q))

    def passive(at: Array) -> Array:
        return np.asarray(numeric(robot, "passive_room")(poses(at))[1])

    for limit, measured, unit_of in (
        ("its {noun}'s limits", room, lambda leg: leg.joint.unit),
        ("the limits of a passive joint, or of phi,", passive, lambda leg: "m at its end"),
    ):
        found = _first_below(measured, marks, -_ROUNDING)
        if found is None:
            continue
        at, i, _ = found
        leg = robot.legs[i]
        beyond = -min(float(_least(measured, marks)[1][i]), 0.0)
        raise UnreachablePose(
            f"{place(at)}, pose {told_pose(poses(np.array([at]))[0])}: leg {i + 1} passes "
            f"{limit.format(noun=leg.joint.noun)} by up to {beyond:.3g} {unit_of(leg)} on the way "
            "beyond; take another path",
            leg=i + 1,
            shortfall=beyond * (leg.lever if measured is room else 1.0),
            index=(),
        )


def _check_type_ii(robot: Manipulator, poses: _Poses, marks: Array, place: _Place) -> None:
    if closure_of(robot).vanishes() is False and not robot.platform.turns:
        return

    def measure(at: Array) -> Array:
        return np.asarray(numeric(robot, "type_ii")(poses(at))[0])

    values = measure(marks)
    changes = np.flatnonzero(values[1:] * values[:-1] <= 0.0)
    if len(changes):
        low, high = marks[changes[0]], marks[changes[0] + 1]
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            same = float(measure(np.array([middle]))[0]) * values[changes[0]] > 0.0
            low, high = (middle, high) if same else (low, middle)
        at = float(low)
    else:
        size = _first_below(lambda at: np.abs(measure(at))[:, None], marks, TYPE_II)
        if size is None:
            return
        at = size[0]
    raise SingularPose(
        f"{place(at)}, pose {told_pose(poses(np.array([at]))[0])}: comes to a singularity (type "
        "II), where the actuators no longer hold the platform; take another path, or go round it",
        kind="II",
        measure=float(np.abs(measure(np.array([at])))[0]),
        index=(),
    )


def _least(measure: Callable[[Array], Array], marks: Array) -> tuple[Array, Array]:
    """Return where each column of a measure (K, c) is least along a way, and how much: (c,) each.

    Its lowest valleys among the marks are looked into, finer and finer.
    """
    values = measure(marks)
    places, least = marks[values.argmin(axis=0)], values.min(axis=0)
    for j in range(values.shape[1]):
        if not np.isfinite(least[j]):
            continue
        column = values[:, j]
        padded = np.concatenate([[np.inf], column, [np.inf]])
        valleys = np.flatnonzero((column <= padded[:-2]) & (column <= padded[2:]))
        for k in valleys[np.argsort(column[valleys])][:_VALLEYS]:
            low, high = marks[max(k - 1, 0)], marks[min(k + 1, len(marks) - 1)]
            for _ in range(_ZOOMS):
                fine = np.linspace(low, high, _FINER)
                found = measure(fine)[:, j]
                best = int(found.argmin())
                low, high = fine[max(best - 1, 0)], fine[min(best + 1, _FINER - 1)]
            if found[best] < least[j]:
                places[j], least[j] = fine[best], found[best]
    return places, least


def _first_below(
    measure: Callable[[Array], Array], marks: Array, least: float
) -> tuple[float, int, float] | None:
    """Return where a measure (K, c) first goes below a value, of which column, and its value."""
    places, lowest = _least(measure, marks)
    columns = np.flatnonzero(lowest < least)
    if not len(columns):
        return None
    all_marks = np.sort(np.concatenate([marks, places[columns]]))
    below = measure(all_marks) < least
    k = int(below.any(axis=1).argmax())
    i = int(below[k].argmax())
    low, high = all_marks[max(k - 1, 0)], all_marks[k]
    if k:
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            inside = float(measure(np.array([middle]))[0, i]) >= least
            low, high = (middle, high) if inside else (low, middle)
    return float(high), i, float(measure(np.array([high]))[0, i])
