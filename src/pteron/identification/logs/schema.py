"""What a log's TOML file may hold: its keys and their types, as pydantic models."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from pteron.identification.logs.description import AngleUnit, ForceUnit, LengthUnit, TimeUnit

__all__ = ["DescriptionTable", "keys_at"]

Number = Annotated[float, Field(allow_inf_nan=False, strict=True)]
Two = tuple[Number, Number]
Names = Annotated[tuple[str, ...], Field(min_length=1)]


class Table(BaseModel):
    """A TOML table in which an unknown key is an error."""

    model_config = ConfigDict(extra="forbid")


class TimeTable(Table):
    """`[time]`."""

    column: str | None = None
    unit: TimeUnit | None = None


class SlidersTable(Table):
    """`[sliders]`."""

    columns: Names | None = None
    unit: LengthUnit | None = None


class ForcesTable(Table):
    """`[forces]`; one pair of limits holds for all sliders."""

    columns: Names | None = None
    unit: ForceUnit | None = None
    gains: tuple[Number, ...] | None = None
    limits: tuple[Two, ...] | Two | None = None


class PoseTable(Table):
    """`[pose]`."""

    columns: Names | None = None
    length_unit: LengthUnit | None = None
    angle_unit: AngleUnit | None = None


class PayloadTable(Table):
    """`[payload]`; `mass`, `inertia` and one of `center_of_mass` and `first_moment`."""

    column: str | None = None
    mass: Number | None = None
    center_of_mass: Two | None = None
    first_moment: Two | None = None
    inertia: Number | None = None


class MotionTable(Table):
    """`[motion]`."""

    period: Number | None = None
    assembly_mode: Literal[1, 2] | None = None


class DrivesTable(Table):
    """`[drives]`."""

    rotor_inertia: tuple[Number, ...] | None = None
    ratio: tuple[Number, ...] | None = None


class DescriptionTable(Table):
    """The whole file."""

    time: TimeTable = TimeTable()
    sliders: SlidersTable = SlidersTable()
    forces: ForcesTable = ForcesTable()
    pose: PoseTable = PoseTable()
    payload: PayloadTable = PayloadTable()
    motion: MotionTable = MotionTable()
    drives: DrivesTable = DrivesTable()


def keys_at(location: tuple[int | str, ...]) -> tuple[str, ...]:
    """Return the valid keys of the table that holds the key at `location`."""
    model: type[BaseModel] = DescriptionTable
    for key in location[:-1]:
        kind = model.model_fields[str(key)].annotation
        assert isinstance(kind, type)
        assert issubclass(kind, BaseModel)
        model = kind
    return tuple(model.model_fields)
