"""Actuator forces over time."""

from __future__ import annotations

from matplotlib.figure import Figure

from pteron.kernels import Array
from pteron.plots.canvas import FONT_SIZE, blank, plain_axes
from pteron.plots.colors import INK, LEG_COLORS, MUTED

__all__ = ["forces_figure"]

_STYLES = ("-", (0, (6, 1.5)), (0, (2, 1.2)), (0, (6, 1.5, 1.5, 1.5)))
"""Of legs 1 to 4: colour alone does not survive every printer."""


def forces_figure(
    time: Array,
    forces: Array,
    *,
    turning_point: float | None = None,
    ylabel: str = "actuator force (N)",
) -> Figure:
    """Return the forces of all legs over time.

    Parameters
    ----------
    time : array, shape (T,)
        s.
    forces : array, shape (T, n)
        N.
    turning_point : float, optional
        Where the way back begins, s.
    ylabel : str
        What is shown; other quantities of the legs look the same.

    Returns
    -------
    matplotlib Figure
    """
    figure = blank(5.4, 3.3)
    axes = plain_axes(figure, "time (s)", ylabel)
    axes.axhline(0.0, color=MUTED, linewidth=0.8)
    for i, force in enumerate(forces.T):
        axes.plot(
            time,
            force,
            color=LEG_COLORS[i],
            linestyle=_STYLES[i],
            linewidth=1.8,
            label=f"leg {i + 1}",
        )
    axes.set_xlim(float(time[0]), float(time[-1]))
    if turning_point is not None:
        axes.axvline(turning_point, color=MUTED, linewidth=0.8, linestyle=(0, (4, 3)))
        middle = (float(time[0]) + turning_point) / 2.0, (turning_point + float(time[-1])) / 2.0
        for at, word in zip(middle, ("out", "back"), strict=True):
            axes.annotate(
                word,
                (at, 1.0),
                xycoords=("data", "axes fraction"),
                xytext=(0.0, 3.0),
                textcoords="offset points",
                ha="center",
                fontsize=FONT_SIZE,
                color=MUTED,
            )
    figure.legend(
        loc="outside upper center",
        ncols=len(forces.T),
        frameon=False,
        fontsize=FONT_SIZE,
        labelcolor=INK,
        handlelength=2.4,
        columnspacing=1.6,
    )
    return figure
