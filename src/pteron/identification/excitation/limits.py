"""What an exciting trajectory must keep: the machine's limits, and its distance from failure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pteron.errors import DataError
from pteron.kernels import Array
from pteron.manipulator import Manipulator

__all__ = ["PER_SLIDER", "UNITS", "Limits", "per_slider", "slider_sizes"]

UNITS = {
    "elbow_sine": "",
    "regularity": "",
    "slider_clearance": "m",
    "speed": "m/s",
    "acceleration": "m/s^2",
    "force": "N",
}
"""The limits by name, and the units of their margins."""

PER_SLIDER = ("speed", "acceleration", "force")
"""Those that may be given for each slider."""


@dataclass(frozen=True)
class Limits:
    """What a trajectory must keep at every instant.

    Attributes
    ----------
    speed : float or sequence of n floats
        Largest speed of the sliders, m/s.
    acceleration : float or sequence of n floats
        Largest acceleration of the sliders, m/s^2.
    force : float or sequence of n floats, optional
        Largest actuator force, N, by the machine's nominal inertia without friction; None for no
        limit.
    elbow_sine : float
        Least sine of each elbow's angle, in (0, 1): the distance from stretched and folded legs.
    regularity : float
        Least abs(det J) over its largest value, in (0, 1): the distance from the singular
        orientations. Without meaning for 3T.
    slider_clearance : float
        Least distance of the sliders from the ends of their guides (`slider_limits`), m; without
        effect on a slider that has no limits.

    Raises
    ------
    DataError
        If a number is not what it should be; the message names it.

    Examples
    --------
    >>> from pteron.identification.excitation import Limits
    >>> Limits(speed=[0.5, 0.5, 1.0, 0.5]).speed
    (0.5, 0.5, 1.0, 0.5)
    """

    speed: float | Sequence[float] = 1.0
    acceleration: float | Sequence[float] = 10.0
    force: float | Sequence[float] | None = None
    elbow_sine: float = 0.25
    regularity: float = 0.3
    slider_clearance: float = 0.005

    def __post_init__(self) -> None:
        for name in PER_SLIDER:
            given = getattr(self, name)
            if given is None and name == "force":
                continue
            several = isinstance(given, list | tuple | np.ndarray)
            values = tuple(_number(name, value) for value in (given if several else (given,)))
            if not values or min(values) <= 0.0:
                raise DataError(f"limits: {name} {given} given, numbers above 0 expected")
            object.__setattr__(self, name, values if several else values[0])
        for name in ("elbow_sine", "regularity"):
            value = _number(name, getattr(self, name))
            if not 0.0 < value < 1.0:
                raise DataError(f"limits: {name} {value:g} given, between 0 and 1 expected")
        if _number("slider_clearance", self.slider_clearance) < 0.0:
            raise DataError(
                f"limits: slider_clearance {self.slider_clearance:g} given, 0 or more expected"
            )


def per_slider(limits: Limits, name: str, robot: Manipulator) -> Array:
    """Return a limit of each slider (n,), infinite where there is none.

    Raises
    ------
    DataError
        If there are not as many numbers as sliders.
    """
    given = getattr(limits, name)
    values = np.atleast_1d(np.array(np.inf if given is None else given, dtype=float))
    if values.size not in (1, robot.freedom):
        raise DataError(
            f"limits: {values.size} numbers for {name}, one expected or {robot.freedom}, one for "
            f"each slider of {robot.name}"
        )
    return np.broadcast_to(values, (robot.freedom,)).copy()


def slider_sizes(robot: Manipulator) -> Array:
    """Return half the range (n,) of each slider, m; 1 where it has no limits."""
    ranges = [leg.slider_limits or (-1.0, 1.0) for leg in robot.legs]
    return np.array([0.5 * (high - low) for low, high in ranges])


def _number(name: str, value: object) -> float:
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise DataError(f"limits: {name} {value!r} given, a number expected") from None
    if not math.isfinite(number):
        raise DataError(f"limits: {name} {number} given, a finite number expected")
    return number
