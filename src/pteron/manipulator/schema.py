"""What a manipulator's TOML file may hold: its keys and their types, as pydantic models.

Only shape and type are checked here; what the numbers mean is checked by the dataclasses they fill.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

__all__ = ["ManipulatorTable"]

Number = Annotated[float, Field(allow_inf_nan=False, strict=True)]
Two = tuple[Number, Number]
Three = tuple[Number, Number, Number]


class Table(BaseModel):
    """A TOML table in which an unknown key is an error."""

    model_config = ConfigDict(extra="forbid")


class SliderTable(Table):
    """`slider = { mass }`."""

    mass: Number


class BodyTable(Table):
    """`mass`, `inertia` and one of `center_of_mass` and `first_moment`."""

    mass: Number
    center_of_mass: Two | None = None
    first_moment: Two | None = None
    inertia: Number


class PlatformTable(BodyTable):
    """`[platform]`."""

    motion: Literal["3T1R", "3T"]
    axis: Three = (0.0, 0.0, 1.0)
    x_axis: Three | None = None


class LegTable(Table):
    """One of `[[legs]]`."""

    guide_point: Three
    direction: Three
    slider_direction: Three | None = None
    platform_point: Three
    upper_length: Number
    lower_length: Number
    elbow: Literal[1, -1] = 1
    slider_limits: Two | None = None
    slider: SliderTable
    upper: BodyTable
    lower: BodyTable


class ManipulatorTable(Table):
    """The whole file."""

    name: str
    gravity: Three = (0.0, 0.0, -9.81)
    platform: PlatformTable
    legs: list[LegTable]
