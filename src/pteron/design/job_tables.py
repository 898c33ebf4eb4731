"""The tables of a job's TOML file, each checked by itself, as pydantic models."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, field_validator, model_validator

from pteron.bodies.tables import Count, Number, Three, TomlTable, Two, key
from pteron.design.load_tables import Least, PayloadTable, Positive, as_list
from pteron.design.spec import Floor
from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.manipulator.dimensions import Stock

_FAR = 20.0
"""Length, m, from which a workspace or a cell was probably given in millimetres."""

_COARSE = 0.02
"""Error, m, from which it was probably given in millimetres."""

_LEANS = 1.5
"""Angle, rad, that a tilt must be below."""

_TURNS = 7.0
"""Angle, rad, from which a turn was probably given in degrees."""


def _expect_near(coordinates: Any) -> Any:
    """Refuse lengths, m, that are too large for a cell."""
    lengths = np.abs(coordinates).ravel()
    if lengths.max() > _FAR:
        raise ValueError(f"{lengths.max():g} m given: are these mm?")
    return coordinates


def _fine(error: float) -> float:
    """Refuse errors, m, that are too large for a machine."""
    if error > _COARSE:
        raise ValueError(f"{error:g} m given: is this mm?")
    return error


def _expect_tilt(angle: float) -> float:
    if angle >= _LEANS:
        raise ValueError(f"{angle:g} rad given, below {_LEANS:g} expected: is this in degrees?")
    return angle


def _expect_near_points(points: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
    """Refuse points whose first two coordinates, lengths in m, are too large for a cell."""
    _expect_near([point[:2] for point in points])
    return points


Names = Annotated[list[str], BeforeValidator(as_list), Field(min_length=1)]
"""One name, or a list of names."""

Near = Annotated[Positive, AfterValidator(_expect_near)]
"""A length above 0 and of a cell's size, m."""

Fine = Annotated[Positive, AfterValidator(_fine)]
"""A greatest error above 0, m."""

Place = Annotated[Three, AfterValidator(_expect_near)]
"""A place in a cell, m."""


class WorkspaceTable(TomlTable):
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
        """Say whether the tool may enter a box, corners (3,) from the workspace's middle, m."""
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
        """Whether the platform must tilt."""
        return self.tilt is not None or self.directions is not None

    @property
    def words(self) -> str:
        """The shape of the workspace in words."""
        if self.size is not None:
            return f"workspace {' x '.join(f'{1e3 * x:g}' for x in self.size)} mm"
        if self.poses is not None:
            return f"workspace of {len(self.poses)} pose{'s' if len(self.poses) > 1 else ''}"
        return f"workspace: cylinder of radius {self.radius:g} m, height {self.height:g} m"


class LoadTable(PayloadTable):
    """`[payload]`: the body that the platform carries, with the tool's centre point."""

    tool: Place = key(
        "the tool's centre point in the platform's frame, m: what must reach", (0.0, 0.0, 0.0)
    )


class CycleTable(TomlTable):
    """`[[cycles]]`: a path of the tool through points, repeated without end."""

    name: str | None = None
    points: Annotated[
        list[tuple[Number, ...]], Field(min_length=2), AfterValidator(_expect_near_points)
    ] = key(
        "from the middle of the workspace, m; a turn about the upright may follow, or "
        "roll, pitch and yaw, rad"
    )
    corner: Least = key(
        "metres before and after a point where the path leaves its lines; 0: stop", 0.0
    )
    duration: Positive | None = key("of the path, s; left out, as fast as the motors can", None)
    dwell: Least = key("rest after it, s", 0.0)
    back: bool = key("whether the path goes back as it came", False)
    share: Positive | None = key(
        "how often it is done in a duty cycle of all; without it each counts by itself", None
    )
    anywhere: bool = key(
        "whether it may be at any place and in any direction of the workspace", True
    )


class MotionTable(TomlTable):
    """`[motion]`: speed and acceleration that are required everywhere, in every direction."""

    speed: Least = key("of P, m/s", 0.0)
    acceleration: Least = key("of P, m/s^2", 0.0)


class AccuracyTable(TomlTable):
    """`[accuracy]`: the greatest position error of the tool, and the tolerances of parts."""

    most: Fine = key("m")
    counted: Literal["deviation", "worst"] = key(
        "root of the sum of squares of all errors, or their sum", "deviation"
    )
    counts_per_turn: Positive = key("of the motors' encoders", 20000.0)
    backlash: bool = key("whether the gearboxes' backlash counts", True)
    point: Least = key("of joints' places, m", 0.0)
    length: Least = key("of links, m", 0.0)
    angle: Least = key("of axes, rad", 0.0)

    @property
    def has_part_errors(self) -> bool:
        """Whether any tolerance of the machine's parts is given, beside errors of its drives."""
        return bool(self.point or self.length or self.angle)


class StiffnessTable(TomlTable):
    """`[stiffness]`: the greatest deflection of the tool under a force."""

    force: Positive = key("in any direction, N")
    most: Fine = key("m")


class KeepOutTable(TomlTable):
    """`[[keep_out]]`: a box in which no part of the machine may be."""

    low: Place = key("m; from the middle of a workspace that floats")
    high: Place = key("m")

    @model_validator(mode="after")
    def _rises(self) -> Self:
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


class MotorsTable(TomlTable):
    """`[motors]`: the lists of motors and gearboxes to choose from."""

    list: str | None = key("CSV or TOML file; else the package's examples", None)
    gearboxes: str | None = key("CSV file; else the package's examples", None)
    margin: Annotated[Number, Field(ge=1.0)] = key(
        "what a drive must be able to do, over what is asked", 1.2
    )
    friction: Annotated[Number, Field(ge=0.0, lt=0.5)] = key(
        "dry friction as a share of the rated torque", 0.05
    )


class LinksTable(TomlTable):
    """`[links]`: the materials and sizes of the moving parts."""

    upper: Names = key("stock of cranks, to choose", ["aluminium-tube:40x2", "aluminium-tube:60x3"])
    lower: Names = key("stock of rods, to choose from", ["carbon-tube:12x1", "carbon-tube:20x1.5"])
    plate: Positive = key("thickness of an aluminium platform, m", 0.006)
    carriage: Positive = key("mass of what slides on a guide, kg", 0.4)
    guide: Positive = key("half the width of a guide, m", 0.015)

    @field_validator("upper", "lower")
    @classmethod
    def _expect_known(cls, names: list[str]) -> list[str]:
        for name in names:
            try:
                Stock.parse(name)
            except ModelError as error:
                raise ValueError(error.message) from None
        return names


class FloorsTable(TomlTable):
    """`[floors]`: least measures of every pose of the workspace, each 1 at best."""

    type_i: Floor = 0.1
    type_ii: Floor = 0.05
    clearance: Least = key("least distance of two bodies from surface to surface, m", 0.0)


class SearchTable(TomlTable):
    """`[search]`: the length of the search, and its seed of random numbers."""

    evaluations: Count = key("designs of each kind", 800)
    seed: Annotated[int, Field(ge=0, strict=True)] = 0


class BoundTable(TomlTable):
    """`[most]`: greatest values of other quantities."""

    price: Positive | None = None
    rated_power: Positive | None = None
    moving_mass: Positive | None = None
    energy: Positive | None = None
    cycle_time: Positive | None = None
