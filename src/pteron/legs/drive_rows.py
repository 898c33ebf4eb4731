"""Rows of the table of the legs' drives, in `pteron check` and reports: a text for each leg."""

from __future__ import annotations

from collections.abc import Sequence

from pteron.legs.drive import Drive, Elastic, Stribeck
from pteron.legs.kind import LegKind

_QUANTITIES = (
    ("dry friction", "coulomb", "{force}"),
    ("Stribeck friction at rest", "stribeck.force", "{force}"),
    ("Stribeck speed (37 % left)", "stribeck.speed", "{rate}"),
    ("viscous friction", "viscous", "{damping}"),
    ("offset", "offset", "{force}"),
    ("friction smoothed below", "rest_speed", "{rate}"),
    ("gear ratio", "ratio", "rad/{joint}"),
    ("rotor inertia at motor", "rotor_inertia", "kg m^2"),
    ("screw lead", "screw.lead", "m"),
    ("screw efficiency", "screw.efficiency", "1"),
    ("inertia of motor and screw at joint", "inertia", "{inertia}"),
    ("rated torque", "rated_torque", "N m"),
    ("maximum force", "max_force", "{force}"),
    ("maximum speed", "max_speed", "{rate}"),
    ("transmission stiffness", "elastic.stiffness", "{stiffness}"),
    ("transmission backlash", "elastic.backlash", "{joint}"),
    ("current time constant", "current_time", "s"),
    ("encoder", "counts_per_turn", "counts per turn of the motor"),
)
"""Names, where a `Drive` has them, and units."""


def drive_rows(legs: Sequence[LegKind]) -> list[tuple[str, list[str]]]:
    """Return table rows of the drives' quantities: (name, a text for each leg).

    A unit that all legs share is part of the quantity's name.

    Examples
    --------
    >>> import pteron
    >>> from dataclasses import replace
    >>> legs = pteron.load("five-bar").legs
    >>> for row in drive_rows([replace(legs[0], drive=pteron.legs.Drive(coulomb=3.0)), legs[1]]):
    ...     print(row)
    ('dry friction (N m)', ['3', '-'])
    ('friction smoothed below (rad/s)', ['0.001', '-'])
    """
    rows = []
    for name, place, unit in _QUANTITIES:
        numbers = [_drive_number(leg.drive, place) for leg in legs]
        if any(numbers):
            units = [unit.format(**_units(leg)) for leg in legs]
            is_shared = len(set(units)) == 1
            texts = [
                f"{number:.4g}{'' if is_shared else f' {leg_unit}'}" if number else "-"
                for number, leg_unit in zip(numbers, units, strict=True)
            ]
            rows.append((f"{name} ({units[0]})" if is_shared else name, texts))
    return rows


def _drive_number(drive: Drive | None, place: str) -> float | None:
    """Return a number of a drive by attribute path ("elastic.stiffness"); None if absent."""
    if drive is None or (place == "rest_speed" and not (drive.coulomb or drive.stribeck)):
        return None
    quantity: Drive | Stribeck | Elastic | float | None = drive
    for name in place.split("."):
        quantity = getattr(quantity, name, None)
    return quantity if isinstance(quantity, float) else None


def _units(leg: LegKind) -> dict[str, str]:
    """Return the units of a leg's drive quantities ("force", "rate" ...), linear or rotary."""
    slides = leg.joint.unit == "m"
    return {
        "joint": leg.joint.unit,
        "force": leg.joint.force_unit,
        "rate": f"{leg.joint.unit}/s",
        "damping": "N s/m" if slides else "N m s",
        "stiffness": "N/m" if slides else "N m/rad",
        "inertia": "kg" if slides else "kg m^2",
    }
