"""Configuration sections of Klipper's kinematics `delta`: see its delta.py and kin_delta.c."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from pteron.export.printers.bed import told_bed
from pteron.export.printers.centers import Center, end_stop
from pteron.export.printers.linear_delta import LinearDelta
from pteron.export.printers.sections import (
    PINS,
    SPEEDS,
    ConfigSection,
    mm,
    number,
    reading_comment,
    rotation_distance,
    signed,
)
from pteron.manipulator import Manipulator


def delta(robot: Manipulator, centers: Sequence[Center]) -> Iterator[ConfigSection]:
    """Yield the sections of `delta`, with the numbers of `LinearDelta`."""
    found = LinearDelta.from_centers(robot, centers, "Klipper's delta")
    good = found.most if found.ends is None else found.bed
    yield ConfigSection(
        "printer",
        (
            ("kinematics", "delta"),
            *SPEEDS,
            ("delta_radius", mm(found.radius)),
            ("minimum_z_position", None),
            ("print_radius", None),
        ),
        (*told_bed(robot, found.level, good, found.most), *found.told),
    )
    for i, name in enumerate("abc"):
        joint = f"{robot.legs[i].joint.coordinate}{i + 1}"
        top = None if found.ends is None else mm(found.ends[i])
        yield ConfigSection(
            f"stepper_{name}",
            (
                ("angle", number(found.angles[i])),
                ("arm_length", mm(found.arms[i])),
                ("position_endstop", top),
                ("rotation_distance", rotation_distance(robot, i)),
                ("endstop_pin", None),
                *PINS,
            ),
            (
                f"Its position is {'' if found.rises[i] > 0.0 else '-'}{joint} in mm "
                f"{signed(1000.0 * found.zeros[i])} mm.",
                *end_stop(top, "carriage"),
                *reading_comment(robot, i, "rotation_distance"),
            ),
        )
