"""Tables of a workspace, and of the cell around it: of a search's file, and of a task's."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from pteron.bodies.tables import Number, Three, TomlTable, Two, key
from pteron.design.load_tables import Least, Positive
from pteron.kernels import Array

_FAR = 20.0
"""Length, m, from which a workspace or a cell was probably given in millimetres."""

_COARSE = 0.02
"""Error, m, from which it was probably given in millimetres."""

_LEANS = 1.5
"""Angle, rad, that a tilt must be below."""

_TURNS = 7.0
"""Angle, rad, from which a turn was probably given in degrees."""


def _expect_near(coordinates: Any) -> Any:
    """Return coordinates in m; raise if they are too large for a machine's cell."""
    lengths = np.abs(coordinates).ravel()
    if lengths.max() > _FAR:
        raise ValueError(f"{lengths.max():g} m given: are these mm?")
    return coordinates


def _fine(error: float) -> float:
    """Return an accuracy (error), m; raise if it is too large for a machine."""
    if error > _COARSE:
        raise ValueError(f"{error:g} m given: is this mm?")
    return error


def _expect_tilt(angle: float) -> float:
    """Return a tilt in rad; raise if it is too large, as an angle in degrees is."""
    if angle >= _LEANS:
        raise ValueError(f"{angle:g} rad given, below {_LEANS:g} expected: is this in degrees?")
    return angle


def _expect_turn(turn: tuple[float, float]) -> tuple[float, float]:
    """Return the range [low, high] of a turn, rad; raise if it is empty, or given in degrees."""
    if not turn[0] < turn[1]:
        raise ValueError(f"{list(turn)} given, [low, high] expected, rad")
    if max(map(abs, turn)) > _TURNS:
        raise ValueError(f"{list(turn)} rad given: are these degrees?")
    return turn


def expect_near_points(points: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
    """Return points; raise if their first two coordinates, m, are too large for a cell."""
    _expect_near([point[:2] for point in points])
    return points


Near = Annotated[Positive, AfterValidator(_expect_near)]
"""A length above 0 and of a cell's size, m."""

Fine = Annotated[Positive, AfterValidator(_fine)]
"""A greatest error above 0, m."""

Place = Annotated[Three, AfterValidator(_expect_near)]
"""A place in a cell, m."""


class WorkspaceTable(TomlTable):
    """`[workspace]`: the region in which the machine must work, and its orientations there.

    A box given by its sides, a cube or a cylinder may have no center: then it floats, and each
    design has it where the machine does best. A machine that only turns has no places: its
    workspace is a tilt, ranges of angles, or both.
    """

    low: tuple[Number, ...] | None = key("a box's least x, y, z, m", None)
    high: tuple[Number, ...] | None = key("a box's greatest x, y, z, m", None)
    sides: tuple[Positive, ...] | None = key("of a box, in place of these, m", None)
    center: tuple[Number, ...] | None = key(
        "of a box of sides, a cube or a cylinder, m; left out, it floats", None
    )
    edge: Positive | None = key("of a cube, m", None)
    radius: Positive | None = key("of a cylinder, m", None)
    height: Positive | None = key("of a cylinder, m", None)
    axis: Literal["x", "y", "z"] = key("of a cylinder", "z")
    tilt: Annotated[Positive, AfterValidator(_expect_tilt)] | None = key(
        "of the platform to every side, rad: all tilts up to it are needed", None
    )
    angles: dict[str, Annotated[Two, AfterValidator(_expect_turn)]] | None = key(
        "least and greatest value of angles of the pose, rad, by name", None
    )
    samples: Annotated[int, Field(ge=2, le=41, strict=True)] = key(
        "poses along each of its sides", 5
    )

    @model_validator(mode="before")
    @classmethod
    def _add_no_place(cls, table: Any) -> Any:
        """Return the table; one that states orientations alone has a box of no coordinates."""
        if isinstance(table, dict) and set() < set(table) - {"samples"} <= {"tilt", "angles"}:
            return table | {"low": (), "high": ()}
        return table

    @model_validator(mode="after")
    def _one_shape(self) -> Self:
        """Return the workspace; raise unless its keys state exactly a box, a cube or a cylinder."""
        keys = ("low", "high", "sides", "center", "edge", "radius", "height")
        keys_present = {key for key in keys if getattr(self, key) is not None}
        valid_sets = ({"low", "high"}, {"sides"}, {"edge"}, {"radius", "height"})
        if keys_present not in valid_sets and keys_present - {"center"} not in valid_sets[1:]:
            raise ValueError(
                f"{', '.join(sorted(keys_present)) or 'nothing'} given; a box has low and high, or "
                "sides, a cube edge, a cylinder radius and height; these three have a center, or "
                "float"
            )
        pairs = ((self.low, self.high), (self.sides, self.center))
        if any(a is not None and b is not None and len(a) != len(b) for a, b in pairs):
            raise ValueError("unlike numbers of coordinates given")
        if self.low is not None and not all(
            a < b for a, b in zip(self.low, self.high or (), strict=True)
        ):
            raise ValueError(f"low {list(self.low)} is not below high {list(self.high or ())}")
        return self

    @property
    def shape(self) -> Literal["box", "cube", "cylinder"]:
        """Whether the workspace is a "box", a "cube" or a "cylinder"."""
        if self.radius is not None:
            return "cylinder"
        return "cube" if self.edge is not None else "box"

    @property
    def floats(self) -> bool:
        """Whether the workspace has no fixed place, but may be placed anywhere."""
        return self.low is None and self.center is None

    @property
    def words(self) -> str:
        """The workspace's shape, size and place as text."""
        sizes = " x ".join(f"{1e3 * side:.4g}" for side in self.dimensions(self.lengths or 1))
        text = f"{self.shape} of {sizes} mm" if sizes else "orientations"
        text += ", wherever the machine does best" if self.floats else ""
        return f"workspace: {text}{self.range_words}"

    @property
    def range_words(self) -> str:
        """The ranges of orientations as text that follows; empty without."""
        tilt = "" if self.tilt is None else f", at every tilt up to {self.tilt:g} rad"
        ranges = (f", {name} {a:g} to {b:g} rad" for name, (a, b) in (self.angles or {}).items())
        return tilt + "".join(ranges)

    @property
    def has_ranges(self) -> bool:
        """Whether the machine must reach ranges of orientations."""
        return self.tilt is not None or bool(self.angles)

    def with_center(self, center: Iterable[float]) -> Self:
        """Return a copy of the workspace centred at `center` (k,), m."""
        return self.model_copy(update={"center": tuple(map(float, center))})

    def dimensions(self, count: int) -> tuple[float, ...]:
        """Return the sides (count,) of the box around the workspace, m."""
        if self.low is not None and self.high is not None:
            return tuple(b - a for a, b in zip(self.low, self.high, strict=True))
        if self.radius is not None and self.height is not None:
            return tuple(
                self.height if letter == self.axis else 2.0 * self.radius for letter in "xyz"
            )
        return self.sides or (self.edge or 0.0,) * count

    @property
    def ends(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Lower and upper corner of the box around a placed workspace, m."""
        if self.low is not None and self.high is not None:
            return self.low, self.high
        center = self.center or ()
        halves = [side / 2.0 for side in self.dimensions(len(center))]
        ends = tuple(
            zip(*((x - h, x + h) for x, h in zip(center, halves, strict=True)), strict=True)
        )
        return ends[0], ends[1]

    @property
    def lengths(self) -> int | None:
        """Number of the workspace's length coordinates; None if any number fits."""
        if self.low is not None:
            return len(self.low)
        return len(self.sides or self.center or ()) or (3 if self.radius else None)


class ToolWorkspaceTable(TomlTable):
    """`[workspace]`: the positions of the tool's centre point: a box, a cylinder or a list."""

    size: Annotated[tuple[Near, ...], Field(min_length=2, max_length=3)] | None = key(
        "sides of a box, m; two for a flat one", None
    )
    radius: Near | None = key("of an upright cylinder, m", None)
    height: Near | None = key("of the cylinder, m", None)
    poses: Annotated[list[tuple[Number, ...]], Field(min_length=1)] | None = key(
        "positions, all of which must be met: x y z, m", None
    )
    center: Place | None = key(
        "its middle in the cell, m; left out, it may be anywhere in the cell", None
    )
    turn: Two | None = key("least and greatest turn about the upright, rad", None)
    tilt: Annotated[Positive, AfterValidator(_expect_tilt)] | None = key(
        "of the platform to every side, rad: it fills a cone", None
    )
    directions: Annotated[list[Three], Field(min_length=1)] | None = key(
        "of the platform's z, at each of which it must work; level is [0, 0, 1]", None
    )

    @model_validator(mode="after")
    def _one_shape(self) -> Self:
        """Return the workspace; raise unless it has one shape and valid turns and directions."""
        keys = ("size", "radius", "height", "poses")
        keys_present = [key for key in keys if getattr(self, key) is not None]
        if keys_present not in (["size"], ["radius", "height"], ["poses"]):
            raise ValueError(
                f"{', '.join(keys_present) or 'nothing'} given; a box has size, a cylinder radius "
                "and height, anything else a list of poses"
            )
        if self.poses is not None and {len(vector) for vector in self.poses} not in ({2}, {3}):
            raise ValueError("poses: each has x y, or x y z")
        _expect_near(self.poses or 0.0)
        if self.turn is not None and not self.turn[0] < self.turn[1]:
            raise ValueError(f"turn: {list(self.turn)} given, [low, high] expected, rad")
        if self.turn is not None and max(map(abs, self.turn)) > _TURNS:
            raise ValueError(f"turn: {list(self.turn)} rad given: are these degrees?")
        if self.directions is not None and not all(vector[2] > 0.0 for vector in self.directions):
            raise ValueError("directions: each leads upwards; z above 0 expected")
        return self

    @property
    def half(self) -> Array:
        """Half the sides (3,) of the box around the workspace, m."""
        if self.poses is not None:
            sides = np.ptp(np.array(self.poses), axis=0)
        elif self.radius is not None and self.height is not None:
            sides = np.array([2.0 * self.radius, 2.0 * self.radius, self.height])
        else:
            sides = np.array(self.size)
        return np.pad(0.5 * sides, (0, 3 - len(sides)))

    def meets(self, low: Array, high: Array) -> bool:
        """Return whether the tool's workspace meets a box of corners (3,), m, about its middle."""
        if self.poses is not None:
            poses = np.pad(self.poses, ((0, 0), (0, 3 - len(self.poses[0]))))
            poses = poses - 0.5 * (poses.min(axis=0) + poses.max(axis=0))
            return bool(((poses > low) & (poses < high)).all(axis=1).any())
        half = self.half
        if not ((low < half) & (high > -half) | (half == 0.0) & (low < 0.0) & (high > 0.0)).all():
            return False
        nearest = np.hypot(*np.clip(0.0, low, high)[:2])
        return self.radius is None or bool(nearest < self.radius)

    @property
    def tilts(self) -> bool:
        """Whether the workspace requires the platform to tilt."""
        return self.tilt is not None or self.directions is not None

    @property
    def words(self) -> str:
        """The workspace's shape and size as text."""
        if self.size is not None:
            return f"workspace {' x '.join(f'{1e3 * x:g}' for x in self.size)} mm"
        if self.poses is not None:
            return f"workspace of {len(self.poses)} pose{'s' if len(self.poses) > 1 else ''}"
        return f"workspace: cylinder of radius {self.radius:g} m, height {self.height:g} m"


class KeepOutTable(TomlTable):
    """`[[keep_out]]`: a box in which no part of the machine may be."""

    low: Place = key("m; from the middle of a workspace that floats")
    high: Place = key("m")

    @model_validator(mode="after")
    def _rises(self) -> Self:
        """Return the box; raise unless each low end is below the high end."""
        if not all(a < b for a, b in zip(self.low, self.high, strict=True)):
            raise ValueError(f"low {list(self.low)} is not below high {list(self.high)}")
        return self


class CellTable(TomlTable):
    """`[cell]`: the space for the machine."""

    footprint: tuple[Near, Near] | None = key("along x and y, m", None)
    height: Near | None = key("m", None)
    low: Place | None = key("of a cell with a place of its own, m", None)
    high: Place | None = key("m", None)
    margin: Least = key("half the width of bodies about their middle lines, m", 0.03)
