"""Units compared with the machine: joints, poses and time steps that cannot be its own."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pteron.errors import DataError
from pteron.identification.logs.joints import joint_symbols
from pteron.identification.logs.log import Finding
from pteron.legs import LegKind
from pteron.manipulator import Manipulator

_BEYOND = 3.0
"""How far beyond the machine's size a coordinate may lie; encoders have their own zero."""
_TURNS = 4.0 * math.pi
_STRONGEST = 1e9
"""Force that no actuator has, N."""
_LONGEST_STEP = 0.2
_STANDSTILL = 1e-3
_SMALLER = ((1e3, "mm"), (1e6, "um"))


def size_of(robot: Manipulator) -> float:
    """Return the extent of a machine, m: between its guide points, along a leg and its platform."""
    points = np.array([leg.guide_point for leg in robot.legs])
    apart = np.linalg.norm(points[:, None] - points, axis=-1).max()
    reach = max(leg.size + float(np.linalg.norm(leg.platform_point)) for leg in robot.legs)
    return float(apart + reach)


def joint_spans(robot: Manipulator) -> NDArray[np.float64]:
    """Return what a travel of each joint is compared with, (n,): the machine's size, m; 1 rad."""
    size = size_of(robot)
    return np.array([size if joint.unit == "m" else 1.0 for joint in joint_symbols(robot)])


def check_joints(
    joints: NDArray[np.float64],
    robot: Manipulator,
    units: tuple[str, ...],
    columns: tuple[str, ...],
    source: str,
    first_row: int,
) -> None:
    """Raise a `DataError` where joint coordinates, (rows, n) in SI, are too large for the machine.

    A joint cannot leave the others far behind: its coordinate is bound by its limits, or by the
    machine's size, along a guide that may be oblique to the leg's plane. A crank makes few turns.
    """
    for j, (leg, joint) in enumerate(zip(robot.legs, joint_symbols(robot), strict=True)):
        values = joints[:, j]
        travel = _BEYOND * _travel_of(leg, robot) if joint.unit == "m" else _TURNS
        beyond = np.abs(values) > travel
        if not beyond.any():
            continue
        i = int(np.argmax(beyond))
        place = f"{source}: row {first_row + i + 1}, column {columns[j]}"
        if joint.unit != "m":
            raise DataError(f"{place}: {_turned(values[i], units[j], 'joints', 'unit')}")
        usual = travel / _BEYOND
        advice = _advice("joints", "unit", units[j], float(np.abs(values).max()), usual)
        raise DataError(
            f"{place}: {values[i]:g} m, read as {units[j]}, but the joint of this machine travels "
            f"about {usual:.2g} m; {advice}"
        )


def check_forces(
    forces: NDArray[np.float64], columns: tuple[str, ...], source: str, first_row: int
) -> None:
    """Raise a `DataError` where forces, (rows, n), are larger than any actuator's."""
    beyond = ~(np.abs(forces) <= _STRONGEST)
    if beyond.any():
        i, j = (int(k) for k in np.argwhere(beyond)[0])
        raise DataError(
            f"{source}: row {first_row + i + 1}, column {columns[j]}: {forces[i, j]:g} is no "
            f"force; up to {_STRONGEST:g} is expected; correct the value, or leave the row out"
        )


def check_pose(
    pose: NDArray[np.float64],
    robot: Manipulator,
    units: tuple[str, str],
    columns: tuple[str, ...],
    source: str,
    first_row: int,
) -> None:
    """Raise a `DataError` where measured poses, (rows, m), are too large for the machine."""
    far = max(float(np.linalg.norm(leg.guide_point)) for leg in robot.legs)
    size = size_of(robot) + far + max(_farthest(leg.limits) for leg in robot.legs)
    for j, column in enumerate(columns):
        turns = robot.coordinates[j] == "phi"
        largest = _TURNS if turns else _BEYOND * size
        beyond = np.abs(pose[:, j]) > largest
        if not beyond.any():
            continue
        i = int(np.argmax(beyond))
        place = f"{source}: row {first_row + i + 1}, column {column}"
        if turns:
            raise DataError(f"{place}: {_turned(pose[i, j], units[1], 'pose', 'angle_unit')}")
        peak = float(np.abs(pose[:, j]).max())
        raise DataError(
            f"{place}: {pose[i, j]:g} m, read as {units[0]}, but the machine extends about "
            f"{size:.2g} m; {_advice('pose', 'length_unit', units[0], peak, size)}"
        )


def standstill(
    travelled: NDArray[np.float64],
    robot: Manipulator,
    units: tuple[str, ...],
    columns: tuple[str, ...],
    source: str,
) -> tuple[Finding, ...]:
    """Return a finding where no joint moves by a thousandth of its span: the unit may be wrong.

    `travelled` is between each joint's least and greatest coordinate, shape (n,), m or rad.
    """
    spans = joint_spans(robot)
    j = int(np.argmax(travelled / spans))
    if travelled[j] > _STANDSTILL * spans[j]:
        return ()
    joint = joint_symbols(robot)[j]
    machine = f", where the machine extends about {spans[j]:.2g} m" if joint.unit == "m" else ""
    message = (
        f"{source}: the {joint.noun}s, read as {units[j]}, travel at most {travelled[j]:.2g} "
        f"{joint.unit}{machine}; check their unit"
    )
    return (Finding("units", message, column=columns[j]),)


def check_step(step: float, column: str, source: str) -> None:
    """Raise a `DataError` if a median step, s, of no declared unit is too long for a motion."""
    if step <= _LONGEST_STEP:
        return
    likely = "ms" if step < 1e2 else "us"
    raise DataError(
        f"{source}: column {column}: the median step is {step:g} s, where a motion is sampled at "
        f'under {_LONGEST_STEP:g} s; if the file holds {likely}, say so: [time] unit = "{likely}" '
        'in a TOML file beside it; if these are seconds, unit = "s"'
    )


def _travel_of(leg: LegKind, robot: Manipulator) -> float:
    if leg.limits is not None:
        return _farthest(leg.limits)
    # Along a guide that is oblique to the leg's reach the slider travels farther.
    return size_of(robot) * max(leg.reach_bound.radius / leg.size, 1.0)


def _farthest(limits: tuple[float, float] | None) -> float:
    return 0.0 if limits is None else max(abs(limit) for limit in limits)


def _turned(value: float, unit: str, table: str, key: str) -> str:
    return (
        f"{value:g} rad, read as {unit}, is over two turns; if the file holds degrees, say so: "
        f'[{table}] {key} = "deg" in a TOML file beside it'
    )


def _advice(table: str, key: str, unit: str, peak: float, size: float) -> str:
    for factor, smaller in _SMALLER:
        if unit == "m" and peak / factor <= _BEYOND * size:
            return (
                f"if the file holds {smaller}, say so: [{table}] {key} = "
                f'"{smaller}" in a TOML file beside it'
            )
    return "check the unit, and that the log belongs to this machine"
