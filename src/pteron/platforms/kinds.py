"""The classes of the platforms' equations; `equations_class` picks a platform's."""

from __future__ import annotations

from typing import Protocol

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
_XYZ: dict[str, type[PlatformEquations]] = {"3T3R": TurnsXYZ, "3R": CentredXYZ}


class Described(Protocol):
    """The properties of a platform that tell its kind of equations."""

    @property
    def motion(self) -> str:
        """Its freedom."""

    @property
    def angle_order(self) -> str:
        """The angles that it has, if it tilts."""

    @property
    def slides(self) -> bool:
        """Whether its halves slide."""


def equations_class(platform: Described) -> type[PlatformEquations]:
    """Return the kind of equations of a platform."""
    if platform.slides:
        return Sliding
    return (_XYZ if platform.angle_order == "xyz" else _EQUATIONS)[platform.motion]
