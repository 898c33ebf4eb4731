"""Pictures of the drives of a machine over a cycle: force over speed, and power over time."""

from __future__ import annotations

from matplotlib.figure import Figure

from pteron.motion import Sizing
from pteron.plots import Ability, force_speed_figure, power_figure
from pteron.report.motion_frames import line_samples


def force_speed(sizing: Sizing) -> Figure:
    """Return force over speed of each drive, within the limits in the machine's file."""
    joints = [leg.joint for leg in sizing.robot.legs]
    some = line_samples(len(sizing.time))
    return force_speed_figure(
        sizing.speeds[some],
        sizing.forces[some],
        units=[(f"{joint.unit}/s", joint.force_unit) for joint in joints],
        abilities=[
            Ability(drive.max_speed, drive.max_force, drive.rated_force) for drive in sizing.drives
        ],
        rms=(sizing.rms_speeds, sizing.rms_forces),
    )


def power(sizing: Sizing) -> Figure:
    """Return the power of each drive over time, and their sum."""
    some = line_samples(len(sizing.time))
    return power_figure(sizing.time[some], sizing.power[some])
