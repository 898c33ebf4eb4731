"""`Tool`: a tool that a machine's platform can carry, with its centre point and its inertia."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from pteron.arguments import checked_arguments
from pteron.bodies.inertia import inertia_count
from pteron.bodies.vectors import Vector, not_negative, number, numbers, vector
from pteron.manipulator.names import name_faults
from pteron.platforms import Platform
from pteron.toml import keep_checked

_SPATIAL = 6
"""Numbers of a tensor: Ixx, Ixy, Ixz, Iyy, Iyz, Izz."""


@checked_arguments
@dataclass(frozen=True)
class Tool:
    """A tool: a body that the platform carries where it is mounted, and its centre point.

    `pteron.motion.with_tool` mounts it; a controller's `set_payload` takes its last three numbers.

    Parameters
    ----------
    name : str
        What it is called.
    point : vector
        Its centre point in the platform's frame, m.
    mass : float
        kg; 0 of one that is in the platform's mass already.
    center_of_mass : vector, optional
        In the platform's frame, m; by default its centre point.
    central_inertia : float or sequence of float
        About its own centre of mass, kg m^2: along the platform's axis; of a platform that tilts
        Ixx, Ixy, Ixz, Iyy, Iyz and Izz in the platform's frame. 0 is a point mass.

    Raises
    ------
    ModelError
        If it has no name, the mass is negative, or what must be a number is none.
    """

    name: str
    point: Vector = (0.0, 0.0, 0.0)
    mass: float = 0.0
    center_of_mass: Vector | None = None
    central_inertia: float | tuple[float, ...] = 0.0

    def __post_init__(self) -> None:
        checks: dict[str, Callable[[Any, str], object]] = {
            "point": vector,
            "mass": partial(not_negative, unit="kg"),
            "central_inertia": _inertia,
        }
        if self.center_of_mass is not None:
            checks["center_of_mass"] = vector
        keep_checked(self, checks, name_faults(self.name))

    @property
    def center(self) -> Vector:
        """The tool's centre of mass in the platform's frame, m."""
        return self.point if self.center_of_mass is None else self.center_of_mass

    def turned(self, turn: Callable[[Vector], Vector]) -> Tool:
        """Return the tool in a rotated frame of the platform: every vector v becomes turn(v)."""
        center, inertia = self.center_of_mass, self.central_inertia
        if isinstance(inertia, tuple):
            rotation = np.array(
                [turn((1.0, 0.0, 0.0)), turn((0.0, 1.0, 0.0)), turn((0.0, 0.0, 1.0))]
            ).T
            places, tensor = np.triu_indices(3), np.zeros((3, 3))
            tensor[places] = inertia
            tensor = tensor + np.triu(tensor, 1).T
            inertia = tuple((rotation @ tensor @ rotation.T)[places].tolist())
        return replace(
            self,
            point=turn(self.point),
            center_of_mass=None if center is None else turn(center),
            central_inertia=inertia,
        )


def tool_faults(platform: Platform, tools: Sequence[Tool]) -> Iterator[str]:
    """Yield the faults of a machine's tools, as lines of text."""
    names = [tool.name for tool in tools]
    for i, tool in enumerate(tools, start=1):
        if tool.name in names[: i - 1]:
            yield f"tools, item {i}: name: {tool.name!r} is listed twice; give each its own name"
        several = isinstance(tool.central_inertia, tuple)
        if tool.central_inertia != 0.0 and several != (inertia_count(platform.inertia.kinds) > 1):
            components = platform.inertia_names
            expected = ", ".join(components) if len(components) > 1 else "one number"
            yield (
                f"tools, item {i}: central_inertia: {tool.central_inertia} given, {expected} "
                f"expected for a {platform.motion} platform"
            )


def _inertia(raw: Any, key: str) -> float | tuple[float, ...]:
    """Return a tool's inertia from a file: one number, or six for a spatial inertia."""
    return numbers(raw, key, _SPATIAL) if isinstance(raw, Sequence) else number(raw, key)
