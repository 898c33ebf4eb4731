"""Pictures of the drives of a machine over a cycle: force over speed, and power over time."""

from __future__ import annotations

from matplotlib.figure import Figure

from pteron.motion import Sizing
from pteron.plots import Ability, force_speed_figure, power_figure
from pteron.report.motion_frames import few


def force_speed(found: Sizing) -> Figure:
    """Return force over speed of each drive, within what the machine's file says that it can do."""
    joints = [leg.joint for leg in found.robot.legs]
    some = few(len(found.time))
    return force_speed_figure(
        found.speeds[some],
        found.forces[some],
        units=[(f"{joint.unit}/s", joint.force_unit) for joint in joints],
        abilities=[
            Ability(drive.max_speed, drive.max_force, drive.rated_force) for drive in found.drives
        ],
        rms=(found.rms_speeds, found.rms_forces),
    )


def power(found: Sizing) -> Figure:
    """Return the power of each drive over time, and their sum."""
    some = few(len(found.time))
    return power_figure(found.time[some], found.power[some])
