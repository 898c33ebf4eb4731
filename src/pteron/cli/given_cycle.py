"""The cycles that subcommands are given: the standard one, or one from a file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from pteron.cli.arguments import option
from pteron.cli.screen import note
from pteron.errors import DataError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pteron.manipulator import Manipulator
    from pteron.motion import Motion, PickAndPlace
    from pteron.shapes import PoseLike

STANDARD = "adept"
"""What the pick-and-place cycle of 25, 305 and 25 mm is called."""

CYCLE = option(
    "cycle", f"{STANDARD}, the standard pick-and-place cycle, or a table of a motion.", "CYCLE"
)

_SAMPLES = 481
_LEAST = 0.2

_SLOW = 0.5
"""s between samples that is unlikely."""

_UNLIKE = 1.5
"""How many times as far a motion may go by its poses as by its velocities, or the inverse."""


def cycle_of(robot: Manipulator, cycle: str, duration: float | None) -> Motion:
    """Return a cycle by its name, or from a table: of poses, or of joints, from the home pose."""
    if cycle == STANDARD:
        return standard_cycle(robot, duration=duration)
    if duration is not None:
        raise DataError(f"--duration is for --cycle {STANDARD}; a table has its own time")
    return replayed(robot, cycle)


def standard_cycle(
    robot: Manipulator,
    around: PoseLike | None = None,
    scale: float | None = None,
    duration: float | None = None,
) -> PickAndPlace:
    """Return the standard cycle about a pose, the home pose if none is given."""
    from pteron.motion import pick_and_place
    from pteron.workspace import home_pose, reserve

    middle = home_pose(robot) if around is None else around
    # A machine with little reserve anywhere moves where it has half of its best.
    least = min(_LEAST, float(reserve(robot, middle).smallest) / 2.0)
    return pick_and_place(
        robot, middle, scale=scale, samples=_SAMPLES, duration=duration, least=least
    )


def replayed(robot: Manipulator, file: str, start: PoseLike | None = None) -> Motion:
    """Return a motion from a table; what is unlikely in it is told.

    A table of joints alone is followed from a pose to start from, the home pose if none is given.
    """
    import numpy as np

    from pteron.motion import replay
    from pteron.tables import read_table
    from pteron.workspace import home_pose

    rows = read_table(file)
    names = [n for n in (*robot.coordinates, *robot.joint_names) if n in rows.columns]
    told_doubts(robot, names, rows.numbers(names), file)
    motion = replay(robot, rows, start=home_pose(robot) if start is None else start)
    if float(np.median(np.diff(motion.time))) >= _SLOW:
        note(f"Note: {file}: t in steps of {motion.time[1]:g}: are these ms? s are expected")
    far, meant = _lengths(motion)
    if not _UNLIKE * far >= meant >= far / _UNLIKE:
        note(
            f"Note: {file}: its poses go {far:.3g} m or rad, its velocities {meant:.3g} in the "
            "same time: is t in s, are they per s?"
        )
    return motion


def told_doubts(
    robot: Manipulator, columns: Sequence[str], values: NDArray[Any], source: str
) -> None:
    """Tell what is possible but unlikely in numbers that are given."""
    from pteron.workspace.doubts import value_doubts

    for text in value_doubts(robot, columns, values):
        note(f"Note: {source}: {text}")


def _lengths(motion: Motion) -> tuple[float, float]:
    """Return how far a motion goes by its poses, and by its velocities."""
    import numpy as np

    means = np.abs(motion.velocity[1:] + motion.velocity[:-1]) / 2.0
    steps = np.diff(motion.time)
    return float(np.abs(np.diff(motion.pose, axis=0)).sum()), float((steps @ means).sum())
