"""How well the sliders hold the platform, over its orientation."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from pteron.kernels import Array
from pteron.plots.canvas import FONT_SIZE, blank, plain_axes
from pteron.plots.colors import GRID, INK, MUTED, PAPER, REACH, WARNING

__all__ = ["regularity_figure"]


def regularity_figure(
    angles: Array,
    regularity: Array,
    singular: Array,
    *,
    home: float | None = None,
    used: tuple[float, float] | None = None,
) -> Figure:
    """Return abs(det J), relative to its largest value, over phi.

    Parameters
    ----------
    angles : array, shape (A,)
        phi, rad, ascending.
    regularity : array, shape (A,)
        det J over its largest value.
    singular : array, shape (S,)
        The singular orientations, rad.
    home : float, optional
        phi of the home pose, rad.
    used : (float, float), optional
        The least and greatest phi of a motion, rad.

    Returns
    -------
    matplotlib Figure
    """
    figure = blank(5.4, 2.9)
    axes = plain_axes(figure, "orientation φ (degrees)", "|det J| / max |det J|")
    degrees = np.degrees(angles)
    if used is not None:
        low, high = np.degrees(used)
        axes.axvspan(low, high, color=GRID, alpha=0.6, linewidth=0.0, zorder=0.5)
        axes.annotate(
            "used by the cycle",
            ((low + high) / 2.0, 0.04),
            ha="center",
            va="bottom",
            fontsize=FONT_SIZE,
            color=MUTED,
        )
    axes.plot(degrees, np.abs(regularity), color=REACH, linewidth=2.0, zorder=3)
    for angle in np.degrees(singular):
        axes.axvline(angle, color=WARNING, linewidth=1.2, linestyle=(0, (4, 2)))
        axes.annotate(
            f"singular, {angle:.1f}°".replace("-", "\u2212"),
            (angle, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(0.0, 3.0),
            textcoords="offset points",
            ha="center",
            fontsize=FONT_SIZE,
            color=WARNING,
        )
    if home is not None:
        value = float(np.interp(home, angles, np.abs(regularity)))
        axes.plot(
            [np.degrees(home)],
            [value],
            marker="o",
            color=INK,
            markeredgecolor=PAPER,
            markersize=6.0,
            zorder=4,
            linestyle="none",
        )
        axes.annotate(
            "home",
            (float(np.degrees(home)), value),
            xytext=(0.0, -12.0),
            textcoords="offset points",
            ha="center",
            fontsize=FONT_SIZE,
            color=INK,
        )
    axes.set_xlim(float(degrees[0]), float(degrees[-1]))
    axes.set_xticks(np.arange(-180, 181, 60))
    axes.set_ylim(0.0, 1.06)
    return figure
