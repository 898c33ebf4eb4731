"""What is possible but unlikely in a machine or in values: most often a wrong unit or sign."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import hypot, pi, sqrt
from typing import Any

import numpy as np

from pteron.bodies.vectors import Vector, cross
from pteron.kernels import Array
from pteron.legs import LegKind
from pteron.manipulator import Manipulator

_LARGE = 10.0
"""Length, m, beyond which millimetres are likelier."""

_ROUNDING = 1e-9

_UNLIKE = 20.0
"""How many times a uniform bar's, about its centre, a link's inertia may be, or the inverse: two
masses at its ends have 3 times."""

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
    platform = robot.platform
    if hypot(*platform.tool) > _LARGE:
        found.append(f"platform: tool: {list(platform.tool)} m: are these mm?")
    radius = max(hypot(*leg.platform_point) for leg in robot.legs)
    if radius > 0.0:
        found += [f"platform: {text}" for text in _spread(platform.joined, 3.0 * radius)]
    axis = platform.axis if platform.turns and not platform.slides else None
    for i, leg in enumerate(robot.legs, start=1):
        found += [f"leg {i}: {text}" for text in (*_leg_doubts(leg), *leg.doubts(axis))]
    if axis is not None:
        found += _turning_offsets(robot.legs, axis)
    return tuple(found)


def _leg_doubts(leg: LegKind) -> Iterator[str]:
    """Yield what a person should look at again, one line each."""
    for q in leg.quantities:
        if q.role == "length" and q.value[0] > _LARGE:
            yield f"{q.name}: {q.value[0]:g} m: are these mm?"
    for key in ("guide_point", "platform_point", "fixed_offset"):
        if hypot(*getattr(leg, key)) > _LARGE:
            yield f"{key}: {list(getattr(leg, key))} m: are these mm?"
    far = hypot(*leg.platform_point)
    if 0.0 < leg.size < far <= _LARGE:
        yield (
            f"platform_point: {far:g} m from P, farther than the leg is long: is it in the "
            "platform's frame?"
        )
    if leg.limits is not None:
        yield from (f"limits: {text}" for text in _range(leg.limits, leg.joint.unit))
    for letter, (key, low, high, ends) in leg.extents.items():
        body: Any = leg.bodies[letter]
        x, length = body.center_of_mass[0], high - low
        if not low - _ROUNDING * length <= x <= high + _ROUNDING * length:
            turned = f"; is it {-x:g}?" if low <= -x <= high else ""
            yield (
                f"{key}: center_of_mass: x = {x:g} m is not between {ends}: {low:g} to {high:g} m "
                f"is usual{turned}"
            )
        yield from (f"{key}: {text}" for text in _unlike_a_bar(body, length))


def _range(limits: tuple[float, float], unit: str) -> Iterator[str]:
    most = max(map(abs, limits))
    if unit == "m" and most > _LARGE:
        yield f"{list(limits)} m: are these mm?"
    if unit == "rad" and most > 2.0 * pi:
        yield f"{list(limits)} rad: are these degrees?"


def _turning_offsets(legs: Sequence[LegKind], axis: Vector) -> Iterator[str]:
    """Yield the legs whose fixed offset is kept from turning by no leg at the same hinge."""
    keeps: dict[Vector, bool] = {}
    for leg in legs:
        free = np.array(leg.free_axes(None)).reshape(-1, 3)
        held = np.linalg.matrix_rank(np.vstack([free, axis])) > np.linalg.matrix_rank(free)
        keeps[leg.platform_point] = keeps.get(leg.platform_point, False) or bool(held)
    for i, leg in enumerate(legs, start=1):
        if hypot(*cross(leg.fixed_offset, axis)) > 0.0 and not keeps[leg.platform_point]:
            yield (
                f"leg {i}: fixed_offset: does not turn with phi, but no leg at this platform_point "
                "keeps it from turning"
            )


def _unlike_a_bar(body: Any, length: float) -> Iterator[str]:
    """Yield what in a link's inertia is far from that of a bar of its length."""
    beside = hypot(*body.center_of_mass[1:])
    if beside > length:
        yield f"center_of_mass: {beside:g} m beside it: are these mm?"
        return
    own = body.inertia - body.mass * sum(x * x for x in body.center_of_mass)
    share = own / (body.mass * length * length / 12.0)
    if not 1.0 / _UNLIKE <= share <= _UNLIKE:
        yield (
            f"inertia: {body.inertia:g} kg m^2 leaves {own:.3g} about the centre of mass, "
            f"{share:.2g} times that of a uniform bar: is it about the origin, in kg m^2?"
        )


def _spread(body: Any, size: float) -> Iterator[str]:
    """Yield what lies farther from the platform's P than a platform of a size has it."""
    off = hypot(*body.center_of_mass)
    if off > size:
        yield f"center_of_mass: {off:g} m away: are these mm?"
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
