"""The closed form around an engine that is called from Python, in machine code.

Pteron's compiler builds it, so that the glue costs a peer as little as it would cost Pteron.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca

import pteron
from peers.closure import Array, Closure
from peers.leg_closure import LegClosure
from peers.library import Missing
from peers.tilting_closure import TiltingClosure
from pteron.kernels import TARGETS, Port
from pteron.kernels.c import compiler

__all__ = ["ClosedForm", "Follow", "Project", "closed_form", "forces", "joints", "joints_and_rates"]

Follow = Callable[[Array, Array, Array], tuple[Array, Array, Array, Array]]
"""From pose, velocity and acceleration to q, v, a and what the projection needs."""

Project = Callable[[Array, Array], Array]
"""From the tree's joint forces and `rows` to the actuator forces."""

ClosedForm = Closure | LegClosure


def closed_form(robot: pteron.Manipulator, carried: bool = True) -> ClosedForm:
    """Return the closed form of a machine, for a tree with or without its platform."""
    if robot.platform.tilts:
        return TiltingClosure.of(robot)
    prrr = all(leg.type == "PRRR" for leg in robot.legs)
    return Closure.of(robot) if prrr else LegClosure.of(robot, carried)


def joints(closure: ClosedForm, unbounded: bool) -> Follow:
    """Return the closed form's `joints`, compiled."""
    return _compiled(closure.joints(unbounded))


def joints_and_rates(closure: ClosedForm, unbounded: bool) -> Follow:
    """Return the same function with dq/dx (V, m), by rows, in the place of `rows`.

    It is what a projection needs that is written with matrices; J is the actuators' part of it.
    """
    function = closure.joints(unbounded)
    motion = function.sx_in()
    q, v, a, _ = function.call(motion)
    rates = ca.densify(ca.jacobian(v, motion[1]))
    outputs = [q, v, a, rates.T]
    shape = rates.shape[0], rates.shape[1]
    return _compiled(ca.Function("joints_and_rates", motion, outputs), last=shape)


def forces(closure: ClosedForm) -> Project:
    """Return the closed form's `forces`, compiled."""
    return _compiled(closure.forces())


def _compiled(function: ca.Function, last: tuple[int, ...] | None = None) -> Callable[..., Any]:
    """Return the function in machine code; `last` is the shape of its last output by rows."""
    if compiler() is None:
        raise Missing("no C compiler for the closed form around it")
    given = [Port(f"in{i}", (function.size1_in(i),)) for i in range(function.n_in())]
    found = [Port(f"out{i}", (function.size1_out(i),)) for i in range(function.n_out())]
    if last is not None:
        found[-1] = Port(found[-1].name, last)
    return TARGETS["c"](function.name(), function, tuple(given), tuple(found))
