"""The kinds of platforms by the motion that files name: those of this folder and of packages.

A package names its kinds as entry points of the group `pteron.platforms`; its module is imported
when a file asks for the motion, not before.
"""

from __future__ import annotations

from typing import Literal

from pteron.errors import ModelError
from pteron.extensions import extension_names, extension_value, load_extension
from pteron.platforms.motion import PlatformEquations
from pteron.platforms.sliding import Sliding
from pteron.platforms.tilting import (
    CentredRollPitchYaw,
    CentredXYZ,
    FiveFreedoms,
    RollPitchYaw,
    TurnsXYZ,
    Universal,
)
from pteron.platforms.translating import PlanarTranslating, Translating
from pteron.platforms.tripod import Tripod
from pteron.platforms.turning import PlanarTurning, Turning

GROUP = "pteron.platforms"

AngleOrder = Literal["rpy", "xyz"]
"""rpy: R = Rz(yaw) Ry(pitch) Rx(roll). xyz: R = Rx(rx) Ry(ry) Rz(rz)."""

KINDS: dict[str, type[PlatformEquations]] = {
    kind.motion_name: kind
    for kind in (
        Translating,
        Turning,
        PlanarTranslating,
        PlanarTurning,
        RollPitchYaw,
        FiveFreedoms,
        CentredRollPitchYaw,
        Universal,
        Tripod,
    )
}
"""The kinds of platforms that are loaded, by their motion; add another here."""

XYZ: dict[str, type[PlatformEquations]] = {
    kind.motion_name: kind for kind in (TurnsXYZ, CentredXYZ)
}
"""Those with the angle order "xyz"."""


def motion_names() -> tuple[str, ...]:
    """Return the names of all platform motions, built-in and of installed packages."""
    return (*KINDS, *(name for name in extension_names(GROUP) if name not in KINDS))


def kind_of_motion(motion: object) -> type[PlatformEquations] | None:
    """Return the platform class of a motion such as "3T1R"; None if it is unknown.

    Raises
    ------
    ModelError
        If the package that has it cannot be imported, or holds no kind with that motion.
    """
    if not isinstance(motion, str):
        return None
    if motion not in KINDS and (kind := load_extension(GROUP, motion)) is not None:
        if not (
            isinstance(kind, type)
            and issubclass(kind, PlatformEquations)
            and getattr(kind, "motion_name", None) == motion
        ):
            value = extension_value(GROUP, motion)
            raise ModelError(f"{value} is no kind of platform with motion_name {motion!r}")
        KINDS[motion] = kind
    return KINDS.get(motion)


def equations_class(motion: str, angle_order: str, slides: bool) -> type[PlatformEquations]:
    """Return the class of platform equations for a motion, an angle order and sliding halves."""
    if slides:
        return Sliding
    return XYZ[motion] if angle_order == "xyz" and motion in XYZ else KINDS[motion]
