"""Variables of a search: numbers of a machine's geometry that move as one, within a range."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pteron.design.masses import with_stretched_bodies
from pteron.design.paths import Place, geometric_keys, places
from pteron.design.spec import Spec, VariableTable
from pteron.equations.machine import numbers
from pteron.errors import DataError, ModelError
from pteron.kernels import Array
from pteron.manipulator import Manipulator

_STEP = 1e-6
"""Share of a range over which the geometry's change is measured."""


@dataclass(frozen=True)
class Variable:
    """Numbers that move as one.

    Attributes
    ----------
    name : str
        What tables call it.
    places : tuple of Place
        The numbers.
    by : {"value", "factor", "offset"}
        Whether they get the value itself, their start times it, or their start and it.
    low, high : float
        Its range.
    start : float
        Its value in the machine to begin with; the mean where several numbers differ.
    """

    name: str
    places: tuple[Place, ...]
    by: Literal["value", "factor", "offset"]
    low: float
    high: float
    start: float

    def number(self, place: Place, start: float, value: float) -> float:
        """Return what one of the numbers becomes; `start` is what it was."""
        if self.by == "factor":
            return start * value
        return place.sign * value + (start if self.by == "offset" else 0.0)


def variables_of(spec: Spec) -> tuple[Variable, ...]:
    """Return the variables of a search.

    Raises
    ------
    DataError
        With all that is wrong with them, a line each.
    """
    found: list[Variable] = []
    faults: list[str] = []
    for i, table in enumerate(spec.variables, start=1):
        try:
            found += _variables(spec.start, table)
        except ModelError as error:
            faults += [f"variables, item {i}: {fault}" for fault in error.faults]
    moved: dict[tuple[int, str, int | None], str] = {}
    for variable in found:
        for place in variable.places:
            key = place.leg, place.key, place.part
            if key in moved:
                faults.append(f"{place.path}: moved by {moved[key]} and by {variable.name}")
            moved[key] = variable.name
    if faults:
        raise DataError("\n".join(faults))
    return tuple(found)


def _variables(robot: Manipulator, table: VariableTable) -> list[Variable]:
    moved = [place for path in table.moves for place in places(robot, path)]
    legs = sorted({place.leg for place in moved})
    groups = [[p for p in moved if p.leg == leg] for leg in legs] if table.each else [moved]
    found = []
    for group in groups:
        starts = [place.sign * place.read(robot) for place in group]
        start = {"factor": 1.0, "offset": 0.0}.get(table.by, float(np.mean(starts)))
        name = table.name or (table.moves[0].lstrip("-") if not table.each else "")
        if table.each:
            name = f"{table.name or group[0].key} of leg {group[0].leg}"
        if table.by == "value" and any(place.key.endswith("length") for place in group):
            if table.range[0] <= 0.0:
                raise ModelError(f"range: {table.range[0]:g} m given, but a length is above 0")
        found.append(Variable(name, tuple(group), table.by, *table.range, start))
    return found


def design_of(spec: Spec, variables: Sequence[Variable], values: Sequence[float]) -> Manipulator:
    """Return the machine of a design: the start with its variables at these values.

    Raises
    ------
    ModelError
        If there can be no such machine.
    """
    robot = spec.start
    legs = list(robot.legs)
    changed: dict[int, dict[str, list[float]]] = {}
    for variable, value in zip(variables, values, strict=True):
        for place in variable.places:
            held = changed.setdefault(place.leg, {})
            if place.key not in held:
                held[place.key] = np.atleast_1d(getattr(legs[place.leg - 1], place.key)).tolist()
            part = place.part or 0
            number = variable.number(place, place.read(robot), float(value))
            held[place.key][part] = number
    for i, fields in changed.items():
        leg = legs[i - 1]
        given = {
            key: tuple(parts) if len(parts) > 1 else parts[0] for key, parts in fields.items()
        }
        other = replace(leg, **given)
        legs[i - 1] = with_stretched_bodies(leg, other) if spec.masses == "per length" else other
    return replace(robot, legs=tuple(legs))


def geometry_slopes(spec: Spec, variables: Sequence[Variable], values: Array) -> Array:
    """Return d geometry / d values (G, V): how `equations.machine.numbers` follow the variables.

    Lengths and points are linear in them, so that a difference is exact but for rounding.
    """
    columns = []
    for k, variable in enumerate(variables):
        step = _STEP * (variable.high - variable.low)
        ends = []
        for side in (1.0, -1.0):
            moved = np.array(values, dtype=float)
            moved[k] += side * step
            ends.append(np.array(numbers(design_of(spec, variables, moved))))
        columns.append((ends[0] - ends[1]) / (2.0 * step))
    return np.array(columns).T
