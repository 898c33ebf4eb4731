"""The record of a machine in files that belong to it, and the comparison with a machine.

A file of gains, of identified values or of calibrated ones fits one machine. Its record has a
digest of the topology, one of the geometry, and the geometry's numbers, so that a difference has a
name. Masses, drives and limits do not count.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import fields
from hashlib import sha256
from typing import Any, NamedTuple

import numpy as np

from pteron.errors import DataError, shorten, warn_unlikely
from pteron.manipulator.manipulator import Manipulator

MOST_DIFFERENCE = 0.01
"""Largest relative difference of a dimension at which a file still fits a machine.

Calibration moves lengths and points of a built machine by some 0.1 %, directions by some mrad; two
designs differ by more than 1 %. Chosen: gains and base parameters of a machine that is 1 % off
change by about as much, which margins of control and intervals of identification have room for.
"""

_DIGITS = 16
"""Hexadecimal digits of a digest: two machines of 2^32 share one by chance."""

_ANGULAR = ("direction", "normal")
"""Roles of quantities that are unit vectors."""


class _Dimension(NamedTuple):
    """A named quantity of a machine's geometry, with the role that defines its differences."""

    name: str
    """As files name it: "legs[1].lower_length", "platform.axis"."""
    role: str
    values: tuple[float, ...]


def machine_record(robot: Manipulator) -> dict[str, Any]:
    """Return a machine's name, layout and dimensions as a table, to be stored in a file."""
    dimensions = {d.name: [float(v) for v in d.values] for d in _dimensions(robot)}
    return {
        "name": robot.name,
        "layout": _layout(robot),
        "topology": _digest(_layout(robot)),
        "geometry": _digest(dimensions),
        "dimensions": dimensions,
    }


def expect_machine(record: object, robot: Manipulator, source: object) -> None:
    """Raise if the machine recorded in a file differs from the machine used with it.

    Without a record (files of earlier versions) nothing is compared. A difference of at most
    `MOST_DIFFERENCE`, as of a calibrated machine, is issued as a warning, `UnlikelyValue`.

    Raises
    ------
    DataError
        If the topology is another one, or a dimension differs by more.
    """
    if record is None:
        return
    if not isinstance(record, Mapping):
        raise DataError(f"{source}: machine: {shorten(record)} given, a table expected")
    expected = machine_record(robot)
    name = shorten(record.get("name"))
    if record.get("topology") != expected["topology"]:
        raise DataError(
            f"{source}: belongs to {name}, a machine of another topology "
            f"({shorten(record.get('layout'))}) than {robot.name} ({expected['layout']}); give the "
            "machine that it was made for"
        )
    if record.get("geometry") == expected["geometry"]:
        return
    difference, text = _largest_difference(record, robot, source)
    if not difference <= MOST_DIFFERENCE:
        raise DataError(
            f"{source}: belongs to {name}, whose dimensions differ from those of {robot.name}: "
            f"{text}, at most {MOST_DIFFERENCE:.0%} expected; give the machine that it was made "
            "for, or make the file anew"
        )
    if difference > 0.0:
        warn_unlikely(f"{source}: made for {name} of slightly other dimensions: {text}")


def _largest_difference(
    record: Mapping[str, Any], robot: Manipulator, source: object
) -> tuple[float, str]:
    """Return the largest relative difference of dimensions, and a text that names it."""
    numbers = record.get("dimensions")
    if not isinstance(numbers, Mapping):
        raise DataError(f"{source}: machine.dimensions: missing; make the file anew")
    dimensions = list(_dimensions(robot))
    size = max(np.linalg.norm(d.values) for d in dimensions if d.role in ("length", "point"))
    optional = {"platform.axis_offset"} & ({d.name for d in dimensions} ^ set(numbers))
    if optional:
        return math.inf, f"one of them has no {optional.pop()}"
    worst, text = 0.0, ""
    for dimension in dimensions:
        here = np.array(dimension.values)
        try:
            there = np.array(numbers[dimension.name], dtype=float)
            if there.shape != here.shape or not np.isfinite(there).all():
                raise ValueError
        except (KeyError, TypeError, ValueError):
            raise DataError(
                f"{source}: machine.dimensions: {dimension.name}: {len(here)} numbers expected; "
                "make the file anew"
            ) from None
        difference = _relative_difference(dimension.role, here, there, float(size))
        if difference > worst:
            worst = difference
            text = (
                f"{dimension.name} is {_numbers(there)} in the file and {_numbers(here)} in the "
                f"machine ({difference:.2%} off)"
            )
    return worst, text


def _relative_difference(role: str, here: Any, there: Any, size: float) -> float:
    """Return |difference| / length, for points over the machine's size; for directions in rad."""
    change = float(np.linalg.norm(there - here))
    if role in _ANGULAR:
        return change
    if role == "point":
        return change / size
    return change / max(float(np.linalg.norm(here)), 1e-300)


def _layout(robot: Manipulator) -> str:
    """Return a machine's topology as text: "3T: RSS+ RSS+ RSS+", with the signs of its elbows."""
    platform = robot.platform
    legs = []
    for leg in robot.legs:
        signs = [float(v) for q in leg.quantities if q.role == "sign" for v in q.value]
        legs.append(leg.type + "".join("+" if sign > 0.0 else "-" for sign in signs))
    angles = f" {platform.angle_order}" if platform.has_angle_order else ""
    slides = ", slides" if platform.slides else ""
    slides += ", axes apart" if platform.axis_offset is not None else ""
    return f"{platform.motion}{angles}{slides}: {' '.join(legs)}"


def _dimensions(robot: Manipulator) -> Iterator[_Dimension]:
    """Yield each geometric dimension of a machine by name: of every leg, then the platform."""
    for i, leg in enumerate(robot.legs, start=1):
        stored = {field.name for field in fields(leg)}
        for quantity in leg.quantities:
            # Quantities without a field are derived from the others.
            if quantity.role != "sign" and quantity.name in stored:
                yield _Dimension(f"legs[{i}].{quantity.name}", quantity.role, tuple(quantity.value))
        yield _Dimension(f"legs[{i}].platform_point", "point", leg.platform_point)
        yield _Dimension(f"legs[{i}].fixed_offset", "point", leg.fixed_offset)
    platform = robot.platform
    yield _Dimension("platform.axis", "direction", platform.axis)
    if platform.x_axis is not None:
        yield _Dimension("platform.x_axis", "direction", platform.x_axis)
    if platform.second_axis is not None:
        yield _Dimension("platform.second_axis", "direction", platform.second_axis)
    if platform.center is not None:
        yield _Dimension("platform.center", "point", platform.center)
    if platform.axis_offset is not None:
        yield _Dimension("platform.axis_offset", "point", platform.axis_offset)


def _digest(content: object) -> str:
    """Return a SHA-256 digest of JSON content, shortened, as hexadecimal digits."""
    return sha256(json.dumps(content).encode()).hexdigest()[:_DIGITS]


def _numbers(components: Any) -> str:
    """Return numbers as text with six digits, separated by commas."""
    return ", ".join(f"{component:.6g}" for component in components)
