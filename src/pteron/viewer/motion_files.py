"""The motion in a file opened in the viewer: poses or joints over time, a simulation, or a log."""

from __future__ import annotations

from pathlib import PurePath

from pteron.errors import DataError, shorten
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.motion import Motion
from pteron.playback import playback, read_content
from pteron.tables import ENDINGS

_LARGEST = 100 << 20
"""Greatest size of a file, bytes; the motion of a larger one takes minutes to compute."""


def motion_of_file(robot: Manipulator, name: str, content: bytes, start: Array) -> Motion:
    """Return the motion that a file holds.

    The ending of its name says whether it is CSV or Parquet; `start` is a pose of the assembly mode
    that is meant where the file gives joints alone.
    """
    source = shorten(PurePath(name).name, bare=True) or "the file"
    ending = PurePath(name).suffix.lower()
    if ending not in ENDINGS:
        raise DataError(f"{source}: a motion's file ends in {' or '.join(ENDINGS)}")
    if len(content) > _LARGEST:
        size, most = len(content) >> 20, _LARGEST >> 20
        raise DataError(f"{source}: {size} MB given, {most} MB or less expected; cut a part out")
    if not content:
        raise DataError(f"{source}: is empty")
    return playback(robot, read_content(robot, content, source), start).motion
