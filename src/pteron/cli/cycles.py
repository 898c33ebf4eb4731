"""The cycles that subcommands are given: the standard one, or one from a file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pteron.cli.arguments import option
from pteron.cli.screen import note
from pteron.errors import DataError, PteronError, SingularPose, UnreachablePose

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

_UNLIKE = 1.5
"""How many times as far a motion may go by its poses as by its velocities, or the inverse."""


def cycle_of(robot: Manipulator, cycle: str, duration: float | None) -> Motion:
    """Return a cycle by its name or from a table.

    A table has the columns t, the pose, its rates and accelerations, as `pteron forces` has them.
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
    import numpy as np

    from pteron.motion import Motion
    from pteron.tables import read_table

    columns = [f"{rate}{name}" for rate in ("", "d", "dd") for name in robot.coordinates]
    table = read_table(file)
    values = table.numbers(["t", *columns])
    falls = np.flatnonzero(np.diff(values[:, 0]) <= 0.0)
    if len(values) < 2:
        raise DataError(f"{table.source}: one row; a motion has two or more")
    if len(falls):
        raise DataError(
            f"{table.place(int(falls[0]) + 1)}, column t: the time does not go on from the row "
            "before it; put the rows in order"
        )
    m = robot.freedom
    motion = Motion(values[:, 0], *(values[:, k : k + m] for k in (1, 1 + m, 1 + 2 * m)))
    _check_poses(robot, motion, table)
    far, meant = _lengths(motion)
    if not _UNLIKE * far >= meant >= far / _UNLIKE:
        note(
            f"Warning: {table.source}: its poses go {far:.3g} m or rad, its velocities "
            f"{meant:.3g} in the same time: is t in s, are they per s?"
        )
    return motion


def _check_poses(robot: Manipulator, motion: Motion, table: Table) -> None:
    """Refuse the first row whose pose the machine cannot do."""
    from pteron.dynamics import inverse_dynamics
    from pteron.workspace.doubts import value_doubts

    state = motion.pose, motion.velocity, motion.acceleration
    try:
        inverse_dynamics(robot, *state)
    except (UnreachablePose, SingularPose) as error:
        row = error.index[0]
        doubts = "".join(f"; {text}" for text in value_doubts(robot, robot.coordinates, state[0]))
        try:
            inverse_dynamics(robot, *(part[row] for part in state))
        except PteronError as alone:
            raise PteronError(f"{table.place(row)}, {alone}{doubts}") from None


def _lengths(motion: Motion) -> tuple[float, float]:
    """Return how far a motion goes by its poses, and by its velocities."""
    import numpy as np

    means = np.abs(motion.velocity[1:] + motion.velocity[:-1]) / 2.0
    steps = np.diff(motion.time)
    return float(np.abs(np.diff(motion.pose, axis=0)).sum()), float((steps @ means).sum())
