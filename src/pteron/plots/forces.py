"""Pictures of the legs' forces over time, and of the type-II measure over the platform's angle."""

from __future__ import annotations

from math import inf

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from pteron.kernels import Array
from pteron.manipulator import RobotLike
from pteron.plots.canvas import (
    GRID,
    INK,
    MUTED,
    PAPER,
    REACH,
    WARNING,
    blank,
    groups_of,
    leg_curves,
    legend,
    numbered,
    plain_axes,
    remark,
    spot,
    stack,
    zero_line,
)
from pteron.plots.joint_columns import joints_of, named, rows

_ROOM = 75.0
"""Least distance, degrees, of singular orientations that are named in words."""


def forces_figure(
    time: ArrayLike,
    forces: ArrayLike,
    *,
    turning_point: float | None = None,
    ylabel: str | None = None,
    robot: RobotLike | None = None,
) -> Figure:
    """Return the forces (T, n) of all legs, N or N m, over time (T,), s.

    The way back begins at the turning point, s. The robot says which legs give forces and which
    torques: of both, each have axes of their own. Other quantities of the legs look the same, under
    another label.
    """
    joints = joints_of(robot, forces)
    time, forces = rows(time, named(robot, forces, "forces"), "forces", len(joints))
    words = [ylabel or f"actuator {joint.force} ({joint.force_unit})" for joint in joints]
    groups = groups_of(words)
    figure = blank(5.4, 3.3 if len(groups) == 1 else 1.2 + 1.6 * len(groups))
    found = stack(figure, "time (s)", list(groups))
    for axes, own in zip(found, groups.values(), strict=True):
        zero_line(axes)
        leg_curves(axes, time, forces, own, 1.8, numbered(len(joints)), "leg")
        if turning_point is not None:
            axes.axvline(turning_point, color=MUTED, linewidth=0.8, linestyle=(0, (4, 3)))
    if turning_point is not None:
        remark(found[0], "out", (float(time[0]) + turning_point) / 2.0, inf, MUTED, 3.0)
        remark(found[0], "back", (turning_point + float(time[-1])) / 2.0, inf, MUTED, 3.0)
    legend(figure, forces.shape[1])
    return figure


def regularity_figure(
    angles: Array,
    type_ii: Array,
    singular: Array,
    *,
    home: float | None = None,
    used: tuple[float, float] | None = None,
) -> Figure:
    """Return the size of the type-II measure over the platform's angle, NaN where it has none.

    The angles (A,) ascend; the singular orientations, the angle of the home pose, and the least and
    greatest angle of a motion are marked. All are in rad.
    """
    figure = blank(5.4, 2.9)
    axes = plain_axes(figure, "orientation φ (degrees)", "type-II measure")
    degrees = np.degrees(angles)
    if used is not None:
        low, high = (float(angle) for angle in np.degrees(used))
        axes.axvspan(low, high, color=GRID, alpha=0.6, linewidth=0.0, zorder=0.5)
        remark(axes, "used by the cycle", (low + high) / 2.0, 0.04, MUTED)
    axes.plot(degrees, np.abs(type_ii), color=REACH, linewidth=2.0, zorder=3)
    roomy = np.degrees(np.diff(singular)).min(initial=np.inf) > _ROOM
    for i, angle in enumerate(np.degrees(singular)):
        axes.axvline(angle, color=WARNING, linewidth=1.2, linestyle=(0, (4, 2)))
        text = f"singular, {angle:.1f}°" if roomy else f"{angle:.0f}°"
        rise = 3.0 if roomy or i % 2 else 14.0
        remark(axes, text.replace("-", "\u2212"), float(angle), inf, WARNING, rise)
    if home is not None:
        at, value = float(np.degrees(home)), float(np.interp(home, angles, np.abs(type_ii)))
        spot(axes, at, value, INK, PAPER, 6.0, zorder=4)
        remark(axes, "home", at, value, INK, -12.0)
    axes.set_xlim(float(degrees[0]), float(degrees[-1]))
    axes.set_xticks(np.arange(-180, 181, 60))
    axes.set_ylim(0.0, 1.06)
    return figure
