"""The radii of the capsules that represent a machine's bodies, for clearances between them."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import partial

from pteron.bodies.vectors import not_negative
from pteron.toml import keep_checked


@dataclass(frozen=True)
class Radii:
    """The radii of the capsules round the bodies' centre lines, m; 0 for the lines themselves.

    Parameters
    ----------
    guide : float
        Radius of a slider's guide, m.
    upper : float
        Radius of an upper link or a crank, or of a ram's cylinder, m.
    lower : float
        Radius of a last link, of each rod, or of a ram's piston, m.
    platform : float
        Radius of the platform's arms, m.

    Raises
    ------
    ModelError
        If one is negative, or not a finite number.
    """

    guide: float = 0.0
    upper: float = 0.0
    lower: float = 0.0
    platform: float = 0.0

    def __post_init__(self) -> None:
        check = partial(not_negative, unit="m")
        keep_checked(self, {field.name: check for field in fields(self)})

    @property
    def leg(self) -> float:
        """The greater of the upper and lower link's radius, m, for both on one line."""
        return max(self.upper, self.lower)
