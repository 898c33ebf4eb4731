"""Warnings about a drive by itself: unlikely values, most often in a wrong unit."""

from __future__ import annotations

from collections.abc import Iterator
from math import pi, sqrt

from pteron.legs.drive import Drive, Elastic, Winding
from pteron.legs.kind import LegKind

_SLOW = 5.0
"""Motor radians per metre below which a slider's ratio is unlikely: belts have 20 and more, screws
hundreds."""

_SMOOTH = 0.1
"""Greatest usual `rest_speed`, the speed within which dry friction changes its sign smoothly, as a
share of the drive's greatest speed."""

_PEAK = 20.0
"""Greatest ratio of a drive's peak to its rated force, or the inverse: servo drives have 2 to 5."""

_SLOWEST, _FASTEST = 1.0, 1e4
"""Frequencies, Hz, between which a motor on its transmission vibrates while the joint is held."""

_PLAY = {"m": 2e-3, "rad": 0.05}
"""Greatest usual play of a transmission, by the joint's unit."""

_LAG = 0.02
"""Greatest usual time constant of a current loop, s: they have 0.1 to 3 ms."""

_WAVE = 0.5
"""Greatest usual ripple, as a share of a motor's torque."""


def drive_warnings(leg: LegKind) -> Iterator[str]:
    """Yield warnings about unlikely values of a leg's drive, one line each."""
    drive = leg.drive
    if drive is None:
        return
    unit, slides = leg.joint.force_unit, leg.joint.unit == "m"
    rate = f"{leg.joint.unit}/s"
    if slides and drive.rotor_inertia > 0.0 and abs(drive.gear) < _SLOW:
        left_out = " (left out)" if drive.ratio is None else ""
        yield (
            f"drive: rotor_inertia with a ratio of {drive.gear:g} motor radians per metre"
            f"{left_out}: belts have some tens, screws hundreds"
        )
    dry = drive.coulomb + (drive.stribeck.force if drive.stribeck else 0.0)
    rated, most = drive.rated_force, drive.max_force
    if most is not None and dry > most:
        yield (
            f"drive: dry friction of {dry:g} {unit} is more than max_force, {most:g} {unit}: it "
            "could not move"
        )
    if rated is not None and dry > rated:
        yield (
            f"drive: dry friction of {dry:g} {unit} is more than rated_torque gives at the joint, "
            f"{rated:.3g} {unit}: are ratio and rated_torque at the motor, in rad/{leg.joint.unit} "
            "and N m?"
        )
    if rated is not None and most is not None and not 1.0 / _PEAK <= most / rated <= _PEAK:
        yield (
            f"drive: max_force is {most / rated:.2g} times what rated_torque gives at the joint, "
            f"{rated:.3g} {unit}: is the ratio in rad/{leg.joint.unit}?"
        )
    fastest = drive.max_speed
    if fastest is not None and drive.rest_speed > _SMOOTH * fastest:
        yield (
            f"drive: rest_speed of {drive.rest_speed:g} {rate} smooths dry friction over much of "
            f"the speeds up to max_speed, {fastest:g} {rate}"
        )
    if fastest is not None and drive.stribeck and drive.stribeck.speed > fastest:
        yield (
            f"drive: stribeck.speed of {drive.stribeck.speed:g} {rate} is beyond max_speed, "
            f"{fastest:g} {rate}"
        )
    if drive.elastic:
        yield from _elastic_warnings(drive, drive.elastic, leg.joint.unit)
    if drive.current_time and drive.current_time > _LAG:
        yield (
            f"drive: current_time of {drive.current_time:g} s: current loops have 0.1 to 3 ms; is "
            "it in s?"
        )
    if drive.winding:
        yield from _winding_warnings(drive, drive.winding, unit, rate)
    high = max((abs(wave.size) for wave in drive.ripple), default=0.0)
    if high > _WAVE:
        yield f"drive: ripple of {high:g} times the torque: is its size a share, not per cent?"


def _elastic_warnings(drive: Drive, bends: Elastic, unit: str) -> Iterator[str]:
    """Yield warnings about unlikely values of an elastic transmission."""
    stiffness = "N/m" if unit == "m" else "N m/rad"
    frequency = sqrt(bends.stiffness / drive.inertia) / (2.0 * pi)
    if not _SLOWEST <= frequency <= _FASTEST:
        yield (
            f"drive: its motor vibrates at {frequency:.2g} Hz while the joint is held: are "
            f"elastic.stiffness in {stiffness} and rotor_inertia in kg m^2, at the motor?"
        )
    if bends.backlash > _PLAY[unit]:
        yield f"drive: elastic.backlash of {bends.backlash:g} {unit} is much: is it in {unit}?"


def _winding_warnings(drive: Drive, winding: Winding, unit: str, rate: str) -> Iterator[str]:
    """Yield warnings about a motor winding inconsistent with the drive's other values."""
    constant = abs(drive.gear) * winding.torque_constant
    stall, fastest = constant * winding.voltage / winding.resistance, winding.voltage / constant
    if drive.max_force is not None and drive.max_force > stall:
        yield (
            f"drive: max_force is {drive.max_force:g} {unit}, but the winding gives {stall:.3g} "
            f"{unit} at most: is torque_constant in N m/A?"
        )
    if drive.max_speed is not None and drive.max_speed > fastest:
        yield (
            f"drive: max_speed is {drive.max_speed:g} {rate}, but the winding's supply ends at "
            f"{fastest:.3g} {rate}: is torque_constant in N m/A?"
        )
