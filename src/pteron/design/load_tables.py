"""Tables of a search's file for loads: payload, cycles, errors, elasticity and a list of motors."""

from __future__ import annotations

from math import inf, sqrt
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from pteron.bodies.inertia import inertia_count
from pteron.bodies.tables import Number, Six, Three, TomlTable, key
from pteron.indices import ALUMINIUM, STEEL, Elasticity, Section, Tolerances
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.motion import Motion, line_path, pick_and_place
from pteron.motion.payload import add_payload
from pteron.motion.trajectories.time_law import sample_curve
from pteron.motion.trajectories.time_polynomials import polynomial
from pteron.motion.trajectories.timed_path import timed_path


def default_table(table: type[TomlTable]) -> Any:
    """Return a pydantic field whose default is an empty `table`, so that it may be left out."""
    return Field(default_factory=lambda: table.model_validate({}))


def as_list(names: Any) -> Any:
    """Return a name as a list with a single item; a list as it is."""
    return [names] if isinstance(names, str) else names


Positive = Annotated[Number, Field(gt=0.0)]
"""A number above 0."""

Least = Annotated[Number, Field(ge=0.0)]
"""A number of 0 or more."""

Floor = Annotated[Number, Field(ge=0.0, lt=1.0)]
"""Type of the least value of a measure that is 1 at best."""

Names = Annotated[list[str], BeforeValidator(as_list), Field(min_length=1)]
"""One name, or a list of names."""

SAMPLES = 121
"""Samples of a cycle; forces are taken between them too."""

_PEAK = 10.0 / sqrt(3.0)
"""Greatest acceleration of a quintic from rest to rest over its length and inverse squared time."""


def _numbers(numbers: Any) -> Any:
    """Return a single number as a list with one item; anything else unchanged."""
    return [numbers] if isinstance(numbers, int | float) else numbers


def _one_or_six(numbers: Any) -> Any:
    """Return the inertia's one or six numbers; raise on a list whose length is not 6."""
    if isinstance(numbers, list | tuple) and len(numbers) != 6:
        raise ValueError(f"{len(numbers)} numbers given, 1 or 6 expected: Ixx Ixy Ixz Iyy Iyz Izz")
    return numbers


Each = Annotated[tuple[Least, ...], BeforeValidator(_numbers), Field(min_length=1)]
"""One number of 0 or more for all legs, or one a leg."""


class PayloadTable(TomlTable):
    """`[payload]`: what the platform carries."""

    mass: Least = key("kg", 0.0)
    center: Three | None = key(
        "its centre of mass in the platform's frame, m; the tool if left out", None
    )
    inertia: Annotated[Number | Six, BeforeValidator(_one_or_six)] = key(
        "about its centre of mass, kg m^2: one number, or the tensor's six", 0.0
    )

    def add_to(self, robot: Manipulator) -> Manipulator:
        """Return the machine with the payload added to its platform."""
        inertia = self.inertia
        tensor = (
            inertia if isinstance(inertia, tuple) else (inertia, 0.0, 0.0, inertia, 0.0, inertia)
        )
        tilts = inertia_count(robot.platform.inertia.kinds) > 1
        return add_payload(robot, self.mass, self.center, tensor if tilts else tensor[5])


class CycleTable(TomlTable):
    """`[[cycles]]`: a motion along lines through points, or the standard pick-and-place."""

    points: Annotated[list[tuple[Number, ...]], Field(min_length=2)] | None = key(
        "of the tool, from the workspace's middle, m; angles may follow, rad", None
    )
    times: tuple[Number, ...] | None = key("when it rests at each of them, s, from 0", None)
    duration: Positive | None = key(
        "of the whole, s; left out, what [motion] acceleration gives", None
    )
    corner: Least = key("metres from a point at which it leaves its lines", 0.0)
    scale: Positive | None = key("of the standard pick-and-place, in place of points", None)
    direction: Three | None = key("where that goes across", None)
    dwell: Least = key("rest after it, s", 0.0)
    anywhere: bool = key("whether loads count at all its places and turns in the workspace", False)

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        """Return the cycle; raise unless it has either points or a scale, and consistent times."""
        if (self.points is None) == (self.scale is None):
            raise ValueError("give either points, or the scale of the standard pick-and-place")
        if self.times is not None:
            if self.duration is not None or self.corner or self.points is None:
                raise ValueError("times go with points alone: no duration, corner or scale")
            steps = np.diff(self.times)
            if len(self.times) != len(self.points) or self.times[0] != 0.0 or (steps <= 0.0).any():
                raise ValueError(
                    f"times: {list(self.times)} given, one for each of {len(self.points)} points "
                    "expected, from 0 on, ascending"
                )
        for a, b in zip(self.points or (), (self.points or ())[1:], strict=False):
            if a == b:
                raise ValueError(f"points: {list(a)} given twice, one after the other")
        return self

    @property
    def words(self) -> str:
        """The cycle in a line: "4 points in 0.4 s, then 0.1 s of rest"."""
        what = (
            f"{len(self.points)} points" if self.points else f"pick-and-place x {self.scale:.12g}"
        )
        duration = self.times[-1] if self.times else self.duration
        time = "as [motion] acceleration allows" if duration is None else f"in {duration:.12g} s"
        dwell = f", then {self.dwell:.12g} s of rest" if self.dwell else ""
        return f"{what} {time}{dwell}{', anywhere in the workspace' if self.anywhere else ''}"

    def motion(self, robot: Manipulator, middle: Array, acceleration: float) -> Motion:
        """Return the cycle's motion of `robot` about the pose `middle` (m,)."""
        if self.points is None:
            return pick_and_place(
                robot,
                middle,
                scale=self.scale,
                duration=self.duration,
                samples=SAMPLES,
                direction=self.direction,
                peak=acceleration,
            )
        poses = np.tile(middle, (len(self.points), 1))
        lengths = len(robot.platform.lengths)
        for pose, point in zip(poses, self.points, strict=True):
            pose[:lengths] += point[:lengths]
            pose[lengths : len(point)] = point[lengths:]
        path = line_path(robot, poses, self.corner)
        stretches = np.diff(self.times) if self.times else np.sqrt(np.diff(path.rests))
        if not self.times:
            total = self.duration or sqrt(_PEAK / acceleration) * stretches.sum()
            stretches = stretches * total / stretches.sum()
        law = polynomial("quintic")
        course = timed_path(path, stretches.tolist(), [law] * len(stretches))
        return sample_curve(course.at, course.duration, course.duration / (SAMPLES - 1))


class ErrorsTable(TomlTable):
    """`[errors]`: what the machine's accuracy is worked out from, each to either side."""

    encoder: Each = key("errors of the joints, m or rad", (0.0,))
    backlash: Each = key("whole play of the drives at their joints, m or rad", (0.0,))
    point: Least = key("tolerance of every joint's place, m", 0.0)
    length: Least = key("of every link's length, m", 0.0)
    angle: Least = key("of every axis, rad", 0.0)

    @property
    def tolerances(self) -> Tolerances:
        """The table's values as `Tolerances` for `pose_error`."""
        joints, backlash = (v[0] if len(v) == 1 else v for v in (self.encoder, self.backlash))
        return Tolerances(joints, backlash, self.point, self.length, self.angle)


class SectionTable(TomlTable):
    """A link's section: a round tube, a rod, or a square tube, of steel or aluminium."""

    diameter: Positive | None = key("of a round one, m", None)
    side: Positive | None = key("of a square one, m", None)
    wall: Positive | None = key("m; left out, a round one is full", None)
    material: Literal["steel", "aluminium"] = "steel"

    @model_validator(mode="after")
    def _one_shape(self) -> Self:
        """Return the section; raise unless it has a diameter, or a side and wall, that fit."""
        if (self.diameter is None) == (self.side is None) or (self.side and self.wall is None):
            raise ValueError("give a diameter, or a side and a wall")
        outer = self.diameter or self.side or 0.0
        if self.wall is not None and 2.0 * self.wall > outer:
            raise ValueError(f"wall: {self.wall:g} m given, at most half of {outer:g} m")
        return self

    @property
    def section(self) -> Section:
        """The cross-section as a `Section` with its material, for stiffnesses."""
        material = {"steel": STEEL, "aluminium": ALUMINIUM}[self.material]
        if self.side is not None:
            return Section.square_tube(self.side, self.wall or 0.0, material)
        assert self.diameter is not None  # one of both is given
        return Section.tube(self.diameter, self.wall or self.diameter / 2.0, material)


class ElasticityTable(TomlTable):
    """`[elasticity]`: what gives way under a force on the tool; what is left out is rigid."""

    force: Positive | None = key("on the tool, in any direction, N", None)
    actuators: Annotated[tuple[Positive, ...], BeforeValidator(_numbers)] | None = key(
        "stiffness of the drives at their joints, N/m or N m/rad", None
    )
    upper: SectionTable | None = key("of upper links or cranks", None)
    lower: SectionTable | None = key("of lower links or rods", None)
    rod_distance: Positive | None = key("of a pair of rods, m", None)

    @model_validator(mode="after")
    def _expect_some(self) -> Self:
        """Return the table; raise if it names no elastic part."""
        if self.actuators is None and self.upper is None and self.lower is None:
            raise ValueError("nothing gives way; give actuators, upper or lower")
        return self

    @property
    def elasticity(self) -> Elasticity:
        """The table's values as `Elasticity` for `stiffness`."""
        stiffnesses = (inf,) if self.actuators is None else self.actuators
        upper, lower = (None if t is None else t.section for t in (self.upper, self.lower))
        return Elasticity(
            stiffnesses if len(stiffnesses) > 1 else stiffnesses[0], upper, lower, self.rod_distance
        )


class MotorsTable(TomlTable):
    """`[motors]`: the motors to choose from, for `motor_margin`."""

    file: str = key("a CSV, Parquet or TOML file beside this one")
