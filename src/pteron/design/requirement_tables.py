"""Tables of a task's file: payload, cycles, accuracy, drives, links and bounds."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, field_validator

from pteron.bodies.tables import Count, Number, TomlTable, Two, key
from pteron.design.load_tables import Floor, Least, Names, PayloadTable, Positive
from pteron.design.workspace_tables import Fine, Place, expect_near_points
from pteron.errors import ModelError
from pteron.manipulator.dimensions import Stock

_LEAST_OUTER, _LEAST_WALL = 4e-3, 0.5e-3
"""Least diameter and wall of a link, m: thinner ones are bent by hand."""


class LoadTable(PayloadTable):
    """`[payload]`: the body that the platform carries, with the tool's centre point."""

    tool: Place = key(
        "the tool's centre point in the platform's frame, m: what must reach", (0.0, 0.0, 0.0)
    )


class ToolCycleTable(TomlTable):
    """`[[cycles]]`: a path of the tool through points, repeated without end."""

    name: str | None = None
    points: Annotated[
        list[tuple[Number, ...]], Field(min_length=2), AfterValidator(expect_near_points)
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


class RequiredMotionTable(TomlTable):
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
        """Whether tolerances of points, lengths or angles are given besides the drives' errors."""
        return bool(self.point or self.length or self.angle)


class StiffnessTable(TomlTable):
    """`[stiffness]`: the greatest deflection of the tool under a force."""

    force: Positive = key("in any direction, N")
    most: Fine = key("m")


class ProcessTable(TomlTable):
    """`[process]`: the force of a process, such as milling, at the tool's centre point."""

    force: Positive = key("in any direction, at every pose, for as long as it takes, N")


class LimitsTable(TomlTable):
    """`[limits]`: what an engineer asks of every machine; docs state where each comes from."""

    rated: Annotated[Number, Field(gt=0.0, le=1.0)] = key(
        "greatest torque to hold the machine at rest, and root mean square torque of the cycles, "
        "over the rated torque of motor or gear",
        0.9,
    )
    inertia: Two = key("least and greatest inertia of the load over that of the rotor", (0.1, 10.0))
    sag: Fine | None = key(
        "greatest displacement of the tool by payload and weight, m; else [accuracy] most, or "
        "1/1000 of the workspace's longest side",
        None,
    )
    stress: Annotated[Number, Field(gt=0.0, le=1.0)] = key(
        "greatest stress over the material's strength", 0.5
    )
    buckling: Annotated[Number, Field(ge=1.0)] = key(
        "least load at which a link buckles over its compression", 3.0
    )
    frequency: Annotated[Number, Field(ge=1.0)] = key(
        "least natural frequency over that of the cycle", 5.0
    )
    joints: Annotated[Number, Field(gt=0.0, le=1.0)] = key(
        "greatest load of a joint or guide over its rating", 1.0
    )

    @field_validator("inertia")
    @classmethod
    def _expect_range(cls, inertia: tuple[float, float]) -> tuple[float, float]:
        """Return the inertia ratios; raise unless they are an interval of positive numbers."""
        if not 0.0 < inertia[0] < inertia[1]:
            raise ValueError(f"{list(inertia)} given, [least, greatest] above 0 expected")
        return inertia


class DriveListsTable(TomlTable):
    """`[motors]`: the lists of motors and gearboxes to choose from."""

    list: str | None = key("CSV or TOML file; else the package's examples", None)
    gearboxes: str | None = key("CSV file; else the package's examples", None)
    joints: str | None = key("CSV file of joints and rails; else the package's examples", None)
    margin: Annotated[Number, Field(ge=1.0)] = key(
        "peak torque and speed that a drive must have, over what is asked", 1.2
    )
    friction: Annotated[Number, Field(ge=0.0, lt=0.5)] = key(
        "dry friction as a share of the rated torque", 0.05
    )


class LinksTable(TomlTable):
    """`[links]`: the materials and sizes of the moving parts."""

    upper: Names = key(
        "stock of cranks and cylinders, to choose from",
        [f"aluminium-tube:{size}" for size in ("30x2", "40x2", "60x3", "80x4", "120x5", "160x6")],
    )
    lower: Names = key(
        "stock of rods and pistons, to choose from",
        [
            *(f"carbon-tube:{size}" for size in ("12x1", "20x1.5", "30x2", "40x2", "60x3")),
            *(f"aluminium-tube:{size}" for size in ("80x4", "120x5")),
        ],
    )
    slenderness: Two = key("least and greatest length of a link over its diameter", (2.5, 100.0))
    pair: Positive = key("spacing of a pair of rods over the platform's radius", 1.2)
    plate: Positive = key("thickness of an aluminium platform, m", 0.006)
    carriage: Positive = key("mass of the bracket on a rail's carriage, kg", 0.2)

    @field_validator("upper", "lower")
    @classmethod
    def _expect_known(cls, names: list[str]) -> list[str]:
        """Return the names of bar stock; raise where a name cannot be parsed."""
        for name in names:
            try:
                stock = Stock.parse(name)
            except ModelError as error:
                raise ValueError(error.message) from None
            wall = 0.5 * (stock.outer - stock.inner)
            if stock.outer < _LEAST_OUTER or wall < _LEAST_WALL:
                raise ValueError(
                    f"{name}: a diameter of {1e3 * stock.outer:g} mm and a wall of "
                    f"{1e3 * wall:g} mm given, at least {1e3 * _LEAST_OUTER:g} and "
                    f"{1e3 * _LEAST_WALL:g} mm expected of a link"
                )
        return names


class BodyFloorsTable(TomlTable):
    """`[floors]`: least measures of every pose of the workspace, each 1 at best."""

    type_i: Floor = 0.1
    type_ii: Floor = 0.05
    clearance: Least = key("least distance of two bodies from surface to surface, m", 0.0)


class KindSearchTable(TomlTable):
    """`[search]`: the length of the search, and its seed of random numbers."""

    evaluations: Count = key("designs of each kind", 400)
    seed: Annotated[int, Field(ge=0, strict=True)] = 0


class BoundTable(TomlTable):
    """`[most]`: greatest values of other quantities."""

    price: Positive | None = None
    rated_power: Positive | None = None
    moving_mass: Positive | None = None
    energy: Positive | None = None
    cycle_time: Positive | None = None
