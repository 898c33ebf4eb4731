"""The motions of platforms and the classes of their equations: `equations_class` picks one."""

from __future__ import annotations

from functools import cache
from typing import Literal

from pteron.platforms.motion import PlatformEquations
from pteron.platforms.sliding import Sliding
from pteron.platforms.tilting import (
    CentredRollPitchYaw,
    CentredXYZ,
    RollPitchYaw,
    TurnsXYZ,
    Universal,
)
from pteron.platforms.translating import PlanarTranslating, Translating
from pteron.platforms.tripod import Tripod
from pteron.platforms.turning import PlanarTurning, Turning

Motion = Literal["3T", "3T1R", "2T", "2T1R", "3T3R", "3R", "2R", "1T2R"]
"""3T: the platform only translates. 3T1R: it also turns about its axis (Schoenflies motion). 2T and
2T1R: the same in the plane across its axis. Platforms that tilt: 3T3R moves freely, 3R and 2R turn
about a centre, on a ball joint or a universal joint, 1T2R is a tripod's."""

AngleOrder = Literal["rpy", "xyz"]
"""rpy: R = Rz(yaw) Ry(pitch) Rx(roll). xyz: R = Rx(rx) Ry(ry) Rz(rz)."""

_EQUATIONS: dict[str, type[PlatformEquations]] = {
    "3T": Translating,
    "3T1R": Turning,
    "2T": PlanarTranslating,
    "2T1R": PlanarTurning,
    "3T3R": RollPitchYaw,
    "3R": CentredRollPitchYaw,
    "2R": Universal,
    "1T2R": Tripod,
}
XYZ: dict[str, type[PlatformEquations]] = {"3T3R": TurnsXYZ, "3R": CentredXYZ}
"""The classes for the angle order "xyz"."""

TILTING = tuple(motion for motion, kind in _EQUATIONS.items() if kind.tilts)
"""The motions of platforms that turn about more axes than one."""


@cache
def equations_class(motion: str, angle_order: str, slides: bool) -> type[PlatformEquations]:
    """Return the class of equations for a motion, an order of angles, and sliding halves or not."""
    if slides:
        return Sliding
    turns = XYZ if angle_order == "xyz" else _EQUATIONS
    return turns.get(motion) or _EQUATIONS[motion]
