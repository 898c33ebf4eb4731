"""The functions of the pose that vanish at singular poses: values, slopes, and bounds in boxes.

The search for the nearest singular pose uses them. These functions hold square roots, whose slope
is infinite at the edge of a leg's reach. Each root is therefore a variable of its own, r^2 = g(x),
r >= 0: as a function of pose and roots it is smooth on the edge too, and beyond it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from pteron.kernels import Array, Port, bounded_function, bounds
from pteron.kernels.bounds import Bounded
from pteron.kernels.graph import INPUT, expression, graph_of
from pteron.manipulator import Manipulator

Kind = Literal["I", "II", "constraint"]
"""Type I: a leg is stretched or folded. Type II: the actuators do not hold the platform.
Constraint: the legs do not hold its orientation."""

_PROGRAM = {"I": "squared_type_i", "II": "type_ii", "constraint": "constraint"}
"""Name of the program that gives the function, by kind."""


@dataclass(frozen=True)
class Vanishing:
    """A function that vanishes at the singular poses of a kind.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    kind : {"I", "II", "constraint"}
        The kind: for type I the function is the square of the leg's type-I measure; else it is the
        machine's type-II or constraint measure.
    leg : int
        The leg of type I, from 1; else 0.
    """

    robot: Manipulator
    kind: Kind
    leg: int = 0

    @property
    def smooth(self) -> Smooth:
        """The function in terms of pose and roots."""
        return _smooth(self.robot, self.kind, self.leg)

    def proves_absence(self, boxes: Array) -> NDArray[np.bool_]:
        """Return which boxes (B, 2, m) are proved, by intervals, to have no zero in reach."""
        squares = bounds(self.robot, "squared_type_i", boxes)["squares"]
        is_absent = np.asarray((squares.high < 0.0).any(axis=-1))
        if self.leg:
            return is_absent | (squares.low[:, self.leg - 1] > 0.0)
        for bounds_in in (self._plain_bounds, self.smooth.bounds):
            undecided = np.flatnonzero(~is_absent)
            if len(undecided):
                low, high = bounds_in(boxes[undecided])
                is_absent[undecided] = (low > 0.0) | (high < 0.0) | np.isnan(low)
        return is_absent

    def _plain_bounds(self, boxes: Array) -> tuple[Array, Array]:
        """Return bounds (B,) of the function of the pose alone: narrower where it has slopes."""
        (measure,) = bounds(self.robot, _PROGRAM[self.kind], boxes).values()
        return measure.low, measure.high


class Smooth(NamedTuple):
    """A function of the pose and of the roots in it."""

    radicands: Bounded
    """The squares of the roots, by pose."""
    dividend: Bounded
    """The dividend, by pose and roots: a quotient vanishes where its dividend does."""
    function: ca.Function
    """The value, the radicands, the squares of all type-I measures, and their slopes by pose and
    roots, of poses (m, K) and roots (R, K)."""

    @property
    def roots(self) -> int:
        """The number of roots."""
        return self.radicands.outputs[0].size

    def bounds(self, boxes: Array) -> tuple[Array, Array]:
        """Return bounds (B,) of the dividend in boxes (B, 2, m); NaN where it has no value."""
        low, high, nowhere = boxes[:, 0], boxes[:, 1], np.zeros(len(boxes), bool)
        if self.roots:
            least, most, _ = self.radicands(low, high, range(self.roots))
            nowhere = np.asarray(~(most >= 0.0).all(axis=-1))
            least, most = (np.sqrt(np.maximum(part, 0.0)) for part in (least, most))
            # A root rounds to the nearest float.
            low = np.hstack([low, np.maximum(np.nextafter(least, -np.inf), 0.0)])
            high = np.hstack([high, np.nextafter(most, np.inf)])
            low[nowhere], high[nowhere] = 0.0, 0.0
        least, most, _ = self.dividend(low, high, [0])
        return np.where(nowhere, np.nan, least[:, 0]), np.where(nowhere, np.nan, most[:, 0])


@lru_cache(maxsize=256)
def _smooth(robot: Manipulator, kind: Kind, leg: int) -> Smooth:
    """Return a measure of singularity as a function of pose and roots, with its Jacobian."""
    graph = graph_of(bounded_function(robot, _PROGRAM[kind]).function)
    pose = ca.SX.sym("pose", robot.freedom)
    radicands, roots = [], []
    expressions: list[ca.SX] = []
    lifted: list[bool] = []
    for node in graph.nodes:
        if node.operation == INPUT:
            expressions.append(pose[node.arguments[1]])
            lifted.append(False)
            continue
        parts = [expressions[k] for k in node.arguments]
        lifted.append(any(lifted[k] for k in node.arguments))
        if node.operation == "sqrt" and not lifted[-1] and not parts[0].is_constant():
            radicands.append(parts[0])
            roots.append(ca.SX.sym("root"))
            expressions.append(roots[-1])
            lifted[-1] = True
        else:
            expressions.append(expression(node, parts))
    top = graph.outputs[0][max(leg - 1, 0)]
    numerator = expressions[top]
    while graph.nodes[top].operation == "div":
        top = graph.nodes[top].arguments[0]
    radicand_column, root_column = ca.vertcat(*radicands), ca.vertcat(*roots)
    variables = ca.vertcat(pose, root_column)
    (squares,) = bounded_function(robot, "squared_type_i").function.call([pose])
    outputs = ca.vertcat(numerator, radicand_column, ca.vec(squares))
    return Smooth(
        Bounded(
            ca.Function("radicands", [pose], [radicand_column]), (Port("radicands", (len(roots),)),)
        ),
        Bounded(ca.Function("dividend", [variables], [expressions[top]]), (Port("dividend", ()),)),
        ca.Function(
            "smooth",
            [pose, root_column],
            ca.cse([outputs, ca.densify(ca.jacobian(outputs, variables))]),
        ),
    )
