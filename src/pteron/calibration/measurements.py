"""Measurements of a machine at many poses: the joints' readings, and what an instrument saw there.

A row is a pose. Any of pose columns, a height and a distance may be measured in it, the others are
NaN; `Setup` says of what: marks on the platform, planes, anchors and the instrument's frame.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pteron.bodies.vectors import Vector

TOOL = ""
"""The name of the mark, plane or anchor of a row that names none: the tool, the only plane."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Place:
    """A point that measurements speak of: a mark on the platform, or an anchor in the base frame.

    Parameters
    ----------
    at : vector
        Where it is, or, if it is not known, where it is sought from, m.
    known : bool
        Whether it is known; else it is found with the geometry.
    """

    at: Vector = (0.0, 0.0, 0.0)
    known: bool = True


@dataclass(frozen=True)
class Plane:
    """The plane normal . p = offset in the base frame, above which heights are counted.

    Parameters
    ----------
    normal : unit vector
        Heights grow along it.
    offset : float
        m.
    known : bool
        Whether it is known; else it is found with the geometry.
    """

    normal: Vector = (0.0, 0.0, 1.0)
    offset: float = 0.0
    known: bool = True


@dataclass(frozen=True)
class Setup:
    """What the measurements of a log refer to, as the TOML file beside it says.

    Parameters
    ----------
    noise : mapping
        Standard deviation by column (a pose's, `height`, `distance`), m or rad; under "readings"
        that of the joints' readings. A column that is missing has its noise found.
    marks, planes, anchors : mapping
        By name. The tool is the mark `TOOL`; the plane `TOOL` is z = 0 unless it is given.
    frame_known : bool
        Whether the instrument measures in the base frame.
    """

    noise: Mapping[str, float] = field(default_factory=dict)
    marks: Mapping[str, Place] = field(default_factory=dict)
    planes: Mapping[str, Plane] = field(default_factory=dict)
    anchors: Mapping[str, Place] = field(default_factory=dict)
    frame_known: bool = True


@dataclass(frozen=True)
class Measurements:
    """N rows of measurements.

    Attributes
    ----------
    readings : array, shape (N, n)
        What the joints read, m or rad.
    poses : array, shape (N, m)
        The pose's coordinates as measured, in the instrument's frame; its lengths are those of the
        row's mark. NaN where not measured.
    heights : array, shape (N,)
        Of the row's mark over the row's plane, along its normal, m; NaN where not measured.
    distances : array, shape (N,)
        From the row's mark to its anchor, or to where the mark of another row was, m; else NaN.
    origins : array of int, shape (N,)
        That other row, from 0; -1 where there is none.
    marks, planes, anchors : tuple of str
        Of each row; `TOOL` where it names none.
    places : tuple of str
        Where each row stands in its file, for messages: "bed.csv, line 7".
    times : array, shape (N,), optional
        s, in the order taken.
    setup : Setup
        What they refer to.
    """

    readings: Array
    poses: Array
    heights: Array
    distances: Array
    origins: NDArray[np.int64]
    marks: tuple[str, ...]
    planes: tuple[str, ...]
    anchors: tuple[str, ...]
    places: tuple[str, ...]
    times: Array | None = None
    setup: Setup = Setup()

    @classmethod
    def of(
        cls,
        readings: Array,
        *,
        poses: Array | None = None,
        heights: Array | None = None,
        setup: Setup = Setup(),  # noqa: B008 - frozen
    ) -> Measurements:
        """Return measurements of the tool: whole or partial poses, heights, or both."""
        readings = np.asarray(readings, dtype=float)
        n = len(readings)
        none = np.full(n, np.nan)
        unnamed = (TOOL,) * n
        return cls(
            readings,
            np.full(readings.shape, np.nan) if poses is None else np.asarray(poses, dtype=float),
            none if heights is None else np.asarray(heights, dtype=float),
            none,
            np.full(n, -1),
            unnamed,
            unnamed,
            unnamed,
            tuple(f"row {i + 1}" for i in range(n)),
            None,
            setup,
        )

    def __len__(self) -> int:
        return len(self.readings)

    def rows(self, chosen: NDArray[np.bool_]) -> Measurements:
        """Return some of the rows, chosen by a mask; a row takes those it is measured from along."""
        kept = chosen.copy()
        kept[self.origins[chosen & (self.origins >= 0)]] = True
        number = np.cumsum(kept) - 1
        origins = np.where(self.origins[kept] >= 0, number[self.origins[kept]], -1)
        at = np.flatnonzero(kept)
        unasked = ~chosen[kept]

        def measured(values: Array) -> Array:
            part = values[kept].copy()
            part[unasked] = np.nan
            return part

        return Measurements(
            self.readings[kept],
            measured(self.poses),
            measured(self.heights),
            measured(self.distances),
            origins,
            tuple(self.marks[i] for i in at),
            tuple(self.planes[i] for i in at),
            tuple(self.anchors[i] for i in at),
            tuple(self.places[i] for i in at),
            None if self.times is None else self.times[kept],
            self.setup,
        )
