"""Kinds of platforms, entered in `kinds.py`; read `platforms.motion` before writing another."""

from pteron.platforms.kinds import equations_class
from pteron.platforms.motion import PlatformEquations
from pteron.platforms.parts import Bar, Geared
from pteron.platforms.platform import Platform

__all__ = ["Bar", "Geared", "Platform", "PlatformEquations", "equations_class"]


def __dir__() -> list[str]:
    return sorted(__all__)
