"""Several axes in one figure, all in the style of single ones."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec, SubplotSpec

from pteron.plots.canvas import plain_axes

__all__ = ["panel", "stack"]


def panel(figure: Figure, place: SubplotSpec, xlabel: str, ylabel: str) -> Axes:
    """Return plain axes at a place of a grid."""
    axes = plain_axes(figure, xlabel, ylabel)
    axes.set_subplotspec(place)
    return axes


def stack(
    figure: Figure, xlabel: str, ylabels: list[str], ratios: list[float] | None = None
) -> list[Axes]:
    """Return axes one above the other, which share the lowest one's scale along x."""
    grid = GridSpec(len(ylabels), 1, figure=figure, height_ratios=ratios)
    found = [panel(figure, grid[i], "", ylabel) for i, ylabel in enumerate(ylabels)]
    found[-1].set_xlabel(xlabel)
    for axes in found[:-1]:
        axes.sharex(found[-1])
        axes.tick_params(labelbottom=False)
    return found
