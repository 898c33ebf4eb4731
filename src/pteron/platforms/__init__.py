"""Kinds of platforms, one file each; `platforms.motion` is the page to read before another."""

from pteron.platforms.motion import PlatformEquations
from pteron.platforms.platform import Bar, Geared, Platform
from pteron.platforms.translating import PlanarTranslating, Translating
from pteron.platforms.turning import PlanarTurning, Turning

EQUATIONS: dict[str, type[PlatformEquations]] = {
    "3T": Translating,
    "3T1R": Turning,
    "2T": PlanarTranslating,
    "2T1R": PlanarTurning,
}
"""The kinds of platforms by their key `motion`."""

__all__ = ["EQUATIONS", "Bar", "Geared", "Platform", "PlatformEquations"]
