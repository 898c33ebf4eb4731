"""Motors with transmissions: gearboxes, screws, belts, and all pairs that fit a joint."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, nan
from pathlib import Path

import numpy as np

from pteron.kernels import Array
from pteron.legs import Drive, Screw
from pteron.motion import Motor
from pteron.parts.lists import NOT_NEGATIVE, POSITIVE, expected_number, read_parts

MOTORS = Path(__file__).parent / "motors.csv"
GEARBOXES = Path(__file__).parent / "gearboxes.csv"
"""The lists of the package."""

JOINTS = {
    "rad": "a crank",
    "m": "a guide or a ram",
    "slider": "a guide alone, as a belt",
    "ram": "a ram alone",
}
"""The joints that a transmission fits."""

CRITICAL = 0.8
"""Speed of a screw over its critical one that makers permit."""

_NUT = 0.1
"""Length of a screw beyond its travel, m."""

_ONE_FIXED, _YOUNG = 2.046, 210e9
"""Euler's buckling load of a rod with one end fixed, the other supported, over that of one between
hinges; Pa."""

_REST_SPEED = 5e-3
"""Speed, rad/s or m/s, below which dry friction is regularised in the files."""


@dataclass(frozen=True)
class Gearbox:
    """The transmission between a motor and a joint: a gear, a belt or a screw.

    Parameters
    ----------
    name : str
        Its name.
    joint : str
        What it drives: one of `JOINTS`.
    ratio : float
        Motor angle over the joint's coordinate, rad/rad or rad/m.
    inertia : float
        At the motor's shaft, kg m^2.
    backlash : float
        The whole play at the joint, rad or m.
    stiffness : float
        At the joint, N m/rad or N/m, without the motor's shaft.
    rated_force, peak_force : float
        What it bears all the time, and for a moment, at the joint, N m or N.
    price : float
        NaN where the list has none.
    side, length : float
        Of its housing, square to the motor's shaft and along it, m.
    mass : float
        kg.
    screw : float
        Root diameter of a screw, m; 0 of what is none.
    efficiency : float
        Of a screw.
    """

    name: str
    joint: str
    ratio: float = expected_number(POSITIVE)
    inertia: float = expected_number(NOT_NEGATIVE)
    backlash: float = expected_number(NOT_NEGATIVE)
    stiffness: float = expected_number(POSITIVE)
    rated_force: float = expected_number(POSITIVE, default=inf)
    peak_force: float = expected_number(POSITIVE, default=inf)
    price: float = expected_number(NOT_NEGATIVE, default=nan)
    side: float = expected_number(NOT_NEGATIVE, default=0.0)
    length: float = expected_number(NOT_NEGATIVE, default=0.0)
    mass: float = expected_number(NOT_NEGATIVE, default=0.0)
    screw: float = expected_number(NOT_NEGATIVE, default=0.0)
    efficiency: float = expected_number(POSITIVE, default=1.0)

    def fits(self, joint: str) -> bool:
        """Return whether it drives a joint of this kind: "rad", "slider" or "ram"."""
        return self.joint == joint or (self.joint == "m" and joint != "rad")


def read_gearboxes(path: str | Path) -> tuple[Gearbox, ...]:
    """Return the gearboxes of a CSV or Parquet file; see `read_parts`."""
    return read_parts(path, Gearbox, JOINTS)


@dataclass(frozen=True)
class Option:
    """A motor with a gearbox; `friction` is dry friction as a share of the rated torque."""

    motor: Motor
    gearbox: Gearbox
    friction: float

    def drive(self, travel: float) -> Drive:
        """Return the motor and gearbox as a `Drive` of a joint with this travel, m or rad.

        Its dry friction is assumed.
        """
        motor, ratio = self.motor, self.gearbox.ratio
        return Drive(
            coulomb=self.friction * motor.rated_torque * ratio,
            rotor_inertia=motor.rotor_inertia + self.gearbox.inertia,
            ratio=ratio,
            rest_speed=_REST_SPEED,
            rated_torque=self.rated_torque,
            max_force=min(motor.peak_torque * ratio, self.gearbox.peak_force),
            max_speed=motor.max_speed / ratio,
            screw=self.screw(travel),
        )

    def screw(self, travel: float) -> Screw | None:
        """Return the screw for a travel, m, longer than it by the nut; None without one."""
        gearbox = self.gearbox
        if not gearbox.screw:
            return None
        lead = 2.0 * math.pi / gearbox.ratio
        return Screw(lead, gearbox.screw, travel + _NUT, min(gearbox.efficiency, 1.0))

    @property
    def name(self) -> str:
        """The names of the motor and the gearbox as text: "motor + gearbox"."""
        return f"{self.motor.name} + {self.gearbox.name}"

    @property
    def price(self) -> float:
        """The sum of both prices; NaN where one is unknown."""
        return self.motor.price + self.gearbox.price

    @property
    def rated_torque(self) -> float:
        """Torque that motor and gearbox both bear all the time, at the motor, N m."""
        return min(self.motor.rated_torque, self.gearbox.rated_force / self.gearbox.ratio)

    @property
    def stiffness(self) -> float:
        """Stiffness at the joint with the motor's shaft held at its rotor, N m/rad or N/m."""
        shaft = self.motor.shaft_stiffness * self.gearbox.ratio**2
        return 1.0 / (1.0 / self.gearbox.stiffness + 1.0 / shaft)

    @property
    def power(self) -> float:
        """The motor's rated torque times its greatest speed, W."""
        return self.motor.rated_torque * self.motor.max_speed

    @property
    def outline(self) -> tuple[float, float]:
        """Greatest side, and length along the shaft, of motor and gearbox together, m."""
        side, length = self.motor.outline
        return max(side, self.gearbox.side), length + self.gearbox.length


@dataclass(frozen=True)
class Options:
    """All motors with all gearboxes of one kind of joint, the cheapest first."""

    all: tuple[Option, ...]

    @classmethod
    def combine(
        cls, motors: Sequence[Motor], gearboxes: Sequence[Gearbox], joint: str, friction: float
    ) -> Options:
        """Return all motor-gearbox pairs for `joint`, sorted by price, or else by rated power."""
        options = [
            Option(motor, gearbox, friction)
            for motor in motors
            for gearbox in gearboxes
            if gearbox.fits(joint)
        ]
        priced = all(np.isfinite(option.price) for option in options)
        return cls(tuple(sorted(options, key=lambda o: o.price if priced else o.power)))

    def numbers(self, travel: float) -> Array:
        """Return numbers (8, O) of all pairs at a joint with this travel, m or rad, SI units.

        They are ratio, inertia, rated and peak torque less friction and losses, speed, backlash,
        stiffness, and the load at the joint under which a screw buckles. Torques are those that
        motor and gearbox both bear, at the motor.
        """
        rows = []
        for option in self.all:
            motor, gearbox = option.motor, option.gearbox
            friction, screw = option.friction * motor.rated_torque, option.screw(travel)
            peak = min(motor.peak_torque, gearbox.peak_force / gearbox.ratio)
            inertia, speed, buckles = motor.rotor_inertia + gearbox.inertia, motor.max_speed, inf
            if screw is not None and screw.diameter and screw.length:
                inertia += screw.inertia
                speed = min(speed, CRITICAL * screw.critical_speed * gearbox.ratio)
                second_moment = math.pi / 64.0 * screw.diameter**4
                buckles = _ONE_FIXED * math.pi**2 * _YOUNG * second_moment / screw.length**2
            share = 1.0 if screw is None else screw.efficiency
            rows.append(
                (
                    gearbox.ratio,
                    inertia,
                    share * (option.rated_torque - friction),
                    share * (peak - friction),
                    speed,
                    gearbox.backlash,
                    option.stiffness,
                    buckles,
                )
            )
        return np.array(rows).reshape(len(rows), 8).T
