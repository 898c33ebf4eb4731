"""The machine a subcommand is about."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pteron.errors import DataError

if TYPE_CHECKING:
    from pteron.manipulator import Manipulator

__all__ = ["load_robot", "signs"]


def load_robot(name_or_path: str, elbows: str | None = None) -> Manipulator:
    """Load a machine, in the working mode that `elbows` says, such as ``++-+``."""
    from pteron.manipulator import load

    robot = load(name_or_path)
    if elbows is None:
        return robot
    if set(elbows) - set("+-") or len(elbows) != len(robot.legs):
        raise DataError(
            f"--elbows: {elbows!r} given, {len(robot.legs)} signs + or - expected, one for each "
            f"leg of {robot.name}, such as {signs(robot)}"
        )
    legs = zip(robot.legs, elbows, strict=True)
    return replace(robot, legs=tuple(replace(leg, elbow=int(f"{s}1")) for leg, s in legs))


def signs(robot: Manipulator) -> str:
    """Return a machine's working mode as one sign a leg."""
    return "".join("+" if leg.elbow > 0 else "-" for leg in robot.legs)
