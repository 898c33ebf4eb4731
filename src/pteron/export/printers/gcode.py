"""Export of the G-code M665 and M666 for Marlin and RepRapFirmware: a linear Delta's geometry.

Both have towers X, Y and Z at 210, 330 and 90 degrees, each with a correction of its angle, and
else the numbers of `LinearDelta`. Marlin (delta.cpp, M665.cpp, M666) counts its end stops down from
the lowest one's height, so that M666 is 0 or less; RepRapFirmware (LinearDeltaKinematics.cpp) from
their mean.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pteron.errors import ModelError
from pteron.export.descriptions import banner
from pteron.export.names import prefix_of
from pteron.export.printers.linear_delta import LinearDelta
from pteron.export.printers.sections import reading_comment
from pteron.export.writing import write_export
from pteron.manipulator import Manipulator, RobotLike, as_manipulator

_TOWERS = (210.0, 330.0, 90.0)
"""Angles of the firmware's towers X, Y and Z, degrees."""

_MOST_TURN = 60.0
"""Greatest correction of a tower's angle, degrees."""


def marlin_lines(robot: RobotLike) -> list[str]:
    """Return M665 and M666 for Marlin.

    Raises
    ------
    ModelError
        As `export_marlin`.
    """
    numbers, order = _numbers(as_manipulator(robot))
    rod = float(np.mean(numbers.arms))
    trims = [numbers.arms[i] - rod for i in order]
    trim_words = _lettered_values("ABC", trims) if max(map(abs, trims)) > 0.5e-7 else ""
    return _lines(numbers, order, _mm(rod), trim_words, min, -1.0)


def reprap_lines(robot: RobotLike) -> list[str]:
    """Return M665 and M666 for RepRapFirmware.

    Raises
    ------
    ModelError
        As `export_reprap`.
    """
    numbers, order = _numbers(as_manipulator(robot))
    rods = ":".join(_mm(numbers.arms[i]) for i in order)
    return _lines(numbers, order, rods, "", np.mean, 1.0)


def _lines(
    numbers: LinearDelta,
    order: Sequence[int],
    rods: str,
    trims: str,
    of_ends: Callable[[Sequence[float]], Any],
    sign: float,
) -> list[str]:
    """Return M665 and M666; `of_ends` gives the height that end stops are measured from."""
    height, end_lines = "", []
    if numbers.ends is not None:
        level = float(of_ends(numbers.ends))
        ends = [sign * (numbers.ends[i] - level) for i in order]
        height, end_lines = f" H{_mm(level)}", [f"M666{_lettered_values('XYZ', ends)}"]
    first = f"M665 L{rods} R{_mm(numbers.radius)}{height} B{1e3 * numbers.bed:.1f}"
    return [first + _lettered_values("XYZ", _turns(numbers, order), 1.0) + trims, *end_lines]


def export_marlin(robot: RobotLike, folder: str | Path = ".") -> list[Path]:
    r"""Write M665 and M666 of a linear Delta for Marlin, NAME_marlin.gcode.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine; its name becomes the file's.
    folder : path
        Where; made if it is missing.

    Returns
    -------
    list of Path
        The file written; it says how far the firmware's numbers are from the machine, if they are.

    Raises
    ------
    ModelError
        If the machine is no linear Delta with towers about 210, 330 and 90 degrees.
    OutputError
        If the folder cannot be written.

    Examples
    --------
    >>> import pteron
    >>> from pteron.export.printers.gcode import marlin_lines
    >>> print(*marlin_lines(pteron.load("linear-delta")), sep="\n")
    M665 L229.4000 R99.8000 H273.4466 B84.8 X0.0000 Y0.0000 Z0.0000
    M666 X0.0000 Y0.0000 Z0.0000
    """
    return _write(robot, folder, "Marlin", marlin_lines(robot))


def export_reprap(robot: RobotLike, folder: str | Path = ".") -> list[Path]:
    """Write M665 and M666 of a linear Delta for RepRapFirmware, NAME_reprap.gcode.

    Parameters, result and errors are those of `export_marlin`.
    """
    return _write(robot, folder, "RepRapFirmware", reprap_lines(robot))


def _write(robot: RobotLike, folder: str | Path, firmware: str, lines: Sequence[str]) -> list[Path]:
    """Write G-code lines under a commented head to a file in a folder, and return its path."""
    machine = as_manipulator(robot)
    numbers, order = _numbers(machine)
    towers = ", ".join(f"{axis} is leg {i + 1}" for axis, i in zip("XYZ", order, strict=True))
    head = [line for line in banner(machine, f"{firmware} settings") if "SI units" not in line]
    comments = [
        f"Towers: {towers}. Lengths in mm, angles in degrees.",
        f"X, Y and Z are P's place, Z from where its z is {1e3 * numbers.level + 0.0:.6g} mm.",
        *numbers.error_comments,
        *(text for i in range(3) for text in reading_comment(machine, i, "steps per mm (M92)")),
    ]
    text = "\n".join([*(f"; {line}".rstrip() for line in (*head, *comments)), *lines]) + "\n"
    name = firmware.lower().removesuffix("firmware")
    return write_export(folder, {f"{prefix_of(machine)}_{name}.gcode": text})


def _numbers(robot: Manipulator) -> tuple[LinearDelta, list[int]]:
    """Return a machine's numbers, and its leg, from 0, at each of the firmware's towers."""
    numbers = LinearDelta.from_robot(robot)
    beside = np.abs(_wrap_degrees(np.subtract.outer(_TOWERS, numbers.angles)))
    order = [int(row.argmin()) for row in beside]
    if sorted(order) != [0, 1, 2] or beside.min(axis=1).max() > _MOST_TURN:
        angles = ", ".join(f"{angle:.1f}" for angle in numbers.angles)
        raise ModelError(
            f"{robot.name}: its towers stand at {angles} degrees, and M665 has them about 210, 330 "
            "and 90: turn the model about z"
        )
    return numbers, order


def _turns(numbers: LinearDelta, order: Sequence[int]) -> list[float]:
    """Return each tower's angle less the firmware's, degrees."""
    return [
        float(_wrap_degrees(numbers.angles[i] - firmware_angle))
        for i, firmware_angle in zip(order, _TOWERS, strict=True)
    ]


def _wrap_degrees(angle: float | np.ndarray) -> np.ndarray:
    """Return angles, degrees, wrapped to -180 (included) to 180 (excluded)."""
    return np.asarray((np.asarray(angle) + 180.0) % 360.0 - 180.0)


def _lettered_values(letters: str, numbers: Sequence[float], factor: float = 1000.0) -> str:
    """Return G-code words: each letter with its value, scaled by `factor`, to four decimals."""
    pairs = zip(letters, numbers, strict=True)
    return "".join(f" {letter}{round(factor * number, 4) + 0.0:.4f}" for letter, number in pairs)


def _mm(metres: float) -> str:
    """Return a length in m as millimetres to four decimals."""
    return f"{1000.0 * metres:.4f}"
