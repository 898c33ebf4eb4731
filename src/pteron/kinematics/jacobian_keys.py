"""`jacobian_keys`: the keys of a machine's legs that its Jacobian depends on, for messages."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

from pteron.equations.machine import number_places, numbers
from pteron.kernels import general_program
from pteron.manipulator import Manipulator

_ROLES = ("point", "direction", "length")
"""Roles of the quantities that are named; an elbow's side or a derived axis is no dimension."""


def jacobian_keys(robot: Manipulator) -> tuple[str, ...]:
    """Return the keys of the leg dimensions that the Jacobian depends on, as files name them.

    They are derived from the sparsity of the symbolic Jacobian by the geometry. A key that no leg
    gives, because its default is used, is left out.
    """
    jacobian = general_program(robot, "jacobian").function
    touched = set(jacobian.jac_sparsity(0, 0).get_triplet()[1])
    places = number_places(robot)
    starts = [start for place in places for start in place.values()]
    ends = dict(pairwise([*starts, len(numbers(robot))]))
    keys: dict[str, None] = {}
    for leg, place in zip(robot.legs, places, strict=False):
        named = [q.name for q in leg.quantities if q.role in _ROLES]
        for key in (*named, "platform_point"):
            span = range(place[key], ends[place[key]])
            if getattr(leg, key, None) is not None and not touched.isdisjoint(span):
                keys[key] = None
    return tuple(keys)


def alternatives(keys: Iterable[str]) -> str:
    """Return names joined by "or": "direction", "direction or platform_point", "a, b or c"."""
    *others, last = keys
    return f"{', '.join(others)} or {last}" if others else last
