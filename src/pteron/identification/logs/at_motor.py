"""Logs taken at the motors: factors and gains that convert them to the joints.

Positions in turns or encoder counts get factors, forces in per cent of rated torque get gains, both
from what the robot's file says of its drives: gear ratio, counts a turn, rated torque.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from pteron.errors import DataError
from pteron.identification.logs.description import Description
from pteron.identification.logs.findings import Finding
from pteron.identification.logs.search import Group
from pteron.legs import Drive
from pteron.manipulator import Manipulator


class Recorded(Protocol):
    """A `Log`, or a log's file yet to be read, whose forces may be multiplied by gains."""

    @property
    def source(self) -> str:
        """The log's name in messages."""

    @property
    def description(self) -> Description:
        """The description of the log: units, gains, what its columns hold."""

    def with_gains(self, description: Description, finding: Finding) -> Self:
        """Return the log with the gains of a description, and a finding that states it."""


AnyLog = TypeVar("AnyLog", bound=Recorded)

_NEEDS = {"turns": ("ratio",), "counts": ("ratio", "counts_per_turn")}
"""Values of a drive that positions need, by their unit."""

_RATED = ("ratio", "rated_torque")
"""Values of a drive that forces in per cent need."""


def joint_factors(joints: Group, robot: Manipulator, source: str) -> NDArray[np.float64]:
    """Return factors (n,) from motor angles or counts to joint coordinates; else 1.

    `joints` are the log's position columns with their units.

    Raises
    ------
    DataError
        If the drives do not tell how a motor moves its joint.
    """
    needed = _NEEDS.get(joints.units[0], ())
    lacking = _missing_drive_values(robot, needed)
    if lacking:
        raise DataError(
            f"{source}: the joints are in {joints.units[0]} of the motors, but the drives of "
            f"{robot.name} have no {lacking}; give it in the robot's file, such as drive = "
            "{ ratio = 50.0, counts_per_turn = 131072.0 }: a joint's coordinate is 2 pi counts / "
            "counts_per_turn / ratio"
        )
    drives = [leg.drive or Drive() for leg in robot.legs]
    if not needed:
        return np.ones(len(drives))
    counts = [(d.counts_per_turn if len(needed) > 1 else None) or 1.0 for d in drives]
    return 2.0 * np.pi / (np.array(counts) * [d.gear for d in drives])


def apply_rated_torque(log: AnyLog, robot: Manipulator) -> AnyLog:
    """Return a log of forces in per cent of rated torque with gains that make N or N m of them.

    Where a drive lacks a value for that, the log is returned as it is.
    """
    about = log.description
    if _missing_drive_values(robot, _RATED):
        return log
    drives = [leg.drive or Drive() for leg in robot.legs]
    gains = tuple(drive.gear * (drive.rated_torque or 0.0) / 100.0 for drive in drives)
    full_scale = ", ".join(
        f"{100.0 * gain:.4g} {leg.joint.force_unit}"
        for gain, leg in zip(gains, robot.legs, strict=True)
    )
    finding = Finding(
        "read",
        f"{log.source}: forces in per cent of the motors' rated torque: by ratio and rated_torque "
        f"of the robot's drives 100 % are {full_scale}",
    )
    return log.with_gains(replace(about, gains=gains), finding)


def percent_advice(robot: Manipulator) -> str:
    """Return how forces in per cent become forces at the joints, for a message."""
    lacking = _missing_drive_values(robot, _RATED)
    return (
        f"or give {lacking} in the drives of {robot.name}'s file, such as drive = {{ ratio = 50.0, "
        "rated_torque = 1.27 }: a force is per cent / 100 times rated_torque times ratio"
    )


def _missing_drive_values(robot: Manipulator, names: tuple[str, ...]) -> str:
    """Return which of a drive's values some leg has not, with the legs; empty if none."""
    known = [[getattr(leg.drive, name, None) is not None for name in names] for leg in robot.legs]
    legs = [str(i) for i, flags in enumerate(known, start=1) if not all(flags)]
    absent = [name for k, name in enumerate(names) if not all(flags[k] for flags in known)]
    return f"{' and '.join(absent)} (legs {', '.join(legs)})" if absent else ""
