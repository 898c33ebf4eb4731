"""The choice of functions to export as code, and for each all that C or Structured Text needs.

That is its graph of operations with names, the meaning of each argument, the machine's own values
for arguments such as `parameters`, and test vectors: states with the results to expect there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pteron.controllers import CONTROLLERS, Controller, Custom
from pteron.equations.drives import drive_names, drive_numbers
from pteron.equations.machine import Machine, closure_of
from pteron.errors import ModelError
from pteron.export.command_units import DRIVEN, Output, at_readings, factors, in_units
from pteron.export.descriptions import TEXTS, law_meanings, meaning
from pteron.export.identified_parameters import Identified, base_program, read_identified
from pteron.export.node_names import node_names
from pteron.export.tools import tool_tables
from pteron.kernels import (
    FUNCTIONS as COMPILED,
    LOADED,
    REDUCIBLE,
    SELECTED,
    Array,
    Graph,
    Port,
    Program,
    graph_of,
    program,
    specialised as with_values,
)
from pteron.kernels.functions import TABLE
from pteron.kernels.graph import CONSTANT
from pteron.kinematics import inverse_kinematics, random_poses
from pteron.manipulator import Manipulator, parameter_names, parameters
from pteron.manipulator.readings import to_readings

FUNCTIONS = (
    "inverse_kinematics",
    "direct_kinematics",
    "jacobian",
    "inverse_dynamics",
    "inverse_dynamics_base",
    "forward_dynamics",
    "regressor",
    "set_payload",
)
"""Functions exported by default, and those of `FEED` for a machine with drives. Where direct
kinematics has no closed form, `direct_step` takes its place."""

FEED = ("feed_forward", "joint_feed_forward")
"""Feed-forward for a controller, from the platform's motion or from the joints'."""

Asked = str | Controller | Custom | Sequence[str | Controller | Custom]
"""A choice of functions, by name, and of controllers, whose laws they are."""

PLACES = ("pose", "joints", "motors")
"""Inputs that say where the machine is."""

_CHANGE, _CHANGES = 1e-9, 8
"""Share by which inputs of an example are changed to see how its results do, and how many times.

Far above rounding, far below the shares at which results bend."""

_PAYLOAD = "set_payload"
"""The function that makes the parameters of a payload."""

_BASE = "_base"
"""Suffix of the name of a function of base parameters."""


@dataclass(frozen=True)
class NumberTable:
    """The machine's own values for an argument: code has them as a constant array to pass."""

    name: str
    comment: str
    names: tuple[str, ...]
    values: Array


@dataclass(frozen=True)
class Example:
    """A test vector: a state, what a function returns for it, and its status.

    The status is that of exported code: 0 where all is well, 1 where there is no result, as out of
    reach. (That of `pteron.kernels.programs` is the other way round.)
    """

    inputs: tuple[Array, ...]
    results: tuple[Array, ...]
    status: int
    gains: tuple[float, ...] = ()
    """For each result the greatest relative change of a column, per relative change of the inputs:
    by so much rounding is magnified near a singular pose."""


@dataclass(frozen=True)
class Exported:
    """One function: its graph with names, its inputs and outputs, and its test vectors."""

    name: str
    summary: str
    graph: Graph
    names: dict[int, str]
    """Names of the graph's nodes that compute something, by their number."""
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    meanings: dict[str, str]
    """Meanings of inputs and outputs, with their units."""
    tables: tuple[NumberTable, ...]
    examples: tuple[Example, ...]
    compares: bool = False
    """Whether it compares for its own ends, not to tell whether a leg reaches."""

    @property
    def several(self) -> bool:
        """Whether it returns several poses, one a row, of which some may not exist."""
        return self.name == "direct_kinematics"

    @property
    def operations(self) -> int:
        """Arithmetic operations."""
        return len(self.graph.operations())


def has_drives(robot: Manipulator) -> bool:
    """Return whether the machine's file says what drives its joints."""
    return any(leg.drive is not None for leg in robot.legs)


def listed(functions: Asked) -> list[str | Controller | Custom]:
    """Return a choice of functions as a list."""
    single = isinstance(functions, str | Controller | Custom)
    return [functions] if single else list(functions)  # type: ignore[arg-type, list-item]


def chosen(
    robot: Manipulator,
    functions: Asked | None,
    *,
    usual: Sequence[str] = FUNCTIONS,
    specialised: bool,
    wrench: bool,
    output: Output,
    base: str | Path | None,
    tables: bool = True,
) -> tuple[Exported, ...]:
    """Return the functions to export: the `usual` unless a choice is given.

    `tables` says whether the code can have tables of the machine's own values. Where not, they are
    folded in, all but the inertial parameters that `set_payload` returns.

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
    asked = [] if functions is None else listed(functions)
    given = {one.what: one for one in asked if not isinstance(one, str)}
    names = [one if isinstance(one, str) else one.what for one in asked]
    own = {name for name, one in given.items() if isinstance(one, Custom)}
    if functions is None:
        closed = closure_of(robot).closed_form
        step = {"direct_kinematics": "direct_step"}
        names = [name if closed else step.get(name, name) for name in usual]
        if identified:  # which leaves the bodies unknown
            needs = {name: TABLE[name].inputs for name in names if name in TABLE}
            names = [name for name in names if "parameters" not in needs.get(name, ())]
            names += [name + _BASE for name in FEED]
            names.append(_PAYLOAD + _BASE)
        elif has_drives(robot):
            names += FEED
        if specialised:
            names = [name for name in names if name.removesuffix(_BASE) != _PAYLOAD]
    names = list(dict.fromkeys(names))
    based = {name + _BASE for name in (*REDUCIBLE, _PAYLOAD)}
    allowed = sorted({*COMPILED, *based} - {"base_regressor"})
    valid = f"choose from {', '.join(allowed)}"
    for name in names:
        if name in own and name in allowed:
            raise ModelError(
                f"functions: {name!r} is the name of a function of pteron; give the controller's "
                "casadi.Function another one"
            )
        if name not in allowed and name not in own:
            raise ModelError(f"functions: {name!r} cannot be exported; {valid}")
        if specialised and name.removesuffix(_BASE) == _PAYLOAD:
            raise ModelError(
                f"functions: {name!r} returns parameters, which `specialised` folds into the code; "
                "leave one of them out"
            )
    if not names:
        raise ModelError(f"functions: none given; {valid}")
    factors(robot, output)
    if output != "force" and not {name.removesuffix(_BASE) for name in names} & {*DRIVEN, *own}:
        raise ModelError(
            f'output: "{output}" is what drives are told, but none of {", ".join(DRIVEN)} is '
            "written; name one of them"
        )
    controllers: dict[str, Controller | Custom] = {**CONTROLLERS, **given}
    return tuple(
        _exported(
            robot,
            name,
            identified,
            specialised or (not tables and what == _PAYLOAD),
            tables,
            wrench,
            output,
            controllers.get(what),
        )
        for name, what in (
            (name, name if name in own else name.removesuffix(_BASE)) for name in names
        )
    )


def _exported(
    robot: Manipulator,
    name: str,
    identified: Identified | None,
    specialised: bool,
    tabled: bool,
    wrench: bool,
    output: Output,
    controller: Controller | Custom | None,
) -> Exported:
    custom = isinstance(controller, Custom)
    what = name if custom else name.removesuffix(_BASE)
    loaded = wrench and what in LOADED
    base = (identified or Identified.of(robot)) if name != what else None
    if isinstance(controller, Custom):
        given = controller.law(robot).program
    elif base:
        given = base_program(what, base, wrench=loaded, folded=specialised)
    elif controller:
        given = _without_status(controller.law(robot).program)
    else:
        given = program(robot, what, wrench=loaded, named=True)
    taken = {port.name for port in given.inputs}
    bodies = not custom and ("parameters" in taken or name in SELECTED)
    if identified and bodies:
        other = f"ask for {what + _BASE}" if what in (*REDUCIBLE, _PAYLOAD) else "leave it out"
        raise ModelError(
            f"functions: {name!r} takes every body's parameters, which identified base parameters "
            f"do not tell; {other}, or export the model file that pteron identify wrote"
        )
    given = at_readings(given, robot)
    if custom or what in DRIVEN:
        given = in_units(given, robot, output)
    shared = [port.name for port in given.inputs if port.shared]
    tables = tuple(_table(robot, port, base, controller) for port in shared)
    fixed = {name: table.values for name, table in zip(shared, tables, strict=True)}
    if specialised:
        given, tables = with_values(given, fixed), ()
    elif not tabled:
        kept = {port.name for port in given.inputs} & {"parameters", "base_parameters"}
        given = with_values(given, {key: fixed[key] for key in shared if key not in kept})
        tables = ()
    elif what == _PAYLOAD:
        tables += tuple(NumberTable(*table) for table in tool_tables(robot))
    graph = graph_of(given.function, given.inputs)
    machine = Machine.numeric(robot)
    states = _states(robot, given.inputs, fixed, controller)
    # Argument names must differ from those of the results.
    outputs = tuple(
        replace(port, name=f"{port.name}_out") if port.name in taken else port
        for port in given.outputs
    )
    summary = TEXTS["summaries"].get(
        what, f"{what.replace('_', ' ')}, as pteron.{what}.".capitalize()
    )
    if base:
        summary = summary.replace(", from the inertial parameters", "") + " From base parameters."
    if name in ("direct_kinematics", "closure_poses"):
        summary += TEXTS["notes"]["modes"]
        summary += "" if machine.closure.keeps_modes else TEXTS["notes"]["branches"]
    elif (
        not custom
        and "pose" in taken
        and not {"sqrt", "less"} & {node.operation for node in graph.nodes}
    ):
        summary += " It does not ask whether the legs reach."
    meanings = {port.name: meaning(robot, port, output) for port in (*given.inputs, *outputs)}
    if custom:
        summary = f"{what}, a control law of one's own."
        known = {port: meaning(robot, Port(port, (1,)), output) for port in TEXTS["law"]}
        meanings = {**known, **meanings} | {one: f"see the table {what}_{one}" for one in shared}
    if not tabled:
        told = {"parameters": _PAYLOAD, "base_parameters": _PAYLOAD + _BASE}
        meanings |= {
            key: f"{TEXTS['carried'][key]}; {told[key]} returns them"
            for key in told.keys() & meanings
        }
    if controller:
        meanings |= law_meanings(controller.what, meanings)
    elif {"pose", "joints"} <= taken:
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
        compares=custom,
    )


def _without_status(given: Program) -> Program:
    """Return a program without its last output, all others the same to the bit."""
    symbols = given.function.sx_in()
    results = given.function.call(symbols)[:-1]
    return Program.of(given.name, symbols, given.inputs, results, given.outputs[:-1])


def _table(
    robot: Manipulator, name: str, base: Identified | None, controller: Controller | Custom | None
) -> NumberTable:
    """Return the machine's own numbers for a shared input, or a controller's parameters."""
    if isinstance(controller, Custom):
        values = controller.law(robot).numbers[f"law_{name}"].ravel()
        names = tuple(f"{name}_{k}" for k in range(1, len(values) + 1))
        return NumberTable(f"{controller.what}_{name}", TEXTS["tables"]["own"], names, values)
    comment = TEXTS["tables"][name]
    if name == "gains":
        assert controller is not None
        law = controller.law(robot)
        return NumberTable(f"{controller.what}_gains", comment, law.gain_names, law.gains)
    if name == "drives":
        return NumberTable(name, comment, drive_names(robot), drive_numbers(robot))
    if base is not None:
        verdict = f" Verdict of the identification: {base.grade}." if base.grade else ""
        return NumberTable(name, comment + verdict, base.comments, base.values)
    return NumberTable(name, comment, parameter_names(robot), parameters(robot))


def _states(
    robot: Manipulator,
    ports: Sequence[Port],
    fixed: dict[str, Array],
    controller: Controller | Custom | None,
) -> list[list[Array]]:
    """Return inputs at three random poses in reach, and far out of it."""
    rng = np.random.default_rng(1)
    states = []
    law = controller.law(robot) if controller else None
    # Where the joints are given a pose is but next to theirs.
    apart = 1e-3 if "joints" in {port.name for port in ports} else 0.0
    for pose in random_poses(robot, 3, seed=rng):
        at_drives = to_readings(robot, inverse_kinematics(robot, pose))
        known = {"pose": pose + apart, "joints": at_drives, "motors": at_drives, **fixed}
        if law:
            start = law.memory(pose, np.zeros_like(pose))
            known["memory"] = start + 1e-3 * rng.normal(size=start.shape)
        states.append(
            [np.array(known.get(port.name, rng.normal(size=port.shape))) for port in ports]
        )
    beyond = [
        value + 100.0 * np.arange(1, len(value) + 1) if port.name in ("pose", "joints") else value
        for port, value in zip(ports, states[0], strict=True)
    ]
    return [*states, beyond]


def _evaluated(given: Program, graph: Graph, inputs: list[Array]) -> Example:
    values = given.function.call([np.reshape(value, (-1, 1)) for value in inputs])
    results = tuple(np.array(value).ravel("F") for value in values)
    if given.name == "direct_kinematics":  # of several poses one will do
        poses = results[0].reshape(given.outputs[0].shape)
        status = 0 if np.isfinite(poses).all(axis=1).any() else 1
        return Example(tuple(inputs), results, status, _gains(given, inputs, results))
    # What a machine has not is NaN throughout.
    computed = [
        value[[graph.nodes[k].operation != CONSTANT for k in nodes]]
        for value, nodes in zip(results, graph.outputs, strict=True)
    ]
    finite = np.isfinite(np.concatenate(computed)).all()
    return Example(tuple(inputs), results, 0 if finite else 1, _gains(given, inputs, results))


def _gains(given: Program, inputs: list[Array], results: tuple[Array, ...]) -> tuple[float, ...]:
    """Return the gains of an example, from inputs changed at random by a small share."""
    rng = np.random.default_rng(0)
    gains = np.ones(len(results))
    for _ in range(_CHANGES):
        changed = [v * (1.0 + _CHANGE * rng.choice([-1.0, 1.0], np.shape(v))) for v in inputs]
        values = given.function.call([np.reshape(value, (-1, 1)) for value in changed])
        for k, (value, result) in enumerate(zip(values, results, strict=True)):
            columns = (-1, given.outputs[k].shape[-1] if len(given.outputs[k].shape) > 1 else 1)
            size = np.abs(np.nan_to_num(result)).reshape(columns).max(axis=0, initial=0.0)
            change = np.nan_to_num(np.array(value).ravel("F") - result).reshape(columns)
            share = np.abs(change).max(axis=0, initial=0.0) / np.maximum(size, 1e-300)
            gains[k] = max(gains[k], float(share.max(initial=0.0)) / _CHANGE)
    return tuple(gains.tolist())
