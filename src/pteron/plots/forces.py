"""Pictures of the legs' forces, or other quantities of the legs, over time."""

from __future__ import annotations

from math import inf

from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from numpy.typing import ArrayLike

from pteron.manipulator import RobotLike
from pteron.plots.canvas import (
    MUTED,
    blank,
    groups_of,
    legend,
    real_figure,
    remark,
    stack,
    zero_line,
)
from pteron.plots.joint_columns import joints_of, pick_machine_columns, rows
from pteron.plots.leg_curves import leg_curves, leg_numbers


def forces_figure(
    time: ArrayLike,
    forces: ArrayLike,
    *,
    turning_point: float | None = None,
    ylabel: str | None = None,
    robot: RobotLike | None = None,
    ax: Axes | SubFigure | None = None,
) -> Figure:
    """Return a figure of the forces (T, n) of all legs, N or N m, over time (T,), s.

    `turning_point`, s, is marked as the beginning of the way back. With a robot whose legs give
    forces and torques, both have axes of their own. Other quantities of the legs may be shown, with
    another `ylabel`.
    """
    joints = joints_of(robot, forces)
    time, forces = rows(time, pick_machine_columns(robot, forces, "forces"), "forces", len(joints))
    words = [ylabel or f"actuator {joint.force} ({joint.force_unit})" for joint in joints]
    groups = groups_of(words)
    figure = blank(5.4, 3.3 if len(groups) == 1 else 1.2 + 1.6 * len(groups), ax)
    panels = stack(figure, "time (s)", list(groups))
    for axes, legs in zip(panels, groups.values(), strict=True):
        zero_line(axes)
        leg_curves(axes, time, forces, legs, 1.8, leg_numbers(len(joints)), "leg")
        if turning_point is not None:
            axes.axvline(turning_point, color=MUTED, linewidth=0.8, linestyle=(0, (4, 3)))
    if turning_point is not None:
        remark(panels[0], "out", (float(time[0]) + turning_point) / 2.0, inf, MUTED, 3.0)
        remark(panels[0], "back", (turning_point + float(time[-1])) / 2.0, inf, MUTED, 3.0)
    legend(figure, forces.shape[1])
    return real_figure(figure)
