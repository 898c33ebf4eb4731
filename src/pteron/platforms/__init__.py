"""Kinds of platforms, entered in `kinds.py`; read `platforms.motion` before writing another."""

from typing import TYPE_CHECKING

from pteron.public import publish as _publish

if TYPE_CHECKING:
    from pteron.platforms.motion import PlatformEquations as PlatformEquations
    from pteron.platforms.parts import Bar as Bar, GearedPart as GearedPart
    from pteron.platforms.platform import Platform as Platform

_publish(__name__)
