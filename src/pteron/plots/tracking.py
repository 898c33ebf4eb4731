"""Picture of the tracking errors of a simulated machine over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from numpy.typing import ArrayLike

from pteron.kernels import Array
from pteron.platforms.coordinates import coordinate
from pteron.plots.canvas import blank, groups_of, legend, real_figure, stack, zero_line
from pteron.plots.joint_columns import rows
from pteron.plots.leg_curves import leg_curves

_SCALES = ((1.0, ""), (1e3, "m"), (1e6, "µ"), (1e9, "n"))
"""Factors and prefixes of units."""


def tracking_figure(
    time: ArrayLike, error: ArrayLike, names: Sequence[str], *, ax: Axes | SubFigure | None = None
) -> Figure:
    """Return a figure of the errors (T, m) of the pose over time (T,), s.

    `names` are its coordinates; angles, in rad, have axes of their own, lengths are in m.
    """
    time, error = rows(time, error, "error", len(names))
    groups = groups_of([coordinate(name).unit for name in names])
    scales = [_scale(error[:, columns]) for columns in groups.values()]
    labels = [f"error ({scales[k][1]}{unit})" for k, unit in enumerate(groups)]
    figure = blank(5.4, 1.6 + 1.6 * len(groups), ax)
    panels = stack(figure, "time (s)", labels)
    for axes, columns, (factor, _) in zip(panels, groups.values(), scales, strict=True):
        zero_line(axes)
        leg_curves(axes, time, factor * error, columns, 1.4, names)
    legend(figure, len(names))
    return real_figure(figure)


def _scale(errors: Array) -> tuple[float, str]:
    """Return the factor and the SI prefix that make the largest value a number above 1."""
    largest = float(np.abs(errors).max(initial=0.0))
    return next((pair for pair in _SCALES if largest * pair[0] >= 1.0), _SCALES[-1])
