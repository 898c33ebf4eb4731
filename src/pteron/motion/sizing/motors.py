"""Rotary motors as their data sheets have them, read from a CSV, Parquet or TOML file of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from pydantic import create_model

from pteron.arguments import checked_arguments
from pteron.bodies.tables import Number, TomlTable
from pteron.errors import DataError, warn_unlikely
from pteron.renamed import former_attribute
from pteron.tables import read_table
from pteron.toml import joined_faults, read_toml, to_model

_FASTEST = 3000.0
"""Speed, rad/s, from which on `Motor.warnings` asks whether it is in revolutions per minute:
3000 rad/s are 29 000 revolutions per minute, far beyond servo motors."""

_SLUGGISH = 30.0
"""Rated torque over rotor inertia, rad/s^2, below which `Motor.warnings` asks whether the inertia
is in kg cm^2: servo motors have hundreds to tens of thousands."""

_NUMBERS = ("rotor_inertia", "rated_torque", "peak_torque", "max_speed")
"""Names of the numbers of a motor, in the columns of a file too."""

_OPTIONAL = ("price", "side", "length", "mass", "stiffness")
"""Names of those that may be left out."""

_SHEAR, _SHAFT = 50e6, 4.0
"""Where a motor has no stiffness: stress of its shaft at peak torque, Pa, and the shaft's length
over its diameter."""

_STEEL_SHEAR = 81e9
"""Pa."""


@checked_arguments
@dataclass(frozen=True)
class Motor:
    """A rotary motor; all values are at its shaft.

    Parameters
    ----------
    name : str
        Its name in messages and tables.
    rotor_inertia : float
        Inertia of its rotor, with what turns with it before the gear, kg m^2.
    rated_torque : float
        Torque that it gives all the time, N m.
    peak_torque : float
        Torque that it gives for a moment, N m.
    max_speed : float
        Its greatest speed, rad/s.
    price : float, optional
        In any currency; NaN where unknown.
    side, length : float, optional
        Of its housing, square to the shaft and along it, m; otherwise estimated from the rated
        torque, as of servo motors.
    mass : float, optional
        kg; otherwise estimated likewise.
    stiffness : float, optional
        Of its shaft in torsion, N m/rad; otherwise that of a shaft with 50 MPa at peak torque.

    Raises
    ------
    DataError
        If a number is not above 0 (an inertia may be 0), or peak_torque is below rated_torque.
    """

    name: str
    rotor_inertia: float
    rated_torque: float
    peak_torque: float
    max_speed: float
    price: float = math.nan
    side: float = math.nan
    length: float = math.nan
    mass: float = math.nan
    stiffness: float = math.nan

    def __post_init__(self) -> None:
        faults = []
        for key in _OPTIONAL:
            number, least = getattr(self, key), key == "price"
            if number < 0.0 or (number == 0.0 and not least):
                expected = "0 or more" if least else "a number above 0"
                faults.append(f"{key}: {number:g} given, {expected} expected")
        for key in _NUMBERS:
            number, least = getattr(self, key), key == "rotor_inertia"
            if not (math.isfinite(number) and (number > 0.0 or (least and number == 0.0))):
                expected = "0 or more" if least else "a number above 0"
                faults.append(f"{key}: {number:g} given, {expected} expected")
        if not faults and self.peak_torque < self.rated_torque:
            faults.append(
                f"peak_torque: {self.peak_torque:g} N m given, at least rated_torque expected, "
                f"{self.rated_torque:g} N m"
            )
        if faults:
            raise DataError(joined_faults(faults), subject=f"motor {self.name}")

    doubts = former_attribute("doubts", "warnings")

    @property
    def outline(self) -> tuple[float, float]:
        """Side and length of the housing, m; where not given 62 T^0.36 and 100 T^0.3 mm."""
        torque = self.rated_torque
        side = 0.062 * torque**0.36 if math.isnan(self.side) else self.side
        return side, 0.1 * torque**0.3 if math.isnan(self.length) else self.length

    @property
    def shaft_stiffness(self) -> float:
        """The given torsional stiffness of the shaft, or an estimate from peak torque, N m/rad."""
        if not math.isnan(self.stiffness):
            return self.stiffness
        diameter = float(np.cbrt(16.0 * self.peak_torque / (math.pi * _SHEAR)))
        return _STEEL_SHEAR * math.pi * diameter**3 / (32.0 * _SHAFT)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about unlikely numbers of the motor, often of a wrong unit, one line each."""
        texts = []
        if self.max_speed >= _FASTEST:
            texts.append(
                f"motor {self.name}: max_speed of {self.max_speed:g} rad/s: is it in revolutions "
                "per minute?"
            )
        if self.rated_torque < _SLUGGISH * self.rotor_inertia:
            texts.append(
                f"motor {self.name}: rotor_inertia of {self.rotor_inertia:g} kg m^2 with a rated "
                f"torque of {self.rated_torque:g} N m: is it in kg cm^2?"
            )
        return tuple(texts)


def read_motors(path: str | Path) -> tuple[Motor, ...]:
    """Return the motors listed in a file.

    Parameters
    ----------
    path : str or path
        A CSV or Parquet file with the columns name, rotor_inertia, rated_torque, peak_torque and
        max_speed, a row a motor, which without a name is called by its number; or a TOML file with
        a table `[[motors]]` of these keys, name too, for each. kg m^2, N m and rad/s; price, side,
        length, mass and stiffness may stand beside them.

    Returns
    -------
    tuple of Motor

    Raises
    ------
    DataError
        If there is no such file, a column of numbers or a key is missing, a number is not what it
        must be, or two motors have one name.

    Warns
    -----
    UnlikelyValue
        Of each of `Motor.warnings`.
    """
    rows = (
        _read_toml_motors(path)
        if Path(path).suffix.lower() == ".toml"
        else _read_table_motors(path)
    )
    motors, names = [], set()
    for place, row in rows:
        try:
            motor = Motor(**row)
        except DataError as error:
            raise DataError(f"{place}: {error}") from None
        if motor.name in names:
            raise DataError(f"{place}: motor {motor.name} is listed twice; give each its own name")
        for text in motor.warnings:
            warn_unlikely(text)
        names.add(motor.name)
        motors.append(motor)
    if not motors:
        raise DataError(f"{path}: lists no motor")
    return tuple(motors)


_MOTOR_KEYS: Any = {"name": (str, ...), **dict.fromkeys(_NUMBERS, (Number, ...))}
_MOTOR_KEYS |= dict.fromkeys(_OPTIONAL, (Number | None, None))
_MotorTable: Any = create_model("_MotorTable", __base__=TomlTable, **_MOTOR_KEYS)


class _MotorsFile(TomlTable):
    motors: list[_MotorTable]


_Rows = list[tuple[str, dict[str, Any]]]


def _read_toml_motors(path: str | Path) -> _Rows:
    """Return the motors of a TOML file as rows: (file name, values of the motor by key)."""
    document = read_toml(path, DataError, "no such file")
    motor_file = to_model(_MotorsFile, document, str(path), DataError)
    return [(str(path), motor.model_dump(exclude_none=True)) for motor in motor_file.motors]


def _read_table_motors(path: str | Path) -> _Rows:
    """Return the motors of a CSV or Parquet file as rows: (place in the file, values by key)."""
    table = read_table(path)
    optional = tuple(key for key in _OPTIONAL if key in table.columns)
    values = np.hstack([table.numbers(_NUMBERS), table.numbers(optional, "nan")])
    if "name" in table.columns:
        names = table.frame["name"].cast(pl.String).fill_null("").str.strip_chars().to_list()
    else:
        names = [f"{i}" for i in range(1, len(table) + 1)]
    keys = (*_NUMBERS, *optional)
    return [
        (table.place(i), {"name": name or f"{i + 1}", **dict(zip(keys, row, strict=True))})
        for i, (name, row) in enumerate(zip(names, values.tolist(), strict=True))
    ]
