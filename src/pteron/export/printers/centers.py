"""The spheres on which a Delta's platform moves while one joint is held, as firmware has them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from pteron.equations.machine import Machine
from pteron.export.printers.sections import unfit_error
from pteron.kernels import Array
from pteron.legs.leg import SphereLocus
from pteron.manipulator import Manipulator

SAME = 1e-6
"""Deviation, m or of a unit vector, up to which a machine is as regular as Klipper assumes."""


@dataclass(frozen=True)
class Center:
    """The centre of the sphere on which P, the platform's point, moves at a fixed joint q.

    It is origin + q along, or origin + along cos(q) + across sin(q).
    """

    leg: int
    origin: Array
    along: Array
    across: Array | None
    radius: float

    @property
    def is_prismatic(self) -> bool:
        """Whether it moves along a line."""
        return self.across is None

    @classmethod
    def from_leg(cls, machine: Machine, leg: int) -> Center | None:
        """Return the centre for a leg; None if P moves on no sphere at a fixed joint."""
        q = ca.SX.sym("q")
        locus, offset = machine.legs[leg].locus(q), machine.platform.offsets[leg]
        if not isinstance(locus, SphereLocus):
            return None
        function = ca.Function(
            "center", [q], [locus.center - offset.a - offset.constant, locus.radius]
        )

        def center(coordinate: float) -> Array:
            """Return the centre (3,), m, at a joint coordinate, m or rad."""
            return np.array(function(coordinate)[0]).ravel()

        radius = float(function(0.0)[1])
        start, step = center(0.0), center(1.0) - center(0.0)
        if np.allclose(center(2.0), start + 2.0 * step, rtol=0.0, atol=1e-12):
            return cls(leg, start, step, None, radius)
        half, quarter = center(math.pi), center(0.5 * math.pi)
        origin = 0.5 * (start + half)
        cosine_arm, sine_arm = start - origin, quarter - origin
        if np.allclose(
            center(1.0), origin + math.cos(1.0) * cosine_arm + math.sin(1.0) * sine_arm, 0.0, 1e-12
        ):
            return cls(leg, origin, cosine_arm, sine_arm, radius)
        return None


def common_value(robot: Manipulator, numbers: Sequence[float], reason: str, taker: str) -> float:
    """Return the common value of all legs, m; `reason` and `taker` are for the error's message.

    Raises
    ------
    ModelError
        If they do not, by more than a micrometre.
    """
    for i, number in enumerate(numbers[1:], start=2):
        if abs(number - numbers[0]) > SAME:
            first_value, second_value = (round(1000.0 * v, 6) + 0.0 for v in (number, numbers[0]))
            text = f"{reason.format(first_value)}, leg 1 {second_value:.6g} mm"
            raise unfit_error(robot, i, text, taker)
    return float(np.mean(numbers))


def bearing(point: Array) -> float:
    """Return the bearing of a point as seen from the z axis, degrees from x, 0 to 360."""
    angle = math.degrees(math.atan2(point[1], point[0])) % 360.0
    return 0.0 if 360.0 - angle < 1e-9 else angle


def end_stop(end: str | None, what: str) -> tuple[str, ...]:
    """Return the comment on an end stop's position, if it is given."""
    if end is None:
        return ()
    return (f"position_endstop: the {what} at its upper limit; measure it on the machine.",)
