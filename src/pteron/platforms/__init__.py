"""Kinds of platforms, one file each; `platforms.motion` is the page to read before another."""

from pteron.platforms.motion import PlatformEquations
from pteron.platforms.platform import Platform
from pteron.platforms.translating import Translating
from pteron.platforms.turning import Turning

EQUATIONS: dict[str, type[PlatformEquations]] = {"3T": Translating, "3T1R": Turning}
"""The kinds of platforms by their key `motion`."""

__all__ = ["EQUATIONS", "Platform", "PlatformEquations"]
