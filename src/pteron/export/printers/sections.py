"""Common parts of firmware configurations: number formats, comments and refusals."""

from __future__ import annotations

import math

from pteron.errors import ModelError
from pteron.legs import Reading
from pteron.manipulator import Manipulator

INSTEAD = "use --linuxcnc, or --c for a controller of your own"
"""Advice at the end of error messages."""


def unfit_error(robot: Manipulator, leg: int, reason: str, firmware: str) -> ModelError:
    """Return the ModelError that a machine, because of a leg, does not fit the firmware."""
    return ModelError(f"{robot.name}: {firmware} does not fit leg {leg}: {reason}; {INSTEAD}")


def mm(metres: float) -> str:
    """Return a length in millimetres."""
    return number(1000.0 * metres)


def number(size: float) -> str:
    """Return a number without an exponent."""
    text = f"{size:.12f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def signed_number(size: float) -> str:
    """Return a number as it is added to something: "+ 1.5"."""
    return f"{'-' if size < 0.0 else '+'} {abs(size):.9g}"


def rotation_distance(robot: Manipulator, leg: int) -> str | None:
    """Return mm per turn of the motor; None if the machine's file has no ratio."""
    scale = (robot.legs[leg].reading or Reading()).scale
    drive = robot.legs[leg].drive
    if drive is None or drive.ratio is None:
        return None
    return number(2000.0 * math.pi * abs(scale / drive.ratio))


def reading_comment(robot: Manipulator, leg: int, key: str) -> tuple[str, ...]:
    """Return a comment on a drive whose reading differs from the joint coordinate, if any."""
    reading = robot.legs[leg].reading
    if reading is None:
        return ()
    if rotation_distance(robot, leg):
        ratio = f"{key} has that in it"
    else:
        change = "multiply" if "distance" in key else "divide"
        ratio = f"{change} your {key} by {reading.scale:.9g}"
    return (
        f"The drive of leg {leg + 1} counts otherwise: joint = {reading.zero:.9g} + "
        f"{reading.scale:.9g} reading (m, rad): {ratio}; the end stop gives the zero.",
    )
