"""The base parameters that cost least: which columns to keep so that the dynamics are quickest."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from pteron.bodies.parameters import JOINED, OWN
from pteron.kernels import Array, count_operations, program
from pteron.kernels.hoisting import hoisted
from pteron.manipulator import Manipulator, parameter_data
from pteron.reduction.find import base_parameters
from pteron.reduction.result import BaseParameters

_NONZERO = 1e-9
"""Pivots of the grouping, whose entries are of order one in lengths of a link, are larger."""


@lru_cache(maxsize=32)
def cheapest_parameters(robot: Manipulator) -> BaseParameters:
    """Return base parameters with which the inverse dynamics need fewest operations.

    Any invertible combination of a base set is a base set. The masses that the lower links' m and
    m gamma_x amount to are left to the joints, and m_u to the slider; among what remains (the lower
    links' masses or the platform's four parameters, for one) columns are exchanged as long as the
    reduced model gets cheaper. It is a local search, from two starts.

    Parameters
    ----------
    robot : Manipulator
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
    >>> base = pteron.cheapest_parameters(robot)
    >>> base.rank, pteron.compile(robot, "inverse_dynamics", base=base).operations
    (26, 319)
    """
    columns = parameter_data(robot)
    base = base_parameters(robot)
    grouping = _without_units(robot, base)
    candidates = [k for k, p in enumerate(columns) if (p.kind, p.body) not in JOINED]
    always = [k for k in candidates if (columns[k].kind, columns[k].body) in OWN]
    others = [k for k in candidates if k not in always]
    # Not all are left to the joints: a telescopic shaft's lower part hands its mass to no other.
    joined = [k for k in range(len(columns)) if k not in candidates]
    found = {base.kept}
    for order in (others, others[::-1]):
        start = _independent(grouping, always + order + joined)
        found.add(_improved(robot, grouping, start, candidates)[1])
    best = min(found, key=lambda kept: (_final_cost(robot, kept), kept))
    return base_parameters(robot, keep=[columns[k].name for k in best])


def _without_units(robot: Manipulator, base: BaseParameters) -> Array:
    """Return the grouping with lengths in multiples of a link, so that no entry is extreme."""
    length = max(leg.size for leg in robot.legs)
    powers = length ** np.array([float(p.length_power) for p in base.parameters])
    return np.asarray(base.grouping * powers / powers[list(base.kept), None])


def _independent(grouping: Array, order: Sequence[int]) -> tuple[int, ...]:
    """Return the first columns, in this order, that do not depend on those before them."""
    rest = grouping.copy()
    kept = []
    for column in order:
        vector = rest[:, column]
        size = np.linalg.norm(vector)
        if size > _NONZERO:
            kept.append(column)
            rest = rest - np.outer(vector, vector @ rest) / size**2
    return tuple(sorted(kept))


def _improved(
    robot: Manipulator, grouping: Array, kept: tuple[int, ...], candidates: Sequence[int]
) -> tuple[int, tuple[int, ...]]:
    """Exchange columns one by one as long as that saves operations."""
    cost = _cost(robot, kept)
    while True:
        basis = grouping[:, kept]
        better = (cost, kept)
        for column in candidates:
            if column in kept:
                continue
            shares = np.linalg.solve(basis, grouping[:, column])
            for place in np.flatnonzero(np.abs(shares) > _NONZERO):
                other = tuple(sorted({*kept, column} - {kept[place]}))
                better = min(better, (_cost(robot, other), other))
        if better[0] >= cost:
            return cost, kept
        cost, kept = better


def _cost(robot: Manipulator, kept: tuple[int, ...]) -> int:
    """Return the operations before the pass that saves some, which would take far longer."""
    columns = tuple((column,) for column in kept)
    return count_operations(program(robot, "inverse_dynamics", columns, plain=True).function)


def _final_cost(robot: Manipulator, kept: tuple[int, ...]) -> int:
    """Return the operations of the kernel: after the pass, base parameters made ready once."""
    built = program(robot, "inverse_dynamics", tuple((column,) for column in kept))
    return count_operations(hoisted(built, "base_parameters")[0].function)
