"""The cycles that subcommands are given: the standard one, or one from a file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pteron.cli.arguments import option
from pteron.cli.screen import note
from pteron.errors import DataError

if TYPE_CHECKING:
    from pteron.manipulator import Manipulator
    from pteron.motion import Motion
    from pteron.tables import Table

STANDARD = "adept"
"""What the pick-and-place cycle of 25, 305 and 25 mm is called."""

CYCLE = option(
    "cycle", f"{STANDARD}, the standard pick-and-place cycle, or a table of a motion.", "CYCLE"
)

_SAMPLES = 481
_LEAST = 0.2

_UNLIKE = 3.0
"""How many times as far a motion may go by its poses as by its velocities, or the inverse."""


def cycle_of(robot: Manipulator, cycle: str, duration: float | None) -> Motion:
    """Return a cycle by its name or from a table.

    A table is one that `pteron.motion.replay` takes, such as `pteron cycle` writes.
    """
    if cycle == STANDARD:
        from pteron.motion import pick_and_place
        from pteron.workspace import home_pose, reserve

        home = home_pose(robot)
        # A machine with little reserve anywhere moves where it has half of its best.
        least = min(_LEAST, float(reserve(robot, home).smallest) / 2.0)
        return pick_and_place(robot, home, samples=_SAMPLES, duration=duration, least=least)
    if duration is not None:
        raise DataError(f"--duration is for --cycle {STANDARD}; a table has its own time")
    return _from_table(robot, cycle)


def _from_table(robot: Manipulator, file: str) -> Motion:
    from pteron.motion import replay
    from pteron.tables import read_table
    from pteron.workspace import home_pose
    from pteron.workspace.doubts import value_doubts

    rows = read_table(file)
    _check_rates(robot, rows)
    names = [n for n in (*robot.coordinates, *robot.joint_names) if n in rows.columns]
    joints_only = not set(robot.coordinates) <= set(names)
    motion = replay(robot, rows, start=home_pose(robot) if joints_only else None)
    for text in value_doubts(robot, names, rows.numbers(names)):
        note(f"Note: {rows.source}: {text}")
    return motion


def _check_rates(robot: Manipulator, rows: Table) -> None:
    """Refuse a table whose velocities, where it has them, are not those of its poses and times."""
    import numpy as np

    names = robot.coordinates
    columns = ["t", *names, *(f"d{name}" for name in names)]
    if len(rows) < 2 or not set(columns) <= set(rows.columns):
        return
    values = rows.numbers(columns)
    poses, rates = values[:, 1 : 1 + len(names)], values[:, 1 + len(names) :]
    means = np.abs(rates[1:] + rates[:-1]) / 2.0
    far, meant = np.abs(np.diff(poses, axis=0)).sum(), (np.diff(values[:, 0]) @ means).sum()
    # A time that does not ascend is told as that.
    if meant > 0.0 and not _UNLIKE * far >= meant >= far / _UNLIKE:
        raise DataError(
            f"{rows.source}: its poses go {far:.3g} m or rad, its velocities {meant:.3g} in the "
            "same time; t must be in s, and velocities per s"
        )
