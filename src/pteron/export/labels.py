"""Names for the intermediate quantities of a function, so that generated code can be read."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from pteron.equations.circles import squared_reach
from pteron.equations.geometry import Expression, Geometry
from pteron.equations.legs import closing_vector, leg_motion
from pteron.equations.platforms import platform_motion
from pteron.kernels import Graph, Program, graph_of
from pteron.manipulator import Manipulator

__all__ = ["Labelled", "labelled"]


@dataclass(frozen=True)
class Labelled:
    """A program's graph, and what its nodes are called."""

    program: Program
    graph: Graph
    names: dict[int, str]
    """Of every node that computes something."""


def labelled(robot: Manipulator, given: Program) -> Labelled:
    """Return the graph of a program with names for its nodes.

    Quantities that the equations know are called after them: `leg2_u_a` is a component of leg 2's
    closing vector in the axes of its plane, `c2_z` one of its platform point, and so on. What
    depends on one leg alone carries the leg's number; all else is numbered.
    """
    symbols = given.function.sx_in()
    inputs = dict(zip((port.name for port in given.inputs), symbols, strict=True))
    outputs = given.function.call(symbols)
    known = _quantities(Geometry.of(robot), inputs) if "pose" in inputs else {}
    merged = ca.cse([*outputs, *known.values()])
    function = ca.Function(given.name, symbols, merged)
    graph = graph_of(function, given.inputs)
    count = len(outputs)
    titles: dict[int, str] = {}
    for name, nodes in zip(known, graph.outputs[count:], strict=True):
        node = nodes[0] if nodes else None
        if node is not None and graph.nodes[node].operation not in ("input", "constant"):
            titles.setdefault(node, name)
    pruned, places = _pruned(graph, count)
    kept = {places[k]: name for k, name in titles.items() if k in places}
    return Labelled(given, pruned, _named(pruned, kept, len(robot.legs)))


def _quantities(g: Geometry, inputs: dict[str, Expression]) -> dict[str, Expression]:
    """Return scalar expressions by name, in the order in which they are looked for."""
    rest = ca.SX.zeros(g.freedom)
    velocity = inputs.get("velocity", rest)
    acceleration = inputs.get("acceleration", rest)
    motion = platform_motion(g, inputs["pose"], velocity, acceleration)
    found: dict[str, Expression] = {}
    if motion.turn is not None:
        found |= {"cos_phi": ca.cos(inputs["pose"][3]), "sin_phi": ca.sin(inputs["pose"][3])}
    for i, (leg, point) in enumerate(zip(g.legs, motion.points, strict=True), start=1):
        state = leg_motion(leg, point)
        u = closing_vector(leg, point.position)
        scalars = {"square": ca.dot(u, u), "delta": squared_reach(leg, u)}
        scalars["root"] = ca.sqrt(scalars["delta"])
        if "velocity" in inputs:
            scalars |= {
                "upper_rate": state.upper_rate,
                "lower_rate": state.lower_rate,
                "slider_rate": state.slider_rate,
            }
        if "acceleration" in inputs:
            scalars |= {
                "upper_acceleration": state.upper_acceleration,
                "lower_acceleration": state.lower_acceleration,
                "slider_acceleration": state.slider_acceleration,
            }
        vectors = {
            "u": u,
            "upper": state.position.l_u,
            "lower": state.position.l_l,
            "upper_row": state.position.upper_row,
            "lower_row": state.position.lower_row,
            "c": point.position,
        }
        if "velocity" in inputs:
            vectors |= {"dc": point.velocity}
        if "acceleration" in inputs:
            vectors |= {"ddu": state.closing_acceleration, "ddc": point.acceleration}
        found |= {f"leg{i}_{name}": value for name, value in scalars.items()}
        for name, vector in vectors.items():
            # A platform point's coordinates may serve several legs, in whose plane they lie.
            title = f"{name}{i}" if name.endswith("c") else f"leg{i}_{name}"
            axes = "xyz" if vector.shape[0] == 3 else "ab"
            found |= {f"{title}_{axes[k]}": ca.densify(vector)[k] for k in range(vector.shape[0])}
    return found


def _pruned(graph: Graph, count: int) -> tuple[Graph, dict[int, int]]:
    """Return the graph of the first outputs alone, and where its nodes went."""
    needed = {k for nodes in graph.outputs[:count] for k in nodes}
    for k in range(len(graph.nodes) - 1, -1, -1):
        if k in needed and graph.nodes[k].operation != "input":
            needed.update(graph.nodes[k].arguments)
    places = {k: place for place, k in enumerate(sorted(needed))}
    nodes = tuple(
        node
        if node.operation == "input"
        else type(node)(
            node.operation,
            tuple(places[i] for i in node.arguments),
            node.value,
            node.shared,
            node.outlying,
        )
        for node in (graph.nodes[k] for k in sorted(needed))
    )
    outputs = tuple(tuple(places[k] for k in nodes) for nodes in graph.outputs[:count])
    return Graph(nodes, outputs), places


def _named(graph: Graph, known: dict[int, str], legs: int) -> dict[int, str]:
    """Return a name for every node: known ones, those of one leg, and the rest."""
    of_leg: list[frozenset[int]] = []
    names: dict[int, str] = {}
    counts = [0] * (legs + 1)
    for k, node in enumerate(graph.nodes):
        if node.operation in ("input", "constant"):
            of_leg.append(frozenset())
            continue
        inherited = frozenset().union(*(of_leg[i] for i in node.arguments))
        name = known.get(k, "")
        own = {int(name[3])} if name.startswith("leg") else set()
        of_leg.append(inherited | own)
        if k in known:
            names[k] = known[k]
        elif len(of_leg[k]) == 1:
            (leg,) = of_leg[k]
            counts[leg] += 1
            names[k] = f"leg{leg}_{counts[leg]}"
        else:
            counts[0] += 1
            names[k] = f"t{counts[0]}"
    return names
