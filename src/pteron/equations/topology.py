"""A machine's topology and its numbers, apart: machines of one topology share general programs.

The topology is the kinds of legs, the platform's motion, and which optional data there are; signs
of elbows are numbers. `equations.machine.numbers` are the numbers that motion and reach depend on;
`stored_numbers` are all that the machine's fields hold, limits of joints among them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from functools import lru_cache
from math import nan
from typing import Any

from pteron.legs.kind import LegKind
from pteron.manipulator import Manipulator


@lru_cache(maxsize=256)
def topology_of(robot: Manipulator) -> Manipulator:
    """Return the machine with NaN for every number: equal for all machines of a topology."""
    return with_stored_numbers(robot, iter(lambda: nan, None))


def stored_numbers(robot: Manipulator) -> list[float]:
    """Return all numbers in a machine's fields except inertia, drives and tools."""
    recorded: list[float] = []
    _replace(robot, recorded.append)
    return recorded


def with_stored_numbers(robot: Manipulator, numbers: Iterator[Any]) -> Manipulator:
    """Return the machine with other numbers, or expressions, in its fields, in order."""
    replaced: Manipulator = _replace(robot, lambda _: next(numbers))
    return replaced


def _replace(value: Any, exchange: Callable[[float], Any], is_sign: bool = False) -> Any:
    """Return a value with each float x in it (recursively) replaced by exchange(x), unchecked."""
    if isinstance(value, float) or (is_sign and isinstance(value, int)):
        return exchange(float(value))
    if isinstance(value, tuple):
        elements = [_replace(element, exchange) for element in value]
        return type(value)(*elements) if hasattr(value, "_fields") else tuple(elements)
    if not is_dataclass(value) or hasattr(value, "kinds"):
        return value
    signs: set[str] = set()
    if isinstance(value, LegKind):
        signs = {quantity.name for quantity in value.quantities if quantity.role == "sign"}
    replaced = object.__new__(type(value))
    for field in fields(value):
        content = getattr(value, field.name)
        # Which legs hold bars, that do not turn, is the machine's structure; what does not count in
        # comparisons, such as the record of a template, is no part of the machine.
        if field.compare and (field.name != "fixed_offset" or any(content)):
            content = _replace(content, exchange, field.name in signs)
        vars(replaced)[field.name] = content
    return replaced
