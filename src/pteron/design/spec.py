"""The TOML file of a design search, as pydantic models: variables, requirements and objectives."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import chain
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeAlias

from pydantic import BeforeValidator, Field, PrivateAttr, field_validator, model_validator

from pteron.bodies.tables import Count, Number, TomlTable, Two, key
from pteron.design.load_tables import (
    CycleTable,
    ElasticityTable,
    ErrorsTable,
    Floor,
    MotorsTable,
    PayloadTable,
    Positive,
    as_list,
    default_table,
)
from pteron.design.quantities import DesignQuantity, expect_quantity
from pteron.design.user_quantities import function_of, named_quantity
from pteron.design.workspace_tables import WorkspaceTable
from pteron.errors import DataError, shorten
from pteron.manipulator import Manipulator
from pteron.renamed import former_attribute
from pteron.toml import read_toml, to_model

_ABSENT = "no such file; it should describe a search for a design"
"""The end of the message for a missing file."""

ROUNDING = 1e-9
"""Relative tolerance of bounds."""

FAILED = 1e6
"""Violation of a design that is no possible machine, or lacks a quantity."""


def _expect_rising(pair: tuple[float, float]) -> tuple[float, float]:
    """Return the pair [low, high]; raise unless low is below high."""
    low, high = pair
    if not low < high:
        raise ValueError(f"[{low:g}, {high:g}] given, whose range is empty; give [low, high]")
    return pair


class VariableTable(TomlTable):
    """`[[variables]]`: numbers of the robot's file that move as one."""

    moves: Annotated[tuple[str, ...], BeforeValidator(as_list), Field(min_length=1)] = key(
        'paths such as "legs[1,3].platform_point" or "-legs[2].guide_point.x"'
    )
    range: Two = key("least and greatest value")
    by: Literal["value", "factor", "offset"] = key(
        "whether the numbers get the value, their start times it, or their start and "
        "it; a minus before a path turns the value's sign",
        "value",
    )
    each: bool = key("whether every leg has a variable of its own", False)
    name: str | None = key("what tables call it; its first path if left out", None)

    _rises = field_validator("range")(_expect_rising)


class FloorsTable(TomlTable):
    """`[floors]`: least measures of the poses of the workspace, or of the cube."""

    type_i: Floor = key("type-I measure of every leg; 0: it need only reach", 0.05)
    type_ii: Floor = key("type-II measure of the machine; 0: it does not matter", 0.01)


class MotionTable(TomlTable):
    """`[motion]`: the speed and acceleration, in every direction, that drives must give."""

    speed: Positive = key("of P in any direction, m/s", 1.0)
    acceleration: Positive = key("of P in any direction, m/s^2", 10.0)


class ObjectiveTable(TomlTable):
    """`[[objectives]]`: one quantity that is to be small, or large."""

    maximise: Annotated[str, Field()] | None = key("a quantity", None)
    minimise: Annotated[str, Field()] | None = key("a quantity", None)

    @field_validator("maximise", "minimise")
    @classmethod
    def _expect_known(cls, name: str | None) -> str | None:
        """Return the objective's quantity name; raise if no quantity is called so."""
        return name and expect_quantity(name)

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        """Return the objective; raise unless it has exactly either maximise or minimise."""
        if (self.maximise is None) == (self.minimise is None):
            raise ValueError("give either maximise or minimise, and a quantity")
        return self

    @property
    def quantity(self) -> str:
        """The name of the quantity to maximise or minimise."""
        return self.maximise or self.minimise or ""

    @property
    def sign(self) -> float:
        """1 for a quantity to minimise, -1 for a quantity to maximise."""
        return 1.0 if self.minimise else -1.0


class RequirementTable(TomlTable):
    """`[[requirements]]`: a quantity with a least or a greatest value."""

    quantity: str
    least: Number | None = None
    most: Number | None = None

    @field_validator("quantity")
    @classmethod
    def _expect_known(cls, name: str) -> str:
        """Return the required quantity's name; raise if no quantity is called so."""
        return expect_quantity(name)

    @model_validator(mode="after")
    def _expect_bound(self) -> Self:
        """Return the requirement; raise where it has no bound or bounds that contradict."""
        if self.least is None and self.most is None:
            raise ValueError(f"{self.quantity}: neither least nor most given")
        if None not in (self.least, self.most) and self.least > self.most:  # type: ignore[operator]
            raise ValueError(
                f"{self.quantity}: at least {self.least:.12g} and at most {self.most:.12g} cannot "
                "both be"
            )
        return self

    def violation(self, amount: float, failed: float) -> float:
        """Return by how much `amount` violates the bounds, relative; 0 if met; `failed` if NaN."""
        if math.isnan(amount):
            return failed
        missing = 0.0 if self.least is None else (self.least - amount) / (abs(self.least) or 1.0)
        beyond = 0.0 if self.most is None else (amount - self.most) / (abs(self.most) or 1.0)
        gap = max(missing, beyond)
        return gap if gap > ROUNDING else 0.0

    @property
    def words(self) -> str:
        """The requirement in words: "links at most 1.2"."""
        ends = (("at least", self.least), ("at most", self.most))
        bounds = (f"{word} {bound:.12g}" for word, bound in ends if bound is not None)
        return f"{self.quantity} {' and '.join(bounds)}"


class SearchTable(TomlTable):
    """`[search]`: size, length and seed of the search."""

    population: Annotated[int, Field(ge=4, strict=True)] = key("designs kept", 40)
    generations: Count = key("how many", 25)
    refined: Annotated[int, Field(ge=0, strict=True)] = key(
        "designs of each generation that are improved by gradients", 4
    )
    seed: Annotated[int, Field(ge=0, strict=True)] = key("of all chance", 0)


Quantitative: TypeAlias = str | DesignQuantity | Callable[[Manipulator], float]
"""A quantity by its name, or a user's own."""


def _note_quantity(quantity: Quantitative, functions: dict[str, DesignQuantity]) -> str:
    """Return a quantity's name, after adding a user-defined quantity to `functions`."""
    if not isinstance(quantity, str):
        named = named_quantity(quantity)
        if function_of(functions.setdefault(named.name, named)) != function_of(named):
            raise DataError(f"{named.name}: two quantities of this name; give one another name")
        return named.name
    try:
        return quantity if quantity in functions else expect_quantity(quantity)
    except ValueError as error:
        raise DataError(str(error)) from None


class Spec(TomlTable):
    """A search for a design, as in its TOML file."""

    robot: str = key("the machine to begin with: a catalog name or a TOML file")
    pose: tuple[Number, ...] | None = key(
        "its orientation is the cube's; all zero if left out", None
    )
    angles: tuple[Number, ...] | None = key(
        "several angles that workspace and cube must allow, rad", None
    )
    masses: Literal["per length", "kept"] = key(
        "what a link's inertia does when its length changes", "per length"
    )
    variables: Annotated[list[VariableTable], Field(min_length=1)]
    objectives: Annotated[list[ObjectiveTable], Field(min_length=1)]
    requirements: list[RequirementTable] = Field(default_factory=list)
    workspace: WorkspaceTable | None = None
    floors: FloorsTable = default_table(FloorsTable)
    motion: MotionTable = default_table(MotionTable)
    payload: PayloadTable | None = None
    cycles: list[CycleTable] = Field(default_factory=list)
    errors: ErrorsTable | None = None
    elasticity: ElasticityTable | None = None
    motors: MotorsTable | None = None
    search: SearchTable = default_table(SearchTable)

    _source: str = PrivateAttr("")
    _user_quantities: dict[str, DesignQuantity] = PrivateAttr(default_factory=dict)

    @property
    def source(self) -> str:
        """The path of the file that the search was read from; empty if there is none."""
        return self._source

    @property
    def quantity_names(self) -> tuple[str, ...]:
        """The quantities that objectives and requirements name, each once."""
        named = (o.quantity for o in self.objectives), (r.quantity for r in self.requirements)
        return tuple(dict.fromkeys(chain(*named)))

    asked = former_attribute("asked", "quantity_names")

    @property
    def user_quantities(self) -> dict[str, DesignQuantity]:
        """The quantities that `with_objectives` and `with_requirement` have brought, by name."""
        return dict(self._user_quantities)

    def with_objectives(
        self, *, minimise: Sequence[Quantitative] = (), maximise: Sequence[Quantitative] = ()
    ) -> Spec:
        """Return a copy of the search with other objectives.

        Parameters
        ----------
        minimise, maximise : sequence of str, callable or DesignQuantity
            What is to be small, and large: names of quantities; functions of the machine, which
            take a `Manipulator` and return a number; or, of what needs more than the machine,
            `DesignQuantity`, whose `of` takes the `Design`. Processes import functions by module
            and name.

        Raises
        ------
        DataError
            If there is no such quantity, or a function has the name of another quantity.
        """
        functions = dict(self._user_quantities)
        tables = [
            ObjectiveTable.model_construct(minimise=_note_quantity(quantity, functions))
            for quantity in minimise
        ] + [
            ObjectiveTable.model_construct(maximise=_note_quantity(quantity, functions))
            for quantity in maximise
        ]
        if not tables:
            raise DataError("objectives: none given; give minimise or maximise")
        return self._with_functions(functions, objectives=tables)

    def with_requirement(
        self, quantity: Quantitative, *, least: float | None = None, most: float | None = None
    ) -> Spec:
        """Return a copy of the search with a further requirement (see `with_objectives`)."""
        functions = dict(self._user_quantities)
        name = _note_quantity(quantity, functions)
        table = RequirementTable.model_construct(quantity=name, least=least, most=most)
        try:
            table._expect_bound()  # type: ignore[operator]
        except ValueError as error:
            raise DataError(str(error)) from None
        return self._with_functions(functions, requirements=[*self.requirements, table])

    def _with_functions(self, functions: dict[str, DesignQuantity], **update: Any) -> Spec:
        """Return a copy of the spec with user-defined quantities and updated keys."""
        spec = self.model_copy(update=update)
        spec._user_quantities = functions
        return spec

    def with_seed(self, seed: int) -> Spec:
        """Return a copy of the search with another seed of the random numbers."""
        return self.model_copy(update={"search": self.search.model_copy(update={"seed": seed})})

    def requirement_lines(self) -> list[str]:
        """Return the search's objectives and requirements as lines of text."""
        lines = [
            f"{part.quantity} as {'small' if part.minimise else 'large'} as possible"
            for part in self.objectives
        ]
        lines += [part.words for part in self.requirements]
        lines += [] if self.workspace is None else [self.workspace.words]
        lines += [
            f"{name} at least {floor:.12g} everywhere"
            for name, floor in self.floors
            if not any(r.quantity == name and r.least is not None for r in self.requirements)
        ]
        if self.payload is not None:
            lines.append(f"a payload of {self.payload.mass:.12g} kg")
        lines += [f"cycle {k}: {part.words}" for k, part in enumerate(self.cycles, start=1)]
        speed, acceleration = self.motion.speed, self.motion.acceleration
        if {"force", "speed", "drive_load"} & set(self.quantity_names):
            lines.append(f"motion at up to {speed:.12g} m/s and {acceleration:.12g} m/s^2")
        return lines


def read_spec(path: str | Path) -> Spec:
    """Read the specification of a design search from a TOML file.

    Machine and motor files that it names are sought in its own folder first.

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
    source = shorten(str(path), bare=True, longest=1000)
    spec = to_model(Spec, read_toml(path, DataError, _ABSENT), source, DataError)
    folder = Path(path).parent
    update: dict[str, Any] = {}
    if (folder / spec.robot).is_file():
        update["robot"] = str(folder / spec.robot)
    if spec.motors is not None and (folder / spec.motors.file).is_file():
        update["motors"] = MotorsTable(file=str(folder / spec.motors.file))
    read = spec.model_copy(update=update)
    read._source = source
    return read
