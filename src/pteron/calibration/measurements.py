"""Measurements of a machine at many poses: the joints' readings and an instrument's values there.

A row is a pose. A position, angles, a height and a distance may be measured in it; what is not, is
NaN. With more legs than coordinates the readings alone show how far they contradict each other.
`Setup` has what they refer to: marks on the platform, planes, anchors, the instrument's frame.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pteron.bodies.vectors import Vector
from pteron.errors import DataError
from pteron.kernels import as_array
from pteron.manipulator import Manipulator
from pteron.renamed import former_attribute
from pteron.shapes import JointsLike, PoseLike

KINDS = ("position", "angle", "closure", "height", "distance")
"""Kinds of measurements, each with a noise of its own.

A closure is the misfit of n readings at the pose that fits them best, n - m numbers that should be
0; its noise is that of the readings."""

VALUES, TEXTS = tuple(f"{kind}s" for kind in KINDS), ("marks", "planes", "anchors", "places")
"""Fields with what was measured in each row, by kind, and what each row is called by."""

TOOL = ""
"""Name of the mark or plane of a row that names none: the tool, and the plane z = 0."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Place:
    """A point that measurements refer to: a mark on the platform, or an anchor in the base frame.

    Parameters
    ----------
    at : vector
        Its position or, where it is not known, the start of the search for it, m.
    known : bool
        Whether it is known; else it is found with the geometry.
    """

    at: Vector = (0.0, 0.0, 0.0)
    known: bool = True


@dataclass(frozen=True)
class ReferencePlane:
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
    """Noise and reference points of a log's measurements, from the TOML file beside the log.

    Parameters
    ----------
    noise : mapping
        Standard deviation of a `position`'s coordinates, of an `angle`, a `height`, a `distance`
        and of the joints' `readings`, m or rad. What is missing has its noise found from the
        residuals; the readings' counts as none, except in closures, whose noise is then found.
    marks, planes, anchors : mapping
        By name. The tool is the mark `TOOL`; the plane `TOOL` is z = 0 unless it is given.
    frame_known : bool
        Whether the instrument measures in the base frame.
    """

    noise: Mapping[str, float] = field(default_factory=dict)
    marks: Mapping[str, Place] = field(default_factory=dict)
    planes: Mapping[str, ReferencePlane] = field(default_factory=dict)
    anchors: Mapping[str, Place] = field(default_factory=dict)
    frame_known: bool = True


def error_unit(kind: str) -> str:
    """Return the unit in which errors of a kind of measurement are shown: mrad or mm."""
    return {"angle": "mrad", "closure": "mm or mrad"}.get(kind, "mm")


def spread_rows(count: int, most: int) -> NDArray[np.int64]:
    """Return the indices of at most `most` of `count` rows, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(int))


def length_columns(robot: Manipulator) -> list[int]:
    """Return the indices of the pose's lengths among x, y and z."""
    return ["xyz".index(name) for name in robot.coordinates if name in "xyz"]


def position_axes(robot: Manipulator) -> Array:
    """Return the axes (3, 3), in rows, along which positions are measured, in the base frame."""
    cartesian = len(length_columns(robot)) in (0, 3)
    return np.eye(3) if cartesian else np.array(robot.platform.frame)


def _rows_of(measured: PoseLike | None, name: str, rows: int, columns: Sequence[str] = ()) -> Array:
    """Return measured values as an array (rows, len(columns)), or (rows,) without columns.

    All are NaN if `measured` is None. From a table, the `columns` are selected by their names. The
    `name` of the argument begins the message of an error.
    """
    shape = (rows, *([len(columns)] if columns else []))
    if measured is None:
        return np.full(shape, np.nan)
    numbers = as_array(measured, name, shape[1:], columns=columns)
    if numbers.shape != shape:
        raise DataError(
            f"{name}: shape {numbers.shape} given, {shape} expected: a row for each of the readings"
        )
    return numbers


@dataclass(frozen=True)
class Measurements:
    """N rows of measurements.

    Attributes
    ----------
    readings : array, shape (N, n)
        What the joints read, m or rad.
    positions : array, shape (N, 3)
        x, y and z of the row's mark in the instrument's frame, m; NaN where not measured. Of a
        machine with one or two of them as coordinates they are along its platform's frame at
        angles zero, else along the base frame.
    angles : array, shape (N, k)
        The pose's angles, as many as it has, rad; NaN where not measured.
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
    closures : array, shape (N, n - m)
        Of a machine with more legs than coordinates: 0, as its legs meet in one platform; NaN where
        a row's readings do not count.
    """

    readings: Array
    positions: Array
    angles: Array
    heights: Array
    distances: Array
    origins: NDArray[np.int64]
    marks: tuple[str, ...]
    planes: tuple[str, ...]
    anchors: tuple[str, ...]
    places: tuple[str, ...]
    times: Array | None = None
    setup: Setup = Setup()
    closures: Array = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        """Complete the closures, none by default, and their noise, which is the readings'."""
        noise = self.setup.noise
        if self.closures.ndim < 2:
            object.__setattr__(self, "closures", np.empty((len(self.readings), 0)))
        if self.closures.shape[1] and "readings" in noise and "closure" not in noise:
            noise = {**noise, "closure": noise["readings"]}
            object.__setattr__(self, "setup", replace(self.setup, noise=noise))

    @classmethod
    def from_readings(
        cls,
        robot: Manipulator,
        readings: JointsLike,
        *,
        poses: PoseLike | None = None,
        positions: PoseLike | None = None,
        heights: ArrayLike | None = None,
        setup: Setup | None = None,
    ) -> Measurements:
        """Return measurements of the tool: poses of P where the tool is there, else of the tool.

        Parameters
        ----------
        robot : Manipulator
            The machine.
        readings : array, shape (N, n)
            What the joints read, m or rad.
        poses : array, shape (N, m), optional
            Coordinates as measured: lengths of the tool, and angles; NaN where not.
        positions : array, shape (N, 3), optional
            Of the tool, m, in place of the poses' lengths.
        heights : array, shape (N,), optional
            Of the tool over the plane, m.
        setup : Setup, optional
            What they refer to; by default the base frame and the plane z = 0.

        Raises
        ------
        DataError
            If an array has another shape: a row for each row of readings.
        """
        read = as_array(readings, "readings", (robot.joint_count,), columns=robot.joint_names)
        read = read.reshape(-1, robot.joint_count)
        n, angular = len(read), robot.platform.angular
        coordinates = _rows_of(poses, "poses", n, robot.coordinates)
        at = np.full((n, 3), np.nan)
        at[:, length_columns(robot)] = coordinates[:, ~angular]
        if positions is not None:
            at = _rows_of(positions, "positions", n, ("x", "y", "z"))
        unnamed = (TOOL,) * n
        return cls(
            readings=read,
            positions=at,
            angles=coordinates[:, angular],
            heights=_rows_of(heights, "heights", n),
            distances=np.full(n, np.nan),
            origins=np.full(n, -1),
            marks=unnamed,
            planes=unnamed,
            anchors=unnamed,
            places=tuple(f"row {i + 1}" for i in range(n)),
            setup=setup or Setup(),
            closures=np.zeros((n, robot.redundancy)),
        )

    of = former_attribute("of", "from_readings")

    def __len__(self) -> int:
        return len(self.readings)

    @property
    def parts(self) -> dict[str, Array]:
        """The measured numbers by kind, (N, k) each; NaN where nothing was measured."""
        lengths = self.heights[:, None], self.distances[:, None]
        return dict(zip(KINDS, (self.positions, self.angles, self.closures, *lengths), strict=True))

    @property
    def kinds(self) -> list[str]:
        """The kinds of measurements of which there is at least one."""
        return [kind for kind, array in self.parts.items() if not np.isnan(array).all()]

    @property
    def kind_of(self) -> NDArray[np.str_]:
        """The kind of each of a row's numbers (K,)."""
        return np.repeat(KINDS, [array.shape[1] for array in self.parts.values()])

    def rows(self, chosen: NDArray[np.bool_]) -> Measurements:
        """Return rows chosen by a mask, and those that a distance of theirs is measured from."""
        selected = chosen.copy()
        selected[self.origins[chosen & (self.origins >= 0)]] = True
        number = np.cumsum(selected) - 1
        origins = np.where(self.origins[selected] >= 0, number[self.origins[selected]], -1)
        changed: dict[str, Any] = {
            name: tuple(np.array(getattr(self, name), dtype=object)[selected]) for name in TEXTS
        }
        for name in VALUES:
            changed[name] = getattr(self, name)[selected]
            changed[name][~chosen[selected]] = np.nan
        times = None if self.times is None else self.times[selected]
        readings = self.readings[selected]
        return replace(self, readings=readings, origins=origins, times=times, **changed)
