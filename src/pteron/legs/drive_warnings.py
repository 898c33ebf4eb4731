"""Warnings about a drive by itself: unlikely values, most often in a wrong unit."""

from __future__ import annotations

from collections.abc import Iterator

from pteron.legs.kind import LegKind

_SLOW = 5.0
"""Motor radians per metre below which a slider's ratio is unlikely: belts have 20 and more, screws
hundreds."""

_SMOOTH = 0.1
"""Greatest usual `rest_speed`, the speed within which dry friction changes its sign smoothly, as a
share of the drive's greatest speed."""

_PEAK = 20.0
"""Greatest ratio of a drive's peak to its rated force, or the inverse: servo drives have 2 to 5."""


def drive_warnings(leg: LegKind) -> Iterator[str]:
    """Yield warnings about a leg's drive by itself, one line each."""
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
