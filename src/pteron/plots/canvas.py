"""Empty figures in the style of all pictures."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pteron.plots.colors import GRID, INK, MUTED

__all__ = ["FONT_SIZE", "blank", "plain_axes"]

FONT_SIZE = 9.0
"""Points. Figures are about as wide as a phone's screen, so that text stays legible there."""


def blank(width: float, height: float) -> Figure:
    """Return a figure of so many inches, transparent, with a canvas of its own."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    figure.patch.set_alpha(0.0)
    return figure


def plain_axes(figure: Figure, xlabel: str, ylabel: str) -> Axes:
    """Return axes with a light grid and no frame but the two scales."""
    axes = figure.add_subplot()
    axes.patch.set_alpha(0.0)
    axes.set_xlabel(xlabel, fontsize=FONT_SIZE, color=INK)
    axes.set_ylabel(ylabel, fontsize=FONT_SIZE, color=INK)
    axes.tick_params(labelsize=FONT_SIZE, colors=INK, color=MUTED, length=3.0, width=0.7)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set(color=MUTED, linewidth=0.7)
    axes.grid(color=GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    return axes
