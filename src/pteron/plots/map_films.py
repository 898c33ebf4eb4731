"""`map_film`: a film of a map over three coordinates, a frame for each value of the last."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from pteron.errors import DataError
from pteron.maps import Map
from pteron.plots.canvas import pixels
from pteron.plots.film_encoders import ENCODERS, Pixels
from pteron.plots.films import Film, checked_film, write_film
from pteron.plots.index_maps import color_scale, map_panels
from pteron.progress import Progress

_FPS = 10.0
"""Frames a second where nothing else is asked."""

_DPI = 160
"""Pixels an inch."""


def map_film(
    index_map: Map,
    name: str,
    path: str | Path,
    *,
    fps: float = _FPS,
    progress: Progress | None = None,
) -> Film:
    """Write a film that goes through the last coordinate of a map over three.

    Its colours mean the same in all frames.

    Parameters
    ----------
    index_map : Map
        Over three coordinates.
    name : str
        The index.
    path : str or Path
        The file: .mp4 or .gif.
    fps : float
        Frames, that is values of the last coordinate, a second.
    progress : callable, optional
        Is told the share that is done, from 0 to 1.

    Returns
    -------
    Film

    Raises
    ------
    DataError
        If the map has not three coordinates, or not such an index.
    OutputError
        If the file cannot be written, or its ending is neither .mp4 nor .gif.
    PteronError
        If the encoder of MP4 files is not there; the extra `film` brings it.
    """
    target = checked_film(path)
    if len(index_map.grid.axes) != 3 or name not in index_map.values:
        raise DataError("a film needs a map over three coordinates, and an index that is in it")
    last, scales = index_map.grid.axes[-1], {name: color_scale(index_map, name)}
    rate = ENCODERS[target.suffix.lower()].rate(fps)

    def drawn(coordinate: float) -> Figure:
        """Return the figure of the map at a value of its last coordinate."""
        layer = index_map.slice_at(last.name, coordinate)
        return map_panels([(layer, name)], scales, index_map.causes)

    coordinates = last.values.tolist()
    figure = drawn(coordinates[0])
    size = _make_even(figure)
    figure.draw_without_rendering()
    places = [axes.get_position() for axes in figure.axes]
    pictures = (_pixels(drawn(coordinate), size, places) for coordinate in coordinates)
    write_film(target, pictures, len(coordinates), size, rate, progress)
    return Film(target, last.count, rate, 1.0, size)


def _make_even(figure: Figure) -> tuple[int, int]:
    """Set a figure's width and height to even numbers of pixels, which films need; return them."""
    width, height = (2 * round(_DPI * float(side) / 2.0) for side in figure.get_size_inches())
    figure.set_dpi(_DPI)
    figure.set_size_inches(width / _DPI, height / _DPI)
    return width, height


def _pixels(figure: Figure, size: tuple[int, int], places: Sequence[Bbox]) -> Pixels:
    """Return the pixels of a figure whose axes are moved to places."""
    figure.set_layout_engine("none")
    figure.set_dpi(_DPI)
    figure.set_size_inches(size[0] / _DPI, size[1] / _DPI)
    for axes, place in zip(figure.axes, places, strict=True):
        axes.set_position(place)
    return pixels(figure)
