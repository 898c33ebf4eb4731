"""Pictures of a trajectory over time, of the platform or of the joints, with its derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from numpy.typing import ArrayLike

from pteron.errors import DataError
from pteron.kernels import Array, as_array
from pteron.manipulator import RobotLike
from pteron.platforms.coordinates import coordinate
from pteron.plots.canvas import blank, groups_of, legend, panels, real_figure, zero_line
from pteron.plots.joint_columns import joints_of
from pteron.plots.leg_curves import leg_curves, leg_numbers

_ORDERS = ("", "/s", "/s²", "/s³", "/s⁴")
"""Endings of the units of a quantity and its derivatives."""

_OF_POSE = ("pose", "velocity", "acceleration", "jerk", "snap")
"""Names of the pose and its derivatives."""

_OF_JOINTS = ("joint", "speed", "acceleration", "jerk", "snap")
"""Names of a joint coordinate and its derivatives."""

_WIDE, _TALL, _HEAD = 5.4, 1.35, 0.75
"""Width of the figure, height of each row, and of what is above and below the rows, inches."""


def trajectory_figure(
    time: ArrayLike, *courses: ArrayLike, names: Sequence[str], ax: Axes | SubFigure | None = None
) -> Figure:
    """Return a figure of the platform's pose, velocity, acceleration and jerk over time.

    Lengths and angles stand beside each other, derivatives below them.

    Parameters
    ----------
    time : array, shape (T,)
        s.
    *courses : array, shape (T, m)
        The pose and, as many as there are, its derivatives; m, rad and s.
    names : sequence of str
        The pose's coordinates, `robot.coordinates`.
    ax : Axes or SubFigure, optional
        Axes of another figure, on which it is drawn; several panels take their place.

    Returns
    -------
    Figure

    Raises
    ------
    DataError
        If the shapes do not fit together.

    Examples
    --------
    >>> import pteron
    >>> from pteron.motion import pick_and_place
    >>> robot = pteron.load("delta")
    >>> cycle = pick_and_place(robot, [0.0, 0.0, -0.9])
    >>> figure = pteron.plots.trajectory_figure(
    ...     cycle.time, cycle.pose, cycle.velocity, names=robot.coordinates
    ... )
    >>> [axes.get_ylabel() for axes in figure.axes]
    ['pose (m)', 'velocity (m/s)']
    """
    coordinates = [coordinate(name) for name in names]
    groups = groups_of([c.unit for c in coordinates])
    return _courses_figure(time, courses, [c.symbol for c in coordinates], groups, _OF_POSE, ax=ax)


def joints_figure(
    time: ArrayLike,
    *courses: ArrayLike,
    robot: RobotLike | None = None,
    ax: Axes | SubFigure | None = None,
) -> Figure:
    """Return a figure of the joints' coordinates over time, with their derivatives below.

    Parameters
    ----------
    time : array, shape (T,)
        s.
    *courses : array, shape (T, n)
        The joint coordinates and, as many as there are, their derivatives; m or rad, and s.
    robot : Manipulator, name or path, optional
        Says which joints slide and which turn, beside each other; without it all slide.
    ax : Axes or SubFigure, optional
        Axes of another figure, on which it is drawn; several panels take their place.

    Returns
    -------
    Figure

    Raises
    ------
    DataError
        If the shapes do not fit together.

    Examples
    --------
    >>> import pteron
    >>> from pteron.motion import pick_and_place
    >>> cycle = pick_and_place("delta", [0.0, 0.0, -0.9])
    >>> joints = pteron.inverse_kinematics("delta", cycle.pose)
    >>> figure = pteron.plots.joints_figure(cycle.time, joints, robot="delta")
    >>> figure.axes[0].get_ylabel()
    'joint (rad)'
    """
    known = courses and np.ndim(courses[0]) == 2
    units = [joint.unit for joint in joints_of(robot, courses[0] if known else np.empty((0, 0)))]
    groups = groups_of(units)
    return _courses_figure(time, courses, leg_numbers(len(units)), groups, _OF_JOINTS, "leg", ax=ax)


def _courses_figure(
    time: ArrayLike,
    courses: Sequence[ArrayLike],
    names: Sequence[str],
    groups: Mapping[Any, list[int]],
    words: Sequence[str],
    noun: str = "",
    *,
    ax: Axes | SubFigure | None = None,
) -> Figure:
    """Return a figure of courses (T, k) over time: a row a derivative, a column a unit."""
    t = as_array(time, "time", ())
    curves = [as_array(course, words[min(k, 4)], ()) for k, course in enumerate(courses)]
    _expect_fitting(t, curves, len(names), words)
    labels = [
        [f"{word} ({unit}{order})" for unit in groups]
        for word, order, _ in zip(words, _ORDERS, curves, strict=False)
    ]
    figure = blank(_WIDE, _HEAD + _TALL * len(curves), ax)
    axes_rows = panels(figure, "time (s)", labels)
    for column in zip(*axes_rows, strict=True):
        figure.align_ylabels(column)
    for row, course in zip(axes_rows, curves, strict=True):
        for axes, columns in zip(row, groups.values(), strict=True):
            zero_line(axes)
            leg_curves(axes, t, course, columns, 1.6, names if course is curves[0] else (), noun)
    legend(figure, len(names))
    return real_figure(figure)


def _expect_fitting(time: Array, curves: list[Array], width: int, words: Sequence[str]) -> None:
    """Raise a `DataError` if times or courses have unfit shapes, or there are too many courses."""
    if time.ndim != 1 or len(time) < 2:
        raise DataError(f"time: shape {time.shape} given, (T,) expected, T above 1")
    if not 1 <= len(curves) <= len(_ORDERS):
        raise DataError(f"{len(curves)} courses given, 1 to {len(_ORDERS)} expected")
    for word, course in zip(words, curves, strict=False):
        if course.shape != (len(time), width):
            raise DataError(f"{word}: shape {course.shape} given, ({len(time)}, {width}) expected")
