"""Kinds of platforms, entered in `kinds.py`; read `platforms.motion` before writing another."""

from pteron.platforms.kinds import equations_class as equations_class
from pteron.platforms.motion import PlatformEquations as PlatformEquations
from pteron.platforms.parts import Bar as Bar, Geared as Geared
from pteron.platforms.platform import Platform as Platform
from pteron.public import publish as _publish

_publish(__name__)
