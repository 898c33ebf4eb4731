"""`Screw`: the ball screw of a drive, its efficiency, its inertia and its critical speed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import inf, pi, sqrt
from typing import Literal

from pteron.bodies.vectors import number, positive
from pteron.errors import ModelError
from pteron.toml import keep_checked

Ends = Literal["fixed-free", "supported", "fixed-supported", "fixed"]

_DENSITY, _MODULUS = 7850.0, 2.06e11
"""Of steel, kg/m^3 and N/m^2."""

_ROOTS: dict[str, float] = {
    "fixed-free": 1.875104,
    "supported": pi,
    "fixed-supported": 3.926602,
    "fixed": 4.730041,
}
"""The root of each support's equation for the first bending frequency of a uniform beam."""

CRITICAL_SHARE = 0.8
"""Share of its critical speed that a screw may reach: makers' usual allowance for misalignment."""


@dataclass(frozen=True)
class Screw:
    """A ball screw between motor and slider or ram, as a uniform steel rod.

    Parameters
    ----------
    lead : float
        Travel a turn, m.
    diameter : float, optional
        Of the root, m.
    length : float, optional
        Between its bearings, m.
    efficiency : float
        The share of the motor's work that moves the nut, and of the nut's work that turns the motor
        back; 1 is none lost.
    support : {"fixed-supported", "fixed", "supported", "fixed-free"}
        How its ends are held.
    """

    lead: float
    diameter: float | None = None
    length: float | None = None
    efficiency: float = 1.0
    support: Ends = "fixed-supported"

    def __post_init__(self) -> None:
        lengths = [key for key in ("lead", "diameter", "length") if getattr(self, key) is not None]
        check = partial(positive, unit="m")
        keep_checked(self, {"efficiency": number, **dict.fromkeys(lengths, check)})
        if not 0.0 < self.efficiency <= 1.0:
            raise ModelError(
                f"efficiency: {self.efficiency:g} given, above 0 and at most 1 expected"
            )
        if self.support not in _ROOTS:
            *names, last = map(repr, _ROOTS)
            raise ModelError(
                f"support: {self.support!r} given, {', '.join(names)} or {last} expected"
            )

    @property
    def inertia(self) -> float:
        """Moment of inertia about its axis, kg m^2; 0 without diameter or length."""
        if self.diameter is None or self.length is None:
            return 0.0
        return pi / 32.0 * _DENSITY * self.length * self.diameter**4

    @property
    def reflected_inertia(self) -> float:
        """The inertia reflected to the slider or ram, kg."""
        return (2.0 * pi / self.lead) ** 2 * self.inertia

    @property
    def critical_speed(self) -> float:
        """The slider's speed at which the screw whirls, m/s; infinite without its dimensions.

        The screw then turns as often as it vibrates in its first bending mode.
        """
        if self.diameter is None or self.length is None:
            return inf
        wave = _ROOTS[self.support] / self.length
        frequency = wave**2 / (2.0 * pi) * self.diameter / 4.0 * sqrt(_MODULUS / _DENSITY)
        return self.lead * frequency
