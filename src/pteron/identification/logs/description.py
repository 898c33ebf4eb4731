"""What is known about a log beside its numbers: the TOML file beside it, found, read, written."""

from __future__ import annotations

import codecs
from collections.abc import Callable, Iterable
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_args

from pydantic import (
    AfterValidator,
    AliasChoices,
    BeforeValidator,
    ConfigDict,
    Field,
    TypeAdapter,
    ValidationError,
    field_validator,
    model_validator,
)
from pydantic.dataclasses import dataclass

from pteron.atomic import write_text
from pteron.errors import DataError, shown
from pteron.identification.logs.joints import joint_symbols, units_of
from pteron.manipulator import Manipulator
from pteron.tables import Dialect
from pteron.toml import fault_lines, read_toml, table_keys, told, validated

TimeUnit = Literal["s", "ms", "us"]
LengthUnit = Literal["m", "mm", "um"]
AngleUnit = Literal["rad", "deg"]
ForceUnit = Literal["N", "N m", "A", "V", "%"]
JointUnit = Literal["m", "mm", "um", "rad", "deg"]

_ROUNDING = 1e-12
_OF_A_MANIPULATOR = {"platform", "legs"}
_Class = TypeVar("_Class", bound=type)


def _not_zero(value: float) -> float:
    if value == 0.0:
        raise ValueError("0 given: its motor would not move the joint")
    return value


def _rising(pair: tuple[float, float]) -> tuple[float, float]:
    low, high = pair
    if not low < high:
        raise ValueError(f"{low:g} is not below {high:g}; give [low, high]")
    return pair


def _pairs(given: Any) -> Any:
    """Return one pair, which holds for all joints, as a list of pairs."""
    flat = isinstance(given, list | tuple) and len(given) == 2
    return [given] if flat and not any(isinstance(one, list | tuple) for one in given) else given


def _single(given: Any) -> Any:
    """Return one unit, which holds for all joints that it can measure, as a list of units."""
    if isinstance(given, str) and given not in get_args(JointUnit):
        raise ValueError(f"{shown(given)} given, one of {', '.join(get_args(JointUnit))} expected")
    return (given,) if isinstance(given, str) else given


def _known_encoding(name: str) -> str:
    try:
        codecs.lookup(name)
    except (LookupError, ValueError):
        raise ValueError(f"{shown(name)} is no text encoding that Python knows") from None
    return name


Number = Annotated[float, Field(allow_inf_nan=False, strict=True)]
Factor = Annotated[Number, AfterValidator(_not_zero)]
Two = tuple[Number, Number]
Pair = Annotated[Two, AfterValidator(_rising)]
Names = Annotated[tuple[str, ...], Field(min_length=1)]


def _of_joints(key: str) -> Any:
    """Return the field of a key under ``[joints]``, which older files call ``[sliders]``."""
    choices = AliasChoices(f"joints.{key}", f"sliders.{key}")
    return Field(validation_alias=choices, serialization_alias=f"joints.{key}")


_CONFIG = ConfigDict(extra="forbid", validate_by_name=True, validate_by_alias=True)


def _raises_data_errors(cls: _Class) -> _Class:
    """Make a pydantic dataclass refuse its arguments with a `DataError`."""
    checked: Callable[..., None] = cls.__init__  # type: ignore[misc]

    @wraps(checked)
    def __init__(self: Any, *args: Any, **given: Any) -> None:  # noqa: N807
        try:
            checked(self, **dict(zip(cls.__dataclass_fields__, args, strict=False)), **given)
        except ValidationError as error:
            raise DataError(told(cls.__name__, fault_lines(error, cls))) from None

    cls.__init__ = __init__  # type: ignore[misc]
    return cls


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
        does not feel it.
    inertia : float
        Moment of inertia about the platform's axis through P, kg m^2. A 3T platform does not feel
        it.
    center_of_mass : tuple of float, optional
        Its position in the platform frame, m, in place of the first moment.

    Raises
    ------
    DataError
        If no real body has this inertia: the mass must be positive and I m >= (m gamma)^2.
    """

    mass: Annotated[Number, Field(gt=0.0)]
    first_moment: Two = (0.0, 0.0)
    inertia: Number = 0.0
    center_of_mass: Annotated[Two | None, Field(exclude=True)] = None

    @model_validator(mode="after")
    def _real(self) -> KnownPayload:
        if self.center_of_mass is not None:
            x, y = self.center_of_mass
            object.__setattr__(self, "first_moment", (self.mass * x, self.mass * y))
            object.__setattr__(self, "center_of_mass", None)
        hx, hy = self.first_moment
        least = (hx * hx + hy * hy) / self.mass
        if not self.inertia >= least * (1.0 - _ROUNDING):
            raise ValueError(
                f"inertia: {self.inertia:g} kg m^2 belongs to no real body; with this mass and "
                f"centre of mass, and about P, it must be at least {least:g} kg m^2"
            )
        return self


@_raises_data_errors
@dataclass(frozen=True, config=_CONFIG)
class Description:
    """The description of a log, as its TOML file gives it; None where it says nothing.

    The alias of each field is the key in the file: ``[time] unit`` is ``"time.unit"``.

    Parameters
    ----------
    csv_separator, csv_decimal, csv_encoding, csv_header_lines : optional
        How a CSV file is written; see `pteron.tables.Dialect`.
    time_column, payload_column : str, optional
        Names of columns.
    joint_columns, force_columns, pose_columns : tuple of str, optional
        Names of columns, in the order of the legs and of the pose's coordinates.
    time_unit : {"s", "ms", "us"}, optional
    joint_unit : {"m", "mm", "um", "rad", "deg"} or tuple of them, optional
        Unit of the joint coordinates, or one each; a single one holds for the joints it can
        measure, lengths for sliders and angles for cranks.
    length_unit : {"m", "mm", "um"}, optional
        Unit of x, y and z.
    angle_unit : {"rad", "deg"}, optional
        Unit of phi.
    column_force_unit : {"N", "N m", "A", "V", "%"}, optional
        Unit of the force columns, before the gains.
    gains : tuple of float, optional
        Newtons (at a crank: newton metres) per unit of the force columns, one a joint.
    limits : tuple of (float, float), optional
        Saturation of the forces in `force_unit`: one pair for all joints, or one each.
    payload : KnownPayload, optional
        What is carried in phase 1.
    period : float, optional
        Period of the excitation, s.
    assembly_mode : {1, 2}, optional
        Which solution of the direct kinematics the machine is in, counted from 1 as a person
        counts. (`Treatment.mode` counts columns of `direct_kinematics`, from 0.)
    rotor_inertia : tuple of float, optional
        Of each joint's motor, kg m^2.
    ratio : tuple of float, optional
        Turn of each motor per metre (or radian) of its joint, rad.

    Raises
    ------
    DataError
        If a unit, the period or the assembly mode cannot be, if a gain or ratio is 0, or if a
        column is named twice.
    """

    csv_separator: Annotated[
        Literal[",", ";", "\t", "|", " "] | None, Field(alias="csv.separator")
    ] = None
    csv_decimal: Annotated[Literal[".", ","] | None, Field(alias="csv.decimal")] = None
    csv_encoding: Annotated[
        Annotated[str, AfterValidator(_known_encoding)] | None, Field(alias="csv.encoding")
    ] = None
    csv_header_lines: Annotated[int | None, Field(alias="csv.header_lines", ge=1, strict=True)] = (
        None
    )
    time_column: Annotated[str | None, Field(alias="time.column")] = None
    time_unit: Annotated[TimeUnit | None, Field(alias="time.unit")] = None
    joint_columns: Annotated[Names | None, _of_joints("columns")] = None
    joint_unit: Annotated[
        tuple[JointUnit, ...] | None, BeforeValidator(_single), _of_joints("unit")
    ] = None
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
    assembly_mode: Annotated[Literal[1, 2] | None, Field(alias="motion.assembly_mode")] = None
    rotor_inertia: Annotated[
        tuple[Annotated[Number, Field(ge=0.0)], ...] | None, Field(alias="drives.rotor_inertia")
    ] = None
    ratio: Annotated[tuple[Factor, ...] | None, Field(alias="drives.ratio")] = None

    @field_validator("payload", mode="before")
    @classmethod
    def _whole_payload(cls, given: Any) -> Any:
        if not isinstance(given, dict) or "mass" not in given:
            return given
        center, moment = "center_of_mass" in given, "first_moment" in given
        if (center or moment) and "inertia" not in given:
            raise ValueError("inertia is missing; give it about P, in kg m^2")
        if "inertia" in given and center == moment:
            which = "both center_of_mass and" if center else "neither center_of_mass nor"
            raise ValueError(f"{which} first_moment given; give one of the two")
        return given

    @model_validator(mode="after")
    def _apart(self) -> Description:
        named = [self.time_column, self.payload_column]
        for several in (self.joint_columns, self.force_columns, self.pose_columns):
            named += several or ()
        columns = [name for name in named if name is not None]
        twice = next((name for i, name in enumerate(columns) if name in columns[:i]), None)
        if twice is not None:
            raise ValueError(f"columns: {shown(twice)} is named twice; each column has one meaning")
        if self.dialect.decimal == self.dialect.separator:
            raise ValueError('csv: "," cannot be both the separator and the decimal sign')
        return self

    @property
    def force_unit(self) -> str:
        """Unit of a log's forces: "N" (at cranks N m) once gains are applied, else the columns'."""
        raw = self.column_force_unit
        return "N" if raw is None or raw == "N m" or self.gains is not None else raw

    @property
    def dialect(self) -> Dialect:
        """How a CSV file is written."""
        return Dialect(
            self.csv_separator or ",",
            self.csv_decimal or ".",
            self.csv_encoding or "utf-8",
            self.csv_header_lines,
        )

    def joint_units(self, robot: Manipulator) -> tuple[str | None, ...]:
        """Return the unit declared for each joint of a machine, None where nothing is."""
        joints, given = joint_symbols(robot), self.joint_unit or ()
        if len(given) != 1:
            return given or (None,) * len(joints)
        return tuple(given[0] if given[0] in units_of(joint) else None for joint in joints)

    def check(self, robot: Manipulator) -> None:
        """Raise a `DataError` if this is no description of a machine's log."""
        joints, legs = joint_symbols(robot), len(robot.legs)
        lists = {
            "joints.columns": (self.joint_columns, legs),
            "forces.columns": (self.force_columns, legs),
            "forces.gains": (self.gains, legs),
            "drives.rotor_inertia": (self.rotor_inertia, legs),
            "drives.ratio": (self.ratio, legs),
            "pose.columns": (self.pose_columns, len(robot.coordinates)),
        }
        for key, (values, needed) in lists.items():
            if values is not None and len(values) != needed:
                what = f"{needed} pose coordinates" if key == "pose.columns" else f"{needed} legs"
                raise DataError(
                    f"{key}: {len(values)} given, but the machine has {what}; give one each, or "
                    "name the machine the log belongs to"
                )
        one_or_each = {
            "forces.limits": (self.limits, "pairs"),
            "joints.unit": (self.joint_unit, "units"),
        }
        for key, (several, noun) in one_or_each.items():
            if several is not None and len(several) not in (1, legs):
                raise DataError(
                    f"{key}: {len(several)} {noun} given, but the machine has {legs} legs; give "
                    "one for all, or one each"
                )
        if self.joint_unit is not None:
            units = self.joint_units(robot)
            right = [unit in units_of(joint) for unit, joint in zip(units, joints, strict=True)]
            if not (any(right) if len(self.joint_unit) == 1 else all(right)):
                raise DataError(
                    f"joints.unit: {', '.join(self.joint_unit)} given, but the joints of this "
                    f"machine are measured in {_counted(joint.unit for joint in joints)}"
                )
        if self.column_force_unit in ("N", "N m"):
            usual = [joint.force_unit for joint in joints]
            if self.column_force_unit not in usual:
                raise DataError(
                    f"forces.unit: {self.column_force_unit} given, but the forces of this "
                    f"machine's joints are measured in {_counted(usual)}"
                )
        if self.payload is not None and "phi" in robot.coordinates and not self.payload.inertia:
            raise DataError(
                "payload: only its mass is given, but the machine turns its platform; give "
                "center_of_mass (or first_moment) and inertia about P"
            )


def find_description(log_path: str | Path) -> Path | None:
    """Return the TOML file beside a log, of the same stem, or None where there is none.

    A manipulator's file is no description of a log, whatever it is called.
    """
    path = Path(log_path).with_suffix(".toml")
    if not path.is_file():
        return None
    try:
        document = read_toml(path, DataError, _ABSENT)
    except DataError:
        return path  # what is wrong with it is told where it is read
    return None if document.keys() >= _OF_A_MANIPULATOR else path


def read_description(path: str | Path) -> Description:
    """Read the description of a log from a TOML file, in which every key is optional.

    Parameters
    ----------
    path : str or path
        The file. Its tables: ``[csv]`` separator, decimal, encoding, header_lines; ``[time]``
        column, unit; ``[joints]`` (or ``[sliders]``) columns, unit; ``[forces]`` columns, unit,
        gains, limits; ``[pose]`` columns, length_unit, angle_unit; ``[payload]`` column, mass,
        center_of_mass or first_moment, inertia; ``[motion]`` period, assembly_mode; ``[drives]``
        rotor_inertia, ratio.

    Returns
    -------
    Description

    Raises
    ------
    DataError
        If there is no such file, or if it is not TOML, has unknown keys or values that cannot be;
        the message names each such key, and the valid ones.
    """
    source = shown(str(path), bare=True, longest=1000)
    document = read_toml(path, DataError, _ABSENT)
    if document.keys() >= _OF_A_MANIPULATOR:
        raise DataError(f"{source}: describes a manipulator; the description of a log was expected")
    if document.keys() >= {"joints", "sliders"}:
        raise DataError(f"{source}: [sliders] is the older name of [joints]; give one of them")
    flat: dict[str, Any] = {}
    for table, entries in document.items():
        if table not in _TABLES or not isinstance(entries, dict):
            flat[table] = entries
        elif table == "payload":
            rest = dict(entries)
            flat |= {"payload.column": rest.pop("column")} if "column" in rest else {}
            flat |= {"payload": rest} if rest else {}
        else:
            flat |= {f"{table}.{key}": value for key, value in entries.items()}
    return validated(Description, flat, source, DataError)


def write_description(description: Description, path: str | Path) -> Path:
    """Write a description to a TOML file that `read_description` reads back without loss.

    Raises
    ------
    OutputError
        If the file cannot be written; one that was there is left as it was.
    """
    import tomlkit

    given = TypeAdapter(Description).dump_python(
        description, mode="json", by_alias=True, exclude_none=True
    )
    tables: dict[str, dict[str, Any]] = {}
    for key, value in given.items():
        table, _, entry = key.partition(".")
        tables.setdefault(table, {}).update({entry: value} if entry else value)
    document = tomlkit.document()
    document.add(tomlkit.comment("A log for Pteron: its columns, their units, what is known."))
    for name, entries in tables.items():
        document.add(name, tomlkit.item(entries))
    return write_text(path, tomlkit.dumps(document))


_ABSENT = "no such file; it should describe a log"
_TABLES = table_keys(Description)


def _counted(units: Iterable[str]) -> str:
    return " and ".join(dict.fromkeys(units))
