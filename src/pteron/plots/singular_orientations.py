"""The type-II measure over the platform's angle, with the singular orientations marked."""

from __future__ import annotations

from math import inf

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from pteron.kernels import Array
from pteron.plots.canvas import (
    GRID,
    INK,
    MUTED,
    PAPER,
    REACH,
    WARNING,
    blank,
    plain_axes,
    real_figure,
    remark,
    spot,
)

_ROOM = 75.0
"""Least distance, degrees, of singular orientations for the longer of two labels."""


def regularity_figure(
    angles: Array,
    type_ii: Array,
    singular: Array,
    *,
    home: float | None = None,
    used: tuple[float, float] | None = None,
    ax: Axes | SubFigure | None = None,
) -> Figure:
    """Return a figure of the type-II measure's size over the platform's angle; NaN leaves a gap.

    The angles (A,) ascend; the singular orientations, the angle of the home pose, and the least and
    greatest angle of a motion are marked. All are in rad.
    """
    figure = blank(5.4, 2.9, ax)
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
        at, measure = float(np.degrees(home)), float(np.interp(home, angles, np.abs(type_ii)))
        spot(axes, at, measure, INK, PAPER, 6.0, zorder=4)
        remark(axes, "home", at, measure, INK, -12.0)
    axes.set_xlim(float(degrees[0]), float(degrees[-1]))
    axes.set_xticks(np.arange(-180, 181, 60))
    axes.set_ylim(0.0, 1.06)
    return real_figure(figure)
