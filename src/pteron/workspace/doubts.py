"""What is possible but unlikely in a machine or in values: most often a wrong unit or sign."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot

import numpy as np

from pteron.kernels import Array
from pteron.legs.doubts import leg_doubts, spread
from pteron.manipulator import Manipulator

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
    platform = robot.platform.inertia
    radius = max(hypot(*leg.platform_point) for leg in robot.legs)
    if radius > 0.0:
        found += [f"platform: {text}" for text in spread(platform, 3.0 * radius)]
    for i, leg in enumerate(robot.legs, start=1):
        found += [f"leg {i}: {text}" for text in leg_doubts(leg)]
    return tuple(found)


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
