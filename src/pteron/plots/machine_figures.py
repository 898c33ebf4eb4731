"""Pictures of the machine: in one pose, or in several beside each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from pteron.arguments import expect
from pteron.errors import DataError
from pteron.kernels import Array
from pteron.kinematics.evaluate import finite_rows
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion import Guide, JointPoints, joint_guides, joint_points
from pteron.plots.canvas import FONT_SIZE, INK, blank, whole_figure
from pteron.plots.machine_axes import MachineAxes
from pteron.plots.machine_drawing import (
    Scene,
    draw_directions,
    draw_machine,
    draw_path,
    draw_surroundings,
    scene_of,
)
from pteron.shapes import PoseLike
from pteron.workspace import home_pose

_WIDTH = 5.6
"""Width of a figure of one pose, inches."""

_SPACE = 4.4
"""Height of a picture in space, inches."""

_PANEL = 2.4
"""Width of one picture beside others, inches."""

_SQUARE = 0.9
"""Height over width of one picture in space beside others."""

_INSET = 0.02
"""Margin on each side of such a picture, as a share of its width."""

_TITLE = 0.24
"""Height of the title over a picture, inches."""

_TITLE_STYLE: dict[str, Any] = {"ha": "center", "va": "bottom", "fontsize": FONT_SIZE, "color": INK}


def draw(
    robot: RobotLike,
    pose: PoseLike | None = None,
    *,
    along: PoseLike | None = None,
    angle: str = "",
    ax: Axes | SubFigure | None = None,
) -> Figure:
    """Return a figure of the machine in a pose: in space, the vertical upwards, or in its plane.

    Gravity is drawn as an arrow, for a planar machine only if it lies in its plane. `robot_figure`
    draws the same from given points.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose : array, shape (m,), optional
        m and rad; by default the home pose.
    along : array, shape (T, m), optional
        Poses of a motion, m and rad: the tool's path is drawn as a dotted line.
    angle : str
        Label of the platform frame's x axis, such as "\u03c6 = 10\u00b0".
    ax : Axes or SubFigure, optional
        Axes of another figure, on which it is drawn; several panels take their place.

    Returns
    -------
    Figure

    Raises
    ------
    UnreachablePose
        If a leg does not reach a pose.
    DataError
        If a pose has not m numbers, or there are several; `poses_figure` draws several.

    Examples
    --------
    >>> import pteron
    >>> figure = pteron.plots.draw("delta")
    >>> figure.savefig("delta.png")  # doctest: +SKIP
    """
    robot = as_manipulator(robot)
    shown = home_pose(robot) if pose is None else finite_rows(robot, pose, "pose")
    if shown.size != robot.freedom:  # a table's row is one pose too
        count = shown.size // robot.freedom
        raise DataError(f"pose: {count} given, 1 expected; poses_figure draws several")
    shown = shown.ravel()
    way = (
        None
        if along is None
        else np.reshape(finite_rows(robot, along, "along"), (-1, robot.freedom))
    )
    return robot_figure(
        joint_points(robot, shown),
        joint_guides(robot, shown if way is None else np.vstack([shown[None], way])),
        gravity=gravity_of(robot),
        path=None if way is None else joint_points(robot, way).tool,
        angle=angle,
        ax=ax,
    )


def gravity_of(robot: Manipulator) -> Array | None:
    """Return a machine's gravity (3,), m/s^2, for a picture: None where there is none."""
    return np.array(robot.gravity) if any(robot.gravity) else None


def robot_figure(
    points: JointPoints,
    guides: Sequence[Guide],
    *,
    gravity: Array | None = None,
    path: Array | None = None,
    angle: str = "",
    ax: Axes | SubFigure | None = None,
) -> Figure:
    """Return a figure of the machine in a pose: in space, the vertical upwards, or in its plane.

    The points are those of one pose, the guides those of `pteron.motion.joint_guides`; the `path`
    (T, 3) of a point in the base frame is in m. Gravity (3,), m/s^2, is drawn as an arrow if it
    lies in the picture's plane; a picture in space without gravity has the platform frame's z
    upwards. `angle` is the label of the platform frame's x axis.
    """
    scene = scene_of(points, guides, gravity)
    sheet = machine_figure(scene, ax=ax)
    draw_surroundings(sheet, scene)
    draw_machine(sheet, scene, points, angle)
    if path is not None:
        draw_path(sheet, path)
    draw_directions(sheet, scene)
    sheet.fill()
    return sheet.figure


def machine_figure(
    scene: Scene, title: str = "", ax: Axes | SubFigure | None = None
) -> MachineAxes:
    """Return axes for a machine in an empty figure of the usual size."""
    height = _SPACE
    if scene.plane is not None:
        height = float(np.clip(0.6 + (_WIDTH - 0.6) * scene.aspect, 2.6, 5.6))
    figure = blank(_WIDTH, height, ax)
    box = None
    if title and ax is not None:
        sheet = scene.sheet(figure)
        sheet.axes.set_title(title, fontsize=FONT_SIZE, color=INK)
        return sheet
    if title:
        figure.suptitle(title, fontsize=FONT_SIZE, color=INK)
        box = (0.0, 0.0, 1.0, 1.0 - 1.2 * _TITLE / height) if scene.plane is None else None
    return scene.sheet(figure, box)


def poses_figure(
    robots: RobotLike | Sequence[RobotLike],
    poses: PoseLike,
    *,
    titles: Sequence[str] = (),
    columns: int | None = None,
    along: PoseLike | None = None,
    ax: Axes | SubFigure | None = None,
) -> Figure:
    """Return a figure of a machine in several poses side by side, from the same viewpoint.

    They may be instants of a motion, or assembly modes of one machine; its working modes are robots
    of their own.

    Parameters
    ----------
    robots : Manipulator, name or path, or a sequence of K
        The machine, or one for each pose, which differ in their working modes.
    poses : array, shape (K, m)
        m and rad; one pose (m,) serves all robots.
    titles : sequence of str
        The title over each picture.
    columns : int, optional
        Number of pictures in a row; by default up to four.
    along : array, shape (T, m), optional
        Poses of a motion, m and rad, whose tool's path is drawn in each picture.
    ax : Axes or SubFigure, optional
        Axes of another figure, on which it is drawn; several panels take their place.

    Returns
    -------
    Figure

    Raises
    ------
    UnreachablePose
        If a leg does not reach a pose.
    DataError
        If the numbers of robots, poses and titles do not fit together.

    Examples
    --------
    >>> import pteron
    >>> delta = pteron.load("delta")
    >>> figure = pteron.plots.poses_figure(delta, [[0.0, 0.0, -0.8], [0.1, 0.0, -0.9]])
    >>> len(figure.axes)
    2
    """
    several = [robots] if isinstance(robots, RobotLike) else list(robots)
    machines = [as_manipulator(robot) for robot in several]
    expect(machines, "robots", "none", "at least 1")
    first = machines[0]
    shown = np.reshape(finite_rows(first, poses, "poses"), (-1, first.freedom))
    count = max(len(machines), len(shown))
    if len(shown) not in (1, count) or len(machines) not in (1, count):
        raise DataError(f"poses: {len(shown)} given for {len(machines)} robots, as many expected")
    if titles and len(titles) != count:
        raise DataError(f"titles: {len(titles)} given, {count} expected, one for each pose")
    expect(columns is None or columns >= 1, "columns", columns, "1 or more")
    path = None if along is None else joint_points(first, along).tool.reshape(-1, 3)
    every = [
        joint_points(machine, pose)
        for machine, pose in zip(
            machines * (count // len(machines)),
            np.resize(shown, (count, first.freedom)),
            strict=True,
        )
    ]
    rails = [joint_guides(machine, shown) for machine in machines] * (count // len(machines))
    scenes = _share_size(
        [scene_of(*pair, gravity_of(first)) for pair in zip(every, rails, strict=True)]
    )
    columns = columns or _columns(count)
    rows = -(-count // columns)
    tall = _PANEL * (_SQUARE if scenes[0].plane is None else min(max(scenes[0].aspect, 0.4), 1.2))
    over = _TITLE if titles else 0.0
    figure = whole_figure(blank(columns * _PANEL, rows * (tall + over), ax))
    sheets = []
    for k, (scene, points) in enumerate(zip(scenes, every, strict=True)):
        x_start, below = (k % columns) / columns, 1.0 - (k // columns + 1) / rows
        share = tall / (tall + over) / rows
        sheet = scene.sheet(
            figure,
            (x_start + _INSET / columns, below, (1.0 - 2 * _INSET) / columns, share),
            small=True,
        )
        draw_surroundings(sheet, scene)
        draw_machine(sheet, scene, points)
        if path is not None:
            draw_path(sheet, path)
        draw_directions(sheet, scene)
        if titles:
            figure.text(x_start + 0.5 / columns, below + share, titles[k], **_TITLE_STYLE)
        sheets.append(sheet)
    together = np.vstack([sheet.drawn_points for sheet in sheets])
    for sheet in sheets:
        sheet.reserve_space(together)
        sheet.fill()
    return figure


def _share_size(scenes: list[Scene]) -> list[Scene]:
    """Return the scenes, each enlarged to the size of the largest one."""
    low = np.min([scene.low for scene in scenes], axis=0)
    high = np.max([scene.high for scene in scenes], axis=0)
    step = max(scene.step for scene in scenes)
    return [replace(scene, low=low, high=high, step=step) for scene in scenes]


def _columns(count: int) -> int:
    """Return the number of columns for `count` pictures: up to four, so that rows are equal."""
    rows = -(-count // 4)
    return -(-count // rows)
