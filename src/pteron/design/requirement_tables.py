"""Tables of a task's file: payload, cycles, accuracy, drives, links and bounds."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, field_validator

from pteron.bodies.tables import Count, Number, TomlTable, key
from pteron.design.load_tables import Floor, Least, Names, PayloadTable, Positive
from pteron.design.workspace_tables import Fine, Place, expect_near_points
from pteron.errors import ModelError
from pteron.manipulator.dimensions import Stock


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


class DriveListsTable(TomlTable):
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
        """Return the names of bar stock; raise where a name cannot be parsed."""
        for name in names:
            try:
                Stock.parse(name)
            except ModelError as error:
                raise ValueError(error.message) from None
        return names


class BodyFloorsTable(TomlTable):
    """`[floors]`: least measures of every pose of the workspace, each 1 at best."""

    type_i: Floor = 0.1
    type_ii: Floor = 0.05
    clearance: Least = key("least distance of two bodies from surface to surface, m", 0.0)


class KindSearchTable(TomlTable):
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
