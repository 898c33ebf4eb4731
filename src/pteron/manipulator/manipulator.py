"""A manipulator as a value: legs, platform and gravity, checked when it is made."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

from pteron.errors import ModelError
from pteron.manipulator.leg import Leg
from pteron.manipulator.platform import Platform
from pteron.manipulator.vectors import Vector, cross, parallel, vector

__all__ = ["STANDARD_GRAVITY", "Manipulator", "working_modes"]

STANDARD_GRAVITY: Vector = (0.0, 0.0, -9.81)
"""Acceleration of gravity where a file does not say it, m/s^2."""


@dataclass(frozen=True)
class Manipulator:
    """A parallel manipulator whose legs carry points of the platform.

    It is a value: it has no hidden state and is never changed; `dataclasses.replace` makes another.

    Parameters
    ----------
    name : str
        What the machine is called.
    platform : Platform
        The moving platform; its motion fixes how many legs there are (3T: 3, 3T1R: 4).
    legs : tuple of Leg
        The legs, in the order of the slider coordinates.
    gravity : vector
        Acceleration of gravity in the base frame, m/s^2.

    Raises
    ------
    ModelError
        If the number of legs differs from the platform's freedom, or if the legs' constraints
        leave the platform another freedom than `platform.motion` says.
    """

    name: str
    platform: Platform
    legs: tuple[Leg, ...]
    gravity: Vector = STANDARD_GRAVITY

    def __hash__(self) -> int:
        """Hash once: the public functions look machines up at every call."""
        return self._hash

    @cached_property
    def _hash(self) -> int:
        return hash((self.name, self.platform, self.legs, self.gravity))

    def __getstate__(self) -> dict[str, Any]:
        # Texts hash differently in every process.
        return {key: value for key, value in self.__dict__.items() if key != "_hash"}

    def __post_init__(self) -> None:
        if type(self.name) is not str or not self.name.strip():
            raise ModelError(f"name: {self.name!r} is not a text with at least one letter")
        legs = tuple(self.legs)
        freedom = len(self.platform.coordinates)
        if len(legs) != freedom:
            raise ModelError(
                f"legs: {len(legs)} given, but a {self.platform.motion} platform has {freedom} "
                f"freedoms and needs {freedom} legs"
            )
        _check_constraints(self.platform, legs)
        object.__setattr__(self, "legs", legs)
        object.__setattr__(self, "gravity", vector(self.gravity, "gravity"))

    @property
    def freedom(self) -> int:
        """Number of pose coordinates m, which is also the number of legs n."""
        return len(self.legs)

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the pose's coordinates: x, y, z and, for 3T1R, phi."""
        return self.platform.coordinates


def _check_constraints(platform: Platform, legs: tuple[Leg, ...]) -> None:
    """Refuse legs that leave the platform a rotation which its motion does not have.

    A leg without R4 withholds every rotation that is not about d; a leg with R4 (3T1R, d not
    parallel to k) withholds the one about d x k.
    """
    if not platform.turns:
        if all(parallel(leg.direction, legs[0].direction) for leg in legs):
            raise ModelError(
                "legs: all directions are parallel, so that the platform is free to turn about "
                "them; a 3T platform needs two legs that are not parallel"
            )
        return
    withheld = [cross(leg.direction, platform.axis) for leg in legs]
    without_universal_joint = any(parallel(leg.direction, platform.axis) for leg in legs)
    spread = any(
        abs(_triple(a, b, platform.axis)) > 1e-9 for a in withheld for b in withheld if a is not b
    )
    if not (without_universal_joint or spread):
        raise ModelError(
            "legs: all directions lie in one plane with the platform's axis, so that the platform "
            "is free to tilt; turn one leg's direction out of that plane"
        )


def _triple(a: Vector, b: Vector, c: Vector) -> float:
    n = cross(a, b)
    return n[0] * c[0] + n[1] * c[1] + n[2] * c[2]


def working_modes(robot: Manipulator) -> tuple[Manipulator, ...]:
    """Return the 2^n working modes of a manipulator: every choice of its elbows' sides.

    Parameters
    ----------
    robot : Manipulator
        The machine; its own choice of elbows is one of those returned.

    Returns
    -------
    tuple of Manipulator
        In binary order of the elbows, leg 1 first: all +1 comes first, all -1 last.

    Examples
    --------
    >>> import pteron
    >>> modes = pteron.working_modes(pteron.load("quadrupteron"))
    >>> len(modes), [leg.elbow for leg in modes[1].legs]
    (16, [1, 1, 1, -1])
    """
    choices = product((1, -1), repeat=len(robot.legs))
    return tuple(
        replace(
            robot,
            legs=tuple(replace(leg, elbow=s) for leg, s in zip(robot.legs, signs, strict=True)),
        )
        for signs in choices
    )
