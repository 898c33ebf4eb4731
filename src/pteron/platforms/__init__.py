"""Kinds of platforms, one file each; `platforms.motion` is the page to read before another."""

from pteron.platforms.motion import PlatformEquations
from pteron.platforms.platform import Bar, Geared, Platform
from pteron.platforms.sliding import Sliding
from pteron.platforms.translating import PlanarTranslating, Translating
from pteron.platforms.turning import PlanarTurning, Turning

_EQUATIONS: dict[str, type[PlatformEquations]] = {
    "3T": Translating,
    "3T1R": Turning,
    "2T": PlanarTranslating,
    "2T1R": PlanarTurning,
}


def equations_class(platform: Platform) -> type[PlatformEquations]:
    """Return the kind of equations of a platform."""
    return Sliding if platform.slides else _EQUATIONS[platform.motion]


__all__ = ["Bar", "Geared", "Platform", "PlatformEquations", "equations_class"]


def __dir__() -> list[str]:
    return sorted(__all__)
