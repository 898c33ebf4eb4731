"""Units compared with the machine: sliders, poses and time steps that cannot be its own."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pteron.errors import DataError
from pteron.identification.logs.finding import Finding
from pteron.manipulator import Manipulator

__all__ = ["check_forces", "check_pose", "check_sliders", "check_step", "size_of", "standstill"]

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
    reach = max(
        leg.upper_length + leg.lower_length + float(np.linalg.norm(leg.platform_point))
        for leg in robot.legs
    )
    return float(apart + reach)


def check_sliders(
    sliders: NDArray[np.float64],
    robot: Manipulator,
    unit: str,
    columns: tuple[str, ...],
    source: str,
    first_row: int,
) -> None:
    """Raise a `DataError` where slider coordinates, (rows, n) in m, are too large for the machine.

    A slider cannot leave the others far behind: its coordinate is bound by its limits, or by the
    machine's size, along a guide that may be oblique to the leg's plane.
    """
    size = size_of(robot)
    for j, leg in enumerate(robot.legs):
        oblique = abs(float(np.dot(leg.direction, leg.e)))
        travel = size / oblique
        if leg.slider_limits is not None:
            travel = max(abs(limit) for limit in leg.slider_limits)
        beyond = np.abs(sliders[:, j]) > _BEYOND * travel
        if beyond.any():
            i = int(np.argmax(beyond))
            peak = float(np.abs(sliders[:, j]).max())
            raise DataError(
                f"{source}: row {first_row + i + 1}, column {columns[j]}: "
                f"{sliders[i, j]:g} m, read as {unit}, but the slider of this machine travels "
                f"about {travel:.2g} m; {_advice('sliders', 'unit', unit, peak, travel)}"
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
    size = size_of(robot) + far + max(_travel(leg.slider_limits) for leg in robot.legs)
    for j, column in enumerate(columns):
        largest = _TURNS if j == 3 else _BEYOND * size
        beyond = np.abs(pose[:, j]) > largest
        if not beyond.any():
            continue
        i = int(np.argmax(beyond))
        place = f"{source}: row {first_row + i + 1}, column {column}"
        if j == 3:
            raise DataError(
                f"{place}: {pose[i, j]:g} rad, read as {units[1]}, is over two turns; if the file "
                'holds degrees, say so: [pose] angle_unit = "deg" in a TOML file beside it'
            )
        peak = float(np.abs(pose[:, j]).max())
        raise DataError(
            f"{place}: {pose[i, j]:g} m, read as {units[0]}, but the machine extends about "
            f"{size:.2g} m; {_advice('pose', 'length_unit', units[0], peak, size)}"
        )


def standstill(
    travelled: NDArray[np.float64],
    robot: Manipulator,
    unit: str,
    columns: tuple[str, ...],
    source: str,
) -> tuple[Finding, ...]:
    """Return a finding where no slider moves by a thousandth of the machine: the unit may be wrong.

    `travelled` is between each slider's least and greatest coordinate, shape (n,), m.
    """
    size = size_of(robot)
    most = float(travelled.max())
    if most > _STANDSTILL * size:
        return ()
    message = (
        f"{source}: the sliders, read as {unit}, travel at most {most:.2g} m, where the machine "
        f"extends about {size:.2g} m; check their unit"
    )
    return (Finding("units", message, column=columns[int(np.argmax(travelled))]),)


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


def _travel(limits: tuple[float, float] | None) -> float:
    return 0.0 if limits is None else max(abs(limit) for limit in limits)


def _advice(table: str, key: str, unit: str, peak: float, size: float) -> str:
    for factor, smaller in _SMALLER:
        if unit == "m" and peak / factor <= _BEYOND * size:
            return (
                f"if the file holds {smaller}, say so: [{table}] {key} = "
                f'"{smaller}" in a TOML file beside it'
            )
    return "check the unit, and that the log belongs to this machine"
