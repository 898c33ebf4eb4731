"""A machine with a payload, a point mass at its tool, and a warning of an unlikely mass."""

from __future__ import annotations

import math
from dataclasses import replace

from pteron.errors import DataError, ModelError
from pteron.manipulator import Manipulator, RobotLike, as_manipulator

_HEAVY = 20.0
"""Payload over the machine's moving mass above which it is likely in grams."""


def payload_warning(robot: Manipulator, mass: float) -> str:
    """Return a warning about an unlikely payload, kg, as a clause; else an empty text."""
    bodies = [body for leg in robot.legs for body in leg.bodies.values()]
    moving = sum(body.values[0] for body in (*bodies, robot.platform.joined))
    if mass <= _HEAVY * moving:
        return ""
    return (
        f"a payload of {mass:g} kg, and the machine moves {moving:.3g} kg of its own: is it in "
        "grams?"
    )


def with_payload(robot: RobotLike, mass: float) -> Manipulator:
    """Return the machine with a point mass at the tool's centre point.

    It is the same machine whose platform is heavier: m + m_L, m gamma + m_L s and I + m_L |s|^2,
    s being `platform.tool` across the platform's axis; as a whole, where the platform tilts, and
    with its part of the inertia tensor.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    mass : float
        The payload m_L, kg; 0 or more.

    Returns
    -------
    Manipulator

    Raises
    ------
    DataError
        If the mass is not a finite number of 0 or more.
    ModelError
        If the platform slides, as that of an I4, and its tool is off the axis: what turns with such
        a tool has a first moment that the model of the platform has not.

    Examples
    --------
    >>> import numpy as np, pteron
    >>> from pteron.motion import with_payload
    >>> robot = pteron.load("quadrupteron")
    >>> with_payload(robot, 0.5).platform.inertia.mass
    1.3
    """
    robot = as_manipulator(robot)
    try:
        carried = float(mass)
    except (TypeError, ValueError):
        carried = math.nan
    if not (math.isfinite(carried) and carried >= 0.0):
        raise DataError(f"payload: {mass!r} given, a mass of 0 kg or more expected")
    if carried == 0.0:
        return robot
    platform = robot.platform
    x, y, z = platform.tool
    if platform.slides and (x, y) != (0.0, 0.0):
        raise ModelError(
            f"platform.tool is {math.hypot(x, y):g} m off the axis of a platform that slides, "
            "where a payload cannot be modelled; give the tool [0, 0, z]",
            subject=robot.name,
        )
    own, shares = platform.inertia, platform.inertia.shares_of_point(x, y, z).values()
    values = [value + carried * share for value, share in zip(own.values, shares, strict=True)]
    return replace(robot, platform=replace(platform, inertia=type(own).of_values(values)))
