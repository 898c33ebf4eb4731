"""How well parameters are known: each by itself, and how they go together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from numpy.typing import NDArray

from pteron.kernels import Array
from pteron.plots.canvas import FONT_SIZE, blank, plain_axes
from pteron.plots.colors import GRID, INK, LEG_COLORS, MUTED, PAPER, REACH, WARNING

__all__ = ["certainty_figure", "correlation_figure"]

_CERTAIN = 1.96
"""Standard deviations from zero beyond which a value is not zero, at 95 %."""

_LEVELS = 10
_LEAST = 0.05
"""Correlations that are nothing to see."""


def certainty_figure(
    names: Sequence[str], ratios: Array, weak: NDArray[np.bool_], inertial: int
) -> Figure:
    """Return each value over its standard deviation, on a logarithmic scale.

    Parameters
    ----------
    names : sequence of str
        Of the p values.
    ratios : array, shape (p,)
        Size of each value over its standard deviation.
    weak : array of bool, shape (p,)
        Which of them the data hardly show.
    inertial : int
        How many of them, at the front, are inertial parameters.

    Returns
    -------
    matplotlib Figure
    """
    p = len(names)
    figure = blank(5.4, 0.7 + 0.185 * p)
    axes = plain_axes(figure, "size of the value over its standard deviation", "")
    axes.grid(visible=False, axis="y")
    finite = ratios[np.isfinite(ratios)]
    high = 10.0 ** np.ceil(np.log10(max(float(finite.max(initial=1.0)), 100.0)))
    axes.axvspan(0.1, _CERTAIN, color=GRID, alpha=0.6, linewidth=0.0, zorder=0.4)
    for k, ratio in enumerate(np.clip(np.nan_to_num(ratios, posinf=high), 0.12, high)):
        y = p - 1 - k
        color = WARNING if weak[k] else REACH if k < inertial else LEG_COLORS[1]
        axes.plot([_CERTAIN, ratio], [y, y], color=color, linewidth=1.2, alpha=0.6)
        axes.plot(
            [ratio],
            [y],
            marker="o" if k < inertial else "s",
            markersize=5.5,
            color=color,
            markeredgecolor=PAPER,
            markeredgewidth=0.6,
        )
    axes.axvline(_CERTAIN, color=MUTED, linewidth=0.9, linestyle=(0, (4, 2)))
    axes.set_xscale("log")
    axes.set_xlim(0.1, high)
    axes.set_ylim(-0.8, p - 0.2)
    ticks = 10.0 ** np.arange(-1, int(np.log10(high)) + 1)
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    axes.set_yticks(range(p), list(reversed(names)), fontsize=FONT_SIZE - 1.0)
    return figure


def correlation_figure(names: Sequence[str], correlation: Array) -> Figure:
    """Return a matrix of correlations: blue goes together, orange one for the other.

    Parameters
    ----------
    names : sequence of str
        Of the p values.
    correlation : array, shape (p, p)
        From -1 to 1.

    Returns
    -------
    matplotlib Figure
    """
    p = len(names)
    side = max(1.0 + 0.165 * p, 3.0)
    figure = blank(side, side)
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
    return figure


def _squares(axes: Axes, cells: NDArray[np.intp], color: str, alpha: float) -> None:
    """Draw the squares of cells (K, 2), row and column, as one path."""
    if not len(cells):
        return
    corners = np.array([[-0.46, -0.46], [0.46, -0.46], [0.46, 0.46], [-0.46, 0.46], [0.0, 0.0]])
    vertices = (cells[:, None, ::-1] + corners).reshape(-1, 2)
    codes = np.tile([Path.MOVETO, *[Path.LINETO] * 3, Path.CLOSEPOLY], len(cells))
    patch = PathPatch(Path(vertices, codes), facecolor=color, edgecolor="none", alpha=alpha)
    axes.add_patch(patch)
