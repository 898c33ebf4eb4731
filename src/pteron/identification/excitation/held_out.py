"""Pick-and-place cycles within the same limits, held out to validate an identified model."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pteron.errors import ModelError
from pteron.identification.excitation.limits import Limits
from pteron.identification.excitation.margins import Margins, margins
from pteron.identification.excitation.random_motions import is_clear, sizes
from pteron.identification.signals.states import FullMotion, home
from pteron.json_values import json_fields
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.motion import pick_and_place
from pteron.motion.trajectories.cycle import Cycle, moves
from pteron.result import Result

_LEAST_CYCLES = 4
"""Least number of cycles."""

_LEAST_DURATION = 10.0
"""Least time that the cycles take together, s."""

_DIRECTIONS = 12
"""Horizontal directions of a cycle that are tried, all round."""

_TILT = 0.5
"""Turn of a platform that tilts, on its way across, rad."""

_SAMPLES = 4000
"""Samples of a cycle at which limits are checked."""

_CLEAR = 1e-4
"""Safety margin of a limit at those samples, over its size."""

_SMALLER, _SLOWER = 0.9, 1.05
"""Factors on size and duration of a cycle, until it keeps the limits."""

_SMALLEST = 5e-3
"""Least scale of a cycle; where not even that keeps the limits there is none."""

_AT_REST = 1e4
"""Duration of a cycle in which nothing but gravity is felt, s."""


@dataclass(frozen=True, eq=False, repr=False)
class RepeatedCycle(Result):
    """Pick-and-place cycles one after the other; each begins and ends at rest in the same pose.

    Attributes
    ----------
    robot : Manipulator
        The machine.
    cycle : Cycle
        Its path, over one unit of time.
    length : float
        How long a cycle takes, s.
    count : int
        How many there are.
    """

    robot: Manipulator
    cycle: Cycle
    length: float
    count: int = 1

    @property
    def duration(self) -> float:
        """Duration of all cycles, s."""
        return self.count * self.length

    def states(self, times: Array) -> FullMotion:
        """Return the motion of platform and joints at times (T,), s."""
        pose, first, second = self.cycle.at(np.remainder(times / self.length, 1.0))
        rates = first / self.length, second / self.length**2
        return FullMotion.from_platform(self.robot, pose, *rates)

    def margins(self, limits: Limits, rate: float = 1000.0) -> Margins:
        """Return one cycle's margins to limits, evaluated at ten times `rate` samples a second."""
        once = replace(self, count=1)
        return margins(once, limits, max(round(10.0 * rate * self.length), _SAMPLES))

    def as_dict(self) -> dict[str, Any]:
        """Return everything but the machine as plain data."""
        cycle = self.cycle
        cycle_data = json_fields(
            scale=cycle.scale, around=cycle.around, across=cycle.across, up=cycle.up
        ) | {"turn": cycle.scale * cycle.turn}
        return json_fields(count=self.count, length=self.length) | cycle_data


def held_out_cycle(
    robot: Manipulator, limits: Limits | None = None, rate: float = 1000.0
) -> RepeatedCycle:
    """Return pick-and-place cycles about the home pose that keep the limits of an excitation.

    The standard cycle (`pteron.motion.pick_and_place`), across in the direction that moves every
    joint most, or one that turns about all its axes where the platform tilts, is made smaller until
    its places keep their limits and the machine can stop anywhere, then slower until it keeps those
    of speed, acceleration and force.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    limits : Limits, optional
        What it keeps at every instant; by default `Limits.of` the machine.
    rate : float
        Samples a second: a cycle takes a whole number of them.

    Raises
    ------
    ModelError
        If no cycle fits.

    Examples
    --------
    >>> import pteron
    >>> from pteron.identification.excitation import Limits, held_out_cycle, margins
    >>> cycles = held_out_cycle(pteron.load("delta"), Limits(speed=2.0))
    >>> cycles.count >= 4, margins(cycles, Limits(speed=2.0)).kept
    (True, True)
    """
    limits = limits or Limits.of(robot)
    repeated = _largest_standard_cycle(robot, min(limits.type_i, limits.type_ii))
    cycle = repeated.cycle
    while not is_clear(replace(repeated, length=_AT_REST), limits, _SAMPLES, _CLEAR):
        cycle = replace(cycle, scale=_SMALLER * cycle.scale)
        if cycle.scale < _SMALLEST:
            raise ModelError(
                f"no pick-and-place cycle of {robot.name} about its home pose keeps the limits; "
                "loosen those that it barely keeps at rest",
                subject=robot.name,
            )
        repeated = replace(repeated, cycle=cycle)
    while not is_clear(repeated, limits, _SAMPLES, _CLEAR):
        repeated = replace(repeated, length=_SLOWER * repeated.length)
    length = math.ceil(rate * repeated.length) / rate
    count = max(_LEAST_CYCLES, math.ceil(_LEAST_DURATION / length))
    return replace(repeated, length=length, count=count)


def _largest_standard_cycle(robot: Manipulator, least: float) -> RepeatedCycle:
    """Return the largest standard cycle that fits, in the direction that moves every joint most.

    A joint that rests says nothing of its forces.
    """
    middle = np.array(home(robot))
    cycles: list[tuple[float, RepeatedCycle]] = []
    if robot.platform.tilts:
        direction, up = moves(robot, None, 1)[0]
        return RepeatedCycle(robot, Cycle(robot.platform, middle, direction, up, _TILT, 1.0), 1.0)
    for direction, up in moves(robot, None, _DIRECTIONS):
        try:
            fits = pick_and_place(robot, middle, direction=direction, least=least)
        except ModelError:
            continue
        cycle = Cycle(robot.platform, middle, direction, up, fits.turn / fits.scale, fits.scale)
        once = RepeatedCycle(robot, cycle, fits.duration)
        joints = once.states(np.linspace(0.0, once.length, _SAMPLES)).joints
        cycles.append((float((np.ptp(joints, axis=0) / sizes(robot, "joints")).min()), once))
    if not cycles:
        pick_and_place(robot, middle, least=least)  # says why there is none
    return max(cycles, key=lambda pair: pair[0])[1]
