"""Layout of the file of a motion for a controller: columns, units, dialect of CSV."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, cast, get_args

import numpy as np
import polars as pl

from pteron.arguments import expect, expect_one_of, expect_to_fit
from pteron.dynamics import drive_forces
from pteron.errors import DataError, shorten
from pteron.identification.excitation.movement import Movement
from pteron.identification.logs import Description
from pteron.identification.logs.clock import PER_SECOND
from pteron.identification.logs.description import AngleUnit, LengthUnit, TimeUnit
from pteron.manipulator import Manipulator
from pteron.manipulator.readings import reading_scales, to_readings
from pteron.tables import Dialect
from pteron.tolerances import SAME

Contents = Literal["all", "joints", "poses"]
"""Contents of a file beside time: everything, the joint coordinates, or the poses."""

_PER_UNIT: dict[str, float] = {**PER_SECOND, "mm": 1e3, "um": 1e6, "deg": 180.0 / math.pi}
"""Units by name, each with the number that makes one SI unit."""

_MOST_SAMPLES = 10_000_000
"""Greatest number of samples of a file."""


@dataclass(frozen=True)
class MotionLayout:
    """Columns and units of a motion's file; a log in the same layout is read by its TOML file.

    Parameters
    ----------
    contents : {"all", "joints", "poses"}
        Everything; or only time and joint coordinates, or time and poses.
    joint_columns : sequence of n str, optional
        Names of the joint coordinates' columns, in the order of the legs.
    length_unit : {"m", "mm", "um"}
        Unit of sliders and poses. Rates and accelerations are in that unit a second, forces in N or
        N m.
    angle_unit : {"rad", "deg"}
        Unit of cranks and the pose's angles.
    time_unit : {"s", "ms", "us"}
        Unit of the column t.
    separator : str, optional
        Separator of a CSV file's cells: by default ``,``, or ``;`` with a decimal comma.
    decimal : {".", ","}
        The decimal sign.

    Raises
    ------
    DataError
        If a unit or sign is not known.
    """

    contents: Contents = "all"
    joint_columns: Sequence[str] | None = None
    length_unit: LengthUnit = "m"
    angle_unit: AngleUnit = "rad"
    time_unit: TimeUnit = "s"
    separator: str | None = None
    decimal: str = "."

    def __post_init__(self) -> None:
        expect_one_of(get_args(Contents), contents=self.contents)
        expect_one_of(get_args(LengthUnit), length_unit=self.length_unit)
        expect_one_of(get_args(AngleUnit), angle_unit=self.angle_unit)
        expect_one_of(get_args(TimeUnit), time_unit=self.time_unit)
        if self.joint_columns is not None:
            object.__setattr__(self, "joint_columns", tuple(self.joint_columns))
        _ = self.dialect  # it refuses signs that are not possible together

    @property
    def dialect(self) -> Dialect | None:
        """Dialect of CSV; None for the default, so that a log's own dialect is found."""
        if self.separator is None and self.decimal == ".":
            return None
        separator = self.separator or (";" if self.decimal == "," else ",")
        return Dialect(cast(Any, separator), cast(Any, self.decimal))

    def description(self, robot: Manipulator) -> Description:
        """Return the description of a log in this layout.

        Raises
        ------
        DataError
            If the machine has another number of joints, or two columns would be called alike.
        """
        joints = {leg.joint.unit: self._unit(leg.joint.unit) for leg in robot.legs}
        turns, poses = bool(robot.platform.angles), self.contents != "joints"
        description = Description(
            csv=self.dialect,
            time_unit=self.time_unit,
            joint_columns=cast(Any, self.joint_columns),
            joint_unit=cast(Any, joints.get("m", joints.get("rad"))),
            joint_angle_unit=cast(Any, joints.get("rad") if len(joints) > 1 else None),
            length_unit=self.length_unit if poses else None,
            angle_unit=self.angle_unit if poses and turns else None,
        )
        description.check(robot)
        names = ["t", *(name for name, _ in self._columns(robot))]
        duplicate = next((name for k, name in enumerate(names) if name in names[:k]), None)
        if duplicate is not None:
            raise DataError(
                f"columns: {shorten(duplicate)} would be the name of two columns; choose another"
            )
        return description

    def frame(self, movement: Movement, rate: float) -> pl.DataFrame:
        """Return a movement from beginning to end as a data frame, `rate` samples a second.

        Raises
        ------
        DataError
            As `description`.
        """
        robot = movement.robot
        self.description(robot)
        samples = movement.duration * rate
        expect_to_fit("rate", rate, 8.0 * samples * (robot.freedom + robot.joint_count))
        ticks = np.arange(math.ceil(samples - SAME) + 1)
        state = movement.states(ticks / rate)
        joints, scales = to_readings(robot, state.joints), reading_scales(robot)
        blocks = {"joints": [joints], "poses": [state.pose]}.get(self.contents) or [
            *(joints, state.pose, state.rates / scales, state.accelerations / scales),
            *(state.velocity, state.acceleration, scales * drive_forces(robot, *state[:3])),
        ]
        columns = {"t": np.asarray(ticks * self._factor("s") / rate, dtype=np.float64)}
        for (name, unit), column in zip(self._columns(robot), np.hstack(blocks).T, strict=True):
            columns[name] = column * self._factor(unit) + 0.0  # no minus zero
        return pl.DataFrame(columns)

    def _columns(self, robot: Manipulator) -> list[tuple[str, str]]:
        """Return the names of the columns after t, with their SI units."""
        names = self.joint_columns or robot.joint_names
        joints = [(name, leg.joint.unit) for name, leg in zip(names, robot.legs, strict=True)]
        pose: list[tuple[str, str]] = list(zip(robot.coordinates, robot.units, strict=True))
        if self.contents != "all":
            return joints if self.contents == "joints" else pose
        columns = joints + pose
        for part in (joints, pose):
            columns += [(f"{order}{name}", unit) for order in ("d", "dd") for name, unit in part]
        return columns + [(name, "") for name in robot.force_names]

    def _unit(self, si: str) -> str:
        """Return the unit in the file of a quantity in an SI unit; derived units are unchanged."""
        units = {"m": self.length_unit, "rad": self.angle_unit, "s": self.time_unit}
        return units.get(si, si)

    def _factor(self, si: str) -> float:
        """Return the factor from an SI unit to the file's unit."""
        return _PER_UNIT.get(self._unit(si), 1.0)


def check_sampling(period: float, rate: float, periods: int) -> None:
    """Raise, before any work, on a period and a rate (samples a second) that give no table."""
    expect(0.0 < period < np.inf, "period", f"{period} s", "a number above 0")
    expect(0.0 < rate < np.inf, "rate", rate, "samples a second above 0")
    expect(periods >= 1, "periods", periods, "1 or more")
    count = periods * period * rate
    if not 0.5 < count <= _MOST_SAMPLES:
        raise DataError(
            f"rate: {rate:g} a second gives {count:.0f} samples in {periods * period:g} s; 1 to "
            f"{_MOST_SAMPLES} are served"
        )
