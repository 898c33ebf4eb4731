"""Names for the intermediate quantities of a function, so that generated code can be read.

A node of the function that equals a named quantity of the equations in several random states gets
its name, however the sums in it were regrouped to save operations.
"""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca
import numpy as np

from pteron.bodies.motion import Expression
from pteron.equations.kinematics import platform_rates
from pteron.equations.machine import Machine
from pteron.kernels import Array, Graph, Program
from pteron.kernels.graph import CONSTANT, INPUT, expression
from pteron.platforms.coordinates import are_angles
from pteron.tolerances import EXACT

NamedQuantity = tuple[str, int, Expression]
"""A name, the leg (from 1) whose quantity it is, or 0, and a scalar or a vector."""

_AXES = {1: [""], 2: ["_a", "_b"], 3: ["_x", "_y", "_z"]}
"""Suffixes of components: a leg's plane has axes a and b."""


def node_names(
    machine: Machine, function: Program, graph: Graph, states: list[list[Array]]
) -> dict[int, str]:
    """Return a name for every node of a program's graph that computes something.

    Quantities of the equations have their names there: `leg2_u_a` is a component of leg 2's closing
    vector in the axes of its plane, `c2_z` one of its platform point, and so on. A node that
    depends on one leg alone has the leg's number; all others are numbered. `states` are values of
    the inputs.
    """
    symbols = function.function.sx_in()
    inputs = {port.name: symbol for port, symbol in zip(function.inputs, symbols, strict=True)}
    results = zip(function.outputs, function.function.call(symbols), strict=True)
    inputs |= {port.name: array.T for port, array in results if port.name == "found"}
    names, legs, scalars = [], [], []
    for name, leg, quantity in _quantities(machine, inputs):
        parts = ca.vertsplit(ca.densify(quantity))
        names += [name + axis for axis in _AXES[len(parts)]]
        legs += [leg] * len(parts)
        scalars += parts
    elements = [symbol.nonzeros() for symbol in symbols]
    nodes = graph.values(lambda i, j: elements[i][j], expression)
    both = ca.Function("both", symbols, [ca.vertcat(*nodes), ca.vertcat(*scalars)])
    computed = [[np.array(part) for part in both(*state)] for state in states]
    node_values, quantities = (np.hstack(parts) for parts in zip(*computed, strict=True))
    return _name_nodes(graph, _matches(node_values, quantities), names, legs)


def _quantities(machine: Machine, inputs: dict[str, Expression]) -> Iterator[NamedQuantity]:
    """Yield the quantities with names, preferred ones first."""
    if "found" in inputs:  # the given pose is the start of Newton's method
        moving = [inputs.get(f"joint_{name}") for name in ("rates", "accelerations")]
        pose = inputs["found"]
        known = moving[0] is not None
        rates = list(platform_rates(machine, pose, *moving)) if known else []
        yield from _motion(machine, pose, *rates)
    elif "pose" in inputs:
        rates = [inputs.get(name) for name in ("velocity", "acceleration")]
        yield from _motion(machine, inputs["pose"], *rates)
    elif "joints" in inputs:
        joints = inputs["joints"]
        for i, (leg, q) in enumerate(zip(machine.legs, ca.vertsplit(joints), strict=True), 1):
            for name, quantity in leg.locus(q)._asdict().items():
                yield f"leg{i}_{name}", i, ca.SX(quantity)
        for k, pose in enumerate(ca.horzsplit(machine.closure.poses(joints)), start=1):
            for name, _, quantity in _motion(machine, pose):
                yield f"pose{k}_{name}", 0, quantity  # of no single leg: the pose depends on all


def _motion(machine: Machine, pose: Expression, *rates: Expression) -> Iterator[NamedQuantity]:
    """Yield the named quantities of the motion of platform points and legs."""
    state = machine.state(pose, *rates)
    platform = state.platform
    for name, coordinate in zip(machine.platform.coordinates, ca.vertsplit(pose), strict=True):
        yield name, 0, coordinate
        if are_angles([name]):
            yield f"cos_{name}", 0, ca.cos(coordinate)
            yield f"sin_{name}", 0, ca.sin(coordinate)
    for i, (equations, leg, point) in enumerate(
        zip(machine.legs, state.legs, platform.points, strict=True), start=1
    ):
        quantities = equations.exported_terms(point, platform.rotation) | {
            "l_u": leg.links[0],
            "l_l": leg.links[1],
            "joint": leg.coordinate,
            "joint_rate": leg.rate,
            "joint_acceleration": leg.acceleration,
            "divisor": leg.divisor,
        }
        for name, quantity in quantities.items():
            if quantity is not None:
                yield f"leg{i}_{name}", i, quantity
        # A platform point's coordinates may serve several legs.
        for name, quantity in zip(("c", "dc", "ddc"), point, strict=True):
            yield f"{name}{i}", 0, quantity


def _matches(node_values: Array, quantities: Array) -> dict[int, int]:
    """Return, by the first node that has its value, the index of each named quantity."""
    places: dict[int, int] = {}
    for place, row in enumerate(quantities):
        if np.isfinite(row).all() and np.ptp(row) > 0.0:  # constants may be equal by chance
            same = (np.abs(node_values - row) <= EXACT * np.abs(row)).all(axis=1)
            for k in np.flatnonzero(same):
                places.setdefault(int(k), place)
                break
    return places


def _name_nodes(
    graph: Graph, known: dict[int, int], names: list[str], legs: list[int]
) -> dict[int, str]:
    """Return a name for every node: known names, numbered ones of a leg, and numbered others."""
    of_leg: list[frozenset[int]] = []
    node_names: dict[int, str] = {}
    counts: dict[str, int] = {}
    for k, node in enumerate(graph.nodes):
        if node.operation in (INPUT, CONSTANT):
            of_leg.append(frozenset())
            continue
        node_legs = {legs[known[k]]} - {0} if k in known else set()
        of_leg.append(frozenset(node_legs).union(*(of_leg[i] for i in node.arguments)))
        if k in known:
            node_names[k] = names[known[k]]
        else:
            stem = f"leg{min(of_leg[k])}_" if len(of_leg[k]) == 1 else "t"
            counts[stem] = counts.get(stem, 0) + 1
            node_names[k] = f"{stem}{counts[stem]}"
    return node_names
