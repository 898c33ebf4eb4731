"""Forces that were measured against forces that were predicted."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator
from numpy.typing import NDArray

from pteron.kernels import Array
from pteron.plots.canvas import FONT_SIZE, blank, plain_axes
from pteron.plots.colors import GRID, INK, LEG_COLORS, MUTED, PAPER
from pteron.plots.panels import stack

__all__ = ["comparison_figure", "errors_figure"]

_TICKS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0)


def comparison_figure(
    time: Array,
    measured: Array,
    predicted: Array,
    without_friction: Array,
    used: NDArray[np.bool_],
    *,
    leg: int,
) -> Figure:
    """Return an actuator's measured and predicted force over time, and their difference below.

    Parameters
    ----------
    time : array, shape (T,)
        s.
    measured, predicted, without_friction : array, shape (T,)
        N; the last one is what the model says without friction and offset.
    used : array of bool, shape (T,)
        Whether a sample counts; the others are shaded.
    leg : int
        Which actuator, from 0, for its colour.

    Returns
    -------
    matplotlib Figure
    """
    figure = blank(4.4, 3.1)
    color = LEG_COLORS[leg]
    forces, rest = stack(figure, "time (s)", ["force (N)", "residual (N)"], [2.1, 1.0])
    forces.plot(time, measured, color=MUTED, alpha=0.45, linewidth=4.0, solid_capstyle="round")
    forces.plot(time, without_friction, color=MUTED, linewidth=1.0, linestyle=(0, (2.5, 1.8)))
    forces.plot(time, predicted, color=color, linewidth=1.3)
    rest.axhline(0.0, color=MUTED, linewidth=0.8)
    missed = measured - predicted
    rest.plot(time, missed, color=MUTED, linewidth=0.6)
    rest.plot(time, np.where(used, missed, np.nan), color=color, linewidth=0.8)
    # What does not count may be far out: it must not flatten what does.
    size = float(np.abs(np.where(used, missed, 0.0)).max()) or 1.0
    rest.set_ylim(-1.2 * size, 1.2 * size)
    for axes in (forces, rest):
        _shade(axes, time, ~used)
    rest.set_xlim(float(time[0]), float(time[-1]))
    figure.align_ylabels([forces, rest])
    return figure


def _shade(axes: Axes, time: Array, where: NDArray[np.bool_]) -> None:
    edges = np.flatnonzero(np.diff(np.r_[False, where, False].astype(int)))
    last = len(time) - 1
    for start, stop in edges.reshape(-1, 2).tolist():
        low, high = float(time[start]), float(time[min(stop, last)])
        axes.axvspan(low, high, color=GRID, alpha=0.75, linewidth=0.0, zorder=0.5)


def errors_figure(errors: Array, without_friction: Array, floor: Array) -> Figure:
    """Return the errors of a prediction beside the noise, on a logarithmic scale.

    Parameters
    ----------
    errors, without_friction, floor : array, shape (n,)
        Of the whole model, of the model without friction and offset, and of the noise, in percent
        of the force's standard deviation.

    Returns
    -------
    matplotlib Figure
    """
    n = len(errors)
    figure = blank(4.8, 0.75 + 0.34 * n)
    axes = plain_axes(figure, "NRMS (% of the force's standard deviation)", "")
    axes.grid(visible=False, axis="y")
    every = np.concatenate([errors, without_friction, floor])
    every = every[np.isfinite(every) & (every > 0.0)]
    low, high = (0.1, 100.0) if not len(every) else (every.min() / 1.5, every.max() * 1.5)
    for i in range(n):
        y = n - 1 - i
        least = max(float(floor[i]), low)
        axes.plot([least, max(without_friction[i], low)], [y, y], color=GRID, linewidth=3.0)
        axes.plot([least, max(errors[i], low)], [y, y], color=LEG_COLORS[i], linewidth=3.0)
        axes.plot(
            [without_friction[i]],
            [y],
            marker="o",
            markersize=7.0,
            color=PAPER,
            markeredgecolor=LEG_COLORS[i],
            markeredgewidth=1.6,
        )
        axes.plot(
            [errors[i]],
            [y],
            marker="o",
            markersize=8.0,
            color=LEG_COLORS[i],
            markeredgecolor=PAPER,
        )
        axes.plot([least], [y], marker="|", markersize=15.0, color=INK, markeredgewidth=1.8)
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    axes.xaxis.set_major_locator(FixedLocator([t for t in _TICKS if low <= t <= high]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_ylim(-0.6, n - 0.4)
    axes.set_yticks(range(n), [f"actuator {n - y}" for y in range(n)], fontsize=FONT_SIZE)
    return figure
