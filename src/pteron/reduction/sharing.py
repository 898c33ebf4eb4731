"""Which columns there are: each parameter of its own, or one for several identical legs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.manipulator import BODY_PARAMETERS, Manipulator, parameter_names

__all__ = ["Sharing", "default_order", "leg_groups", "share", "suffix"]

Sharing = bool | Sequence[Sequence[int]]
"""False: no legs share parameters. True: all do. Or groups of legs, counted from 1, that do."""

_PREFERENCE = (
    *("m_p", "mgx_u", "mgy_u", "I_u", "mgx_l", "mgy_l"),
    *("m_e", "m_l", "mgx_e", "mgy_e", "I_e", "I_l", "m_u"),
)
"""Kinds of columns, those to keep first in front: the choice of the paper's Table 1."""


def leg_groups(robot: Manipulator, shared: Sharing) -> list[tuple[int, ...]]:
    """Return the legs, counted from 1, in groups with one parameter set each."""
    legs = range(1, len(robot.legs) + 1)
    if isinstance(shared, bool):
        return [tuple(legs)] if shared else [(leg,) for leg in legs]
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
    return sorted([*groups, *((leg,) for leg in legs if leg not in named)])


def share(robot: Manipulator, shared: Sharing) -> tuple[tuple[str, ...], Array]:
    """Return the columns' names, and the matrix (N, columns) that adds parameters into them."""
    groups = leg_groups(robot, shared)
    everything = parameter_names(robot)
    names: list[str] = []
    members: list[list[str]] = []
    kinds = ["m_p", *(f"{p}_u" for p in BODY_PARAMETERS), *(f"{p}_l" for p in BODY_PARAMETERS)]
    for block in (kinds[:1], kinds[1:5], kinds[5:]):
        for group in groups:
            for kind in block:
                names.append(kind + suffix(group, len(robot.legs)))
                members.append([f"{kind}{leg}" for leg in group])
    platform = [f"{p}_e" for p in BODY_PARAMETERS]
    names += platform
    members += [[name] for name in platform]
    matrix = np.zeros((len(everything), len(names)))
    for column, group_names in enumerate(members):
        for name in group_names:
            matrix[everything.index(name), column] = 1.0
    return tuple(names), matrix


def suffix(group: tuple[int, ...], legs: int) -> str:
    """Return what ends the names of a group's columns: its leg, its legs, or nothing for all."""
    if len(group) == legs:
        return ""
    return str(group[0]) if len(group) == 1 else "(" + ",".join(map(str, group)) + ")"


def default_order(names: Sequence[str]) -> list[int]:
    """Return the columns in order of preference, those to keep first in front."""

    def rank(column: int) -> tuple[int, int]:
        kind = names[column].rstrip("0123456789(),")
        return _PREFERENCE.index(kind), column

    return sorted(range(len(names)), key=rank)
