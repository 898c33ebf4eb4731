"""`DriveMargin`: a limit of a drive in the machine's file over the load of a cycle."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from pteron.kernels import Array
from pteron.legs import Drive
from pteron.legs.motor_limits import motor_peak
from pteron.legs.screw import CRITICAL_SHARE
from pteron.manipulator import Manipulator
from pteron.renamed import former_attribute
from pteron.result import Result
from pteron.shapes import PerJoint


@dataclass(frozen=True, eq=False, repr=False)
class DriveMargin(Result):
    """A limit of a drive in the machine's file over the cycle's load, at the joint."""

    leg: int
    limit: str
    """The keys of the file: "rated_torque and ratio", "max_force", "max_speed", or those of "curve"
    and "winding" that there are; or the screw's critical speed in words."""
    quantity: str
    """The quantity that it bounds: "rms_force", "peak_force", "peak_speed" or, at the moment where
    the most of what the motor gives at its speed is taken, "force_at_speed"."""
    most: float
    needed: float
    unit: str

    told = former_attribute("told", "overload_text")

    @property
    def margin(self) -> float:
        """The drive's limit divided by its load: 1 or more suffices."""
        return self.most / self.needed if self.needed > 0.0 else math.inf

    def overload_text(self, where: str) -> str:
        """Return a line of text: the leg, the load that exceeds a limit, `where`, and the limit."""
        needed = f"{self.needed:.4g} {self.unit}"
        if self.quantity == "rms_force":
            return (
                f"leg {self.leg}: the cycle needs {needed} RMS{where}, but the motor gives "
                f"{self.most:.4g} {self.unit} continuously ({self.limit})"
            )
        if self.quantity == "force_at_speed":
            return (
                f"leg {self.leg}: the motion takes {needed}{where} at a speed at which its drive "
                f"gives {self.most:.4g} {self.unit} ({self.limit})"
            )
        return (
            f"leg {self.leg}: the motion takes up to {needed}{where}, but its drive gives "
            f"{self.most:g} {self.unit} ({self.limit})"
        )


_WHIRL = f"{CRITICAL_SHARE:.0%} of the screw's critical speed"


def _screw_speed(drive: Drive) -> float | None:
    """Return the speed, m/s, up to which a drive's screw does not whirl; None if it is unknown."""
    if drive.screw is None or drive.screw.critical_speed == math.inf:
        return None
    return CRITICAL_SHARE * drive.screw.critical_speed


def drive_margins(
    robot: Manipulator, needed: Mapping[str, PerJoint], forces: Array, speeds: Array
) -> tuple[DriveMargin, ...]:
    """Return the margins (limit over load) of all drive limits in the machine's file.

    `needed` has the loads of a cycle at each joint (n,), by quantity; quantities may be missing.
    `forces` and `speeds` (..., n) are those at the samples of the cycle.
    """
    margins = []
    for i, leg in enumerate(robot.legs):
        drive, force = leg.drive or Drive(), leg.joint.force_unit
        limits = (
            ("rated_torque and ratio", "rms_force", drive.rated_force, force),
            ("max_force", "peak_force", drive.max_force, force),
            ("max_speed", "peak_speed", drive.max_speed, f"{leg.joint.unit}/s"),
            (_WHIRL, "peak_speed", _screw_speed(drive), f"{leg.joint.unit}/s"),
        )
        margins += [
            DriveMargin(i + 1, key, quantity, most, float(needed[quantity][i]), unit)
            for key, quantity, most, unit in limits
            if most is not None and quantity in needed
        ]
        by_speed = [key for key in ("curve", "winding") if getattr(drive, key)]
        if by_speed and forces.size:
            peak = motor_peak(drive, forces[..., i], speeds[..., i])
            speed_fields = " and ".join(by_speed), "force_at_speed", peak.most, peak.force, force
            margins.append(DriveMargin(i + 1, *speed_fields))
    return tuple(margins)
