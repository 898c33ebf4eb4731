"""What is possible but unlikely in a machine or in values: most often a wrong unit or sign."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import hypot, sqrt
from typing import Any

import numpy as np

from pteron.kernels import Array
from pteron.legs import LegKind
from pteron.manipulator import Manipulator

_LARGE = 10.0
"""Length, m, beyond which millimetres are likelier."""

_ROUNDING = 1e-9

_PULL = 30.0
"""Gravity, m/s^2, beyond which another unit is likelier."""


def doubts(robot: Manipulator) -> tuple[str, ...]:
    """Return what a person should look at again, one line each.

    Parameters
    ----------
    robot : Manipulator
        The machine.

    Returns
    -------
    tuple of str
        Each begins with the place: ``leg 2: lower: center_of_mass: ...``.

    Examples
    --------
    >>> import pteron
    >>> from pteron.workspace.doubts import doubts
    >>> doubts(pteron.load("quadrupteron"))
    ()
    """
    found = []
    if hypot(*robot.gravity) > _PULL:
        found.append(f"gravity: {hypot(*robot.gravity):g} m/s^2: is that mm/s^2?")
    platform = robot.platform.joined
    radius = max(hypot(*leg.platform_point) for leg in robot.legs)
    if radius > 0.0:
        found += [f"platform: {text}" for text in _spread(platform, 3.0 * radius)]
    for i, leg in enumerate(robot.legs, start=1):
        found += [f"leg {i}: {text}" for text in _leg_doubts(leg)]
    return tuple(found)


def _leg_doubts(leg: LegKind) -> Iterator[str]:
    """Yield what a person should look at again, one line each."""
    for q in leg.quantities:
        if q.role == "length" and q.value[0] > _LARGE:
            yield f"{q.name}: {q.value[0]:g} m: are these mm?"
    for key in ("guide_point", "platform_point"):
        if hypot(*getattr(leg, key)) > _LARGE:
            yield f"{key}: {list(getattr(leg, key))} m: are these mm?"
    for letter, (key, low, high, ends) in leg.extents.items():
        body: Any = leg.bodies[letter]
        x, length = body.center_of_mass[0], high - low
        if not low - _ROUNDING * length <= x <= high + _ROUNDING * length:
            turned = f"; is it {-x:g}?" if low <= -x <= high else ""
            yield (
                f"{key}: center_of_mass: x = {x:g} m is not between {ends}: {low:g} to {high:g} m "
                f"is usual{turned}"
            )
        for text in _spread(body, length, along=False):
            yield f"{key}: {text}"


def _spread(body: Any, size: float, along: bool = True) -> Iterator[str]:
    """Yield what lies farther from a body's reference point than a body of a size has it."""
    center = body.center_of_mass
    off = hypot(*center) if along else hypot(*center[1:])
    if off > size:
        yield f"center_of_mass: {off:g} m {'away' if along else 'beside it'}: are these mm?"
    if sqrt(body.inertia / body.mass) > 3.0 * size:
        yield (
            f"inertia: {body.inertia:g} kg m^2 with {body.mass:g} kg is mass "
            f"{sqrt(body.inertia / body.mass):g} m away: is it in kg m^2?"
        )


def value_doubts(robot: Manipulator, columns: Sequence[str], values: Array) -> tuple[str, ...]:
    """Return what is unlikely in poses or joint coordinates, one line each.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    columns : sequence of str
        What the values are: ``x``, ``phi``, ``rho1``, ...; others are not looked at.
    values : array, shape (..., len(columns))
        m and rad.

    Returns
    -------
    tuple of str
    """
    size = max(
        hypot(*leg.guide_point) + leg.size + hypot(*leg.platform_point) for leg in robot.legs
    )
    units = {"phi": "rad"} | {
        f"{leg.joint.coordinate}{i}": leg.joint.unit for i, leg in enumerate(robot.legs, start=1)
    }
    lengths = [k for k, name in enumerate(columns) if name in "xyz" or units.get(name) == "m"]
    angles = [k for k, name in enumerate(columns) if units.get(name) == "rad"]
    found = []
    for chosen, far, question in (
        (lengths, 10.0 * size, "are these mm? m are expected"),
        (angles, 2.0 * np.pi, "are these degrees? rad are expected"),
    ):
        largest = float(np.nanmax(np.abs(values[..., chosen]), initial=0.0))
        if largest > far:
            names = ", ".join(columns[k] for k in chosen)
            found.append(f"{names} up to {largest:g}: {question}")
    return tuple(found)
