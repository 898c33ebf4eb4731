"""A machine with a payload, a point mass at its tool or a body; a warning of an unlikely mass."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pteron.arguments import number_or_nan
from pteron.bodies.inertia import carried_values, inertia_count
from pteron.bodies.vectors import numbers, vector
from pteron.errors import DataError, ModelError, warn_unlikely
from pteron.manipulator import Manipulator, RobotLike, as_manipulator

_HEAVY = 20.0
"""Payload over the machine's moving mass above which it is likely in grams: light parallel robots
carry up to their own moving mass, presses and simulators up to ten times it."""


def payload_warning(robot: Manipulator, mass: float, center: Sequence[float] | None = None) -> str:
    """Return a warning if a payload of `mass` kg is unlikely for the machine; else ''.

    `center` is its centre of mass in the platform's frame, m; by default the tool's centre point.
    """
    place = robot.platform.tool if center is None else center
    if mass > 0.0 and robot.platform.fixed_point is not None and not any(place):
        return (
            f"a payload of {mass:g} kg at P, about which the platform turns, has no effect: give "
            "its centre of mass, or the machine a tool"
        )
    bodies = [body for leg in robot.legs for body in leg.bodies.values()]
    moving = sum(body.values[0] for body in (*bodies, robot.platform.total_inertia))
    if mass <= _HEAVY * moving:
        return ""
    return (
        f"a payload of {mass:g} kg, and the machine moves {moving:.3g} kg of its own: is it in "
        "grams?"
    )


def with_tool(robot: RobotLike, name: str) -> Manipulator:
    """Return the machine with one of the tools of its file mounted.

    The tool's centre point becomes `platform.tool`, and its body is part of the platform, as with
    `with_payload`; the other tools are gone.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    name : str
        The name of one of `robot.tools`.

    Returns
    -------
    Manipulator

    Raises
    ------
    DataError
        If the machine has no such tool.
    ModelError
        If no body has the tool's inertia.

    Examples
    --------
    >>> from dataclasses import replace
    >>> import pteron
    >>> from pteron.manipulator import Tool
    >>> from pteron.motion import with_tool
    >>> gripper = Tool("gripper", (0.0, 0.0, -0.08), 0.3, (0.0, 0.0, -0.03))
    >>> robot = with_tool(replace(pteron.load("delta"), tools=(gripper,)), "gripper")
    >>> robot.platform.tool
    (0.0, 0.0, -0.08)
    """
    robot = as_manipulator(robot)
    tools = {tool.name: tool for tool in robot.tools}
    if name not in tools:
        known = f"; it has {', '.join(tools)}" if tools else ", nor any other; add one as [[tools]]"
        raise DataError(f"tool: {robot.name} has no tool {name!r}{known}")
    tool = tools[name]
    bare = replace(robot, platform=replace(robot.platform, tool=tool.point), tools=())
    try:
        return add_payload(bare, tool.mass, tool.center, tool.central_inertia)
    except (DataError, ModelError) as error:
        raise ModelError(f"tool {name}: {error.message}", subject=robot.name) from None


def with_payload(
    robot: RobotLike,
    mass: float,
    center: Sequence[float] | None = None,
    inertia: float | Sequence[float] = 0.0,
) -> Manipulator:
    """Return the machine with a body on its platform: a point mass at the tool by default.

    The platform's mass becomes m + m_L, its first moment m gamma + m_L s and its inertia I + I_L +
    m_L |s|^2, s being the part of `center` perpendicular to the platform's axis; for a platform
    that tilts, s is all of `center` and the inertia is a tensor. Exported code does the same at run
    time by `set_payload`.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    mass : float
        The payload m_L, kg; 0 or more.
    center : vector, optional
        Its centre of mass in the platform's frame, m; by default the tool's centre point.
    inertia : float or sequence of float
        I_L about its own centre of mass, along the platform's axis, kg m^2; of a platform that
        tilts Ixx, Ixy, Ixz, Iyy, Iyz and Izz in the platform's frame. 0 is a point mass.

    Returns
    -------
    Manipulator

    Raises
    ------
    DataError
        If the mass is not a finite number of 0 or more.
    ModelError
        If no body has this inertia; if the platform slides, as that of an I4, and the payload is
        off the axis: what turns there has a first moment that the model of the platform has not.

    Warns
    -----
    UnlikelyValue
        If the mass is likely in grams, or has no effect since the platform turns about it.

    Examples
    --------
    >>> import numpy as np, pteron
    >>> from pteron.motion import with_payload
    >>> robot = pteron.load("quadrupteron")
    >>> with_payload(robot, 0.5).platform.inertia.mass
    1.3
    """
    machine = as_manipulator(robot)
    loaded = add_payload(machine, mass, center, inertia)
    if warning := payload_warning(machine, float(mass), center):
        warn_unlikely(warning)
    return loaded


def add_payload(
    robot: Manipulator,
    mass: float,
    center: Sequence[float] | None = None,
    inertia: float | Sequence[float] = 0.0,
) -> Manipulator:
    """Return the machine with a payload on its platform; unlike `with_payload` it never warns."""
    payload = number_or_nan(mass)
    if not (math.isfinite(payload) and payload >= 0.0):
        raise DataError(f"payload: {mass!r} given, a mass of 0 kg or more expected")
    platform, inertia_before = robot.platform, robot.platform.inertia
    center_of_mass = platform.tool if center is None else vector(center, "center")
    if platform.carries_on_axis and any(center_of_mass[:2]) and payload:
        place = "platform.tool" if center is None else "center"
        raise ModelError(
            f"{place} is {math.hypot(*center_of_mass[:2]):g} m off the axis of a platform that "
            f"slides, where a payload cannot be modelled; give {place} [0, 0, z]",
            subject=robot.name,
        )
    kind, count = type(inertia_before), inertia_count(inertia_before.kinds)
    inertia_numbers = np.ravel(inertia).tolist()
    tensor = numbers(
        [0.0] * count if inertia_numbers == [0.0] else inertia_numbers, "inertia", count
    )
    if payload == 0.0 and not any(tensor):
        return robot
    load = carried_values(kind, payload, center_of_mass, tensor)
    if any(tensor):
        kind.of_values(load)  # a body that is none says so
    parameters = [a + b for a, b in zip(inertia_before.values, load, strict=True)]
    return replace(robot, platform=replace(platform, inertia=kind.of_values(parameters)))
