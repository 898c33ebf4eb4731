"""Pictures of drives: their forces over their speeds, within limits; and their power over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from numpy.typing import ArrayLike

from pteron.kernels import Array
from pteron.legs import Drive
from pteron.manipulator import RobotLike, as_manipulator
from pteron.plots.canvas import (
    FONT_SIZE,
    INK,
    MUTED,
    PAPER,
    blank,
    groups_of,
    legend,
    plain_axes,
    real_figure,
    spot,
    zero_line,
)
from pteron.plots.joint_columns import joints_of, pick_machine_columns, rows
from pteron.plots.leg_curves import LEG_COLORS, leg_curves, leg_numbers, leg_style

_ROOM = 1.15
"""Half width of the axes over the largest value."""

_FAR = 3.0
"""A limit above this many times the largest value is left out of the picture."""


class Ability(NamedTuple):
    """The limits of a drive, None if unknown; N and m/s, or N m and rad/s."""

    speed: float | None
    force: float | None
    rated: float | None
    """The force that it gives all the time."""


def force_speed_figure(
    speeds: Array,
    forces: Array,
    *,
    units: Sequence[tuple[str, str]] = (),
    abilities: Sequence[Ability] = (),
    rms: tuple[Array, Array] | None = None,
    robot: RobotLike | None = None,
    ax: Axes | SubFigure | None = None,
) -> Figure:
    """Return a figure of each drive's force over its speed, within its limits.

    A drive brakes in the quadrants where force and speed have different signs.

    Parameters
    ----------
    speeds, forces : array, shape (K, n)
        Over the cycle.
    units : sequence of (str, str), optional
        Of each leg's speed and force; legs of other units get axes of their own.
    abilities : sequence of Ability, optional
        Drawn dashed in the leg's colour, the rated force dotted; in grey where all have the same.
    rms : (array, array), shape (n,), optional
        Root mean squares of speed and force, drawn as a dot; by default those of the samples.
    robot : Manipulator, name or path, optional
        Says units and abilities where they are not given; without it all are sliders.
    ax : Axes or SubFigure, optional
        Axes of another figure, on which it is drawn; several panels take their place.
    """
    joints = joints_of(robot, forces)
    speeds = np.asarray(pick_machine_columns(robot, speeds, "joint_rates"), dtype=float)
    forces = np.asarray(pick_machine_columns(robot, forces, "forces"), dtype=float)
    units = units or [(f"{joint.unit}/s", joint.force_unit) for joint in joints]
    abilities = abilities or _abilities(robot) or [Ability(None, None, None)] * len(units)
    if rms is None:
        rms = np.sqrt((speeds**2).mean(axis=0)), np.sqrt((forces**2).mean(axis=0))
    groups = groups_of(units)
    figure = blank(5.4, 3.4 * len(groups), ax)
    for k, ((rate, unit), legs) in enumerate(groups.items()):
        word = "torque" if unit == "N m" else "force"
        place = figure.add_gridspec(len(groups), 1)[k]
        axes = plain_axes(figure, f"speed ({rate})", f"{word} ({unit})", place)
        zero_line(axes)
        axes.axvline(0.0, color=MUTED, linewidth=0.8)
        sizes = []
        for columns, key in ((speeds, "speed"), (forces, "force")):
            used = float(np.abs(columns[:, legs]).max()) or 1.0
            near = [getattr(abilities[i], key) or 0.0 for i in legs]
            near += [abilities[i].rated or 0.0 for i in legs] if key == "force" else []
            sizes.append(_ROOM * max(used, *(limit for limit in near if limit <= _FAR * used), 0.0))
        axes.set(xlim=(-sizes[0], sizes[0]), ylim=(-sizes[1], sizes[1]))
        shared = len({abilities[i] for i in legs}) == 1
        for i in legs[: 1 if shared else None]:
            _box(axes, abilities[i], sizes, MUTED if shared else LEG_COLORS[i])
        for i in legs:
            axes.plot(speeds[:, i], forces[:, i], label=f"leg {i + 1}", **leg_style(i, 1.6))
            spot(axes, rms[0][i], rms[1][i], LEG_COLORS[i], PAPER, 6.5, zorder=5)
        if k == 0:
            # Held at the corners, so that letters of any size stay inside the axes.
            for x, y, side, level in ((0.02, 0.98, "left", "top"), (0.98, 0.02, "right", "bottom")):
                style: dict[str, Any] = {"ha": side, "va": level, "transform": axes.transAxes}
                axes.text(x, y, "brakes", fontsize=FONT_SIZE, color=MUTED, **style)
    legend(figure, min(len(units), 4))
    return real_figure(figure)


def _abilities(robot: RobotLike | None) -> list[Ability]:
    """Return the limits of a machine's drives."""
    legs = () if robot is None else as_manipulator(robot).legs
    drives = [leg.drive or Drive() for leg in legs]
    return [Ability(drive.max_speed, drive.max_force, drive.rated_force) for drive in drives]


def _box(axes: Axes, ability: Ability, sizes: Sequence[float], color: str) -> None:
    """Draw a drive's limits, as far as the axes show them."""
    x = min(ability.speed or sizes[0], sizes[0])
    y = min(ability.force or sizes[1], sizes[1])
    dashed, dotted = (0, (4, 2)), (0, (1, 1.6))
    limits = (ability.force, False, dashed), (ability.speed, True, dashed)
    for limit, upright, style in (*limits, (ability.rated, False, dotted)):
        for side in () if limit is None else (-limit, limit):
            ends = ([side, side], [-y, y]) if upright else ([-x, x], [side, side])
            axes.plot(*ends, color=color, linewidth=1.0, linestyle=style)


def power_figure(
    time: ArrayLike, power: ArrayLike, *, ax: Axes | SubFigure | None = None
) -> Figure:
    """Return a figure of the power (K, n) of all drives over time (K,), s, and of their sum; W."""
    time, power = rows(time, power, "power")
    figure = blank(5.4, 3.3, ax)
    axes = plain_axes(figure, "time (s)", "power (W)")
    zero_line(axes)
    axes.plot(time, power.sum(axis=1), label="all", color=INK, linewidth=2.0)
    count = power.shape[1]
    leg_curves(axes, time, power, range(count), 1.4, leg_numbers(count), "leg")
    legend(figure, count + 1)
    return real_figure(figure)
