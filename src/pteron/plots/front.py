"""Picture of the Pareto front of a design search: designs that no other betters in every objective.

The first objective is upright, against each of the others in a panel each.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from numpy.typing import ArrayLike

from pteron.errors import DataError
from pteron.plots.canvas import INK, PAPER, blank, legend, plain_axes, real_figure, spot
from pteron.plots.leg_curves import LEG_COLORS

_WIDE, _TALL = 5.4, 3.5
"""Width and height of the figure with one panel, inches."""

_PANEL = 2.4
"""Height of each further panel, inches."""

_MARKS = ("D", "s", "^", "v", "P")
"""Marks of the designs that are pointed out: a sixth has the first's again."""


def front_figure(
    objectives: ArrayLike,
    names: Sequence[str],
    units: Sequence[str],
    *,
    start: ArrayLike | None = None,
    chosen: Mapping[str, int] | None = None,
    ax: Axes | SubFigure | None = None,
) -> Figure:
    """Return the picture of a front: the first objective over each of the others.

    Parameters
    ----------
    objectives : array, shape (K, M)
        M objectives of each of K designs; one alone is drawn over the designs' numbers, from 1.
    names, units : sequence of str
        Names and units of the objectives; those with the unit m are shown in mm.
    start : array, shape (M,), optional
        Objectives of the machine that the search began with.
    chosen : mapping of str to int, optional
        Rows of `objectives` to point out, by what these designs are called.
    ax : Axes or SubFigure, optional
        Axes of another figure, on which it is drawn; several panels take their place.

    Returns
    -------
    Figure

    Raises
    ------
    DataError
        If the shapes do not fit together.

    Examples
    --------
    >>> from pteron.plots import front_figure
    >>> figure = front_figure([[0.2, 1.4], [0.3, 1.9]], ["cube", "links"], ["m", "m"])
    >>> [axes.get_ylabel() for axes in figure.axes]
    ['cube (mm)']
    """
    rows = np.asarray(objectives, dtype=float)
    if rows.ndim != 2 or rows.shape[1] != len(names) or len(units) != len(names):
        raise DataError(
            f"objectives: shape {rows.shape} given, (K, {len(names)}) expected, with a unit each"
        )
    begun = None if start is None else np.asarray(start, dtype=float)
    if begun is not None and begun.shape != rows.shape[1:]:
        raise DataError(f"start: shape {begun.shape} given, ({len(names)},) expected")
    scales = np.array([1000.0 if unit == "m" else 1.0 for unit in units])
    labels = [_label(name, unit) for name, unit in zip(names, units, strict=True)]
    rows = rows * scales
    begun = None if begun is None else begun * scales
    if rows.shape[1] == 1:
        rows = np.column_stack([rows, np.arange(1, len(rows) + 1)])
        labels.append("design of the front")
        begun = None
    others = rows.shape[1] - 1
    figure = blank(_WIDE, _TALL + _PANEL * (others - 1), ax)
    grid = figure.add_gridspec(others, 1)
    for k in range(1, others + 1):
        axes = plain_axes(figure, labels[k], labels[0], grid[k - 1])
        order = np.argsort(rows[:, k])
        axes.plot(
            rows[order, k],
            rows[order, 0],
            color=LEG_COLORS[0],
            marker="o",
            markersize=4.5,
            linewidth=0.8,
            linestyle="-" if others == 1 else "none",
            label="designs of the front" if k == 1 else None,
        )
        for mark, (name, at) in zip(cycle(_MARKS), (chosen or {}).items(), strict=False):
            label = name.replace("-", " ") if k == 1 else None
            spot(
                *(axes, rows[at, k], rows[at, 0], LEG_COLORS[1], PAPER, 8.0),
                marker=mark,
                label=label,
                zorder=5,
            )
        if begun is not None and np.isfinite(begun[[0, k]]).all():
            label = "initial machine" if k == 1 else None
            spot(axes, begun[k], begun[0], INK, PAPER, 11.0, marker="*", label=label, zorder=6)
        axes.margins(0.08)
    legend(figure, 3)
    return real_figure(figure)


def fronts_figure(
    fronts: Mapping[str, ArrayLike],
    names: Sequence[str],
    units: Sequence[str],
    *,
    ax: Axes | SubFigure | None = None,
) -> Figure:
    """Return the picture of several fronts of two objectives.

    Parameters
    ----------
    fronts : mapping of str to array, shape (K, 2)
        The two objectives of designs, by what these are.
    names, units : sequence of str
        Of the two objectives.
    ax : Axes or SubFigure, optional
        Axes of another figure, on which it is drawn; several panels take their place.

    Returns
    -------
    Figure
    """
    figure = blank(_WIDE, _TALL, ax)
    labels = [_label(name, unit) for name, unit in zip(names, units, strict=True)]
    axes = plain_axes(figure, labels[1], labels[0])
    styles = zip(fronts.items(), cycle(LEG_COLORS), cycle(_MARKS), strict=False)
    for (name, front), color, mark in styles:
        rows = np.array(front)[np.argsort(np.array(front)[:, 1])]
        axes.plot(
            *(rows[:, 1], rows[:, 0]), color=color, marker=mark, markersize=4.5, linewidth=0.8
        )
        axes.lines[-1].set_label(name)
    axes.margins(0.08)
    legend(figure, 4)
    return real_figure(figure)


def _label(name: str, unit: str) -> str:
    """Return an axis label: the objective's name and unit, with mm for m."""
    unit = "mm" if unit == "m" else unit
    said = name.replace("_", " ")
    return f"{said} ({unit})" if unit else said
