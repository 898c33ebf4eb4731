"""What a model leaves of the measured forces: over time, over speed, and as noise."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from numpy.typing import NDArray

from pteron.kernels import Array
from pteron.plots.canvas import FONT_SIZE, blank, plain_axes
from pteron.plots.colors import GRID, INK, LEG_COLORS, MUTED, PAPER
from pteron.plots.panels import stack

__all__ = [
    "autocorrelation_figure",
    "histogram_figure",
    "residual_speed_figure",
    "residual_time_figure",
]

_STYLES = ("-", (0, (6, 1.5)), (0, (2, 1.2)), (0, (6, 1.5, 1.5, 1.5)))
"""Of legs 1 to 4: colour alone does not survive every printer."""

_COLUMNS = 360
"""Of the curve over a whole recording: what is finer than a line is an envelope."""

_DOTS = 600
_BINS = 30
_FEWEST = 8
"""Samples in a bin whose mean says something."""

_REACH = 4.5
"""Standard deviations to each side."""


def residual_time_figure(time: Array, residuals: Array, used: NDArray[np.bool_]) -> Figure:
    """Return the residuals of all actuators over a whole recording, one above the other.

    Parameters
    ----------
    time : array, shape (T,)
        s.
    residuals : array, shape (T, n)
        N.
    used : array of bool, shape (T, n)
        Whether a sample counts; others are grey, and may lie outside.

    Returns
    -------
    matplotlib Figure
    """
    n = residuals.shape[1]
    figure = blank(4.8, 0.5 + 0.8 * n)
    panels = stack(figure, "time (s)", [f"{i + 1}  (N)" for i in range(n)])
    edges = np.unique(np.linspace(0, len(time), min(_COLUMNS, len(time)) + 1).astype(int))
    starts = edges[:-1]
    middle = np.add.reduceat(time, starts) / np.diff(edges)
    for i, axes in enumerate(panels):
        axes.axhline(0.0, color=MUTED, linewidth=0.8)
        counted = np.where(used[:, i], residuals[:, i], np.nan)
        for values, color in ((residuals[:, i], MUTED), (counted, LEG_COLORS[i])):
            low, high = (f.reduceat(values, starts) for f in (np.fmin, np.fmax))
            axes.fill_between(middle, low, high, facecolor=color, edgecolor=color, linewidth=0.6)
        size = float(np.nanmax(np.abs(counted), initial=0.0)) or 1.0
        axes.set_ylim(-1.15 * size, 1.15 * size)
    panels[-1].set_xlim(float(time[0]), float(time[-1]))
    figure.align_ylabels(panels)
    return figure


def residual_speed_figure(
    speed: Array, residuals: Array, used: NDArray[np.bool_], *, leg: int
) -> Figure:
    """Return an actuator's residuals over its slider's speed: friction that is missing shows here.

    Parameters
    ----------
    speed, residuals : array, shape (T,)
        m/s and N.
    used : array of bool, shape (T,)
        Whether a sample counts; others are grey, and may lie outside.
    leg : int
        Which actuator, from 0, for its colour.

    Returns
    -------
    matplotlib Figure
    """
    figure = blank(3.1, 2.4)
    axes = plain_axes(figure, "slider speed (m/s)", "residual (N)")
    axes.axhline(0.0, color=MUTED, linewidth=0.8)
    step = max(len(speed) // _DOTS, 1)
    some = slice(step // 2, None, step)
    for chosen, color in ((~used[some], MUTED), (used[some], LEG_COLORS[leg])):
        _dots(axes, speed[some][chosen], residuals[some][chosen], color)
    middle, mean = _means(speed[used], residuals[used])
    axes.plot(middle, mean, color=PAPER, linewidth=4.2, solid_capstyle="round", zorder=4)
    axes.plot(middle, mean, color=INK, linewidth=1.8, solid_capstyle="round", zorder=5)
    # What does not count may lie outside: a stuck slider would make the rest a line.
    counted = residuals[used] if used.any() else residuals
    size = float(np.quantile(np.abs(counted), 0.998)) or 1.0
    axes.set_ylim(-2.0 * size, 2.0 * size)
    reach = 1.04 * float(np.abs(speed).max()) or 1.0
    axes.set_xlim(-reach, reach)
    return figure


def _dots(axes: Axes, x: Array, y: Array, color: str) -> None:
    """Draw dots as one path of short strokes: a tenth of the size of markers in an SVG."""
    if not len(x):
        return
    points = np.repeat(np.column_stack([x, y]), 2, axis=0)
    codes = np.tile([Path.MOVETO, Path.LINETO], len(x))
    axes.add_patch(
        # A face keeps Matplotlib from dropping strokes without length.
        PathPatch(
            Path(points, codes),
            facecolor=color,
            edgecolor=color,
            linewidth=2.6,
            capstyle="round",
            alpha=0.55,
        )
    )


def _means(speed: Array, residuals: Array) -> tuple[Array, Array]:
    """Return the mean residual in bins of the speed."""
    if not len(speed):
        return np.empty(0), np.empty(0)
    edges = np.linspace(float(speed.min()), float(speed.max()) + 1e-12, _BINS + 1)
    bins = np.clip(np.digitize(speed, edges) - 1, 0, _BINS - 1)
    count = np.bincount(bins, minlength=_BINS)
    total = np.bincount(bins, weights=residuals, minlength=_BINS)
    mean = np.full(_BINS, np.nan)
    mean[count >= _FEWEST] = total[count >= _FEWEST] / count[count >= _FEWEST]
    return (edges[:-1] + edges[1:]) / 2.0, mean


def histogram_figure(residuals: Array) -> Figure:
    """Return the distribution of residuals, each in its standard deviation, and the normal one.

    Parameters
    ----------
    residuals : array, shape (R, n)
        NaN where there is none.

    Returns
    -------
    matplotlib Figure
    """
    figure = blank(5.4, 3.1)
    axes = plain_axes(figure, "residual (standard deviations)", "density")
    fine = np.linspace(-_REACH, _REACH, 121)
    normal = np.exp(-(fine**2) / 2.0) / np.sqrt(2.0 * np.pi)
    axes.fill_between(fine, normal, color=GRID, linewidth=0.0, zorder=0.6)
    axes.plot(fine, normal, color=INK, linewidth=1.2, label="normal")
    for i, column in enumerate(residuals.T):
        seen = column[np.isfinite(column)]
        size = float(seen.std()) if len(seen) else 0.0
        if size == 0.0:
            continue
        bins = int(np.clip(2.0 * np.cbrt(len(seen)), 12, 60))
        # What is farther out is counted where the picture ends.
        scaled = np.clip((seen - seen.mean()) / size, -_REACH, _REACH)
        density, edges = np.histogram(scaled, bins, (-_REACH, _REACH), density=True)
        axes.stairs(
            density,
            edges,
            color=LEG_COLORS[i],
            linewidth=1.5,
            linestyle=_STYLES[i],
            label=f"actuator {i + 1}",
        )
    axes.set_xlim(-_REACH, _REACH)
    axes.set_ylim(0.0, None)
    _legend(figure)
    return figure


def autocorrelation_figure(correlations: Array, bound: Array) -> Figure:
    """Return the autocorrelation of residuals, and the band in which white noise stays.

    Parameters
    ----------
    correlations : array, shape (L, n)
        At lags 1 to L.
    bound : array, shape (n,)
        Size that white noise keeps below, nineteen times in twenty.

    Returns
    -------
    matplotlib Figure
    """
    figure = blank(5.4, 3.1)
    axes = plain_axes(figure, "lag (equations)", "autocorrelation")
    lags = np.arange(1, len(correlations) + 1)
    edge = float(bound.max())
    axes.axhspan(-edge, edge, color=GRID, alpha=0.8, linewidth=0.0, zorder=0.5)
    axes.axhline(0.0, color=MUTED, linewidth=0.8)
    for i, column in enumerate(correlations.T):
        axes.plot(
            lags,
            column,
            color=LEG_COLORS[i],
            linewidth=1.4,
            linestyle=_STYLES[i],
            marker="o",
            markersize=2.6,
            label=f"actuator {i + 1}",
        )
    # Without a correlation to show, the band still is.
    largest = float(np.abs(correlations).max()) if correlations.size else 0.0
    reach = min(1.15 * max(largest, 2.0 * edge), 1.05)
    axes.set_ylim(-reach, reach)
    axes.set_xlim(0.0, len(correlations) + 1.0)
    _legend(figure)
    return figure


def _legend(figure: Figure) -> None:
    figure.legend(
        loc="outside upper center",
        ncols=5,
        frameon=False,
        fontsize=FONT_SIZE - 1.0,
        labelcolor=INK,
        handlelength=1.8,
        columnspacing=1.0,
        handletextpad=0.5,
    )
