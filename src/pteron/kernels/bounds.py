"""Proved bounds on a machine's functions in boxes of poses, by the narrower of two interval forms.

The natural form (see `kernels.intervals`) is too wide by about the box's width. The mean-value form
f(m) + f'(X) (X - m), m being the middle of the box X, is too wide by about its square: every x in X
has f(x) - f(m) = f'(y) (x - m) for some y between m and x. It is taken where f is proved to be
defined and continuous in all of the box, and f' defined; where f has a kink, the interval of f'
holds the slopes of both sides.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pteron.errors import DataError, ModelError
from pteron.kernels.graph import Graph, graph_of
from pteron.kernels.interval_arithmetic import Interval, add, multiply, subtract
from pteron.kernels.intervals import Enclosure, enclose_nodes, occurs_once
from pteron.kernels.kernel import Array, Port, as_array
from pteron.kernels.programs import numeric_program
from pteron.kernels.targets import FIXED
from pteron.manipulator import Manipulator, RobotLike, as_manipulator

UNBOUNDED = (
    *("condition", "condition_points", "kappa", "speed_least", "speed_most", "turning_speed"),
    *("force_least", "force_most", "turning_moment"),
)
"""Functions of singular values, of which bounds are defined at single poses alone."""


@dataclass(frozen=True)
class Bounded:
    """A function of poses with its gradient, called for bounds on its outputs in boxes.

    Parameters
    ----------
    function : casadi.Function
        SX, of one input (m,).
    outputs : tuple of Port
        Names and shapes of its outputs.
    """

    function: ca.Function
    outputs: tuple[Port, ...]

    @cached_property
    def _graph(self) -> Graph:
        """The graph of the outputs and of the gradients of all their elements, (m, R)."""
        (pose,) = self.function.sx_in()
        outputs = [ca.densify(expression_) for expression_ in self.function.call([pose])]
        elements = ca.vertcat(*map(ca.vec, outputs))
        slopes = ca.densify(ca.jacobian(elements, pose).T)
        return graph_of(ca.Function("bounded", [pose], ca.cse([*outputs, slopes])))

    def rows(self, name: str) -> range:
        """Return the indices of the output `name`'s elements among the elements of all outputs."""
        start = 0
        for port in self.outputs:
            if port.name == name:
                return range(start, start + port.size)
            start += port.size
        raise KeyError(name)

    def __call__(
        self, low: Array, high: Array, rows: Sequence[int]
    ) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Return bounds low, high and whether defined (B, R) of output elements, in B boxes.

        low and high are NaN for an element that is undefined in all of the box.
        """
        graph, size = self._graph, low.shape[1]
        elements = [k for nodes in graph.outputs[:-1] for k in nodes]
        nodes = [elements[r] for r in rows]
        least, most, defined, continuous = enclose_nodes(graph, nodes, [low], [high], len(low))
        moving = np.flatnonzero((low != high).any(axis=0)).tolist()
        # Rows that are continuous in the same boxes share what they have in common.
        groups: dict[bytes, list[int]] = {}
        for at, r in enumerate(rows):
            if continuous[:, at].any() and not occurs_once(graph, elements[r], moving):
                groups.setdefault(continuous[:, at].tobytes(), []).append(at)
        for group in groups.values():
            boxes = np.flatnonzero(continuous[:, group[0]])
            inner = _mean_values(
                graph,
                [nodes[at] for at in group],
                {i: [graph.outputs[-1][rows[at] * size + i] for at in group] for i in moving},
                low[boxes],
                high[boxes],
            )
            places = np.ix_(boxes, np.array(group))
            least[places] = np.fmax(least[places], inner.low)
            most[places] = np.fmin(most[places], inner.high)
        return least, most, defined

    def slopes(
        self, low: Array, high: Array, rows: Sequence[int], columns: Sequence[int]
    ) -> tuple[Array, Array]:
        """Return bounds (B, R, C) of output elements' slopes; infinite where they are undefined."""
        graph, size = self._graph, low.shape[1]
        nodes = [graph.outputs[-1][r * size + i] for r in rows for i in columns]
        least, most, defined, _ = enclose_nodes(graph, nodes, [low], [high], len(low))
        shape = len(low), len(rows), len(columns)
        known = defined & ~np.isnan(least)
        least, most = np.where(known, least, -np.inf), np.where(known, most, np.inf)
        return least.reshape(shape), most.reshape(shape)


def _mean_values(
    graph: Graph, nodes: Sequence[int], slopes: Mapping[int, Sequence[int]], low: Array, high: Array
) -> Interval:
    """Return mean-value bounds f(m) + f'(X) (X - m) of graph nodes (B, N).

    The bounds are NaN if f' may be undefined in the box.
    """
    count = len(low)
    with np.errstate(all="ignore"):  # of boxes without an end
        middle = 0.5 * low + 0.5 * high
    at, upper, *_ = enclose_nodes(graph, nodes, [middle], [middle], count)
    slope_nodes = [node for nodes_ in slopes.values() for node in nodes_]
    shape = count, len(slopes), len(nodes)
    least, most, known = (
        part.reshape(shape) for part in enclose_nodes(graph, slope_nodes, [low], [high], count)[:3]
    )
    with np.errstate(all="ignore"):
        total = Interval(at, upper)
        for k, i in enumerate(slopes):
            center = Interval(middle[:, i : i + 1], middle[:, i : i + 1])
            way = subtract(Interval(low[:, i : i + 1], high[:, i : i + 1]), center)
            total = add(total, multiply(Interval(least[:, k], most[:, k]), way))
    useful = known.all(axis=1)
    return Interval(*(np.where(useful, bound, np.nan) for bound in total[:2]))


def bounded_function(robot: RobotLike, what: str) -> Bounded:
    """Return the kernel `what` of a machine as a function of the pose, for interval bounds.

    Raises
    ------
    ModelError
        If there is no such function, or it depends on more than the pose.
    """
    robot = as_manipulator(robot)
    return _cached_bounded_function(robot, what)


@lru_cache(maxsize=256)
def _cached_bounded_function(robot: Manipulator, what: str) -> Bounded:
    """Return the kernel `what` as a function of the pose, for interval bounds, cached."""
    built = numeric_program(robot, what, plain=True)
    names = [port.name for port in built.inputs]
    if "pose" not in names or set(names) - {"pose", *FIXED}:
        input_names = ", ".join(names)
        raise ModelError(
            f"what: {what!r} depends on {input_names}; bounds are on functions of the pose"
        )
    pose = ca.SX.sym("pose", robot.freedom)
    arguments = [
        pose if port.name == "pose" else ca.SX(ca.DM(FIXED[port.name](robot)))
        for port in built.inputs
    ]
    outputs = built.function.call(arguments)
    return Bounded(ca.Function(what, [pose], outputs), built.outputs)


def bounds(robot: RobotLike, what: str, boxes: ArrayLike) -> dict[str, Enclosure]:
    """Return proved lower and upper bounds of a function of the pose in boxes of poses.

    All functions of the pose alone have bounds. For functions that use singular values
    (`UNBOUNDED`) they may be infinite and undefined in every box larger than a single pose: the
    Jacobi rotations that compute the singular values are undetermined where two of them may be
    equal.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    what : str
        A function of the pose alone: `"type_ii"`, `"jacobian"`, ...; see
        `pteron.kernels.FUNCTIONS`.
    boxes : array, shape (..., 2, m)
        Least and greatest pose of each box, m and rad.

    Returns
    -------
    dict of str to Enclosure
        By the outputs' names; the bounds have the shape (..., *output).

    Raises
    ------
    ModelError
        If there is no such function, or it depends on more than the pose.
    DataError
        If the boxes are none.

    Examples
    --------
    >>> import numpy as np
    >>> from pteron.kernels import bounds
    >>> box = [[-0.01, -0.01, -0.01, -0.1], [0.01, 0.01, 0.01, 0.1]]
    >>> found = bounds("quadrupteron", "type_ii", box)["type_ii"]
    >>> round(float(found.low), 3), round(float(found.high), 3), bool(found.defined)
    (0.646, 0.65, True)
    """
    function = bounded_function(robot, what)
    corners = as_array(boxes, "boxes", (2, function.function.size1_in(0)))
    if not (corners[..., 0, :] <= corners[..., 1, :]).all():
        raise DataError("boxes: a least value is above the greatest, or NaN")
    lead, flat = corners.shape[:-2], corners.reshape(-1, *corners.shape[-2:])
    enclosures = {}
    for port in function.outputs:
        low, high, defined = function(flat[:, 0], flat[:, 1], function.rows(port.name))
        shape = lead + port.shape
        enclosures[port.name] = Enclosure(
            low.reshape(shape), high.reshape(shape), defined.reshape(shape)
        )
    return enclosures
