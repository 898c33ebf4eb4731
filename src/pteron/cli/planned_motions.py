"""The motions that `pteron cycle` plans: pick-and-place cycles, straight lines, joint motions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

from pteron.cli.motion_argument import given_pose, note_unlikely
from pteron.cli.terminal import note
from pteron.errors import DataError

if TYPE_CHECKING:
    from pteron.manipulator import Manipulator
    from pteron.motion import Motion, MotionLimits


def standard_motion(
    machine: Manipulator,
    around: str | None,
    scale: float | None,
    limits: MotionLimits,
    duration: float | None,
    optimal: bool,
    step: float | None,
) -> Motion:
    """Return the pick-and-place cycle about a pose, within limits or the usual acceleration."""
    from dataclasses import replace

    from pteron.motion import check_path, cycle_path, pick_and_place, time_optimal
    from pteron.motion.trajectories.pick_and_place import PEAK_ACCELERATION, farthest_point
    from pteron.motion.trajectories.time_law import time_curve

    middle = given_pose(machine, around, "--around")
    standard = pick_and_place(machine, middle, scale=scale)
    path = cycle_path(standard)
    if optimal:
        return time_optimal(machine, path, limits, step=step)
    check_path(machine, path)
    if duration is None and not limits.is_limited:
        tilts = machine.platform.tilts
        beside = f", and of a point {1e3 * farthest_point(machine):.0f} mm from P as it turns,"
        note(
            "Note: neither options nor the drives in the file state limits: the acceleration of "
            f"the tool{beside if tilts else ''} is limited to {PEAK_ACCELERATION:g} m/s^2"
        )
        if tilts:
            duration = standard.duration
        else:
            limits = replace(limits, tool_acceleration=PEAK_ACCELERATION)
    return time_curve(machine, standard.cycle.at, duration, limits, step)


def line_motion(
    machine: Manipulator,
    from_: str | None,
    to: str | None,
    via: str | None,
    corner: float,
    back: bool,
    limits: MotionLimits,
    duration: float | None,
    optimal: bool,
    law: Literal["quintic", "seventh"],
    step: float | None,
) -> Motion:
    """Return the motion on straight lines from a pose, through a table's poses, to a pose."""
    import numpy as np

    from pteron.motion import line_path, polynomial_motion, return_path, time_optimal

    if to is None and via is None:
        raise DataError(f"no way given; give --to with {' '.join(machine.coordinates)}, or --via")
    poses = [] if via is not None and from_ is None else [given_pose(machine, from_, "--from")]
    if via is not None:
        from pteron.tables import convert_to_si, read_table

        passed = convert_to_si(read_table(via), machine.column_units).numbers(machine.coordinates)
        note_unlikely(machine, machine.coordinates, passed, via)
        poses += list(passed)
    if to is not None:
        poses.append(given_pose(machine, to, "--to"))
    path: Any = line_path(machine, np.array(poses), corner)
    if back:
        path = return_path(path)
    if optimal:
        return time_optimal(machine, path, limits, step=step)
    return polynomial_motion(machine, path, duration=duration, limits=limits, law=law, step=step)


def joint_motion(
    machine: Manipulator,
    from_: str | None,
    to: str | None,
    jerk: Sequence[float] | None,
    limits: MotionLimits,
    step: float | None,
) -> Motion:
    """Return the motion of the joints from a pose to a pose with limited jerk."""
    from pteron.motion import jerk_limited

    if to is None:
        raise DataError(f"no way given; give --to with {' '.join(machine.coordinates)}")
    if jerk is None:
        raise DataError("--jerk is missing; give it, and --acceleration, for the joints")
    ends = given_pose(machine, from_, "--from"), given_pose(machine, to, "--to")
    return jerk_limited(machine, *ends, jerk, limits, step=step)
