"""Pictures with a row for each name: parameters' values with their intervals, and counts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from numpy.typing import ArrayLike

from pteron.arguments import expect
from pteron.errors import DataError
from pteron.kernels import Array
from pteron.plots.canvas import (
    FONT_SIZE,
    INK,
    MUTED,
    PAPER,
    REACH,
    WARNING,
    blank,
    groups_of,
    plain_axes,
    real_figure,
    spot,
)

_WIDE = 5.4
"""Width of the figure, inches."""

_ROW = 0.185
"""Height of a row, inches."""

_HEAD = 0.5
"""Height of the axis labels below the rows of one unit, inches."""


def parameters_figure(
    names: Sequence[str],
    values: ArrayLike,
    *,
    intervals: ArrayLike | None = None,
    units: Sequence[str] = (),
    reference: ArrayLike | None = None,
    ax: Axes | SubFigure | None = None,
) -> Figure:
    """Return a figure of parameters with their intervals, with a scale for each unit.

    Parameters
    ----------
    names : sequence of str
        Names of the p parameters.
    values : array, shape (p,)
        The values, in `units`.
    intervals : array, shape (p,), optional
        Half the width of each interval, such as 1.96 standard deviations; NaN where it is unknown.
    units : sequence of str, optional
        Unit of each parameter; without units all share one scale.
    reference : array, shape (p,), optional
        Values to compare with, such as the drawing's, shown as open rings. A value whose interval
        does not hold its reference is red.
    ax : Axes or SubFigure, optional
        Axes of another figure, on which it is drawn; several panels take their place.

    Returns
    -------
    Figure

    Raises
    ------
    DataError
        If values, intervals, units or reference are not p, one for each name.

    Examples
    --------
    >>> import pteron
    >>> base = pteron.base_parameters(pteron.load("delta"))
    >>> units = [base.parameters[k].unit for k in base.kept]
    >>> figure = pteron.plots.parameters_figure(base.names, base.values(), units=units)
    >>> [axes.get_xlabel() for axes in figure.axes]
    ['kg m', 'kg m^2', 'kg']
    """
    numbers = _checked_values(names, values, "values")
    wide = np.full(len(names), np.nan)
    if intervals is not None:
        wide = _checked_values(names, intervals, "intervals")
    known = None if reference is None else _checked_values(names, reference, "reference")
    if units and len(units) != len(names):
        raise DataError(f"units: {len(units)} given, {len(names)} expected, one for each name")
    groups = groups_of(units or ["value"] * len(names))
    counts = [len(members) for members in groups.values()]
    figure = blank(_WIDE, _HEAD * len(groups) + _ROW * len(names), ax)
    grid = figure.add_gridspec(len(groups), 1, height_ratios=[count + 1.0 for count in counts])
    for k, (unit, members) in enumerate(groups.items()):
        axes = row_axes(figure, [names[i] for i in members], unit, grid[k])
        axes.axvline(0.0, color=MUTED, linewidth=0.8)
        for y, i in enumerate(reversed(members)):
            if known is not None:
                spot(axes, known[i], y, PAPER, INK, 7.5, markeredgewidth=1.2)
            missed = known is not None and abs(numbers[i] - known[i]) > wide[i]
            color = WARNING if missed else REACH
            if np.isfinite(wide[i]):
                ends = [numbers[i] - wide[i], numbers[i] + wide[i]]
                axes.plot(ends, [y, y], color=color, linewidth=2.0, marker="|", markersize=6.0)
            spot(axes, numbers[i], y, color, PAPER, 5.0, markeredgewidth=0.6)
    return real_figure(figure)


def operations_figure(
    names: Sequence[str], counts: ArrayLike, *, ax: Axes | SubFigure | None = None
) -> Figure:
    """Return a figure of bars of counts, such as operations, labelled with their values.

    Parameters
    ----------
    names : sequence of str
        Names of the p rows, from the top.
    counts : array, shape (p,)
        The counts, 0 or more.
    ax : Axes or SubFigure, optional
        Axes of another figure, on which it is drawn; several panels take their place.

    Returns
    -------
    Figure

    Raises
    ------
    DataError
        If there is not one count for each name.

    Examples
    --------
    >>> import pteron
    >>> robot = pteron.load("delta")
    >>> kernel = pteron.compile(robot, "inverse_dynamics", "vm")
    >>> figure = pteron.plots.operations_figure(["delta"], [kernel.operations])
    """
    numbers = _checked_values(names, counts, "counts")
    figure = blank(_WIDE, 0.6 + 0.3 * len(names), ax)
    axes = row_axes(figure, names, "operations")
    rows = np.arange(len(names))[::-1]
    axes.barh(rows, numbers, height=0.6, color=REACH)
    for row, number in zip(rows, numbers, strict=True):
        style: dict[str, Any] = {"va": "center", "fontsize": FONT_SIZE, "color": INK}
        axes.annotate(
            f"{number:g}", (number, row), xytext=(4, 0), textcoords="offset points", **style
        )
    axes.set_xlim(0.0, 1.12 * float(numbers.max(initial=0.0)) or 1.0)
    return real_figure(figure)


def row_axes(figure: Figure, names: Sequence[str], xlabel: str, place: Any = None) -> Axes:
    """Return axes with a row for each name, the first at the top."""
    axes = plain_axes(figure, xlabel, "", place)
    axes.grid(visible=False, axis="y")
    axes.set_ylim(-0.7, len(names) - 0.3)
    axes.set_yticks(range(len(names)), list(reversed(names)), fontsize=FONT_SIZE - 1.0)
    return axes


def _checked_values(names: Sequence[str], numbers: ArrayLike, what: str) -> Array:
    """Return values of named rows as an array (N,), checked for its shape."""
    array = np.asarray(numbers, dtype=float)
    expect(array.shape == (len(names),), what, f"shape {array.shape}", f"({len(names)},)")
    return array
