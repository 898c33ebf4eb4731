"""The HTML page of a motion: the machine in 3-D, and its joints and drives over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from pteron.dynamics import drive_forces
from pteron.kernels import Array
from pteron.kinematics import joint_rates
from pteron.manipulator import Manipulator
from pteron.motion import overloads
from pteron.motion.trajectories.tool import tool_path
from pteron.playback import Playback
from pteron.plots import forces_figure, power_figure, robot_figure
from pteron.plots.machine_figures import gravity_of
from pteron.report.motion_frames import Frames, frames, line_samples
from pteron.report.moving_picture import stage
from pteron.report.quantities import JointQuantity, angles_text, coordinate, force, nouns, speed
from pteron.report.typeset import template
from pteron.workspace import JointRanges, joint_ranges


@dataclass(frozen=True)
class ShownMotion:
    """The contents of the page of a motion with T samples.

    Forces (T, n), N or N m, are the motion's own (`has_given_forces`), or those that the drives
    must give for it; rates (T, n) are those of the joints, and `tool_speed` (T,), m/s, is the
    tool's.
    """

    robot: Manipulator
    playback: Playback
    frames: Frames
    forces: Array
    rates: Array
    tool_speed: Array
    joints: JointRanges
    overloads: tuple[str, ...]

    @property
    def has_given_forces(self) -> bool:
        """Whether the forces came with the motion."""
        return self.playback.forces is not None

    @property
    def has_drives(self) -> bool:
        """Whether the machine's file has drives."""
        return any(leg.drive is not None for leg in self.robot.legs)


def motion_contents(robot: Manipulator, recorded: Playback) -> ShownMotion:
    """Return the contents of the page of a motion, checked to be feasible for the machine."""
    motion = recorded.motion
    forces = recorded.forces
    if forces is None:
        state = motion.pose, motion.velocity, motion.acceleration
        forces = drive_forces(robot, *state, smooth=True)
    rates = joint_rates(robot, motion.pose, motion.velocity).actuated
    tool = tool_path(robot.platform, motion.pose, motion.velocity, motion.acceleration)[1]
    return ShownMotion(
        robot=robot,
        playback=recorded,
        frames=frames(robot, motion, forces),
        forces=forces,
        rates=rates,
        tool_speed=np.linalg.norm(tool, axis=-1),
        joints=joint_ranges(robot, motion.pose),
        overloads=overloads(robot, forces, rates),
    )


def motion_page(robot: Manipulator, recorded: Playback) -> str:
    """Return the page of a motion, as self-contained HTML."""
    motion_shown = motion_contents(robot, recorded)
    joints = [leg.joint for leg in robot.legs]
    whose, origin = _force_origin(motion_shown)
    name = f" of {recorded.source}" if recorded.source else ""
    time = recorded.motion.time
    turned = angles_text(robot, recorded.motion.pose[0])
    begins = f"begins ({turned})" if turned else "begins"
    document = template("motion.html.j2", count=lambda number: f"{number:,}".replace(",", "\u202f"))
    return document.render(
        **stage(
            robot,
            motion_shown.frames,
            doing=f"in the motion{name}",
            still=f"Where the motion {begins}, with its way.",
            picture_title=f"{robot.name} where the motion begins",
            force_title=f"{whose} {force(joints).name}",
        ),
        contents=motion_shown,
        playback=recorded,
        motion=recorded.motion,
        speed=speed(joints),
        joint=nouns(joints),
        figures=_figures(motion_shown),
        force_origin=origin,
        tooled=any(robot.platform.tool),
        loads={
            "peak": np.abs(motion_shown.forces).max(axis=0),
            "speed": np.abs(motion_shown.rates).max(axis=0),
            "power": (motion_shown.forces * motion_shown.rates).sum(axis=1).max(initial=0.0),
            "rms": np.sqrt(
                np.trapezoid(motion_shown.forces**2, time, axis=0) / recorded.motion.duration
            ),
        },
    )


def _force_origin(motion_shown: ShownMotion) -> tuple[str, str]:
    """Return the origin of the forces on the page: as a word, and as a clause."""
    if motion_shown.has_given_forces and motion_shown.playback.log:
        return "Measured", "as they were measured."
    if motion_shown.has_given_forces:
        return "Given", "those of the table."
    if motion_shown.has_drives:
        return "Drive", "what the drives must give, friction and motors included."
    return "Drive", "what the bodies take; friction is left out."


def _figures(motion_shown: ShownMotion) -> dict[str, Figure]:
    """Return the pictures, by their names in the template."""
    robot, motion, at = motion_shown.robot, motion_shown.playback.motion, motion_shown.frames
    machine = robot_figure(at.still, at.guides, gravity=gravity_of(robot), path=at.points.tool)
    joints = [leg.joint for leg in robot.legs]
    some = line_samples(len(motion.time))
    time = motion.time[some] - motion.time[0]
    return {
        "robot": machine,
        "forces": forces_figure(time, motion_shown.forces[some], ylabel=force(joints).axis),
        "joints": _joint_figure(at.time, at.points.coordinates, coordinate(joints)),
        "power": power_figure(time, motion_shown.forces[some] * motion_shown.rates[some]),
        "rates": _joint_figure(time, motion_shown.rates[some], speed(joints)),
    }


def _joint_figure(time: Array, columns: Array, quantity: JointQuantity) -> Figure:
    """Return the figure of a joint quantity (T, n) over time, in its display units."""
    return forces_figure(time, columns * np.array(quantity.factors), ylabel=quantity.axis)
