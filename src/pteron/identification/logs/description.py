"""What is known about a log beside its numbers: names, units, drives, payload, the motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from pteron.errors import DataError

__all__ = [
    "AngleUnit",
    "Description",
    "ForceUnit",
    "KnownPayload",
    "LengthUnit",
    "TimeUnit",
]

TimeUnit = Literal["s", "ms", "us"]
LengthUnit = Literal["m", "mm", "um"]
AngleUnit = Literal["rad", "deg"]
ForceUnit = Literal["N", "A", "V", "%"]

_ROUNDING = 1e-12


@dataclass(frozen=True)
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

    Raises
    ------
    DataError
        If no real body has this inertia: the mass must be positive and I m >= (m gamma)^2.
    """

    mass: float
    first_moment: tuple[float, float] = (0.0, 0.0)
    inertia: float = 0.0

    def __post_init__(self) -> None:
        if not self.mass > 0.0:
            raise DataError(f"payload.mass: {self.mass:g} kg given; a payload's mass is above 0 kg")
        hx, hy = self.first_moment
        least = (hx * hx + hy * hy) / self.mass
        if not self.inertia >= least * (1.0 - _ROUNDING):
            raise DataError(
                f"payload.inertia: {self.inertia:g} kg m^2 belongs to no real body; with this mass "
                f"and centre of mass, and about P, it must be at least {least:g} kg m^2"
            )


@dataclass(frozen=True)
class Description:
    """The description of a log, as its TOML file gives it; None where it says nothing.

    Parameters
    ----------
    time_column, payload_column : str, optional
        Names of columns.
    slider_columns, force_columns, pose_columns : tuple of str, optional
        Names of columns, in the order of the legs and of the pose's coordinates.
    time_unit : {"s", "ms", "us"}, optional
    slider_unit, length_unit : {"m", "mm", "um"}, optional
        Units of the sliders, and of x, y and z.
    angle_unit : {"rad", "deg"}, optional
    column_force_unit : {"N", "A", "V", "%"}, optional
        Unit of the force columns, before the gains.
    gains : tuple of float, optional
        Newtons per unit of the force columns, one a slider.
    limits : tuple of (float, float), optional
        Saturation of the forces in `force_unit`: one pair for all sliders, or one each.
    payload : KnownPayload, optional
        What is carried in phase 1.
    period : float, optional
        Period of the excitation, s.
    assembly_mode : {1, 2}, optional
        Which solution of the direct kinematics the machine is in.
    rotor_inertia : tuple of float, optional
        Of each slider's motor, kg m^2.
    ratio : tuple of float, optional
        Turn of each motor a metre of its slider, rad/m.

    Raises
    ------
    DataError
        If a unit, the period or the assembly mode cannot be, if a gain or ratio is 0, or if a
        column is named twice.
    """

    time_column: str | None = None
    time_unit: TimeUnit | None = None
    slider_columns: tuple[str, ...] | None = None
    slider_unit: LengthUnit | None = None
    force_columns: tuple[str, ...] | None = None
    column_force_unit: ForceUnit | None = None
    gains: tuple[float, ...] | None = None
    limits: tuple[tuple[float, float], ...] | None = None
    pose_columns: tuple[str, ...] | None = None
    length_unit: LengthUnit | None = None
    angle_unit: AngleUnit | None = None
    payload_column: str | None = None
    payload: KnownPayload | None = None
    period: float | None = None
    assembly_mode: int | None = None
    rotor_inertia: tuple[float, ...] | None = None
    ratio: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        units = {
            "time.unit": (self.time_unit, TimeUnit),
            "sliders.unit": (self.slider_unit, LengthUnit),
            "forces.unit": (self.column_force_unit, ForceUnit),
            "pose.length_unit": (self.length_unit, LengthUnit),
            "pose.angle_unit": (self.angle_unit, AngleUnit),
        }
        for key, (unit, known) in units.items():
            if unit is not None and unit not in get_args(known):
                raise DataError(f"{key}: {unit!r} is not one of {', '.join(get_args(known))}")
        columns = [
            *(name for name in (self.time_column, self.payload_column) if name is not None),
            *(self.slider_columns or ()),
            *(self.force_columns or ()),
            *(self.pose_columns or ()),
        ]
        twice = next((name for i, name in enumerate(columns) if name in columns[:i]), None)
        if twice is not None:
            raise DataError(f"columns: {twice!r} is named twice; each column has one meaning")
        if self.period is not None and not self.period > 0.0:
            raise DataError(f"motion.period: {self.period:g} s given; a period is above 0 s")
        if self.assembly_mode not in (None, 1, 2):
            raise DataError(f"motion.assembly_mode: {self.assembly_mode!r} is neither 1 nor 2")
        for key, values in (("forces.gains", self.gains), ("drives.ratio", self.ratio)):
            if values is not None and 0.0 in values:
                raise DataError(f"{key}: one is 0, so that its motor would not move the slider")
        if any(inertia < 0.0 for inertia in self.rotor_inertia or ()):
            raise DataError("drives.rotor_inertia: one is below 0 kg m^2")
        for low, high in self.limits or ():
            if not low < high:
                raise DataError(f"forces.limits: {low:g} is not below {high:g}; give [low, high]")

    @property
    def force_unit(self) -> str:
        """Unit of a log's forces: newtons once gains are applied, else that of the columns."""
        return "N" if self.gains is not None else self.column_force_unit or "N"

    def check(self, legs: int, coordinates: tuple[str, ...]) -> None:
        """Raise a `DataError` if lists do not have one entry a leg (or coordinate) of a machine."""
        lists = {
            "sliders.columns": (self.slider_columns, legs),
            "forces.columns": (self.force_columns, legs),
            "forces.gains": (self.gains, legs),
            "drives.rotor_inertia": (self.rotor_inertia, legs),
            "drives.ratio": (self.ratio, legs),
            "pose.columns": (self.pose_columns, len(coordinates)),
        }
        for key, (values, needed) in lists.items():
            if values is not None and len(values) != needed:
                what = f"{needed} pose coordinates" if key == "pose.columns" else f"{needed} legs"
                raise DataError(
                    f"{key}: {len(values)} given, but the machine has {what}; give one each, or "
                    "name the machine the log belongs to"
                )
        if self.limits is not None and len(self.limits) not in (1, legs):
            raise DataError(
                f"forces.limits: {len(self.limits)} pairs given, but the machine has {legs} legs; "
                "give one pair for all, or one each"
            )
        if self.payload is not None and "phi" in coordinates and not self.payload.inertia:
            raise DataError(
                "payload: only its mass is given, but the machine turns its platform; give "
                "center_of_mass (or first_moment) and inertia about P"
            )
