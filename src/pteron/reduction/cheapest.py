"""`cheapest_parameters`: base parameters with which the inverse dynamics need few operations."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import casadi as ca
import numpy as np

from pteron.bodies.motion import Expression
from pteron.bodies.parameters import JOINED, OWN
from pteron.equations.machine import Machine
from pteron.equations.virtual_work import inverse_dynamics
from pteron.kernels import Array, Port, count_operations, geometry_only, program
from pteron.kernels.graph import graph_of
from pteron.kernels.hoisting import hoist_invariants
from pteron.kernels.program_cache import cached_result
from pteron.manipulator import Manipulator, RobotLike, as_manipulator, parameter_data
from pteron.reduction.find import base_parameters
from pteron.reduction.numerical import independent
from pteron.reduction.result import BaseParameters

_NONZERO = 1e-9
"""Least pivot in an exchange of columns: the grouping's entries are of order one."""


def cheapest_parameters(robot: RobotLike) -> BaseParameters:
    """Return base parameters with which the inverse dynamics need fewest operations.

    Any invertible combination of a base set is a base set. The masses that the lower links' m and
    m gamma_x amount to are left to the joints, and m_u to the slider, where there is a choice;
    among what remains (the lower links' masses or the platform's own parameters, for one) columns
    are exchanged as long as the reduced model gets cheaper: a local search from two starts. Where
    the platform tilts the starts are not improved. The result is never dearer than the choice of
    `base_parameters`.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine; geometry and gravity matter, its inertial parameters do not.

    Returns
    -------
    BaseParameters
        For ``compile(robot, "inverse_dynamics", base=...)``.

    Raises
    ------
    SingularPose
        If the machine is singular at every pose.

    Examples
    --------
    >>> import pteron
    >>> robot = pteron.load("quadrupteron")
    >>> base = pteron.reduction.cheapest_parameters(robot)
    >>> base.rank, pteron.compile(robot, "inverse_dynamics", base=base).operations
    (26, 323)
    """
    return _cheapest_parameters(as_manipulator(robot))


@lru_cache(maxsize=32)
def _cheapest_parameters(robot: Manipulator) -> BaseParameters:
    """Return the base parameters of the cheapest columns, cached in memory and on disk."""
    columns = parameter_data(robot)
    key, packages = ("cheapest", geometry_only(robot)), ("kinematics", "reduction")
    best = cached_result(key, packages, lambda: _cheapest_columns(robot))
    return base_parameters(robot, keep=[columns[k].name for k in best])


def _cheapest_columns(robot: Manipulator) -> tuple[int, ...]:
    """Return the columns of the base whose inverse dynamics need the fewest operations."""
    columns = parameter_data(robot)
    base = base_parameters(robot)
    grouping = _unitless_grouping(robot, base)
    places = [(p.kind, p.body) for p in columns]
    leg_columns = [k for k, place in enumerate(places) if place in OWN]
    shared_columns = [k for k, place in enumerate(places) if place in JOINED]
    others = [k for k in range(len(columns)) if k not in leg_columns and k not in shared_columns]
    model = _Model(robot)
    candidates = {base.kept}
    for order in (others, others[::-1]):
        start = tuple(
            sorted(
                independent(grouping, [*leg_columns, *order, *shared_columns], least=_NONZERO)[0]
            )
        )
        # The columns of a spatial inertia are too many to exchange one by one.
        many = len(robot.platform.inertia_names) > 1
        candidates.add(
            start if many else _improve_by_exchange(model, grouping, start, [*leg_columns, *others])
        )
    return min(candidates, key=lambda columns: (_final_cost(robot, columns), columns))


def _unitless_grouping(robot: Manipulator, base: BaseParameters) -> Array:
    """Return the grouping with lengths in multiples of a link, so that no entry is extreme."""
    length = max(leg.size for leg in robot.legs)
    powers = length ** np.array([float(p.length_power) for p in base.parameters])
    return np.asarray(base.grouping * powers / powers[list(base.kept), None])


def _improve_by_exchange(
    model: _Model, grouping: Array, base_columns: tuple[int, ...], candidates: Sequence[int]
) -> tuple[int, ...]:
    """Exchange columns one by one as long as that saves operations."""
    cost = model.cost(base_columns)
    while True:
        basis = grouping[:, base_columns]
        better = (cost, base_columns)
        for column in candidates:
            if column in base_columns:
                continue
            shares = np.linalg.solve(basis, grouping[:, column])
            for place in np.flatnonzero(np.abs(shares) > _NONZERO):
                other = tuple(sorted({*base_columns, column} - {base_columns[place]}))
                better = min(better, (model.cost(other), other))
        if better[0] >= cost:
            return base_columns
        cost, base_columns = better


class _Model:
    """The reduced model of a machine, with its cost for each choice of base parameters."""

    def __init__(self, robot: Manipulator) -> None:
        self.machine = Machine.numeric(robot)
        names = ("pose", "velocity", "acceleration")
        self.motion = [ca.SX.sym(name, robot.freedom) for name in names]
        self.state = self.machine.state(*self.motion)
        self.known: dict[tuple[int, ...], int] = {}

    def cost(self, base_columns: tuple[int, ...]) -> int:
        """Return the operations of inverse dynamics at a state with these base parameters.

        They are counted before the optimisation pass, which is slow.
        """
        if base_columns not in self.known:
            base = ca.SX.sym("base", len(base_columns))
            base_values = ca.SX(len(self.machine.parameters), 1)
            base_values[list(base_columns)] = base
            known = self.machine, self.state, base_values
            self.known[base_columns] = min(
                self._operations(base, inverse_dynamics(*known, carried=carried))
                for carried in (True, False)
            )
        return self.known[base_columns]

    def _operations(self, base: Expression, forces: Expression) -> int:
        """Count the operations that depend on the state."""
        inputs = [Port("", (symbol.shape[0],)) for symbol in self.motion]
        ports = (*inputs, Port("base", (base.shape[0],), shared=True))
        graph = graph_of(ca.Function("forces", [*self.motion, base], [ca.cse(forces)]), ports)
        return sum(not graph.nodes[k].shared for k in graph.operations())


def _final_cost(robot: Manipulator, base_columns: tuple[int, ...]) -> int:
    """Return the kernel's operations after the pass, with base parameters preprocessed."""
    built = program(robot, "inverse_dynamics", tuple((column,) for column in base_columns))
    return count_operations(hoist_invariants(built, "base_parameters")[0].function)
