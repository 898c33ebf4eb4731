"""What is exported: functions by name, with their numbers, what they mean, and examples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version

import numpy as np

from pteron.equations.drives import drive_names, drive_numbers
from pteron.equations.machine import Machine, closure_of
from pteron.errors import ModelError
from pteron.export.labels import node_names
from pteron.kernels import FUNCTIONS as COMPILED
from pteron.kernels import LOADED, Array, Graph, Port, Program, columns_of, graph_of, program
from pteron.kernels import specialised as with_values
from pteron.kernels.graph import CONSTANT
from pteron.kinematics import inverse_kinematics, random_poses
from pteron.manipulator import Manipulator, parameter_names, parameters
from pteron.reduction import BaseParameters, cheapest_parameters

FUNCTIONS = (
    "inverse_kinematics",
    "direct_kinematics",
    "jacobian",
    "inverse_dynamics",
    "inverse_dynamics_base",
    "forward_dynamics",
    "regressor",
)
"""What is exported unless a choice is given; direct kinematics where it has a closed form, and
`feed_forward` too of a machine with drives."""

_SUMMARIES = {
    "inverse_kinematics": "Joint coordinates of a pose.",
    "direct_kinematics": "Every pose that the joint coordinates allow, one a row; NaN where it is "
    "not real or not in reach.",
    "closure_poses": "Every pose that the joint coordinates allow, one a row, in reach or not.",
    "direct_step": "The pose of the joint coordinates next to a given one, such as the last one "
    "of a motion, by Newton's method; NaN where it does not converge, or comes to another side of "
    "the singularities.",
    "jacobian": "Jacobian: joint rates = J velocity.",
    "inverse_dynamics": "Actuator forces of a motion, from the inertial parameters; no friction.",
    "inverse_dynamics_base": "Actuator forces of a motion, from base parameters; no friction.",
    "forward_dynamics": "Acceleration of the platform under actuator forces; no friction.",
    "drive_forces": "What the drives must give: actuator forces, friction by the sign of the "
    "joint's rate, the motors' inertia.",
    "feed_forward": "What the drives must give: actuator forces, friction, which is smooth where a "
    "joint rests, the motors' inertia.",
    "drive_accelerations": "Acceleration of the platform under what the drives give, friction and "
    "the motors' inertia included.",
    "regressor": "Regressor: actuator forces = regressor parameters.",
}

_MODES = " Each row is one assembly mode throughout: a motion between singularities keeps its row."

_BRANCHES = (
    " A leg may be bent the other way in a row: then its inverse kinematics are not the joint "
    "coordinates given."
)


_TABLE = "The machine's inertial parameters, in the paper's order; SI units."

_DRIVE_TABLE = (
    "The machine's drives, at the joints: motors' inertia, dry and viscous friction, a constant "
    "force, what dry friction has more at rest, the speeds by which it is gone, and within which "
    "dry friction changes its sign; SI units."
)

_BASE_TABLE = "The machine's base parameters, which inverse_dynamics_base takes; SI units."


@dataclass(frozen=True)
class Table:
    """Numbers of the machine that functions take as an argument."""

    name: str
    comment: str
    names: tuple[str, ...]
    values: Array


@dataclass(frozen=True)
class Example:
    """A state, what a function returns for it, and its status: 0, or 1 out of reach."""

    inputs: tuple[Array, ...]
    results: tuple[Array, ...]
    status: int


@dataclass(frozen=True)
class Exported:
    """One function: its graph with names, its ports, and states with their results."""

    name: str
    summary: str
    graph: Graph
    names: dict[int, str]
    """How the nodes of the graph that compute something are called."""
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    meanings: dict[str, str]
    """What the inputs and outputs mean, with their units."""
    tables: tuple[Table, ...]
    examples: tuple[Example, ...]

    @property
    def several(self) -> bool:
        """Whether it returns a pose a row, of which some may not exist."""
        return self.name == "direct_kinematics"

    @property
    def operations(self) -> int:
        """Arithmetic operations."""
        return len(self.graph.operations())


def has_drives(robot: Manipulator) -> bool:
    """Return whether the machine's file says what drives its joints."""
    return any(leg.drive is not None for leg in robot.legs)


def chosen(
    robot: Manipulator,
    functions: str | Sequence[str] | None,
    *,
    specialised: bool,
    wrench: bool,
) -> tuple[Exported, ...]:
    """Return what is to be written: `FUNCTIONS` unless a choice is given.

    Without a closed form for every pose that joints have, there is the step from the last one.

    Raises
    ------
    ModelError
        If a name is unknown, or there is none.
    """
    if functions is None:
        closed = closure_of(robot).closed_form
        step = {"direct_kinematics": "direct_step"}
        functions = [name if closed else step.get(name, name) for name in FUNCTIONS]
        functions += ["feed_forward"] if has_drives(robot) else []
    names = [functions] if isinstance(functions, str) else list(dict.fromkeys(functions))
    allowed = sorted({*COMPILED, "inverse_dynamics_base"} - {"base_regressor"})
    valid = f"choose from {', '.join(allowed)}"
    for name in names:
        if name not in allowed:
            raise ModelError(f"functions: {name!r} cannot be exported; {valid}")
    if not names:
        raise ModelError(f"functions: none given; {valid}")
    return tuple(_exported(robot, name, specialised, wrench) for name in names)


def _exported(robot: Manipulator, name: str, specialised: bool, wrench: bool) -> Exported:
    base = cheapest_parameters(robot) if name == "inverse_dynamics_base" else None
    what = "inverse_dynamics" if base else name
    loaded = wrench and what in LOADED
    given = program(robot, what, columns_of(base) if base else None, wrench=loaded)
    shared = [port.name for port in given.inputs if port.shared]
    tables = tuple(_table(robot, name, base) for name in shared)
    fixed = {table.name: table.values for table in tables}
    if specialised:
        given, tables = with_values(given, fixed), ()
    graph = graph_of(given.function, given.inputs)
    machine = Machine.of(robot)
    states = _states(robot, given.inputs, fixed)
    # Argument names must differ from those of the results.
    taken = {port.name for port in given.inputs}
    outputs = tuple(
        replace(port, name=f"{port.name}_out") if port.name in taken else port
        for port in given.outputs
    )
    summary = _SUMMARIES.get(name, f"{what.replace('_', ' ')}, as pteron.{what}.".capitalize())
    if name in ("direct_kinematics", "closure_poses"):
        summary += _MODES + ("" if machine.closure.keeps_modes else _BRANCHES)
    elif "pose" in taken and not any(node.operation == "sqrt" for node in graph.nodes):
        summary += " It does not ask whether the legs reach."
    return Exported(
        name,
        summary,
        graph,
        node_names(machine, given, graph, states[:3]),
        given.inputs,
        outputs,
        {port.name: _meaning(robot, port) for port in (*given.inputs, *outputs)},
        tables,
        tuple(_evaluated(given, graph, state) for state in states[1:]),
    )


def _table(robot: Manipulator, name: str, base: BaseParameters | None) -> Table:
    """Return the machine's own numbers for a shared input."""
    if name == "drives":
        return Table(name, _DRIVE_TABLE, drive_names(robot), drive_numbers(robot))
    if base is not None:
        return Table(name, _BASE_TABLE, base.expressions(digits=6), base.values())
    return Table(name, _TABLE, parameter_names(robot), parameters(robot))


def _states(
    robot: Manipulator, ports: Sequence[Port], fixed: dict[str, Array]
) -> list[list[Array]]:
    """Return inputs at three random poses in reach, and far out of it."""
    rng = np.random.default_rng(1)
    states = []
    # Where the joints are given a pose is but next to theirs.
    apart = 1e-3 if "joints" in {port.name for port in ports} else 0.0
    for pose in random_poses(robot, 3, seed=rng):
        known = {"pose": pose + apart, "joints": inverse_kinematics(robot, pose), **fixed}
        states.append(
            [np.array(known.get(port.name, rng.normal(size=port.shape))) for port in ports]
        )
    far = 100.0 * np.arange(1, robot.freedom + 1)
    beyond = [
        value + far if port.name in ("pose", "joints") else value
        for port, value in zip(ports, states[0], strict=True)
    ]
    return [*states, beyond]


def _evaluated(given: Program, graph: Graph, inputs: list[Array]) -> Example:
    values = given.function.call([np.reshape(value, (-1, 1)) for value in inputs])
    results = tuple(np.array(value).ravel("F") for value in values)
    # Of several poses one will do; and what a machine has not is NaN throughout.
    computed = [
        value[[graph.nodes[k].operation != CONSTANT for k in nodes]]
        for value, nodes in zip(results, graph.outputs, strict=True)
    ]
    finite = np.isfinite(np.concatenate(computed))
    enough = finite.any() if given.name == "direct_kinematics" else finite.all()
    return Example(tuple(inputs), results, 0 if enough else 1)


def banner(robot: Manipulator, language: str) -> list[str]:
    """Return the lines that begin a generated file."""
    what = f"{len(robot.legs)} legs, {robot.platform.motion}"
    gravity = ", ".join(f"{g:g}" for g in robot.gravity)
    # A name is the user's: it must not end the comment that it stands in.
    name = "".join(c if c.isalnum() or c in " _-.," else "?" for c in " ".join(robot.name.split()))
    return [
        f"{name} ({what}): {language}, generated by Pteron {version('pteron')}.",
        "",
        f"SI units and radians; gravity ({gravity}) m/s^2 in the base frame.",
        "Do not edit: change the machine's file and generate anew.",
    ]


def _meaning(robot: Manipulator, port: Port) -> str:
    """Return what an input or an output means, with its unit."""
    lengths = ", ".join(name for name in robot.platform.coordinates if name != "phi")
    joints = _by_leg([leg.joint.unit for leg in robot.legs])
    forces = _by_leg([leg.joint.force_unit for leg in robot.legs])
    angle, rate, second, moment = (
        (", phi in rad", ", rad/s", ", rad/s^2", ", N m about k")
        if robot.platform.turns
        else ("", "", "", "")
    )
    texts = {
        "pose": f"platform pose: {lengths} in m{angle}",
        "poses": f"poses by rows: {lengths} in m{angle}",
        "found": f"platform pose that has the joint coordinates: {lengths} in m{angle}",
        "velocity": f"the pose's rate: m/s{rate}",
        "acceleration": f"the pose's acceleration: m/s^2{second}",
        "joints": f"joint coordinates, {joints}",
        "forces": f"actuator forces, {forces}, positive the way the joint coordinates grow",
        "wrench": f"wrench on the platform at P: N{moment}",
        "parameters": "inertial parameters, in kg, kg m and kg m^2",
        "base_parameters": "base parameters; see the table of the same name",
        "drives": "numbers of the drives; see the table of the same name",
        "jacobian": "joint rates per unit of the platform's rates",
        "regressor": "actuator forces per unit of each parameter",
        "type_ii": "type-II measure: 0 at a singularity",
        "type_i": "type-I measure of each leg: 0 where it is stretched or folded, 1 at best",
        "margin": "from each leg to the edge of its reach, m; negative beyond it",
    }
    return texts.get(port.name.removesuffix("_out"), "")


def _by_leg(units: Sequence[str]) -> str:
    return units[0] if len(set(units)) == 1 else f"{', '.join(units)} (leg by leg)"
