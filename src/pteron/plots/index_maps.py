"""Pictures of maps of indices over poses: coloured in reach, outside it hatched by the cause."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import scipy  # type: ignore[import-untyped]
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize, to_hex, to_rgb
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, NullFormatter

from pteron.errors import DataError
from pteron.kernels import Array
from pteron.maps import Axis, Map, Summary
from pteron.maps.map import MARGIN, cause
from pteron.platforms.coordinates import coordinate
from pteron.plots.canvas import (
    FONT_SIZE,
    GRID,
    INK,
    MUTED,
    PAPER,
    axis_label,
    blank,
    plain_axes,
    real_figure,
    shown_unit,
    spot,
)
from pteron.plots.leg_curves import LEG_COLORS
from pteron.tolerances import EXACT, SAME
from pteron.workspace import BEYOND_LIMITS, REACHABLE

_WIDTH = 5.0
"""Width of the figure, inches: texts stay legible on a phone."""

_HATCHES = {
    BEYOND_LIMITS: "....",
    1: "////",
    2: "\\\\\\\\",
    3: "xxxx",
    4: "----",
    5: "||||",
    6: "++++",
}
"""Hatches by the status of a pose: beyond a limit, or out of reach of leg 1 to 6."""

_WIDE = 20.0
"""Ratio of the greatest value to the median above which colours are logarithmic."""

_LAST = 99.0
"""Percentile of the last colour where a few values are far off."""

_BELOW = 4.5
"""Sizes of a letter from the axes to the legend: the scale's numbers and its name stand there."""


def map_figure(index_map: Map, *names: str, ax: Axes | SubFigure | None = None) -> Figure:
    """Return the picture of a map: a panel for each index, in a column.

    Over one coordinate it is a curve, over two a plane. Over three it is the three planes through
    the pose that is deepest among those that serve, one below the other, and the indices stand side
    by side. Colours are for the colour-blind too (cividis),
    and the bright ones are always the better ones. Lengths are in mm, angles in degrees.

    Parameters
    ----------
    index_map : Map
        Over one to three coordinates.
    *names : str
        Its indices; by default all.
    ax : Axes or SubFigure, optional
        Axes of another figure, on which it is drawn; several panels take their place.

    Returns
    -------
    Figure

    Raises
    ------
    DataError
        If it has more coordinates, or not such an index.

    Examples
    --------
    >>> from pteron.maps import map_index, pose_grid
    >>> from pteron.plots import map_figure
    >>> grid = pose_grid("delta", {"z": -0.9}, points=31)
    >>> figure = map_figure(map_index("delta", "condition", grid))
    """
    chosen = names or tuple(index_map.values)
    for name in chosen:
        if name not in index_map.values:
            raise DataError(f"{name}: is not in this map; it has {', '.join(index_map.values)}")
    planes = _planes(index_map)
    scales = {name: color_scale(index_map, name) for name in chosen}
    panels = [(plane, name) for plane in planes for name in chosen]
    return map_panels(panels, scales, {}, len(chosen) if len(planes) > 1 else 1, ax)


def _planes(volume: Map) -> list[Map]:
    """Return a map of up to two coordinates, or the planes through the middle of three."""
    axes = volume.grid.axes
    if len(axes) < 3:
        return [volume]
    if len(axes) > 3:
        raise DataError(
            f"{', '.join(axis.name for axis in axes)} vary: a picture shows three coordinates; "
            "hold the others"
        )
    depth = scipy.ndimage.distance_transform_edt(np.pad(volume.reachable, 1))[1:-1, 1:-1, 1:-1]
    middle = np.unravel_index(int(depth.argmax()), depth.shape)
    places = [axis.values[i] for axis, i in zip(axes, middle, strict=True)]
    return [
        volume.slice_at(axis.name, float(place))
        for axis, place in zip(reversed(axes), reversed(places), strict=True)
    ]


def color_scale(shown_map: Map, name: str) -> Normalize:
    """Return the colour scale of an index's values."""
    factor = shown_unit(shown_map.index(name).unit)[0]
    known = (
        factor * shown_map.values[name][shown_map.reachable & np.isfinite(shown_map.values[name])]
    )
    if not len(known):
        return Normalize(0.0, 1.0)
    low, high = float(known.min()), float(known.max())
    if high - low <= SAME * max(abs(low), abs(high)):
        return Normalize(0.9 * low, 1.1 * low + EXACT)
    middle, last = np.percentile(known, [50.0, _LAST]).tolist()
    if low > 0.0 and high > _WIDE * middle:
        return LogNorm(low, last if last > low else high)
    return Normalize(
        low, last if shown_map.index(name).better == "less" and high > 3.0 * last else high
    )


def map_panels(
    panels: Sequence[tuple[Map, str]],
    scales: Mapping[str, Normalize],
    causes: Mapping[str, Any],
    columns: int = 1,
    ax: Axes | SubFigure | None = None,
) -> Figure:
    """Return a figure of panels whose legends all list these causes."""
    heights = [_height(plane) for plane, _ in panels[::columns]]
    figure = blank(columns * _WIDTH, sum(heights), ax)
    grid = figure.add_gridspec(len(heights), columns, height_ratios=heights)
    for k, (plane, name) in enumerate(panels):
        labels = [axis_label(axis.name) for axis in plane.grid.axes]
        upright = labels[1] if len(labels) > 1 else _index_label(plane, name)
        axes = plain_axes(figure, labels[0], upright, grid[divmod(k, columns)])
        axes.set_title(_title(plane), fontsize=FONT_SIZE, color=INK, loc="left")
        if len(labels) == 1:
            _curve(axes, plane, name)
        else:
            _plane(figure, axes, plane, name, scales[name], causes)
    return real_figure(figure)


def _height(plane: Map) -> float:
    """Return the height of a panel with its titles, scale and legend, inches."""
    if len(plane.grid.axes) < 2:
        return 3.2
    first, second = plane.grid.axes
    if first.unit != second.unit:
        return 4.4
    shape = (second.greatest - second.least) / (first.greatest - first.least)
    return min(max(1.35 + 3.6 * shape, 2.4), 6.5)


def _plane(
    figure: Figure, axes: Axes, plane: Map, name: str, scale: Normalize, causes: Mapping[str, Any]
) -> None:
    """Draw an index over two coordinates."""
    axes.grid(visible=False)
    first, second = (_axis_values(axis) for axis in plane.grid.axes)
    factor = shown_unit(plane.index(name).unit)[0]
    cells = factor * np.ma.masked_invalid(plane.values[name].T)
    drawn = np.ma.masked_where(plane.status.T != REACHABLE, cells)
    better = plane.index(name).better == "more"
    mesh = axes.pcolormesh(
        first,
        second,
        drawn,
        norm=scale,
        cmap="cividis" if better else "cividis_r",
        shading="nearest",
        rasterized=True,
    )
    handles = _hatch_unreachable(axes, plane, name, causes)
    if drawn.count():
        _mark_best(axes, plane, name, handles)
    bar = figure.colorbar(
        mesh, ax=axes, fraction=0.05, pad=0.02, extend=_colorbar_extension(drawn, scale)
    )
    direction = "bright is better"
    if drawn.count() and _is_constant(summary := plane.statistics(name)):
        bar.set_ticks([factor * summary.best], labels=[f"{factor * summary.best:.4g}"])
        direction = "the same everywhere here"
    elif isinstance(scale, LogNorm):
        bar.ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        bar.ax.yaxis.set_major_formatter("{x:g}")
        bar.ax.yaxis.set_minor_formatter(NullFormatter())
    bar.set_label(f"{_index_label(plane, name)}\n{direction}", fontsize=FONT_SIZE, color=INK)
    bar.ax.tick_params(labelsize=FONT_SIZE - 1.0, colors=INK, color=MUTED)
    outline: Any = bar.outline
    outline.set_visible(False)
    axes.set(xlim=(first[0], first[-1]), ylim=(second[0], second[-1]))
    if plane.grid.axes[0].unit == plane.grid.axes[1].unit:
        axes.set_aspect("equal")
    if handles:
        axes.legend(
            handles=handles,
            loc="upper center",
            bbox_to_anchor=(0.5, 0.0),
            borderaxespad=_BELOW,
            ncols=2,
            frameon=False,
            fontsize=FONT_SIZE - 1.0,
            labelcolor=INK,
        )


def _colorbar_extension(drawn: Any, scale: Normalize) -> str:
    """Return matplotlib's name for the ends of the colour scale that values exceed."""
    low, high = float(scale.vmin or 0.0), float(scale.vmax or 0.0)
    slack = SAME * (high - low)
    under = drawn.count() > 0 and float(drawn.min()) < low - slack
    over = drawn.count() > 0 and float(drawn.max()) > high + slack
    return ("both" if over else "min") if under else ("max" if over else "neither")


def _hatch_unreachable(axes: Axes, plane: Map, name: str, causes: Mapping[str, Any]) -> list[Any]:
    """Hatch the unusable poses, and return the entries of the legend."""
    first, second = (_axis_values(axis) for axis in plane.grid.axes)
    status, by_cause = plane.status.T, name == MARGIN.name
    handles: dict[str, Any] = {}
    for code in (BEYOND_LIMITS, *range(1, len(_HATCHES))):
        here = status == code
        if not here.any() and cause(code) not in causes:
            continue
        known = by_cause or code == BEYOND_LIMITS
        face = _light(LEG_COLORS[code - 1]) if by_cause and code != BEYOND_LIMITS else GRID
        hatch = _HATCHES[code if known else 1]
        if here.any():
            region = axes.contourf(
                *(first, second, here.astype(float)),
                levels=[0.5, 1.5],
                colors=[face],
                hatches=[hatch],
            )
            region.set(edgecolor=MUTED, linewidth=0.0)
        label = cause(code) if known else "out of reach"
        handles[label] = Patch(facecolor=face, edgecolor=MUTED, hatch=hatch, label=label, lw=0.0)
    undetermined = (status == REACHABLE) & ~np.isfinite(plane.values[name].T)
    if undetermined.any():
        axes.contourf(*(first, second, undetermined.astype(float)), levels=[0.5, 1.5], colors=[INK])
        label = "singular: not determined"
        handles[label] = Patch(facecolor=INK, label=label, lw=0.0)
    serves = (status == REACHABLE).astype(float)
    if 0.0 == serves.min() < serves.max():
        axes.contour(first, second, serves, levels=[0.5], colors=[MUTED], linewidths=0.8)
    return list(handles.values())


def _mark_best(axes: Axes, plane: Map, name: str, handles: list[Any]) -> None:
    """Mark the best pose of a plane, unless the index is constant."""
    summary = plane.statistics(name)
    if _is_constant(summary):
        return
    factor = shown_unit(summary.unit)[0]
    at = [
        shown_unit(axis.unit)[0] * summary.best_pose[plane.grid.coordinates.index(axis.name)]
        for axis in plane.grid.axes
    ]
    label = f"best here: {factor * summary.best:.4g} {_unit(plane, name)}".rstrip()
    spot(axes, at[0], at[1], PAPER, INK, 6.0, zorder=5, label=label, clip_on=False)
    handles.append(axes.lines[-1])


def _is_constant(summary: Summary) -> bool:
    """Return whether an index is constant over the map, up to rounding."""
    return abs(summary.best - summary.worst) <= SAME * abs(summary.best)


def _curve(axes: Axes, curve: Map, name: str) -> None:
    """Draw an index over one coordinate."""
    place = _axis_values(curve.grid.axes[0])
    factor = shown_unit(curve.index(name).unit)[0]
    serves = curve.reachable
    axes.plot(place, np.where(serves, factor * curve.values[name], np.nan), color=INK)
    axes.set(xlim=(place[0], place[-1]))
    if not serves.all():
        axes.fill_between(
            place,
            *(0.0, 1.0),
            where=(~serves).tolist(),
            transform=axes.get_xaxis_transform(),
            facecolor=GRID,
            edgecolor=MUTED,
            hatch="////",
            linewidth=0.0,
            label="out of reach or beyond a joint's limit",
        )
        axes.legend(frameon=False, fontsize=FONT_SIZE - 1.0, labelcolor=INK)


def _light(color: str) -> str:
    """Return a colour mixed with white."""
    red, green, blue = (0.75 + 0.25 * part for part in to_rgb(color))
    return to_hex((red, green, blue))


def _axis_values(axis: Axis) -> Array:
    """Return the coordinates of a map's axis in the units shown."""
    return coordinate(axis.name).shown_factor * axis.values


def _index_label(index_map: Map, name: str) -> str:
    """Return the label of a map's index: its title, with its unit if it has a unit."""
    unit = _unit(index_map, name)
    return f"{index_map.index(name).title} ({unit})" if unit else index_map.index(name).title


def _unit(index_map: Map, name: str) -> str:
    """Return the unit in which an index is shown."""
    return shown_unit(index_map.index(name).unit)[1]


def _title(shown_map: Map) -> str:
    """Return the machine's name and the fixed coordinates."""
    pairs = ((coordinate(name), fixed) for name, fixed in shown_map.grid.fixed_coordinates.items())
    constants = (
        f"{c.symbol} = {c.shown_factor * fixed + 0.0:.4g}{' ' * (c.unit == 'm')}{c.shown_unit}"
        for c, fixed in pairs
    )
    return "  ".join([shown_map.robot, *constants])
