"""U-P-U legs, of the 3-UPU: a ram between universal joints whose axes are parallel.

The leg withholds the turn about m = n - (n.u) u, n along the ram and u along the outer axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.bodies.vectors import Vector
from pteron.legs.keys import ACCOUNTS, keys_of
from pteron.legs.leg import LegMotion
from pteron.legs.ups import UniversalRamLeg, UPSEquations


@dataclass(frozen=True)
class UPU(UniversalRamLeg):
    """A U-P-U leg that carries one point of a platform that translates.

    Its joint coordinate is the length of the ram, from `guide_point` to the platform point.
    """

    type = "UPU"
    couples_vary = True
    account = ACCOUNTS["UPU"]

    keys: ClassVar = keys_of("ram", "universal_ram", "UPU")

    def free_axes(self, axis: Vector | None) -> tuple[Vector, ...]:
        """Return the axes that it leaves free at every pose: the outer ones, and `axis`."""
        assert self.direction is not None  # the file gives it
        return (self.direction,) if axis is None else (self.direction, axis)

    def couples(self, motion: LegMotion, axis: Vector | None) -> Sequence[Expression]:
        """Return, in a list, the couple along m, of length 1; none where the platform turns."""
        if axis is not None:
            return []
        u, ram = ca.SX(list(self.direction or ())), motion.links[1]
        normal_part = ram - ca.dot(u, ram) * u
        return [normal_part / ca.norm_2(normal_part)]


class UPUEquations(UPSEquations):
    """The equations of a U-P-U leg, those of a U-P-S leg under a platform that translates."""


UPU.equations_class = UPUEquations
