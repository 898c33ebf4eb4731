"""Motors with gearboxes, and the cheapest that serve the loads of a machine's legs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from pteron.errors import DataError
from pteron.kernels import Array
from pteron.legs import Drive
from pteron.motion import Motor, read_motors
from pteron.tables import read_table
from pteron.toml import read_toml

MOTORS = Path(__file__).parent / "motors.csv"
GEARBOXES = Path(__file__).parent / "gearboxes.csv"
"""Ordinary motors and gearboxes: examples, as data sheets of several makers have them on average,
with prices of their order of magnitude."""

_REST_SPEED = 5e-3
"""Speed, rad/s or m/s, below which dry friction is regularised in the files."""

_NUMBERS = ("ratio", "inertia", "backlash", "stiffness")


@dataclass(frozen=True)
class Gearbox:
    """The transmission between a motor and a joint: a gear, a belt or a screw.

    Parameters
    ----------
    name : str
        Its name.
    joint : str
        "rad" or "m": what the joint's coordinate is in.
    ratio : float
        Motor angle over the joint's coordinate, rad/rad or rad/m.
    inertia : float
        At the motor's shaft, kg m^2.
    backlash : float
        The whole play at the joint, rad or m.
    stiffness : float
        At the joint, N m/rad or N/m.
    price : float
        NaN where the list has none.
    """

    name: str
    joint: str
    ratio: float
    inertia: float
    backlash: float
    stiffness: float
    price: float = float("nan")


def read_gearboxes(path: str | Path) -> tuple[Gearbox, ...]:
    """Return the gearboxes of a CSV file: a row each, columns named as fields of `Gearbox`.

    Raises
    ------
    DataError
        If there is no such file, or a number is missing or not what it must be.
    """
    table = read_table(path)
    missing = [key for key in ("name", "joint") if key not in table.columns]
    if missing:
        raise DataError(f"{path}: no column {' and '.join(missing)}")
    rows = zip(
        table.frame["name"].to_list(),
        table.frame["joint"].to_list(),
        table.numbers(_NUMBERS).tolist(),
        prices(path, len(table)),
        strict=True,
    )
    gearboxes = [
        Gearbox(name, joint, price=price, **dict(zip(_NUMBERS, numbers, strict=True)))
        for name, joint, numbers, price in rows
    ]
    for k, gearbox in enumerate(gearboxes):
        if gearbox.joint not in ("rad", "m"):
            raise DataError(
                f'{table.place(k)}: joint: {gearbox.joint!r} given, "rad" or "m" expected'
            )
        if (
            not gearbox.ratio > 0.0
            or min(gearbox.inertia, gearbox.backlash) < 0.0
            or not gearbox.stiffness > 0.0
        ):
            raise DataError(
                f"{table.place(k)}: ratio and stiffness above 0, inertia and backlash of 0 or more "
                "expected"
            )
    return tuple(gearboxes)


def prices(path: str | Path, count: int) -> list[float]:
    """Return the prices of the `count` motors of a file; NaN where not stated."""
    if Path(path).suffix.lower() == ".toml":
        listed = read_toml(path, DataError, "no such file")["motors"]
        return [_price(path, motor) for motor in listed]
    table = read_table(path)
    if "price" not in table.columns:
        return [np.nan] * count
    column = table.numbers(("price",))[:, 0]
    if (column < 0.0).any():
        k = int(column.argmin())
        raise DataError(f"{table.place(k)}: price: {column[k]:g} given, 0 or more expected")
    return list(map(float, column))


def _price(path: str | Path, motor: Mapping[str, Any]) -> float:
    """Return a motor's price, NaN where the file states none; raise if it is negative."""
    price = float(motor.get("price", np.nan))
    if price < 0.0:
        raise DataError(
            f"{path}: motor {motor['name']}: price: {price:g} given, 0 or more expected"
        )
    return price


@dataclass(frozen=True)
class Option:
    """A motor with a gearbox."""

    motor: Motor
    gearbox: Gearbox
    price: float
    friction: float

    @property
    def drive(self) -> Drive:
        """The motor and gearbox as a `Drive` of a leg; its dry friction is assumed."""
        motor, ratio = self.motor, self.gearbox.ratio
        return Drive(
            coulomb=self.friction * motor.rated_torque * ratio,
            rotor_inertia=motor.rotor_inertia + self.gearbox.inertia,
            ratio=ratio,
            rest_speed=_REST_SPEED,
            rated_torque=motor.rated_torque,
            max_force=motor.peak_torque * ratio,
            max_speed=motor.max_speed / ratio,
        )

    @property
    def name(self) -> str:
        """The names of the motor and the gearbox as text: "motor + gearbox"."""
        return f"{self.motor.name} + {self.gearbox.name}"


@dataclass(frozen=True)
class Options:
    """All motors with all gearboxes of one kind of joint, the cheapest first."""

    all: tuple[Option, ...]

    @classmethod
    def combine(
        cls,
        motors: Sequence[tuple[Motor, float]],
        gearboxes: Sequence[Gearbox],
        joint: str,
        friction: float,
    ) -> Options:
        """Return all motor-gearbox pairs for `joint`, sorted by price, or else by rated power."""
        options = [
            Option(motor, gearbox, price + gearbox.price, friction)
            for motor, price in motors
            for gearbox in gearboxes
            if gearbox.joint == joint
        ]
        priced = all(np.isfinite(option.price) for option in options)
        return cls(
            tuple(sorted(options, key=lambda option: option.price if priced else power(option)))
        )

    @cached_property
    def numbers(self) -> Array:
        """Ratio, inertia, rated and peak torque, speed, backlash, stiffness, price (8, O), SI."""
        rows = [
            (
                option.gearbox.ratio,
                option.motor.rotor_inertia + option.gearbox.inertia,
                option.motor.rated_torque * (1.0 - option.friction),
                option.motor.peak_torque - option.friction * option.motor.rated_torque,
                option.motor.max_speed,
                option.gearbox.backlash,
                option.gearbox.stiffness,
                option.price,
            )
            for option in self.all
        ]
        return np.array(rows).T


def power(option: Option) -> float:
    """Return the rated torque times the greatest speed of an option's motor, W."""
    return option.motor.rated_torque * option.motor.max_speed


@dataclass(frozen=True)
class JointLoads:
    """The loads of the joints of one machine, rigid bodies alone.

    Attributes
    ----------
    squares : tuple of array, shape (B, n, 3)
        Of each cycle at its places the means, its rest included, of f^2, f q'' and q''^2.
    shares : array, shape (C,)
        Of the time that each cycle has in a duty cycle of all; empty where each counts by itself.
    forces, accelerations : array, shape (S, n)
        Of all samples.
    speeds : array, shape (n,)
        The greatest.
    everywhere : array, shape (2, n)
        Worst force at the asked acceleration and speed in any direction, and acceleration there.
    """

    squares: tuple[Array, ...]
    shares: Array
    forces: Array
    accelerations: Array
    speeds: Array
    everywhere: Array

    def margins(self, options: Options, legs: Sequence[int]) -> Array:
        """Return (3, O) margins (limit over load): rated torque, peak torque and speed."""
        ratio, inertia, rated, peak, speed, *_ = options.numbers
        chosen, i, j = list(legs), ratio[:, None], inertia[:, None]
        worst_squares = []
        for part in self.squares:
            f, mixed, a = np.moveaxis(part[None, :, chosen], -1, 0)
            square = f / i[..., None] ** 2 + 2.0 * j[..., None] * mixed
            worst_squares.append((square + (j * i)[..., None] ** 2 * a).max(axis=1))
        square = duty_cycle_mean(np.array(worst_squares), self.shares).max(axis=1)
        margins = [rated / np.sqrt(np.maximum(square, 1e-30))]
        force, rise = (part[:, chosen].ravel() for part in (self.forces, self.accelerations))
        force, rise = _outermost(force, rise)
        worst = np.abs(force / i + j * i * rise).max(axis=1, initial=0.0)
        f, a = self.everywhere[:, chosen]
        worst = np.maximum(worst, (f / i + j * i * a).max(axis=1))
        margins.append(peak / np.maximum(worst, 1e-15))
        fastest = float(self.speeds[chosen].max())
        return np.array([*margins, speed / np.maximum(ratio * fastest, 1e-15)])


def duty_cycle_mean(worst: Array, shares: Array) -> Array:
    """Return cycles' worst loads (C, ...) averaged by shares (C,); the maximum without shares."""
    if len(shares):
        return np.tensordot(shares / shares.sum(), worst, axes=1)
    return np.asarray(worst.max(axis=0))


def _outermost(x: Array, y: Array) -> tuple[Array, Array]:
    """Return a cloud's points that are extreme in a direction of 65 sampled ones, (K,) each."""
    sizes = np.abs(x).max(initial=1e-12), np.abs(y).max(initial=1e-12)
    angles = np.linspace(0.0, np.pi, 65)
    way = np.outer(np.cos(angles), x / sizes[0]) + np.outer(np.sin(angles), y / sizes[1])
    chosen = np.unique(np.append(way.argmax(axis=1), way.argmin(axis=1)))
    return x[chosen], y[chosen]


def read_lists(
    motors: Path, gearboxes: Path
) -> tuple[list[tuple[Motor, float]], tuple[Gearbox, ...]]:
    """Return the motors with their prices, and the gearboxes, of two files."""
    listed_motors = read_motors(motors)
    return list(
        zip(listed_motors, prices(motors, len(listed_motors)), strict=True)
    ), read_gearboxes(gearboxes)
