"""The reading of an actuated joint: its coordinate as the drive counts it."""

from __future__ import annotations

from dataclasses import dataclass

from pteron.bodies.vectors import number
from pteron.errors import ModelError
from pteron.toml import keep_checked


@dataclass(frozen=True)
class Reading:
    """The relation of a joint's coordinate to its drive's reading: q = zero + scale reading.

    Calibration writes it where the leg's geometry cannot take a zero or a scale.

    Parameters
    ----------
    zero : float
        The coordinate where the drive reads 0, m or rad.
    scale : float
        Metres, or radians, of the coordinate per unit of the reading; not 0.
    """

    zero: float = 0.0
    scale: float = 1.0

    def __post_init__(self) -> None:
        keep_checked(self, {"zero": number, "scale": _not_zero})


def _not_zero(value: object, key: str) -> float:
    """Return a number converted to float; raise ModelError if it is 0."""
    converted = number(value, key)
    if converted == 0.0:
        raise ModelError(f"{key}: 0 given, another number expected")
    return converted
