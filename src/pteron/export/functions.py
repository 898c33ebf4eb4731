"""What is exported: functions by name, with their numbers, what they mean, and examples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from pteron.equations.drives import drive_names, drive_numbers
from pteron.equations.machine import Machine, closure_of
from pteron.errors import ModelError
from pteron.export.identified import Identified, base_program, read_identified
from pteron.export.labels import node_names
from pteron.export.outputs import DRIVEN, NAMES, Output, factors, in_units, meaning
from pteron.kernels import FUNCTIONS as COMPILED
from pteron.kernels import LOADED, REDUCIBLE, Array, Graph, Port, Program, graph_of, program
from pteron.kernels import specialised as with_values
from pteron.kernels.functions import TABLE
from pteron.kernels.graph import CONSTANT
from pteron.kinematics import inverse_kinematics, random_poses
from pteron.manipulator import Manipulator, parameter_names, parameters

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
what `FEED` names too of a machine with drives."""

FEED = ("feed_forward", "joint_feed_forward")
"""What a controller adds to its feedback, from the platform's motion or from the joints'."""

_BASE = "_base"
"""What ends the name of a function of base parameters."""

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
    "forward_dynamics": "Acceleration of the platform under actuator forces; no friction.",
    "drive_forces": "What the drives must give: actuator forces, friction by the sign of the "
    "joint's rate, the motors' inertia.",
    "feed_forward": "What the drives must give: actuator forces, friction, which is smooth where a "
    "joint rests, the motors' inertia.",
    "joint_feed_forward": "What the drives must give, as feed_forward, from the motion of the "
    "joints: also the pose that they have, for the next call to begin with; NaN where Newton's "
    "method does not lead there from the pose given, such as the last one.",
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

_BASE_TABLE = (
    "The machine's base parameters, as pteron identify lists them; SI units. A new list of it may "
    "be put in their place."
)


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
    usual: Sequence[str] = FUNCTIONS,
    specialised: bool,
    wrench: bool,
    output: Output,
    base: str | Path | None,
) -> tuple[Exported, ...]:
    """Return what is to be written: the `usual` unless a choice is given.

    Without a closed form for every pose that joints have, there is the step from the last one.

    Raises
    ------
    ModelError
        If a name is unknown, or there is none; if a drive does not say what the output needs.
    DataError
        If the file of identified base parameters is not one of this machine.
    """
    identified = None if base is None else read_identified(robot, base)
    robot = identified.robot if identified else robot
    if functions is None:
        closed = closure_of(robot).closed_form
        step = {"direct_kinematics": "direct_step"}
        functions = [name if closed else step.get(name, name) for name in usual]
        if identified:  # which leaves the bodies unknown
            needs = {name: TABLE[name].inputs for name in functions if name in TABLE}
            functions = [name for name in functions if "parameters" not in needs.get(name, ())]
            functions += [name + _BASE for name in FEED]
        elif has_drives(robot):
            functions += FEED
    names = [functions] if isinstance(functions, str) else list(dict.fromkeys(functions))
    allowed = sorted({*COMPILED, *(name + _BASE for name in REDUCIBLE)} - {"base_regressor"})
    valid = f"choose from {', '.join(allowed)}"
    for name in names:
        if name not in allowed:
            raise ModelError(f"functions: {name!r} cannot be exported; {valid}")
    if not names:
        raise ModelError(f"functions: none given; {valid}")
    factors(robot, output)
    if output != "force" and not {name.removesuffix(_BASE) for name in names} & set(DRIVEN):
        raise ModelError(
            f'output: "{output}" is what drives are told, but none of {", ".join(DRIVEN)} is '
            "written; name one of them"
        )
    return tuple(_exported(robot, name, identified, specialised, wrench, output) for name in names)


def _exported(
    robot: Manipulator,
    name: str,
    identified: Identified | None,
    specialised: bool,
    wrench: bool,
    output: Output,
) -> Exported:
    what = name.removesuffix(_BASE)
    loaded = wrench and what in LOADED
    base = (identified or Identified.of(robot)) if name.endswith(_BASE) else None
    if base:
        given = base_program(what, base, wrench=loaded, folded=specialised)
    else:
        given = program(robot, what, wrench=loaded)
    if identified and "parameters" in {port.name for port in given.inputs}:
        other = f"ask for {what + _BASE}" if what in REDUCIBLE else "leave it out"
        raise ModelError(
            f"functions: {name!r} takes every body's parameters, which identified base parameters "
            f"do not tell; {other}, or export the model file that pteron identify wrote"
        )
    if what in DRIVEN:
        given = in_units(given, robot, output)
    shared = [port.name for port in given.inputs if port.shared]
    tables = tuple(_table(robot, port, base) for port in shared)
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
    summary = _SUMMARIES.get(what, f"{what.replace('_', ' ')}, as pteron.{what}.".capitalize())
    if base:
        summary = summary.replace(", from the inertial parameters", "") + " From base parameters."
    if name in ("direct_kinematics", "closure_poses"):
        summary += _MODES + ("" if machine.closure.keeps_modes else _BRANCHES)
    elif "pose" in taken and not any(node.operation == "sqrt" for node in graph.nodes):
        summary += " It does not ask whether the legs reach."
    meanings = {port.name: _meaning(robot, port, output) for port in (*given.inputs, *outputs)}
    if {"pose", "joints"} <= taken:
        meanings["pose"] = f"near that of the joints, such as the last: {meanings['pose']}"
    return Exported(
        name,
        summary,
        graph,
        node_names(machine, given, graph, states[:3]),
        given.inputs,
        outputs,
        meanings,
        tables,
        tuple(_evaluated(given, graph, state) for state in states[1:]),
    )


def _table(robot: Manipulator, name: str, base: Identified | None) -> Table:
    """Return the machine's own numbers for a shared input."""
    if name == "drives":
        return Table(name, _DRIVE_TABLE, drive_names(robot), drive_numbers(robot))
    if base is not None:
        verdict = f" Verdict of the identification: {base.grade}." if base.grade else ""
        return Table(name, _BASE_TABLE + verdict, base.comments, base.values)
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


def _meaning(robot: Manipulator, port: Port, output: Output) -> str:
    """Return what an input or an output means, with its unit."""
    lengths = ", ".join(name for name in robot.platform.coordinates if name != "phi")
    units = [leg.joint.unit for leg in robot.legs]
    joints = _by_leg(units)
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
        "joint_rates": f"their rates, {_by_leg([f'{unit}/s' for unit in units])}",
        "joint_accelerations": "their accelerations, " + _by_leg([f"{unit}/s^2" for unit in units]),
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
    name = port.name.removesuffix("_out")
    return meaning(robot, output) if name == NAMES[output] != "forces" else texts.get(name, "")


def _by_leg(units: Sequence[str]) -> str:
    return units[0] if len(set(units)) == 1 else f"{', '.join(units)} (leg by leg)"
