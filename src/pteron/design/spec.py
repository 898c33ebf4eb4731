"""The TOML file of a design search, as pydantic models: variables, requirements and objectives."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, PrivateAttr, field_validator, model_validator

from pteron.bodies.tables import Count, Number, Table, Two
from pteron.design.quantities import known
from pteron.errors import DataError, shown
from pteron.toml import read_toml, validated

_ABSENT = "no such file; it should describe a search for a design"
"""The message where the file is missing."""

_ROUNDING = 1e-9
"""Share of a bound by which it may be missed."""

Positive = Annotated[Number, Field(gt=0.0)]
"""A number above 0."""

Floor = Annotated[Number, Field(ge=0.0, lt=1.0)]
"""Least value of a measure that is 1 at best."""


def _listed(given: Any) -> Any:
    return [given] if isinstance(given, str) else given


def _rising(pair: tuple[float, float]) -> tuple[float, float]:
    low, high = pair
    if not low < high:
        raise ValueError(f"[{low:g}, {high:g}] given, whose range is empty; give [low, high]")
    return pair


class VariableTable(Table):
    """`[[variables]]`: numbers of the robot's file that move as one."""

    moves: Annotated[tuple[str, ...], BeforeValidator(_listed), Field(min_length=1)] = Field(
        description='paths such as "legs[1,3].platform_point" or "-legs[2].guide_point.x"'
    )
    range: Two = Field(description="least and greatest value")
    by: Literal["value", "factor", "offset"] = Field(
        "value",
        description="whether the numbers get the value, their start times it, or their start and "
        "it; a minus before a path turns the value's sign",
    )
    each: bool = Field(False, description="whether every leg has a variable of its own")
    name: str | None = Field(None, description="what tables call it; its first path if left out")

    _rises = field_validator("range")(_rising)


class WorkspaceTable(Table):
    """`[workspace]`: the region in which the machine must work."""

    low: tuple[Number, ...] | None = Field(None, description="a box's least x, y, z, m")
    high: tuple[Number, ...] | None = Field(None, description="a box's greatest x, y, z, m")
    center: tuple[Number, ...] | None = Field(None, description="of a cube or cylinder, m")
    edge: Positive | None = Field(None, description="of a cube, m")
    radius: Positive | None = Field(None, description="of a cylinder, m")
    height: Positive | None = Field(None, description="of a cylinder, m")
    axis: Literal["x", "y", "z"] = Field("z", description="of a cylinder")
    samples: Annotated[int, Field(ge=2, le=41, strict=True)] = Field(
        5, description="poses along each of its sides"
    )

    @model_validator(mode="after")
    def _one_shape(self) -> Self:
        shapes = {
            "box": (self.low, self.high),
            "cube": (self.center, self.edge),
            "cylinder": (self.center, self.radius, self.height),
        }
        given = {
            key
            for key in ("low", "high", "center", "edge", "radius", "height")
            if getattr(self, key) is not None
        }
        wanted = {"box": {"low", "high"}, "cube": {"center", "edge"}}
        wanted["cylinder"] = {"center", "radius", "height"}
        if given not in wanted.values():
            raise ValueError(
                f"{', '.join(sorted(given)) or 'nothing'} given; a box has low and high, a cube "
                "center and edge, a cylinder center, radius and height"
            )
        first, *others = (part for part in shapes[self.shape] if isinstance(part, tuple))
        if any(len(part) != len(first) for part in others):
            raise ValueError("low and high have unlike numbers of coordinates")
        if self.low is not None and not all(
            a < b for a, b in zip(self.low, self.high or (), strict=True)
        ):
            raise ValueError(f"low {list(self.low)} is not below high {list(self.high or ())}")
        return self

    @property
    def shape(self) -> Literal["box", "cube", "cylinder"]:
        """The kind of workspace."""
        if self.low is not None:
            return "box"
        return "cube" if self.edge is not None else "cylinder"

    @property
    def ends(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Least and greatest coordinates of a box or a cube, m."""
        if self.low is not None and self.high is not None:
            return self.low, self.high
        half = (self.edge or 0.0) / 2.0
        center = self.center or ()
        return tuple(x - half for x in center), tuple(x + half for x in center)

    @property
    def lengths(self) -> int:
        """Number of its coordinates."""
        return len(self.low or self.center or ())


class FloorsTable(Table):
    """`[floors]`: least measures of the poses of the workspace, or of the cube."""

    type_i: Floor = Field(0.05, description="type-I measure of every leg; 0: it need only reach")
    type_ii: Floor = Field(
        0.01, description="type-II measure of the machine; 0: it does not matter"
    )


class MotionTable(Table):
    """`[motion]`: the motion by which drives are judged at the workspace's corners."""

    speed: Positive = Field(1.0, description="of P along each axis, m/s")
    acceleration: Positive = Field(10.0, description="of P along each axis, m/s^2")


class ObjectiveTable(Table):
    """`[[objectives]]`: one quantity that is to be small, or large."""

    maximise: Annotated[str, Field()] | None = Field(None, description="a quantity")
    minimise: Annotated[str, Field()] | None = Field(None, description="a quantity")

    @field_validator("maximise", "minimise")
    @classmethod
    def _known(cls, name: str | None) -> str | None:
        return name and known(name)

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if (self.maximise is None) == (self.minimise is None):
            raise ValueError("give either maximise or minimise, and a quantity")
        return self

    @property
    def quantity(self) -> str:
        """The quantity's name."""
        return self.maximise or self.minimise or ""

    @property
    def sign(self) -> float:
        """1 where less is better, -1 where more is."""
        return 1.0 if self.minimise else -1.0


class RequirementTable(Table):
    """`[[requirements]]`: a quantity with a least or a greatest value."""

    quantity: str
    least: Number | None = None
    most: Number | None = None

    @field_validator("quantity")
    @classmethod
    def _known(cls, name: str) -> str:
        return known(name)

    @model_validator(mode="after")
    def _bounded(self) -> Self:
        if self.least is None and self.most is None:
            raise ValueError(f"{self.quantity}: neither least nor most given")
        if None not in (self.least, self.most) and self.least > self.most:  # type: ignore[operator]
            raise ValueError(
                f"{self.quantity}: at least {self.least:g} and at most {self.most:g} cannot both be"
            )
        return self

    def missed_by(self, value: float, failed: float) -> float:
        """Return by how much a value misses it, over the bound; `failed` where there is none."""
        if math.isnan(value):
            return failed
        missing = 0.0 if self.least is None else (self.least - value) / (abs(self.least) or 1.0)
        beyond = 0.0 if self.most is None else (value - self.most) / (abs(self.most) or 1.0)
        gap = max(missing, beyond)
        return gap if gap > _ROUNDING else 0.0

    @property
    def words(self) -> str:
        """The requirement in words: "links at most 1.2"."""
        ends = (("at least", self.least), ("at most", self.most))
        told = (f"{word} {bound:g}" for word, bound in ends if bound is not None)
        return f"{self.quantity} {' and '.join(told)}"


class SearchTable(Table):
    """`[search]`: size, length and seed of the search."""

    population: Annotated[int, Field(ge=4, strict=True)] = Field(40, description="designs kept")
    generations: Count = Field(25, description="how many")
    refined: Annotated[int, Field(ge=0, strict=True)] = Field(
        4, description="designs of each generation that are improved by gradients"
    )
    seed: Annotated[int, Field(ge=0, strict=True)] = Field(0, description="of all chance")


class Spec(Table):
    """A search for a design, as its file has it."""

    robot: str = Field(description="the machine to begin with: a catalog name or a TOML file")
    pose: tuple[Number, ...] | None = Field(
        None, description="its orientation is the cube's; all zero if left out"
    )
    angles: tuple[Number, ...] | None = Field(
        None, description="several angles that workspace and cube must allow, rad"
    )
    masses: Literal["per length", "kept"] = Field(
        "per length", description="what a link's inertia does when its length changes"
    )
    variables: Annotated[list[VariableTable], Field(min_length=1)]
    objectives: Annotated[list[ObjectiveTable], Field(min_length=1)]
    requirements: list[RequirementTable] = Field(default_factory=list)
    workspace: WorkspaceTable | None = None
    floors: FloorsTable = Field(default_factory=lambda: FloorsTable.model_validate({}))
    motion: MotionTable = Field(default_factory=lambda: MotionTable.model_validate({}))
    search: SearchTable = Field(default_factory=lambda: SearchTable.model_validate({}))

    _source: str = PrivateAttr("")

    @property
    def source(self) -> str:
        """The file that it was read from; empty where it was not."""
        return self._source

    def with_seed(self, seed: int) -> Spec:
        """Return the same search with other chance."""
        return self.model_copy(update={"search": self.search.model_copy(update={"seed": seed})})


def read_spec(path: str | Path) -> Spec:
    """Read a search for a design from a TOML file.

    A machine's file is looked for beside it first.

    Parameters
    ----------
    path : str or Path
        The file; the page "Design a machine" of the documentation has all its keys.

    Returns
    -------
    Spec

    Raises
    ------
    DataError
        If it cannot be read, has unknown keys, or asks for the impossible; all its faults are
        listed.
    """
    source = shown(str(path), bare=True, longest=1000)
    spec = validated(Spec, read_toml(path, DataError, _ABSENT), source, DataError)
    beside = Path(path).parent / spec.robot
    found = spec.model_copy(update={"robot": str(beside)} if beside.is_file() else {})
    found._source = source
    return found
