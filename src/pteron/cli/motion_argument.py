"""Motions, poses and payloads that a subcommand is given, read and checked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pteron.cli.arguments import STANDARD, parsed_numbers
from pteron.cli.terminal import note
from pteron.errors import DataError, PteronError, SingularPose, UnreachablePose

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pteron.manipulator import Manipulator
    from pteron.motion import Motion
    from pteron.playback import Playback
    from pteron.shapes import PoseLike
    from pteron.tables import Table

HOME = "home"
"""The word for the home pose in place of a pose's numbers."""

_OTHER = 0.05
"""Difference of joints from those of the poses beside them, in sizes of a leg, that is no error of
tracking."""

_UNLIKE = 3.0
"""Greatest ratio of a motion's length by its velocities to that by its poses, or inverse of it."""


def cycle_text(cycle: str) -> str:
    """Return the noun for a cycle: the standard one's name, or the table of a motion."""
    return "standard pick-and-place cycle" if cycle == STANDARD else f"motion of {cycle}"


def cycle_of(robot: Manipulator, cycle: str, duration: float | None) -> Motion:
    """Return a cycle by its name, or from a table: of poses, or of joints, from the home pose."""
    if cycle == STANDARD:
        from pteron.motion import pick_and_place

        return pick_and_place(robot, duration=duration)
    if duration is not None:
        raise DataError(f"--duration is for --cycle {STANDARD}; a table has its own time")
    return read_motion(robot, cycle)


def read_motion(robot: Manipulator, file: str, start: PoseLike | None = None) -> Motion:
    """Return a motion from a table.

    A table of joints alone is followed from a pose to start from, the home pose if none is given.
    """
    from pteron.tables import read_table

    return _playback_of_table(robot, read_table(file), start).motion


def read_playback(robot: Manipulator, file: str) -> Playback:
    """Return the playback of a motion from a table or a log."""
    from pteron.playback import playback, read_motion
    from pteron.tables import Table

    motion = read_motion(robot, file)
    return (
        _playback_of_table(robot, motion) if isinstance(motion, Table) else playback(robot, motion)
    )


def _playback_of_table(robot: Manipulator, rows: Table, start: PoseLike | None = None) -> Playback:
    """Return the playback of a table; an error names values that may be in another unit."""
    from pteron.kinematics.unlikely_values import unlikely_values
    from pteron.playback import playback_of_table

    file = rows.source
    _check_rates(robot, rows)
    names = [n for n in (*robot.coordinates, *robot.joint_names) if n in rows.columns]
    table_columns = rows.numbers(names)
    _note_other_joints(robot, rows)
    try:
        return playback_of_table(robot, rows, start)
    except (UnreachablePose, SingularPose) as error:
        unlikely = "; ".join(unlikely_values(robot, names, table_columns))
        if not unlikely or (isinstance(error, UnreachablePose) and error.millimetres):
            raise
        raise PteronError(f"{error}; {file}: {unlikely}") from None


def pose_numbers(machine: Manipulator, words: Sequence[str], name: str) -> list[float]:
    """Return the coordinates of a typed pose: of the home pose where the word is `home`."""
    if [word.strip() for word in words] == [HOME]:
        from pteron.workspace import home_pose

        numbers: list[float] = home_pose(machine).tolist()
        return numbers
    return parsed_numbers(words, machine.coordinates, name)


def given_pose(machine: Manipulator, text: str | None, name: str) -> NDArray[Any]:
    """Return the pose (m,) of an option, or the home pose."""
    import numpy as np

    pose = np.array(pose_numbers(machine, [HOME if text is None else text], name))
    note_unlikely(machine, machine.coordinates, pose, name)
    return pose


@dataclass(frozen=True)
class Carried:
    """The load of the platform, as --tool and --payload give it."""

    payload: float = 0.0
    payload_center: tuple[float, ...] | None = None
    payload_inertia: tuple[float, ...] = ()
    tool: str | None = None

    @classmethod
    def from_options(cls, payload: str | None, tool: str | None) -> Carried:
        """Read the options: a mass, perhaps its centre, and perhaps its inertia."""
        if payload is None:
            return cls(tool=tool)
        mass, *further = payload.split("@")
        try:
            parts = [tuple(float(word) for word in part.split(",")) for part in further]
            carried, count = float(mass), len(parts[0]) if parts else 3
        except ValueError:
            carried, count = 0.0, 0
        if count != 3 or len(further) > 2:
            raise DataError(
                f"--payload: {payload!r} given; MASS, MASS@X,Y,Z or MASS@X,Y,Z@INERTIA expected, "
                "kg, m and kg m^2, such as 0.5@0,0,-0.03"
            )
        center = parts[0] if parts else None
        return cls(carried, center, parts[1] if len(parts) > 1 else (), tool)

    def __str__(self) -> str:
        """Return the load in words that follow a machine's name; empty without a load."""
        tool = [] if self.tool is None else [f"tool {self.tool}"]
        center = [f"{component:g}" for component in self.payload_center or ()]
        at = f" at ({', '.join(center)}) m" if center else ""
        words = [*tool, *([f"{self.payload:g} kg{at}"] if self.payload else [])]
        return f" with {' and '.join(words)}" if words else ""

    def load_machine(self, robot: Manipulator) -> Manipulator:
        """Return the machine with the tool and the payload."""
        from pteron.motion import with_payload

        robot = self.mount_tool(robot)
        body = self.payload, self.payload_center, self.payload_inertia or 0.0
        return with_payload(robot, *body)

    def mount_tool(self, robot: Manipulator) -> Manipulator:
        """Return the machine with the tool, without the payload."""
        from pteron.motion import with_tool

        return robot if self.tool is None else with_tool(robot, self.tool)


def note_unlikely(
    robot: Manipulator, columns: Sequence[str], numbers: NDArray[Any], source: str
) -> None:
    """Note values that are possible but unlikely."""
    from pteron.kinematics.unlikely_values import unlikely_values

    for text in unlikely_values(robot, columns, numbers):
        note(f"Note: {source}: {text}")


def _note_other_joints(robot: Manipulator, rows: Table) -> None:
    """Note that a table's joints are not those of its poses, as of those of a pivot."""
    import numpy as np

    from pteron.kinematics import inverse_kinematics
    from pteron.manipulator.readings import to_readings

    names = [*robot.coordinates, *robot.joint_names]
    if not set(names) <= set(rows.columns):
        return
    poses, joints = np.split(rows.numbers(names), [robot.freedom], axis=1)
    expected = to_readings(robot, inverse_kinematics(robot, poses, on_failure="nan"))
    levers = np.array([leg.lever for leg in robot.legs])
    sizes = np.array([leg.size or 1.0 for leg in robot.legs])
    turning = np.array([leg.joint.unit == "rad" for leg in robot.legs])
    differences = joints - expected
    turned = (differences + np.pi) % (2.0 * np.pi) - np.pi
    far = np.abs(np.where(turning, turned, differences)) * levers > _OTHER * sizes
    if far.any() or np.isnan(expected).all():
        note(
            f"Note: {rows.source}: its joints are not those of its poses: was it made with "
            "--pivot, which must then be given again, or for another machine or working mode?"
        )


def _check_rates(robot: Manipulator, rows: Table) -> None:
    """Raise DataError if a table has velocities that are not those of its poses and times."""
    import numpy as np

    names = robot.coordinates
    columns = ["t", *names, *(f"d{name}" for name in names)]
    if len(rows) < 2 or not set(columns) <= set(rows.columns):
        return
    given_rates = rows.numbers(columns)
    poses, rates = given_rates[:, 1 : 1 + len(names)], given_rates[:, 1 + len(names) :]
    means = np.abs(rates[1:] + rates[:-1]) / 2.0
    far, meant = np.abs(np.diff(poses, axis=0)).sum(), (np.diff(given_rates[:, 0]) @ means).sum()
    # A time that does not ascend has a message of its own.
    if meant > 0.0 and not _UNLIKE * far >= meant >= far / _UNLIKE:
        raise DataError(
            f"{rows.source}: its poses go {far:.3g} m or rad, its velocities {meant:.3g} in the "
            "same time; t must be in s, and velocities per s"
        )
