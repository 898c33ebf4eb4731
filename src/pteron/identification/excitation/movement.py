"""The protocol of a movement: an object that gives the motion of platform and joints at times."""

from __future__ import annotations

from typing import Protocol

from pteron.identification.signals.states import FullMotion
from pteron.kernels import Array
from pteron.manipulator import Manipulator


class Movement(Protocol):
    """A motion of a machine that lasts `duration`, s, or repeats after it."""

    @property
    def robot(self) -> Manipulator:
        """The machine."""

    @property
    def duration(self) -> float:
        """Duration, s."""

    def states(self, times: Array, /) -> FullMotion:
        """Return the motion of platform and joints at times (T,), s."""
