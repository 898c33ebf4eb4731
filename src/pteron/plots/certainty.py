"""Pictures of how certain an identification is: its residuals, and its parameters' significance.

Residuals: their distribution beside the normal one, and their correlation in time beside that of
white noise. Parameters: each over its standard deviation, and their correlations.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from numpy.typing import NDArray

from pteron.kernels import Array
from pteron.plots.canvas import (
    FONT_SIZE,
    GRID,
    INK,
    MUTED,
    PAPER,
    REACH,
    WARNING,
    blank,
    legend,
    plain_axes,
    real_figure,
    spot,
    zero_line,
)
from pteron.plots.leg_curves import LEG_COLORS, leg_style
from pteron.plots.row_figures import row_axes
from pteron.plots.ticks import log_scale

_CERTAIN = 1.96
"""Standard deviations from zero beyond which a value is not zero, at 95 %."""

_LEVELS = 10
"""Steps of the colour of a correlation."""

_LEAST = 0.05
"""Least correlation that is drawn."""

_REACH = 4.5
"""Width of a histogram to each side, in standard deviations."""


def histogram_figure(residuals: Array, *, ax: Axes | SubFigure | None = None) -> Figure:
    """Return a figure of the histogram of residuals, in standard deviations, and the normal one.

    Residuals have shape (R, n), NaN where there is none.
    """
    figure = blank(5.4, 3.1, ax)
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
        axes.stairs(density, edges, label=f"actuator {i + 1}", **leg_style(i, 1.5))
    axes.set_xlim(-_REACH, _REACH)
    axes.set_ylim(0.0, None)
    legend(figure, 1 + residuals.shape[1])
    return real_figure(figure)


def autocorrelation_figure(
    correlations: Array, bound: Array, *, ax: Axes | SubFigure | None = None
) -> Figure:
    """Return a figure of the autocorrelation of residuals, with the band of white noise.

    Correlations (L, n) are those at lags 1 to L; white noise keeps below the bound (n,) nineteen
    times in twenty.
    """
    figure = blank(5.4, 3.1, ax)
    axes = plain_axes(figure, "lag (equations)", "autocorrelation")
    lags = np.arange(1, len(correlations) + 1)
    edge = float(bound.max())
    axes.axhspan(-edge, edge, color=GRID, alpha=0.8, linewidth=0.0, zorder=0.5)
    zero_line(axes)
    for i, column in enumerate(correlations.T):
        line = leg_style(i, 1.4)
        axes.plot(lags, column, marker="o", markersize=2.6, label=f"actuator {i + 1}", **line)
    # Without a correlation to show, the band still is.
    largest = float(np.abs(correlations).max()) if correlations.size else 0.0
    reach = min(1.15 * max(largest, 2.0 * edge), 1.05)
    axes.set_ylim(-reach, reach)
    axes.set_xlim(0.0, len(correlations) + 1.0)
    legend(figure, correlations.shape[1])
    return real_figure(figure)


def certainty_figure(
    names: Sequence[str],
    ratios: Array,
    weak: NDArray[np.bool_],
    inertial: int,
    *,
    ax: Axes | SubFigure | None = None,
) -> Figure:
    """Return a figure of the ratio of each value to its standard deviation, on a logarithmic scale.

    The p values have names, ratios (p,) of size to standard deviation, and are `weak` (p,) where
    the data hardly show them. The first `inertial` of them are inertial parameters.
    """
    p = len(names)
    figure = blank(5.4, 0.7 + 0.185 * p, ax)
    axes = row_axes(figure, names, "size of the value over its standard deviation")
    finite = ratios[np.isfinite(ratios)]
    high = 10.0 ** np.ceil(np.log10(max(float(finite.max(initial=1.0)), 100.0)))
    axes.axvspan(0.1, _CERTAIN, color=GRID, alpha=0.6, linewidth=0.0, zorder=0.4)
    for k, ratio in enumerate(np.clip(np.nan_to_num(ratios, posinf=high), 0.12, high)):
        y = p - 1 - k
        color = WARNING if weak[k] else REACH if k < inertial else LEG_COLORS[1]
        axes.plot([_CERTAIN, ratio], [y, y], color=color, linewidth=1.2, alpha=0.6)
        marker = "o" if k < inertial else "s"
        # The largest values stand on the right edge, whole.
        mark_style = {"marker": marker, "markeredgewidth": 0.6, "clip_on": False}
        spot(axes, ratio, y, color, PAPER, 5.5, **mark_style)
    axes.axvline(_CERTAIN, color=MUTED, linewidth=0.9, linestyle=(0, (4, 2)))
    axes.set_ylim(-0.8, p - 0.2)
    log_scale(axes, 0.1, high)
    return real_figure(figure)


def correlation_figure(
    names: Sequence[str], correlation: Array, *, ax: Axes | SubFigure | None = None
) -> Figure:
    """Return a figure of a correlation matrix (p, p): blue is positive, orange negative."""
    p = len(names)
    side = max(1.0 + 0.165 * p, 3.0)
    figure = blank(side, side, ax)
    axes = plain_axes(figure, "", "")
    axes.grid(visible=False)
    off = correlation - np.eye(p) * correlation
    steps = np.ceil(np.abs(off) * _LEVELS).astype(int)
    for sign, color in ((1.0, LEG_COLORS[0]), (-1.0, LEG_COLORS[1])):
        for level in range(1, _LEVELS + 1):
            chosen = (steps == level) & (sign * off >= _LEAST)
            _squares(axes, np.argwhere(chosen), color, level / _LEVELS)
    _squares(axes, np.column_stack([np.arange(p)] * 2), GRID, 1.0)
    size = max(FONT_SIZE - 1.5 - 0.02 * max(p - 30, 0), 5.0)
    axes.set_xticks(range(p), names, rotation=90, fontsize=size, color=INK)
    axes.set_yticks(range(p), names, fontsize=size, color=INK)
    axes.tick_params(length=0.0)
    for spine in axes.spines.values():
        spine.set_visible(False)
    axes.set(xlim=(-0.6, p - 0.4), ylim=(p - 0.4, -0.6), aspect="equal")
    return real_figure(figure)


def _squares(axes: Axes, cells: NDArray[np.intp], color: str, alpha: float) -> None:
    """Draw the squares of cells (K, 2), row and column, as one path."""
    if not len(cells):
        return
    corners = np.array([[-0.46, -0.46], [0.46, -0.46], [0.46, 0.46], [-0.46, 0.46], [0.0, 0.0]])
    vertices = (cells[:, None, ::-1] + corners).reshape(-1, 2)
    codes = np.tile([Path.MOVETO, *[Path.LINETO] * 3, Path.CLOSEPOLY], len(cells))
    path = Path(vertices, codes)
    axes.add_patch(PathPatch(path, facecolor=color, edgecolor="none", alpha=alpha))
