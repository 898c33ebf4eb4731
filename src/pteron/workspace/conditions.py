"""Conditions on a pose, each a compiled function with a floor that it must keep, and their tests.

They are tested at poses, by ordinary evaluation, or in boxes of poses, by intervals. Pavings,
proofs, largest shapes and designs all use the same list. Anything else that a region must keep,
such as a distance between links, is one more condition: the name of a function.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from pteron.arguments import expect
from pteron.equations.edges import edges
from pteron.equations.machine import Machine
from pteron.errors import DataError
from pteron.kernels import Array, bounded_function, layout_of, numeric
from pteron.manipulator import Manipulator, RobotLike, as_manipulator


@dataclass(frozen=True)
class Condition:
    """A condition: an element of a compiled function's output is not below a floor.

    Parameters
    ----------
    leg : int
        The leg that it is about, from 1; 0 where it is about none.
    cause : str
        The cause of the end there: "stretched", "slider at its least", "singular (type II)".
    what : str
        The function of the pose; see `pteron.kernels.FUNCTIONS`.
    output : str
        Name of one of its outputs.
    element : int
        Index of one of that output's elements.
    floor : float
        The least value that keeps it.
    sized : bool
        Whether its absolute value counts.
    """

    leg: int
    cause: str
    what: str
    output: str
    element: int = 0
    floor: float = 0.0
    sized: bool = False

    def __str__(self) -> str:
        return f"leg {self.leg}: {self.cause}" if self.leg else self.cause


_MOST = 64
"""Most conditions in a list: one bit each."""

_CAUSES = {
    "reach": "at the edge of its reach",
    "least": "{} at its least",
    "most": "{} at its most",
    "limits": "{} at a limit",
}


def edge_causes(edges: Sequence[str]) -> tuple[str, ...]:
    """Return the causes of the conditions that are these edges of a leg's reach."""
    return tuple(_CAUSES.get(edge, edge) for edge in edges)


def conditions(
    robot: RobotLike, *, type_i: float = 0.0, type_ii: float = 0.0
) -> tuple[Condition, ...]:
    """Return the conditions on a pose: each leg's reach, all joints' limits, two optional floors.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine, in its working mode.
    type_i : float
        Least type-I measure of every leg; 0: it need only reach.
    type_ii : float
        Least size of the type-II measure of the machine, and of its constraint measure where its
        legs' couples turn with the pose; 0: they do not matter.

    Returns
    -------
    tuple of Condition
        The edges of reach first.

    Raises
    ------
    DataError
        If a floor is negative or not finite.

    Examples
    --------
    >>> from pteron.workspace import conditions
    >>> [str(condition) for condition in conditions("tripteron-router")][::4]
    ['leg 1: stretched', 'leg 3: stretched', 'leg 2: slider at its least']
    """
    robot = as_manipulator(robot)
    for name, floor in (("type_i", type_i), ("type_ii", type_ii)):
        expect(0.0 <= floor < math.inf, name, repr(floor), "a floor of 0 or more")
    required = [*_edges(layout_of(robot))]
    if type_i > 0.0:
        required += [
            Condition(i + 1, "near type I", "squared_type_i", "squares", i, type_i**2)
            for i in range(len(robot.legs))
        ]
    if type_ii > 0.0:
        if any(leg.couples_vary for leg in robot.legs):
            cause = "near a constraint singularity"
            required.append(Condition(0, cause, "constraint", "constraint", 0, type_ii, sized=True))
        required.append(Condition(0, "near type II", "type_ii", "type_ii", 0, type_ii, sized=True))
    return tuple(required)


@lru_cache(maxsize=64)
def _edges(layout: Manipulator) -> tuple[Condition, ...]:
    """Return the conditions of reach and limits, cached for machines of a topology."""
    pose = ca.SX.sym("pose", layout.freedom)
    return tuple(
        Condition(e.leg, _CAUSES.get(e.cause, e.cause).format(e.noun), "room", "room", k)
        for k, e in enumerate(edges(Machine.numeric(layout), pose))
    )


def condition_margins(robot: Manipulator, required: Sequence[Condition], poses: Array) -> Array:
    """Return the margins (..., C) by which poses keep conditions; NaN where undefined."""
    margins = []
    results = {
        what: dict(zip((port.name for port in kernel.outputs), kernel(poses), strict=True))
        for what in dict.fromkeys(condition.what for condition in required)
        for kernel in [numeric(robot, what)]
    }
    for condition in required:
        measure = results[condition.what][condition.output]
        batch_axes = poses.ndim - 1
        if measure.ndim > batch_axes:
            size = math.prod(measure.shape[batch_axes:])
            measure = measure.reshape(*measure.shape[:batch_axes], size)[..., condition.element]
        # An infinite value is as little known as NaN.
        measure = np.where(np.isfinite(measure), measure, np.nan)
        margins.append((np.abs(measure) if condition.sized else measure) - condition.floor)
    return np.stack(margins, axis=-1)


def keeps(robot: Manipulator, required: Sequence[Condition], poses: Array) -> NDArray[np.bool_]:
    """Return which poses (...) keep all conditions, by floating-point evaluation."""
    return np.asarray((condition_margins(robot, required, poses) >= 0.0).all(axis=-1))


class IntervalTest:
    """Interval tests of boxes of poses, condition by condition.

    They are 64 at most.
    """

    def __init__(self, robot: Manipulator, required: Sequence[Condition]) -> None:
        self.conditions = tuple(required)
        if not 0 < len(self.conditions) <= _MOST:
            raise DataError(f"given: {len(self.conditions)} conditions, 1 to {_MOST} expected")
        self.all = np.uint64((1 << len(self.conditions)) - 1)
        self._rows = []
        for condition in self.conditions:
            function = bounded_function(robot, condition.what)
            self._rows.append((function, function.rows(condition.output)[condition.element]))

    def __call__(
        self, low: Array, high: Array, open_: NDArray[np.uint64]
    ) -> tuple[NDArray[np.bool_], NDArray[np.uint64]]:
        """Return which boxes lie outside, and which conditions are still open, as bits.

        Boxes have corners (B, m); bit c of `open_` (B,) says that condition c is not proved in all
        of a box, which lies inside where no bit is set. A condition that is proved is not asked,
        and none is any more of a box that lies outside.
        """
        outside, open_ = np.zeros(len(low), bool), open_.copy()
        for c, condition in enumerate(self.conditions):
            bit = np.uint64(1 << c)
            chosen = np.flatnonzero((open_ & bit != 0) & ~outside)
            if not len(chosen):
                continue
            least, most, defined = self.bounds(c, low[chosen], high[chosen])
            # Undefined everywhere is NaN, which is not above the floor.
            outside[chosen] = ~(most >= condition.floor)
            open_[chosen[(least >= condition.floor) & (least < np.inf) & defined]] &= ~bit
        return outside, open_

    def undecided_conditions(self, low: Array, high: Array) -> NDArray[np.bool_]:
        """Return which conditions (B, C) may fail in each box with corners (B, m).

        A condition that is undefined in a box, such as a limit out of reach, counts as kept: it is
        the reach that fails there.
        """
        may_fail = np.empty((len(low), len(self.conditions)), bool)
        for c, condition in enumerate(self.conditions):
            may_fail[:, c] = ~(self.bounds(c, low, high)[0] >= condition.floor)
        return may_fail

    def bounds(self, c: int, low: Array, high: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Return the least and greatest measure (B,) of condition c, and where it is defined."""
        function, row = self._rows[c]
        enclosures = function(low, high, [row])
        least, most, defined = enclosures[0][:, 0], enclosures[1][:, 0], enclosures[2][:, 0]
        if self.conditions[c].sized:
            size = np.maximum(np.maximum(least, np.negative(most)), 0.0)
            least, most = size, np.maximum(np.negative(least), most)
        return least, most, defined


@lru_cache(maxsize=64)
def interval_test(robot: Manipulator, required: tuple[Condition, ...]) -> IntervalTest:
    """Return the interval test of a machine's poses by these conditions."""
    return IntervalTest(robot, required)
