"""The coordinates of a pose by name: their units, and how they are written for people."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

Unit = Literal["m", "rad"]

SHOWN: dict[str, tuple[str, float]] = {"m": ("mm", 1e3), "rad": ("°", 180.0 / math.pi)}
"""The display unit of lengths and angles by their SI unit, and its value per SI unit."""

_TURN_ROUNDING = 1e-14
"""Tolerance of an angle of half a turn, rad: rounding."""


class Coordinate(NamedTuple):
    """A coordinate of a pose.

    Parameters
    ----------
    unit : {"m", "rad"}
        Its SI unit.
    symbol : str
        The letter that formulas and pictures have for it.
    wrench : str
        The name of the force, or the moment, that does work along it.
    """

    unit: Unit
    symbol: str
    wrench: str

    @property
    def shown_unit(self) -> str:
        """The unit in which the coordinate is shown: "mm" or "deg"."""
        return SHOWN[self.unit][0]

    @property
    def shown_factor(self) -> float:
        """The factor from the coordinate's SI unit to `shown_unit`."""
        return SHOWN[self.unit][1]


COORDINATES: dict[str, Coordinate] = {
    "x": Coordinate("m", "x", "fx"),
    "y": Coordinate("m", "y", "fy"),
    "z": Coordinate("m", "z", "fz"),
    "phi": Coordinate("rad", "φ", "mk"),
    "roll": Coordinate("rad", "roll", "mx"),
    "pitch": Coordinate("rad", "pitch", "my"),
    "yaw": Coordinate("rad", "yaw", "mz"),
    "rx": Coordinate("rad", "rx", "mx"),
    "ry": Coordinate("rad", "ry", "my"),
    "rz": Coordinate("rad", "rz", "mz"),
    "alpha": Coordinate("rad", "\u03b1", "ma"),
    "beta": Coordinate("rad", "\u03b2", "mb"),
}
"""Every coordinate that some platform has, by name."""


def coordinate(name: str) -> Coordinate:
    """Return the pose coordinate of this name; an unknown one counts as a length."""
    return COORDINATES.get(name, Coordinate("m", name, f"f{name}"))


def are_angles(names: Iterable[str]) -> NDArray[np.bool_]:
    """Return whether each of the named coordinates is an angle, (m,) bool."""
    return np.array([coordinate(name).unit == "rad" for name in names], dtype=bool)


def wrap_angle(phi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return angles wrapped to (-pi, pi]; -pi up to rounding becomes pi."""
    wrapped = phi - 2.0 * np.pi * np.ceil((phi - np.pi) / (2.0 * np.pi))
    return np.where(wrapped <= -np.pi + _TURN_ROUNDING, np.pi, wrapped)
