"""Pictures of measured beside predicted drive forces: over time, over speed, and their errors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from numpy.typing import NDArray

from pteron.kernels import Array
from pteron.legs.kind import SLIDER, ActuatedJoint
from pteron.plots.canvas import (
    FONT_SIZE,
    GRID,
    INK,
    MUTED,
    PAPER,
    blank,
    plain_axes,
    real_figure,
    spot,
    stack,
    zero_line,
)
from pteron.plots.leg_curves import LEG_COLORS
from pteron.plots.ticks import fit_time_scale, log_scale

_COLUMNS = 360
"""Points of the curve over a whole recording, each the envelope of its samples."""

_DOTS = 600
"""Samples drawn as dots, about."""

_BINS = 30
"""Intervals of speed whose mean residual is drawn."""

_FEWEST = 8
"""Least samples in a bin whose mean is drawn."""


def comparison_figure(
    time: Array,
    measured: Array,
    predicted: Array,
    without_friction: Array,
    used: NDArray[np.bool_],
    *,
    leg: int,
    joint: ActuatedJoint = SLIDER,
    ax: Axes | SubFigure | None = None,
) -> Figure:
    """Return a figure of an actuator's measured and predicted force, and their difference below.

    Time (T,) is in s, forces (T,) in N or N m, the last one without friction and offset. Samples
    that are not `used` (T,) do not count and are shaded. `leg`, from 0, gives the colour, `joint`
    the words and units.
    """
    figure = blank(4.4, 3.1, ax)
    color, unit = LEG_COLORS[leg], joint.force_unit
    labels = [f"{joint.force} ({unit})", f"residual ({unit})"]
    forces, residuals = stack(figure, "time (s)", labels, [2.1, 1.0])
    forces.plot(time, measured, color=MUTED, alpha=0.45, linewidth=4.0, solid_capstyle="round")
    forces.plot(time, without_friction, color=MUTED, linewidth=1.0, linestyle=(0, (2.5, 1.8)))
    forces.plot(time, predicted, color=color, linewidth=1.3)
    zero_line(residuals)
    missed = measured - predicted
    residuals.plot(time, missed, color=MUTED, linewidth=0.6)
    residuals.plot(time, np.where(used, missed, np.nan), color=color, linewidth=0.8)
    # Samples that do not count may be far out: they must not flatten the others.
    size = float(np.abs(np.where(used, missed, 0.0)).max()) or 1.0
    residuals.set_ylim(-1.2 * size, 1.2 * size)
    edges = np.flatnonzero(np.diff(np.r_[False, ~used, False].astype(int))).reshape(-1, 2)
    for start, stop in np.minimum(edges, len(time) - 1).tolist():
        for axes in (forces, residuals):
            axes.axvspan(time[start], time[stop], color=GRID, alpha=0.75, linewidth=0.0, zorder=0.5)
    fit_time_scale(residuals, time)
    figure.align_ylabels([forces, residuals])
    return real_figure(figure)


def errors_figure(
    errors: Array, without_friction: Array, floor: Array, *, ax: Axes | SubFigure | None = None
) -> Figure:
    """Return a figure of the errors of a prediction beside the noise, on a logarithmic scale.

    The errors (n,) of the whole model and of that without friction and offset, and the noise, are
    in percent of the force's standard deviation.
    """
    n = len(errors)
    figure = blank(4.8, 0.75 + 0.34 * n, ax)
    axes = plain_axes(figure, "NRMS (% of the force's standard deviation)", "")
    axes.grid(visible=False, axis="y")
    every = np.concatenate([errors, without_friction, floor])
    every = every[np.isfinite(every) & (every > 0.0)]
    low, high = (0.1, 100.0) if not len(every) else (every.min() / 1.5, every.max() * 1.5)
    for i, color in zip(range(n), LEG_COLORS, strict=False):
        y = n - 1 - i
        least = max(float(floor[i]), low)
        error, bare = max(errors[i], low), max(without_friction[i], low)
        axes.plot([least, bare], [y, y], color=GRID, linewidth=3.0)
        axes.plot([least, error], [y, y], color=color, linewidth=3.0)
        # Over many decades, as without noise, the largest stand on the right edge: whole.
        spot(axes, bare, y, PAPER, color, 7.0, markeredgewidth=1.6, clip_on=False)
        spot(axes, error, y, color, PAPER, 8.0, clip_on=False)
        axes.plot([least], [y], marker="|", markersize=15.0, color=INK, markeredgewidth=1.8)
    log_scale(axes, low, high)
    axes.set_ylim(-0.6, n - 0.4)
    axes.set_yticks(range(n), [f"actuator {n - y}" for y in range(n)], fontsize=FONT_SIZE)
    return real_figure(figure)


def residual_time_figure(
    time: Array,
    residuals: Array,
    used: NDArray[np.bool_],
    joints: Sequence[ActuatedJoint] | None = None,
    *,
    ax: Axes | SubFigure | None = None,
) -> Figure:
    """Return a figure of the residuals of all actuators over time, one above the other.

    Time (T,) is in s, residuals (T, n) in N or N m, as the joints have them. Samples that are not
    `used` (T, n) do not count: they are grey, and may lie outside.
    """
    n = residuals.shape[1]
    figure = blank(3.8, 0.5 + 1.05 * n, ax)
    units = [joint.force_unit for joint in joints or [SLIDER] * n]
    panels = stack(figure, "time (s)", [f"{i}  ({unit})" for i, unit in enumerate(units, start=1)])
    edges = np.unique(np.linspace(0, len(time), min(_COLUMNS, len(time)) + 1).astype(int))
    starts = edges[:-1]
    middle = np.add.reduceat(time, starts) / np.diff(edges)
    for i, axes in enumerate(panels):
        zero_line(axes)
        counted = np.where(used[:, i], residuals[:, i], np.nan)
        for series, color in ((residuals[:, i], MUTED), (counted, LEG_COLORS[i])):
            low, high = (f.reduceat(series, starts) for f in (np.fmin, np.fmax))
            axes.fill_between(middle, low, high, facecolor=color, edgecolor=color, linewidth=0.6)
        size = float(np.nanmax(np.abs(counted), initial=0.0)) or 1.0
        axes.set_ylim(-1.15 * size, 1.15 * size)
    fit_time_scale(panels[-1], time)
    figure.align_ylabels(panels)
    return real_figure(figure)


def residual_speed_figure(
    speed: Array,
    residuals: Array,
    used: NDArray[np.bool_],
    *,
    leg: int,
    joint: ActuatedJoint = SLIDER,
    ax: Axes | SubFigure | None = None,
) -> Figure:
    """Return a figure of an actuator's residuals over joint speed: unmodelled friction shows here.

    Speeds (T,) are in m/s or rad/s, residuals (T,) in N or N m. Samples that are not `used` (T,) do
    not count: they are grey, and may lie outside. `leg`, from 0, gives the colour, `joint` the
    words and units.
    """
    figure = blank(3.1, 2.4, ax)
    words = f"{joint.noun} speed ({joint.unit}/s)", f"residual ({joint.force_unit})"
    axes = plain_axes(figure, *words)
    zero_line(axes)
    step = max(len(speed) // _DOTS, 1)
    some = slice(step // 2, None, step)
    for chosen, color in ((~used[some], MUTED), (used[some], LEG_COLORS[leg])):
        _dots(axes, speed[some][chosen], residuals[some][chosen], color)
    middle, mean = _means(speed[used], residuals[used])
    axes.plot(middle, mean, color=PAPER, linewidth=4.2, solid_capstyle="round", zorder=4)
    axes.plot(middle, mean, color=INK, linewidth=1.8, solid_capstyle="round", zorder=5)
    # Samples that do not count may lie outside: a stuck joint would make the rest a line.
    counted = residuals[used] if used.any() else residuals
    size = float(np.quantile(np.abs(counted), 0.998)) or 1.0
    axes.set_ylim(-2.0 * size, 2.0 * size)
    reach = 1.04 * float(np.abs(speed).max()) or 1.0
    axes.set_xlim(-reach, reach)
    return real_figure(figure)


def _dots(axes: Axes, x: Array, y: Array, color: str) -> None:
    """Draw dots as a single path of short strokes: a tenth of the size of markers in an SVG."""
    if not len(x):
        return
    path = Path(
        np.repeat(np.column_stack([x, y]), 2, axis=0), np.tile([Path.MOVETO, Path.LINETO], len(x))
    )
    # A face keeps Matplotlib from dropping strokes without length.
    axes.add_patch(PathPatch(path, color=color, linewidth=2.6, capstyle="round", alpha=0.55))


def _means(speed: Array, residuals: Array) -> tuple[Array, Array]:
    """Return the mean residual in bins of the speed."""
    if not len(speed):
        return np.empty(0), np.empty(0)
    edges = np.linspace(float(speed.min()), float(speed.max()) + 1e-12, _BINS + 1)
    bins = np.clip(np.digitize(speed, edges) - 1, 0, _BINS - 1)
    count = np.bincount(bins, minlength=_BINS)
    total = np.bincount(bins, weights=residuals, minlength=_BINS)
    mean = np.where(count >= _FEWEST, total / np.maximum(count, 1), np.nan)
    return (edges[:-1] + edges[1:]) / 2.0, mean
