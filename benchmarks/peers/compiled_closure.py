"""The closed form around an engine that is called from Python, in machine code.

Pteron's compiler builds it, so that the glue costs a peer as little as it would cost Pteron.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca

from peers.closure import Array, Closure
from peers.library import Missing
from pteron.kernels import TARGETS, Port
from pteron.kernels.c import compiler

__all__ = ["Follow", "Project", "forces", "joints", "joints_and_rates"]

Follow = Callable[[Array, Array, Array], tuple[Array, Array, Array, Array]]
"""From pose, velocity and acceleration to q, v, a and what the projection needs."""

Project = Callable[[Array, Array], Array]
"""From the tree's joint forces and `rows` to the actuator forces."""


def joints(closure: Closure, unbounded: bool) -> Follow:
    """Return `Closure.joints`, compiled."""
    return _follow(closure.joints(unbounded), unbounded, Port("rows", (28,)))


def joints_and_rates(closure: Closure, unbounded: bool) -> Follow:
    """Return `Closure.joints_and_rates`, compiled."""
    return _follow(closure.joints_and_rates(unbounded), unbounded, Port("rates", (16, 4)))


def forces(closure: Closure) -> Project:
    """Return `Closure.forces`, compiled."""
    given = Port("tau", (16,)), Port("rows", (28,))
    return _compiled(closure.forces(), given, (Port("forces", (4,)),))


def _follow(function: ca.Function, unbounded: bool, last: Port) -> Follow:
    given = tuple(Port(name, (4,)) for name in ("pose", "velocity", "acceleration"))
    size = 25 if unbounded else 16
    found = Port("q", (size,)), Port("v", (16,)), Port("a", (16,)), last
    return _compiled(function, given, found)


def _compiled(
    function: ca.Function, given: tuple[Port, ...], found: tuple[Port, ...]
) -> Callable[..., Any]:
    if compiler() is None:
        raise Missing("no C compiler for the closed form around it")
    return TARGETS["c"](function.name(), function, given, found)
