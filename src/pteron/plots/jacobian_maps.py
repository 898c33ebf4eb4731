"""Pictures of the Jacobian over two coordinates: condition numbers, and singularities."""

from __future__ import annotations

import numpy as np
import scipy  # type: ignore[import-untyped]
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from numpy.typing import ArrayLike, NDArray

from pteron.errors import DataError
from pteron.kernels import Array, as_array
from pteron.platforms.coordinates import are_angles, coordinate
from pteron.plots.canvas import (
    GRID,
    INK,
    MUTED,
    REACH,
    WARNING,
    axis_label,
    blank,
    labelled_contours,
    plain_axes,
    real_figure,
    remark,
)

_LEVELS = np.array([1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0, 50.0, 100.0, 1000.0])
"""Levels of the condition number, the same in every picture."""

_NAMED = 6
"""Levels with lines and names: beyond, lines run together."""

_WIDTH = 4.2
"""Width of the figure, inches."""

_MARGIN = 0.6
"""Part of the figure's height for scales, inches."""


def condition_figure(
    first: ArrayLike,
    second: ArrayLike,
    condition: ArrayLike,
    *,
    names: tuple[str, str] = ("x", "y"),
    ax: Axes | SubFigure | None = None,
) -> Figure:
    """Return a figure of a condition number over two coordinates: dark is near a singularity.

    The levels are named, and are the same in every map, so that machines can be compared.

    Parameters
    ----------
    first, second : array, shape (A,) and (B,)
        The coordinates, m or rad, such as `ReachSlice` has them.
    condition : array, shape (B, A)
        1 or more; NaN or infinite where there is none. Numbers of unlike units, such as of x and
        phi, are to be made alike first: else their condition number says nothing.
    names : (str, str)
        What the coordinates are; lengths are shown in mm, angles in degrees.
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
    >>> import numpy as np, pteron
    >>> from pteron.workspace import reach_slice
    >>> delta = pteron.load("delta")
    >>> cut = reach_slice(delta, [0.0, 0.0, -0.9], points=15)
    >>> jacobians = pteron.jacobian(delta, cut.poses, on_failure="nan")
    >>> condition = np.linalg.cond(np.nan_to_num(jacobians))  # infinite where not in reach
    >>> figure = pteron.plots.condition_figure(cut.first, cut.second, condition)
    """
    figure, axes, x, y, conditions = _map(first, second, condition, names, ax)
    drawn = np.ma.masked_invalid(np.clip(conditions, 1.0, _LEVELS[-1]))
    for level in _LEVELS[1:-1]:
        if (drawn > level).any():
            axes.contourf(x, y, drawn, levels=[level, np.inf], colors=[REACH], alpha=0.17)
    labelled_contours(axes, x, y, drawn, _LEVELS[:_NAMED])
    _rim(axes, x, y, conditions)
    return real_figure(figure)


def singularities_figure(
    first: ArrayLike,
    second: ArrayLike,
    determinant: ArrayLike,
    *,
    names: tuple[str, str] = ("x", "y"),
    ax: Axes | SubFigure | None = None,
) -> Figure:
    """Return a figure of a determinant's sign over two coordinates: it changes at singular poses.

    Of the Jacobian of q' = J x' these are the type-II singularities, where the actuators, held
    still, no longer hold the platform. Regions of the two signs are shaded, and marked + and -: no
    motion leads from one to the other but through a singularity.

    Parameters
    ----------
    first, second : array, shape (A,) and (B,)
        The coordinates, m or rad.
    determinant : array, shape (B, A)
        Of any unit; NaN where there is none.
    names : (str, str)
        What the coordinates are; lengths are shown in mm, angles in degrees.
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
    >>> import numpy as np, pteron
    >>> x, phi = np.linspace(-0.1, 0.1, 11), np.linspace(-3.0, 3.0, 41)
    >>> poses = np.zeros((41, 11, 4))
    >>> poses[..., 0], poses[..., 3] = np.meshgrid(x, phi)
    >>> robot = pteron.load("quadrupteron")
    >>> determinant = np.linalg.det(pteron.jacobian(robot, poses, on_failure="nan"))
    >>> figure = pteron.plots.singularities_figure(x, phi, determinant, names=("x", "phi"))
    """
    figure, axes, x, y, determinants = _map(first, second, determinant, names, ax)
    # Near type I it goes to infinity, which hides nothing of its sign.
    size = float(np.nanmedian(np.abs(determinants))) if np.isfinite(determinants).any() else 1.0
    drawn = np.ma.masked_invalid(np.arctan(determinants / (size or 1.0)))
    for sign, color, alpha in ((1.0, REACH, 0.30), (-1.0, GRID, 0.75)):
        if (sign * drawn > 0.0).any():
            axes.contourf(x, y, sign * drawn, levels=[0.0, 2.0], colors=[color], alpha=alpha)
            row, column = _middle(np.asarray((sign * drawn > 0.0).filled(False)))
            remark(axes, "+" if sign > 0.0 else "\u2212", float(x[column]), float(y[row]), INK)
    if drawn.min() < 0.0 < drawn.max():
        axes.contour(x, y, drawn, levels=[0.0], colors=[WARNING], linewidths=2.0)
    _rim(axes, x, y, determinants)
    return real_figure(figure)


def _middle(region: NDArray[np.bool_]) -> tuple[int, int]:
    """Return the row and column in a region (B, A) that are farthest from its boundary."""
    depth = scipy.ndimage.distance_transform_edt(np.pad(region, 1))[1:-1, 1:-1]
    row, column = np.unravel_index(int(depth.argmax()), region.shape)
    return int(row), int(column)


def _map(
    first: ArrayLike,
    second: ArrayLike,
    measure: ArrayLike,
    names: tuple[str, str],
    ax: Axes | SubFigure | None,
) -> tuple[Figure, Axes, Array, Array, Array]:
    """Return a figure, its axes, both coordinates in mm and degrees, and a measure (B, A)."""
    scaled, labels = [], []
    for axis_values, name in zip((first, second), names, strict=True):
        numbers = as_array(axis_values, name, ())
        if numbers.ndim != 1 or len(numbers) < 2 or not (np.diff(numbers) > 0.0).all():
            raise DataError(f"{name}: two or more numbers expected that ascend, m or rad")
        scaled.append(coordinate(name).shown_factor * numbers)
        labels.append(axis_label(name))
    x, y = scaled
    array = np.asarray(measure, dtype=float)
    if array.shape != (len(y), len(x)):
        raise DataError(f"values: shape {array.shape} given, ({len(y)}, {len(x)}) expected")
    alike = len(set(are_angles(names).tolist())) == 1
    height = _MARGIN + (_WIDTH - _MARGIN) * (float(np.ptp(y) / np.ptp(x)) if alike else 0.75)
    figure = blank(_WIDTH, min(max(height, 1.8), 6.0), ax)
    axes = plain_axes(figure, *labels)
    axes.grid(visible=False)
    if alike:
        axes.set_aspect("equal")
    axes.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
    return figure, axes, x, y, np.where(np.isfinite(array), array, np.nan)


def _rim(axes: Axes, x: Array, y: Array, measure: Array) -> None:
    """Draw the boundary of the region in which a measure is finite."""
    known = np.isfinite(measure).astype(float)
    if known.min() < known.max():
        axes.contour(x, y, known, levels=[0.5], colors=[MUTED], linewidths=1.0)
