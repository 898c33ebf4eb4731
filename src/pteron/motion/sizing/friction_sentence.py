"""The sentence on the friction that forces of drives include: that of the machine's file."""

from __future__ import annotations

from pteron.legs import Drive
from pteron.manipulator import Manipulator


def has_friction(drive: Drive) -> bool:
    """Return whether a drive of the file has friction or the losses of a screw."""
    lossy = drive.screw is not None and drive.screw.efficiency < 1.0
    return bool(drive.coulomb or drive.viscous or drive.stribeck or lossy)


def friction_sentence(robot: Manipulator) -> str:
    """Return which friction the drives' forces of a machine include, for all commands alike."""
    lacking = [
        str(i)
        for i, leg in enumerate(robot.legs, start=1)
        if not has_friction(leg.drive or Drive())
    ]
    if not lacking:
        return "Friction and losses of screws are those of the file."
    legs = "" if len(lacking) == len(robot.legs) else f" for leg {', '.join(lacking)}"
    return (
        f"No friction is included{legs}: the file has none. Gears and screws with an efficiency of "
        "0.9 take 11 % more; pteron size --friction 0.1 counts it."
    )
