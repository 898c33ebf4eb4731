"""Variables of a design search: numbers of a machine's geometry that move as one, in a range."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from pteron.design.paths import GeometryNumber, named_numbers
from pteron.design.spec import VariableTable
from pteron.equations.machine import numbers
from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.kinematics.unlikely_values import unlikely_length
from pteron.manipulator import Manipulator
from pteron.manipulator.stretched_links import with_stretched_bodies
from pteron.toml import joined_faults

_STEP = 1e-6
"""Step of difference quotients of the geometry, as a share of a variable's range."""


@dataclass(frozen=True)
class Variable:
    """Numbers of the geometry that move as one.

    Attributes
    ----------
    name : str
        Its name in tables.
    places : tuple of GeometryNumber
        The numbers.
    by : {"value", "factor", "offset"}
        Whether they become the value, their start times it, or their start plus it.
    low, high : float
        Its range.
    start : float
        Its value in the machine to begin with; the mean where several numbers differ.
    """

    name: str
    places: tuple[GeometryNumber, ...]
    by: Literal["value", "factor", "offset"]
    low: float
    high: float
    start: float

    @property
    def unit(self) -> str:
        """The unit of the variable's value: "m" for lengths and points, else ""."""
        scale = {"length", "point"} & {place.role for place in self.places}
        return "m" if scale and self.by != "factor" else ""

    def number(self, place: GeometryNumber, start: float, setting: float) -> float:
        """Return a geometric number's new value, from its initial one and the variable's value."""
        if self.by == "factor":
            return start * setting
        return place.sign * setting + (start if self.by == "offset" else 0.0)


def variables_of(robot: Manipulator, tables: Sequence[VariableTable]) -> tuple[Variable, ...]:
    """Return the design variables of a search from its tables; raise with all their faults."""
    variables: list[Variable] = []
    faults: list[str] = []
    for i, table in enumerate(tables, start=1):
        try:
            variables += _variables(robot, table)
        except ModelError as error:
            faults += [f"variables, item {i}: {fault}" for fault in error.faults]
    taken: dict[tuple[int, str, int | None], str] = {}
    for variable in variables:
        for place in variable.places:
            key = place.leg, place.key, place.part
            if key in taken:
                faults.append(f"{place.path}: moved by {taken[key]} and by {variable.name}")
            taken[key] = variable.name
    if faults:
        raise ModelError(joined_faults(faults), faults=faults)
    return tuple(variables)


def _variables(robot: Manipulator, table: VariableTable) -> list[Variable]:
    """Return the design variables that a table states: one, or one for each leg."""
    named = [place for path in table.moves for place in named_numbers(robot, path)]
    legs = sorted({place.leg for place in named})
    groups = [[p for p in named if p.leg == leg] for leg in legs] if table.each else [named]
    variables = []
    for group in groups:
        starts = [place.sign * place.read(robot) for place in group]
        start = {"factor": 1.0, "offset": 0.0}.get(table.by, float(np.mean(starts)))
        name = table.name or (table.moves[0].lstrip("-") if not table.each else "")
        if table.each:
            name = f"{table.name or group[0].key} of leg {group[0].leg}"
        is_length = table.by == "value" and any(place.role == "length" for place in group)
        if is_length and table.range[0] <= 0.0:
            raise ModelError(f"range: {table.range[0]:g} m given, but a length is above 0")
        variable = Variable(name, tuple(group), table.by, *table.range, start)
        if variable.unit == "m" and max(map(abs, table.range)) > unlikely_length(robot):
            raise ModelError(f"range: {list(table.range)} m given: are these mm? m are expected")
        variables.append(variable)
    return variables


def move_variables(
    robot: Manipulator, variables: Sequence[Variable], point: Sequence[float], *, stretch: bool
) -> Manipulator:
    """Return the machine with the design variables set to `point` (V,).

    With `stretch`, links of changed length change their inertia too.
    """
    legs = list(robot.legs)
    changed: dict[int, dict[str, list[float]]] = {}
    for variable, setting in zip(variables, point, strict=True):
        for place in variable.places:
            parts_by_key = changed.setdefault(place.leg, {})
            if place.key not in parts_by_key:
                parts_by_key[place.key] = np.atleast_1d(
                    getattr(legs[place.leg - 1], place.key)
                ).tolist()
            part = place.part or 0
            number = variable.number(place, place.read(robot), float(setting))
            parts_by_key[place.key][part] = number
    for i, fields in changed.items():
        leg = legs[i - 1]
        values_by_key = {
            key: tuple(parts) if len(parts) > 1 else parts[0] for key, parts in fields.items()
        }
        other = replace(leg, **values_by_key)
        legs[i - 1] = with_stretched_bodies(leg, other) if stretch else other
    return replace(robot, legs=tuple(legs), home=None)


def geometry_slopes(
    robot: Manipulator, variables: Sequence[Variable], point: Sequence[float]
) -> Array:
    """Return d geometry / d variables (G, V); rows as in `equations.machine.numbers`.

    Lengths and points are linear in the variables, so that differences are exact up to rounding.
    """

    def geometry(point: Array) -> Array:
        """Return the machine's geometric numbers (G,) at design variables (V,)."""
        return np.array(numbers(move_variables(robot, variables, point.tolist(), stretch=False)))

    return slopes_of(geometry, variables, point).T


def slopes_of(
    function: Callable[[Array], Any], variables: Sequence[Variable], point: Sequence[float]
) -> Array:
    """Return the derivatives (V, ...) of a function of the variables, by central differences."""
    derivatives = []
    for k, variable in enumerate(variables):
        step = _STEP * (variable.high - variable.low) * np.eye(len(variables))[k]
        low, high = (function(np.asarray(point) + side * step) for side in (-1.0, 1.0))
        derivatives.append((np.asarray(high) - low) / (2.0 * step[k]))
    return np.array(derivatives)
