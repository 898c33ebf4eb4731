"""Checks of a log's units: joints, poses or steps too large for the machine, or joints at rest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pteron.errors import DataError
from pteron.identification.logs.description import joint_symbols
from pteron.identification.logs.findings import Finding
from pteron.identification.logs.search import Group
from pteron.legs import LegKind
from pteron.manipulator import Manipulator
from pteron.tables import declaration

_BEYOND = 3.0
"""Largest coordinate, over the machine's size: encoders have their own zero."""

_TURNS = 4.0 * math.pi
"""Largest coordinate of a joint that makes few turns, rad."""

_LONGEST_STEP = 0.2
"""Longest time between samples, s."""

_LIKELY = (("ms", 1e2), ("us", 5e4))
"""Units suggested for steps that are too long in seconds, each with the step beyond which it is
unlikely too."""

_STANDSTILL = 1e-3
"""Travel of the joint that moves most, over its span, below which the unit may be wrong."""

_SMALLER = ((1e3, "mm"), (1e6, "um"))
"""Units suggested for lengths that are too large in metres."""


class Bound(NamedTuple):
    """A bound on a coordinate: a few times its usual size, m; two turns if that is None.

    Joints that turn without end have an infinite size.
    """

    usual: float | None
    owner: str
    """The part of the machine that has that size, for messages."""
    key: str
    """The key of its unit in the description."""


def joint_bounds(robot: Manipulator) -> list[Bound]:
    """Return the bound on each joint's coordinate.

    A joint cannot leave the others far behind: its coordinate is bound by its limits, or by the
    machine's size, along a guide that may be oblique to the leg's plane. A crank makes few turns; a
    joint that turns the platform makes any number.
    """
    owner, key = "the joint of this machine travels", "[joints] unit"
    return [Bound(_travel_of(leg, robot), owner, key) for leg in robot.legs]


def pose_bounds(robot: Manipulator) -> list[Bound]:
    """Return the bound on each coordinate of a measured pose."""
    far = max(float(np.linalg.norm(leg.guide_point)) for leg in robot.legs)
    limits = [leg.limits for leg in robot.legs if leg.joint.unit == "m"]
    size = _size_of(robot) + far + max(map(_farthest, limits), default=0.0)
    length = Bound(size, "the machine extends", "[pose] length_unit")
    key = "[pose] angle_unit"
    # A joint that turns with the platform makes any number of turns.
    endless = robot.platform.angular & ~robot.wraps & bool(robot.platform.rotation_axes)
    angles = [Bound(math.inf if turns else None, "", key) for turns in endless]
    each = zip(angles, robot.platform.angular, strict=True)
    return [angle if angular else length for angle, angular in each]


def check_bounds(
    moved: NDArray[np.float64], bounds: Sequence[Bound], group: Group, source: str, first_row: int
) -> None:
    """Raise a `DataError` where coordinates `moved`, (rows, n) in SI, exceed their bounds."""
    for j, (usual, owner, key) in enumerate(bounds):
        beyond = np.abs(moved[:, j]) > (_TURNS if usual is None else _BEYOND * usual)
        if not beyond.any():
            continue
        i, unit, name = int(np.argmax(beyond)), group.units[j], group.printable_names[j]
        place = f"{source}: row {first_row + i + 1}, column {name}: {moved[i, j]:g}"
        if usual is None:
            raise DataError(
                f"{place} rad, read as {unit}, is over two turns; {_declare('degrees', key, 'deg')}"
            )
        advice, peak = "check the unit, and that the log belongs to this machine", np.inf
        if unit == "m":
            peak = float(np.abs(moved[:, j]).max())
        for factor, smaller in reversed(_SMALLER):
            if peak / factor <= _BEYOND * usual:
                advice = _declare(smaller, key, smaller)
        raise DataError(f"{place} m, read as {unit}, but {owner} about {usual:.2g} m; {advice}")


def check_step(step: float, column: str, source: str) -> None:
    """Raise a `DataError` if a median step, s, of no declared unit is too long for a motion."""
    if step <= _LONGEST_STEP:
        return
    likely = next((unit for unit, most in _LIKELY if step < most), "ns")
    raise DataError(
        f"{source}: column {column}: the median step is {step:g} s, where a motion is sampled at "
        f'under {_LONGEST_STEP:g} s; if these are seconds, declare unit = "s"; '
        + _declare(likely, "[time] unit", likely)
    )


def standstill_findings(
    travelled: NDArray[np.float64], robot: Manipulator, group: Group, source: str, *, declared: bool
) -> tuple[Finding, ...]:
    """Return a finding where no joint moves by a thousandth of its span: the unit may be wrong.

    `travelled` is between each joint's least and greatest coordinate, shape (n,), m or rad.

    Raises
    ------
    DataError
        If a unit that the file says, and that nobody has `declared`, would make it so.
    """
    spans = joint_spans(robot)
    j = int(np.argmax(travelled / spans))
    if travelled[j] > _STANDSTILL * spans[j]:
        return ()
    joint = joint_symbols(robot)[j]
    machine = f", where {spans[j]:.2g} m is usual of this machine" if joint.unit == "m" else ""
    message = (
        f"{source}: the {joint.noun}s, read as {group.units[j]}, travel at most {travelled[j]:.2g} "
        f"{joint.unit}{machine}; check their unit"
    )
    if group.units[j] != joint.unit and not declared:
        raise DataError(
            f"{message}, and say it in a TOML file beside it:"
            + declaration("joints", unit=joint.unit)
        )
    return (Finding("units", message, column=group.printable_names[j]),)


def joint_spans(robot: Manipulator) -> NDArray[np.float64]:
    """Return the usual travel of each joint (n,): the machine's size or 1 rad, or its stroke."""
    size = _size_of(robot)
    strokes = [np.ptp(leg.limits) if leg.limits else np.inf for leg in robot.legs]
    return np.minimum([size if leg.joint.unit == "m" else 1.0 for leg in robot.legs], strokes)


def _size_of(robot: Manipulator) -> float:
    """Return the extent of a machine, m: between its guide points, along a leg and its platform."""
    points = np.array([leg.guide_point for leg in robot.legs])
    width = np.linalg.norm(points[:, None] - points, axis=-1).max()
    offsets = [[leg.platform_point, leg.fixed_offset] for leg in robot.legs]
    lengths = np.linalg.norm(offsets, axis=-1).sum(axis=-1)
    reach = max(leg.size + length for leg, length in zip(robot.legs, lengths, strict=True))
    return float(width + reach)


def _travel_of(leg: LegKind, robot: Manipulator) -> float | None:
    """Return a slider's usual travel, m; infinity for an endless joint, None for a crank."""
    if leg.joint.unit == "rad":
        return None if leg.goes_round else math.inf
    if leg.limits is not None or leg.reach_bound is None:
        return _farthest(leg.limits)
    # Along a guide that is oblique to the leg's reach the slider travels farther.
    return _size_of(robot) * max(leg.reach_bound.radius / leg.size, 1.0)


def _farthest(limits: tuple[float, float] | None) -> float:
    """Return the larger absolute limit; 0 without limits."""
    return 0.0 if limits is None else max(abs(limit) for limit in limits)


def _declare(contents: str, key: str, unit: str) -> str:
    """Return advice to declare a unit in a TOML file, with the lines to write."""
    table, _, subkey = key.partition("] ")
    said = declaration(table.removeprefix("["), **{subkey: unit})
    return f"if the file holds {contents}, say so in a TOML file beside it:{said}"
