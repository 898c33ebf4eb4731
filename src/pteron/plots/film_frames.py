"""The frames of a film of a motion, as pixels: the machine in its poses, all at one scale.

Each frame has the tool's path and a text in a corner; on request the eye goes round the machine,
and the drives' forces are drawn below it, with a line at the time of the frame.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.motion import Motion, joint_guides, joint_points
from pteron.plots.canvas import (
    FONT_SIZE,
    INK,
    MUTED,
    blank,
    groups_of,
    pixels,
    plain_axes,
    zero_line,
)
from pteron.plots.film_encoders import Pixels
from pteron.plots.leg_curves import leg_curves
from pteron.plots.machine_axes import MachineAxes
from pteron.plots.machine_drawing import (
    Scene,
    draw_directions,
    draw_machine,
    draw_path,
    draw_surroundings,
    scene_of,
)
from pteron.plots.machine_figures import gravity_of
from pteron.plots.space_axes import SpaceAxes

_WIDTH = 6.4
"""Width of a frame, inches, whatever its pixels: letters grow with the frame."""

_STRIP = 1.35
"""Height of the strip with the forces' curves, inches."""

_SIDES = 0.62, 0.15
"""Margins left and right of the forces' curves, inches."""

_BELOW, _ABOVE = 0.42, 0.08
"""Margins below and above the forces' curves, inches."""

_PROBES = 24
"""Frames, spread over the film, that the scale of all is chosen for."""

_PATH_POINTS = 1000
"""Least number of points that a longer tool's path is thinned to; twice as many at most."""


def frames(
    robot: Manipulator,
    motion: Motion,
    times: Array,
    size: tuple[int, int],
    *,
    turns: float,
    forces: Array | None,
    corner: str,
) -> Iterator[Pixels]:
    """Yield a frame, an array of pixels, for each of the times (K,), s; `size` is width and height.

    From the first frame to the last the eye goes round the machine `turns` times. Forces (T, n) at
    the motion's samples are drawn below it; `corner` is the text in a corner.
    """
    poses = motion.at(times)[0]
    points, guides = joint_points(robot, poses), joint_guides(robot, motion.pose)
    scene = scene_of(points, guides, gravity_of(robot))
    some = motion.pose[:: max(len(motion.pose) // _PATH_POINTS, 1)]
    path = joint_points(robot, np.vstack([some, motion.pose[-1:]])).tool

    figure = blank(_WIDTH, _WIDTH * size[1] / size[0])
    figure.set_dpi(size[0] / _WIDTH)
    figure.set_layout_engine("none")
    figure.patch.set(facecolor="white", alpha=1.0)
    share = 0.0 if forces is None else _STRIP / float(figure.get_size_inches()[1])
    sheet = scene.sheet(figure, (0.0, share, 1.0, 1.0 - share))
    style: dict[str, Any] = {"ha": "right", "va": "top", "fontsize": FONT_SIZE, "color": MUTED}
    figure.text(0.985, 0.98, corner, **style)
    angles = 2.0 * np.pi * turns * np.linspace(0.0, 1.0, len(times))
    now = [] if forces is None else _strip(figure, robot, motion, forces, share)

    probes = np.unique(np.linspace(0, len(times) - 1, _PROBES).astype(int)).tolist()
    _draw_still(sheet, scene, path)
    sheet.measures = True
    for k in probes:
        draw_machine(sheet, scene, points.at(k))
    sheet.measures = False
    sheet.fill(angles[probes].tolist() if turns else (0.0,))
    sheet.clear(0)
    still_count = 0
    for k, time in enumerate(times):
        if turns and isinstance(sheet, SpaceAxes):
            sheet.turn(float(angles[k]))
        if turns or not still_count:
            _draw_still(sheet, scene, path)
            still_count = 0 if turns else len(sheet.things)
        draw_machine(sheet, scene, points.at(k))
        for line in now:
            line.set_xdata([time, time])
        yield pixels(figure)
        sheet.clear(still_count)


def _draw_still(sheet: MachineAxes, scene: Scene, path: Array) -> None:
    """Draw the parts that are equal in all frames: surroundings, directions, the tool's path."""
    draw_surroundings(sheet, scene)
    draw_directions(sheet, scene)
    draw_path(sheet, path)


def _strip(
    figure: Figure, robot: Manipulator, motion: Motion, forces: Array, share: float
) -> list[Line2D]:
    """Draw the forces at the foot of a figure; return the lines that mark the time.

    There are axes for each unit of force, side by side.
    """
    groups = groups_of([leg.joint.force_unit for leg in robot.legs])
    wide, tall = (float(side) for side in figure.get_size_inches())
    each = wide / len(groups)
    time_lines = []
    for k, (unit, legs) in enumerate(groups.items()):
        axes: Axes = plain_axes(figure, "time (s)", f"drives ({unit})")
        room = each - sum(_SIDES)
        box = ((k * each + _SIDES[0]) / wide, _BELOW / tall, room / wide)
        axes.set_position((*box, share - (_BELOW + _ABOVE) / tall))
        zero_line(axes)
        leg_curves(axes, motion.time, forces, legs, 1.4)
        time_lines.append(
            axes.axvline(float(motion.time[0]), color=INK, linewidth=1.2, clip_on=False)
        )
    return time_lines
