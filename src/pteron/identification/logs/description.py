"""The description of a log: names and units of its columns, and facts beside the numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from functools import wraps
from typing import Annotated, Any, Literal, TypeVar, get_args

from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    field_validator,
    model_validator,
)
from pydantic.dataclasses import dataclass

from pteron.bodies.inertia import PlanarInertia, SpatialInertia
from pteron.errors import DataError, shorten
from pteron.legs.kind import ActuatedJoint
from pteron.manipulator import Manipulator
from pteron.tables import Dialect
from pteron.toml import fault_lines, joined_faults

TimeUnit = Literal["s", "ms", "us", "ns", "100 ns"]
"""Units of time stamps."""

TimeFormat = Literal[
    "hh:mm:ss",
    "YYYY-MM-DD hh:mm:ss",
    "DD.MM.YYYY hh:mm:ss",
    "DD/MM/YYYY hh:mm:ss",
    "MM/DD/YYYY hh:mm:ss",
]
"""Formats of times as text; fractions of a second may follow each."""

LengthUnit = Literal["m", "mm", "um"]
"""Units of sliders' positions and of poses."""

AngleUnit = Literal["rad", "deg"]
"""Units of cranks' positions and of poses."""

ForceUnit = Literal["N", "N m", "A", "V", "%"]
"""Units of forces: newtons at a slider, newton metres at a crank, or amperes, volts or per cent of
a drive."""

MotorUnit = Literal["turns", "counts"]
"""Units of positions at the motor: its turns, or the counts of its encoder."""

JointUnit = Literal["m", "mm", "um", "rad", "deg", "turns", "counts"]
"""All units that joint positions may have."""

_OF_DRIVES = ("A", "V", "%")
"""Units of forces that need gains to become newtons."""

_Class = TypeVar("_Class", bound=type)


def _not_zero(factor: float) -> float:
    """Return the factor; raise where it is zero."""
    if factor == 0.0:
        raise ValueError("0 given: its motor would not move the joint")
    return factor


def _check_rising(pair: tuple[float, float]) -> tuple[float, float]:
    """Return the pair [low, high]; raise unless low is below high."""
    low, high = pair
    if not low < high:
        raise ValueError(f"{low:g} is not below {high:g}; give [low, high]")
    return pair


def _pairs(limits: Any) -> Any:
    """Return one pair, which holds for all joints, as a list of pairs."""
    flat = isinstance(limits, list | tuple) and len(limits) == 2
    return (
        [limits] if flat and not any(isinstance(part, list | tuple) for part in limits) else limits
    )


Number = Annotated[float, Field(allow_inf_nan=False, strict=True)]
Factor = Annotated[Number, AfterValidator(_not_zero)]
Two = tuple[Number, Number]
Three = tuple[Number, Number, Number]
Six = tuple[Number, Number, Number, Number, Number, Number]
Pair = Annotated[Two, AfterValidator(_check_rising)]
Names = Annotated[tuple[str, ...], Field(min_length=1)]


_CONFIG = ConfigDict(extra="forbid", validate_by_name=True, validate_by_alias=True)


def _raises_data_errors(cls: _Class) -> _Class:
    """Make a pydantic dataclass refuse its arguments with a `DataError`."""
    checked: Callable[..., None] = cls.__init__  # type: ignore[misc]
    names = [field.name for field in fields(cls)]

    @wraps(checked)
    def __init__(self: Any, *args: Any, **named: Any) -> None:  # noqa: N807
        try:
            checked(self, **dict(zip(names, args, strict=False)), **named)
        except ValidationError as error:
            raise DataError(joined_faults(fault_lines(error, cls)), subject=cls.__name__) from None

    cls.__init__ = __init__  # type: ignore[misc]
    return cls


def joint_symbols(robot: Manipulator) -> tuple[ActuatedJoint, ...]:
    """Return the names and units of each leg's actuated joint."""
    return tuple(leg.joint for leg in robot.legs)


def _units_of(joint: ActuatedJoint) -> tuple[str, ...]:
    """Return the units in which a joint's coordinate may stand in a file."""
    return get_args(LengthUnit if joint.unit == "m" else AngleUnit) + get_args(MotorUnit)


@_raises_data_errors
@dataclass(frozen=True, config=_CONFIG)
class KnownPayload:
    """A payload whose inertia is known, carried in phase 1 of a log.

    Parameters
    ----------
    mass : float
        kg.
    first_moment : tuple of float
        Mass times the position of the centre of mass in the platform frame, kg m. A 3T platform
        does not feel it; under one that tilts it has three components.
    inertia : float or tuple of float
        Moment of inertia about the platform's axis through P, kg m^2. A 3T platform does not feel
        it. Under one that tilts Ixx, Ixy, Ixz, Iyy, Iyz and Izz about P.
    center_of_mass : tuple of float, optional
        Its position in the platform frame, m, in place of the first moment.

    Raises
    ------
    DataError
        If no real body has this inertia: the mass must be positive and I m >= (m gamma)^2.
    """

    mass: Annotated[Number, Field(gt=0.0)]
    first_moment: Two | Three = (0.0, 0.0)
    inertia: Number | Six = 0.0
    center_of_mass: Annotated[Two | Three | None, Field(exclude=True)] = None

    @model_validator(mode="after")
    def _real(self) -> KnownPayload:
        """Return the payload with its first moment; raise unless it can be a real body's."""
        if self.center_of_mass is not None:
            moment = tuple(self.mass * x for x in self.center_of_mass)
            object.__setattr__(self, "first_moment", moment)
            object.__setattr__(self, "center_of_mass", None)
        if (len(self.first_moment) == 3) != isinstance(self.inertia, tuple):
            raise ValueError(
                "inertia: one number goes with two components of the centre of mass, six numbers "
                "about P with three"
            )
        if isinstance(self.inertia, tuple):
            SpatialInertia.of_values(self.values)
        elif any(self.values[1:]):  # more than the mass is known
            PlanarInertia.of_values(self.values)
        return self

    @property
    def values(self) -> tuple[float, ...]:
        """Its inertial parameters about P, in the order of the platform's kinds."""
        inertia = self.inertia if isinstance(self.inertia, tuple) else (self.inertia,)
        return (self.mass, *self.first_moment, *inertia)


@_raises_data_errors
@dataclass(frozen=True, config=_CONFIG)
class Description:
    """The description of a log, as its TOML file gives it; None where it says nothing.

    The alias of each field is the key in the file: ``[time] unit`` is ``"time.unit"``.

    Parameters
    ----------
    csv : Dialect, optional
        Separator, decimal sign and encoding of a CSV file.
    time_column, payload_column : str, optional
        Names of columns.
    joint_columns, force_columns, pose_columns : tuple of str, optional
        Names of columns, in the order of the legs and of the pose's coordinates.
    time_unit : {"s", "ms", "us", "ns", "100 ns"}, optional
    time_format : str, optional
        One of `TimeFormat`, where times are text.
    joint_unit : {"m", "mm", "um", "rad", "deg", "turns", "counts"}, optional
        Unit of the joint coordinates that it can measure: lengths of sliders, angles of cranks. Or
        turns of the motors, or counts of their encoders, of all joints: they are taken to the
        joints by `ratio` and `counts_per_turn` of the machine's drives.
    joint_angle_unit : {"rad", "deg"}, optional
        Unit of the cranks' coordinates where there are both.
    length_unit : {"m", "mm", "um"}, optional
        Unit of the pose's lengths.
    angle_unit : {"rad", "deg"}, optional
        Unit of the pose's angles.
    column_force_unit : {"N", "N m", "A", "V", "%"}, optional
        Unit of the force columns, before the gains.
    gains : tuple of float, optional
        Newtons, at a crank newton metres, per unit of the force columns, one a joint.
    limits : tuple of (float, float), optional
        Saturation of the forces in `force_unit`: one pair for all joints, or one each.
    payload : KnownPayload, optional
        The payload in phase 1.
    period : float, optional
        Period of the excitation, s.
    start, end : float, optional
        Begin and end of the motion's periodic part, s from where it sets off, between lead-in and
        lead-out. The log may begin earlier or later: the part that repeats is found in it.
    assembly_mode : int, optional
        The pose of `direct_kinematics` that the machine has at the first sample, counted from 1.
    rotor_inertia : tuple of float, optional
        Inertia of each joint's motor, kg m^2.
    ratio : tuple of float, optional
        Turn of each motor per metre (or radian) of its joint, rad.

    Raises
    ------
    DataError
        If a unit, the period or the assembly mode cannot be, if a gain or ratio is 0, or if a
        column is named twice.
    """

    csv: Dialect | None = None
    time_column: Annotated[str | None, Field(alias="time.column")] = None
    time_unit: Annotated[TimeUnit | None, Field(alias="time.unit")] = None
    time_format: Annotated[TimeFormat | None, Field(alias="time.format")] = None
    joint_columns: Annotated[Names | None, Field(alias="joints.columns")] = None
    joint_unit: Annotated[JointUnit | None, Field(alias="joints.unit")] = None
    joint_angle_unit: Annotated[AngleUnit | None, Field(alias="joints.angle_unit")] = None
    force_columns: Annotated[Names | None, Field(alias="forces.columns")] = None
    column_force_unit: Annotated[ForceUnit | None, Field(alias="forces.unit")] = None
    gains: Annotated[tuple[Factor, ...] | None, Field(alias="forces.gains")] = None
    limits: Annotated[
        tuple[Pair, ...] | None, BeforeValidator(_pairs), Field(alias="forces.limits")
    ] = None
    pose_columns: Annotated[Names | None, Field(alias="pose.columns")] = None
    length_unit: Annotated[LengthUnit | None, Field(alias="pose.length_unit")] = None
    angle_unit: Annotated[AngleUnit | None, Field(alias="pose.angle_unit")] = None
    payload_column: Annotated[str | None, Field(alias="payload.column")] = None
    payload: KnownPayload | None = None
    period: Annotated[Number | None, Field(alias="motion.period", gt=0.0)] = None
    start: Annotated[Number | None, Field(alias="motion.start", ge=0.0)] = None
    end: Annotated[Number | None, Field(alias="motion.end", gt=0.0)] = None
    assembly_mode: Annotated[
        Annotated[int, Field(ge=1, strict=True)] | None, Field(alias="motion.assembly_mode")
    ] = None
    rotor_inertia: Annotated[
        tuple[Annotated[Number, Field(ge=0.0)], ...] | None, Field(alias="drives.rotor_inertia")
    ] = None
    ratio: Annotated[tuple[Factor, ...] | None, Field(alias="drives.ratio")] = None

    @field_validator("payload", mode="before")
    @classmethod
    def _whole_payload(cls, payload: Any) -> Any:
        """Return the payload; raise where only part of its inertia is stated."""
        if not isinstance(payload, dict) or "mass" not in payload:
            return payload
        center, moment = "center_of_mass" in payload, "first_moment" in payload
        if (center or moment) and "inertia" not in payload:
            raise ValueError("inertia is missing; give it about P, in kg m^2")
        if "inertia" in payload and center == moment:
            which = "both center_of_mass and" if center else "neither center_of_mass nor"
            raise ValueError(f"{which} first_moment given; give one of the two")
        return payload

    @model_validator(mode="after")
    def _agrees(self) -> Description:
        """Return the description; raise where its columns, times or units contradict each other."""
        named = [self.time_column, self.payload_column]
        for several in (self.joint_columns, self.force_columns, self.pose_columns):
            named += several or ()
        columns = [name for name in named if name is not None]
        twice = next((name for i, name in enumerate(columns) if name in columns[:i]), None)
        if twice is not None:
            raise ValueError(
                f"columns: {shorten(twice)} is named twice; each column has one meaning"
            )
        if self.end is not None and not (self.start or 0.0) < self.end:
            raise ValueError(f"motion.end: {self.end:g} s is not behind motion.start")
        if self.period is None and (self.start is not None or self.end is not None):
            raise ValueError("motion.start, motion.end: are of a periodic part; give its period")
        if self.time_unit is not None and self.time_format is not None:
            raise ValueError("time.format: times as text have no unit; give unit or format")
        return self

    @property
    def force_unit(self) -> str:
        """Unit of a log's forces: "N" (at cranks N m) once gains are applied, else the columns'."""
        raw = self.column_force_unit
        return "N" if raw is None or raw == "N m" or self.gains is not None else raw

    def joint_units(self, robot: Manipulator) -> tuple[str | None, ...]:
        """Return the unit declared for each joint of a machine, None where nothing is."""
        declared = (self.joint_angle_unit, self.joint_unit)
        return tuple(
            next((unit for unit in declared if unit in _units_of(joint)), None)
            for joint in joint_symbols(robot)
        )

    def check(self, robot: Manipulator) -> None:
        """Raise a `DataError` if this is no description of a machine's log."""
        legs, coordinates = f"{len(robot.legs)} legs", f"{len(robot.coordinates)} pose coordinates"
        lists = {
            "joints.columns": (self.joint_columns, legs),
            "forces.columns": (self.force_columns, legs),
            "forces.gains": (self.gains, legs),
            "drives.rotor_inertia": (self.rotor_inertia, legs),
            "drives.ratio": (self.ratio, legs),
            "pose.columns": (self.pose_columns, coordinates),
        }
        for key, (entries, needed) in lists.items():
            if entries is not None and len(entries) != int(needed.split()[0]):
                raise DataError(
                    f"{key}: {len(entries)} given, but the machine has {needed}; give one each, or "
                    "name the machine the log belongs to"
                )
        if self.limits is not None and len(self.limits) not in (1, len(robot.legs)):
            raise DataError(
                f"forces.limits: {len(self.limits)} pairs given, but the machine has {legs}; give "
                "one pair for all, or one each"
            )
        joints = joint_symbols(robot)
        for key, unit, known in (
            (
                "joints.unit",
                self.joint_unit,
                [joint_unit for j in joints for joint_unit in _units_of(j)],
            ),
            ("forces.unit", self.column_force_unit, [*_OF_DRIVES, *(j.force_unit for j in joints)]),
        ):
            if unit is not None and unit not in known:
                raise DataError(
                    f"{key}: {unit} given, but on this machine it is one of "
                    f"{', '.join(dict.fromkeys(known))}"
                )
        if self.payload is not None and robot.platform.angles and not self.payload.inertia:
            raise DataError(
                "payload: only its mass is given, but the machine turns its platform; give "
                "center_of_mass (or first_moment) and inertia about P"
            )
        kinds = robot.platform.inertia.kinds
        if self.payload is not None and len(self.payload.values) != len(kinds):
            raise DataError(
                f"payload: {len(self.payload.values)} inertial parameters given, but this platform "
                f"feels {len(kinds)}: {', '.join(kinds)}"
            )
