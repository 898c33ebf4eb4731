"""Logs taken at the motors, in turns, counts or per cent, converted by the machine's drives."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from pteron.errors import DataError
from pteron.identification.logs.description import Description
from pteron.identification.logs.log import Finding
from pteron.identification.logs.search import Group
from pteron.legs import Drive
from pteron.manipulator import Manipulator


class Recorded(Protocol):
    """A log, or a file of one, whose forces may be multiplied by gains."""

    @property
    def source(self) -> str:
        """Its name in messages."""

    @property
    def description(self) -> Description:
        """Its description."""

    def with_gains(self, description: Description, finding: Finding) -> Self:
        """Return it with the gains of a description, which a finding tells."""


AnyLog = TypeVar("AnyLog", bound=Recorded)

_NEEDS = {"turns": ("ratio",), "counts": ("ratio", "counts_per_turn")}
"""Values of a drive that are needed, by the unit of the joints."""

_RATED = ("ratio", "rated_torque")
"""Those that forces in per cent need."""


def joint_factors(joints: Group, robot: Manipulator, source: str) -> NDArray[np.float64]:
    """Return factors (n,) from turns, or counts, of the motors to joints; 1 for other units.

    Raises
    ------
    DataError
        If the drives do not tell how a motor moves its joint.
    """
    needed = _NEEDS.get(joints.units[0], ())
    lacking = _lacking(robot, needed)
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
    each = [(drive.counts_per_turn or 1.0) * drive.gear for drive in drives]
    if joints.units[0] == "turns":
        each = [drive.gear for drive in drives]
    return 2.0 * np.pi / np.array(each)


def by_rated_torque(log: AnyLog, robot: Manipulator) -> AnyLog:
    """Return a log of forces in per cent of rated torque with gains, where drives tell them."""
    about = log.description
    if _lacking(robot, _RATED):
        return log
    drives = [leg.drive or Drive() for leg in robot.legs]
    gains = tuple(drive.gear * (drive.rated_torque or 0.0) / 100.0 for drive in drives)
    whole = ", ".join(
        f"{100.0 * gain:.4g} {leg.joint.force_unit}"
        for gain, leg in zip(gains, robot.legs, strict=True)
    )
    finding = Finding(
        "read",
        f"{log.source}: forces in per cent of the motors' rated torque: by ratio and rated_torque "
        f"of the robot's drives 100 % are {whole}",
    )
    return log.with_gains(replace(about, gains=gains), finding)


def per_cent_advice(robot: Manipulator) -> str:
    """Return how forces in per cent become forces at the joints, for a message."""
    lacking = _lacking(robot, _RATED)
    return (
        f"or give {lacking} in the drives of {robot.name}'s file, such as drive = {{ ratio = 50.0, "
        "rated_torque = 1.27 }: a force is per cent / 100 times rated_torque times ratio"
    )


def _lacking(robot: Manipulator, names: tuple[str, ...]) -> str:
    """Return which of a drive's values some leg has not, with the legs; empty if none."""
    legs = [
        i
        for i, leg in enumerate(robot.legs, start=1)
        if any(getattr(leg.drive, name, None) is None for name in names)
    ]
    absent = [
        name for name in names if any(getattr(leg.drive, name, None) is None for leg in robot.legs)
    ]
    return f"{' and '.join(absent)} (legs {', '.join(map(str, legs))})" if absent else ""
