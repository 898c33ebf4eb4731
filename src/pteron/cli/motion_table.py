"""Tables of a motion for the command line: its samples, and its peaks beside their limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from pteron.cli.terminal import table

if TYPE_CHECKING:
    import polars as pl
    from rich.table import Table

    from pteron.manipulator import Manipulator
    from pteron.motion import Motion, Peak

_BINDS = 0.98
"""Share of a limit from which a peak counts as at the limit."""


def peaks_table(largest: Sequence[Peak]) -> Table:
    """Return a table of the largest sizes in a motion, beside their limits."""
    numbers = ("leg", "size", "limit", "share")
    rows = (
        (
            f"{_word(peak)} ({peak.unit})" + " (binds)" * (peak.share >= _BINDS),
            *(str(peak.leg or ""), f"{peak.size:.4g}"),
            *((f"{peak.limit:.4g}", f"{peak.share:.0%}") if math.isfinite(peak.limit) else "--"),
        )
        for peak in largest
    )
    return table("largest", *numbers, rows=rows, numbers=numbers)


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
