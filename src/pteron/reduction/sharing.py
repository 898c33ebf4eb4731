"""The regressor's columns where legs share parameters, and the order in which columns are kept.

Legs that are built alike share parameters: the columns of a parameter of several legs are added.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pteron.bodies.parameters import PREFERENCE, TILTING_PREFERENCE, Parameter
from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.manipulator import Manipulator, parameter_data

Sharing = bool | Sequence[Sequence[int]]
"""False: no legs share parameters. True: all do. Else groups of legs, from 1, that share theirs."""


def leg_groups(robot: Manipulator, shared: Sharing) -> list[tuple[int, ...]]:
    """Return groups of legs, counted from 1; the legs of a group share their parameters."""
    legs = range(1, len(robot.legs) + 1)
    if isinstance(shared, bool):
        groups = [tuple(legs)] if shared else []
    else:
        try:
            groups = [tuple(sorted(group)) for group in shared if len(group)]
            named = [leg for group in groups for leg in group]
        except TypeError:
            named, groups = [0], []
        if len(set(named)) != len(named) or not all(type(n) is int and n in legs for n in named):
            raise ModelError(
                f"shared: {shared!r} does not name legs 1 to {len(legs)}, each at most once; "
                "give True, or groups such as [(1, 2), (3, 4)]"
            )
    for group in groups:
        types = sorted({robot.legs[leg - 1].type for leg in group})
        if len(types) > 1:
            raise ModelError(
                f"shared: legs {', '.join(map(str, group))} are of the kinds {', '.join(types)}, "
                "which have other parameters; share within one kind"
            )
    single = [(leg,) for leg in legs if not any(leg in group for group in groups)]
    return sorted([*groups, *single])


def share(
    robot: Manipulator, groups: Sequence[tuple[int, ...]]
) -> tuple[tuple[Parameter, ...], Array]:
    """Return the columns' K parameters, and the matrix (N, K) of ones that adds N columns up."""
    everything = parameter_data(robot)
    columns = parameter_data(robot, groups)

    def joins(p: Parameter, c: Parameter) -> bool:
        """Return whether a column comprises a parameter: kind, body and legs agree."""
        return (p.kind, p.body) == (c.kind, c.body) and set(p.legs) <= set(c.legs)

    return columns, np.array([[float(joins(p, c)) for c in columns] for p in everything])


def default_order(columns: Sequence[Parameter]) -> list[int]:
    """Return the columns' indices in order of preference as base parameters."""
    kinds = {(parameter.kind, parameter.body) for parameter in columns}
    preference = PREFERENCE if kinds <= set(PREFERENCE) else TILTING_PREFERENCE

    def rank(column: int) -> tuple[int, int]:
        """Return a column's place in the order of preference by kind and body, then by index."""
        parameter = columns[column]
        return preference.index((parameter.kind, parameter.body)), column

    return sorted(range(len(columns)), key=rank)
