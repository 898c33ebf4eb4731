"""Tables of a motion for the command line: its samples, its peaks beside limits, its box."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from pteron.cli.terminal import significant, table
from pteron.tolerances import ROUNDING

if TYPE_CHECKING:
    import polars as pl
    from rich.table import Table

    from pteron.manipulator import Manipulator
    from pteron.motion import Motion, Peak
    from pteron.workspace import Box

_BINDS = 0.98
"""Share of a limit from which it counts as reached."""


def peaks_table(largest: Sequence[Peak]) -> Table:
    """Return a table of the peak values of a motion, beside their limits."""
    numbers = ("leg", "value", "limit", "value/limit")
    rows = (
        (
            f"{_word(peak)} ({peak.unit})" + ", at its limit" * (peak.share >= _BINDS),
            *(str(peak.leg or ""), significant(peak.size)),
            *(
                (significant(peak.limit, 4), f"{100.0 * peak.share:.0f} %")
                if math.isfinite(peak.limit)
                else ("none", "-")
            ),
        )
        for peak in largest
    )
    return table("peak", *numbers, rows=rows, numbers=numbers)


def travel_text(machine: Manipulator, motion: Motion) -> str:
    """Return the travel of each coordinate that a motion moves, in mm and degrees."""
    import numpy as np

    travels = zip(machine.coordinates, machine.units, np.ptp(motion.pose, axis=0), strict=True)
    parts = [
        f"{name} {1e3 * travel:.3g} mm" if unit == "m" else f"{name} {np.degrees(travel):.3g} deg"
        for name, unit, travel in travels
        if travel > ROUNDING
    ]
    return ", ".join(parts) or "none"


def _word(peak: Peak) -> str:
    """Return the name of a peak's quantity; the force of a revolute joint is a torque."""
    word = peak.name.replace("_", " ")
    return word.replace("force", "torque") if peak.unit == "N m" else word


def force_word(robot: Manipulator) -> str:
    """Return the noun for the drives' output: "force", "torque", or "force or torque"."""
    return " or ".join(sorted({leg.joint.force for leg in robot.legs}))


def motion_frame(machine: Manipulator, motion: Motion) -> pl.DataFrame:
    """Return a motion's samples: t, pose and joints with two derivatives each, drives' forces."""
    import numpy as np
    import polars as pl

    from pteron.dynamics import drive_forces
    from pteron.kinematics import inverse_kinematics, joint_accelerations, joint_rates
    from pteron.manipulator.readings import reading_scales, to_readings

    path = motion.pose, motion.velocity, motion.acceleration
    columns = {"t": motion.time}
    scales = reading_scales(machine)
    joints = (
        to_readings(machine, inverse_kinematics(machine, path[0])),
        joint_rates(machine, *path[:2]).actuated / scales,
        joint_accelerations(machine, *path).actuated / scales,
    )
    for names, parts in ((machine.coordinates, path), (machine.joint_names, joints)):
        for order, part in zip(("", "d", "dd"), parts, strict=True):
            for name, column in zip(names, part.T, strict=True):
                columns[f"{order}{name}"] = np.asarray(column + 0.0)
    forces = drive_forces(machine, *path) * scales
    columns.update(zip(machine.force_names, forces.T, strict=True))
    return pl.DataFrame(columns)


def box_record(machine: Manipulator, region: Box) -> dict[str, list[float]]:
    """Return the box by coordinate, m and rad."""
    return dict(zip(machine.coordinates, region.box.T.tolist(), strict=True))


def box_lines(machine: Manipulator, region: Box) -> list[str]:
    """Return lines on the box that the platform stays in and on its middle, mm and degrees."""
    rows = list(zip(machine.coordinates, machine.platform.units, *region.box.tolist(), strict=True))
    spans = ", ".join(
        f"{name} {significant(1e3 * a)} to {significant(1e3 * b)} mm"
        if unit == "m"
        else f"{name} {math.degrees(a):.3g} to {math.degrees(b):.3g} deg"
        for name, unit, a, b in rows
    )
    middle = " ".join(f"{0.5 * (a + b) + 0.0:.4g}" for _, _, a, b in rows)
    return [
        f"It stays in a box of poses proved to be in reach and within limits: {spans}.",
        f"The middle of the box, to which it returns: {middle} (m, rad).",
    ]
