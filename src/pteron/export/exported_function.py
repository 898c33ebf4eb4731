"""A function as code needs it: its graph with names, meanings, the machine's values, test vectors.

The choice of functions is in `pteron.export.functions`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pteron.controllers import Controller, Custom
from pteron.equations.drives import drive_names, drive_numbers
from pteron.equations.machine import Machine
from pteron.errors import ModelError
from pteron.export.command_units import DRIVEN, Output, convert_forces, convert_joints
from pteron.export.descriptions import TEXTS, law_meanings, port_meaning
from pteron.export.identified_parameters import Identified, base_program
from pteron.export.node_names import node_names
from pteron.export.tools import tool_tables
from pteron.kernels import (
    LOADED,
    REDUCIBLE,
    SELECTED,
    Array,
    Graph,
    Port,
    Program,
    graph_of,
    program,
    specialise_program as with_values,
)
from pteron.kernels.graph import CONSTANT
from pteron.kinematics import inverse_kinematics, random_poses
from pteron.manipulator import Manipulator, parameter_names, parameters
from pteron.manipulator.readings import to_readings

PAYLOAD = "set_payload"
"""The function that returns the parameters with those of a payload added."""

BASE = "_base"
"""Suffix of the name of a function of base parameters."""

_CHANGE, _CHANGES = 1e-9, 8
"""Share by which inputs of an example are changed to see how its results do, and how many times.

Far above rounding, far below the shares at which results bend."""


@dataclass(frozen=True)
class NumberTable:
    """The machine's values for an argument: in code a constant array to pass."""

    name: str
    comment: str
    names: tuple[str, ...]
    values: Array


@dataclass(frozen=True)
class Example:
    """A test vector: a state, the function's results for it, and its status.

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
class ExportedFunction:
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
        """Whether it returns several poses, as rows, some of which may not exist."""
        return self.name == "direct_kinematics"

    @property
    def operations(self) -> int:
        """Arithmetic operations."""
        return len(self.graph.operations())


@dataclass(frozen=True)
class ExportRequest:
    """A function of a machine that is to be exported, and in which form.

    Attributes
    ----------
    robot, name : Manipulator, str
        The machine, and the function's name in the code.
    identified : Identified, optional
        The machine's identified base parameters.
    specialised : bool
        Whether values are folded into the code.
    tables : bool
        Whether the code can have tables of the machine's own values.
    wrench : bool
        Whether a wrench on the platform is an input.
    output : str
        The unit of the drives' commands.
    controller : Controller or Custom, optional
        Whose law it is.
    """

    robot: Manipulator
    name: str
    identified: Identified | None
    specialised: bool
    tables: bool
    wrench: bool
    output: Output
    controller: Controller | Custom | None

    @property
    def is_custom(self) -> bool:
        """Whether it is the law of a custom controller."""
        return isinstance(self.controller, Custom)

    @property
    def function_name(self) -> str:
        """The function's name without the suffix of base parameters."""
        return self.name if self.is_custom else self.name.removesuffix(BASE)

    @property
    def base(self) -> Identified | None:
        """The base parameters that it takes, if it takes any."""
        if self.name == self.function_name:
            return None
        return self.identified or Identified.from_robot(self.robot)

    def program(self) -> Program:
        """Return its program with joints as drives read them and forces in the drives' units.

        Raises
        ------
        ModelError
            If it takes every body's parameters, which identified base parameters do not give.
        """
        function = self._library_program()
        takes_bodies = "parameters" in {port.name for port in function.inputs}
        if self.identified and not self.is_custom and (takes_bodies or self.name in SELECTED):
            what, based = self.function_name, self.function_name in (*REDUCIBLE, PAYLOAD)
            other = f"ask for {what + BASE}" if based else "leave it out"
            raise ModelError(
                f"functions: {self.name!r} takes every body's parameters, which identified base "
                f"parameters do not tell; {other}, or export the model file that pteron identify "
                "wrote"
            )
        function = convert_joints(function, self.robot)
        if self.is_custom or self.function_name in DRIVEN:
            function = convert_forces(function, self.robot, self.output)
        return function

    def _library_program(self) -> Program:
        """Return the program of the request: a control law, or a function of the library."""
        loaded, base = self.wrench and self.function_name in LOADED, self.base
        if isinstance(self.controller, Custom):
            return self.controller.law(self.robot).program
        if base:
            return base_program(self.function_name, base, wrench=loaded, folded=self.specialised)
        if self.controller:
            return _drop_status(self.controller.law(self.robot).program)
        return program(self.robot, self.function_name, wrench=loaded, named=True)


def exported_function(request: ExportRequest) -> ExportedFunction:
    """Return a function with all that its code needs."""
    robot, controller = request.robot, request.controller
    function = request.program()
    shared = [port.name for port in function.inputs if port.shared]
    tables = tuple(_table(robot, port, request.base, controller) for port in shared)
    numbers = {name: table.values for name, table in zip(shared, tables, strict=True)}
    if request.specialised:
        function, tables = with_values(function, numbers), ()
    elif not request.tables:
        arguments = {port.name for port in function.inputs} & {"parameters", "base_parameters"}
        folded = {key: numbers[key] for key in shared if key not in arguments}
        function, tables = with_values(function, folded), ()
    elif request.function_name == PAYLOAD:
        tables += tuple(NumberTable(*table) for table in tool_tables(robot))
    graph = graph_of(function.function, function.inputs)
    states = _states(robot, function.inputs, numbers, controller)
    taken = {port.name for port in function.inputs}
    # Argument names must differ from those of the results.
    outputs = tuple(
        replace(port, name=f"{port.name}_out") if port.name in taken else port
        for port in function.outputs
    )
    machine = Machine.numeric(robot)
    return ExportedFunction(
        request.name,
        _summary(request, machine, taken, graph),
        graph,
        node_names(machine, function, graph, states[:3]),
        function.inputs,
        outputs,
        _meanings(request, (*function.inputs, *outputs), shared, taken),
        tables,
        tuple(_example_at(function, graph, state) for state in states[1:]),
        compares=request.is_custom,
    )


def _summary(request: ExportRequest, machine: Machine, taken: set[str], graph: Graph) -> str:
    """Return a line on what the function computes, and notes on its results."""
    what = request.function_name
    if request.is_custom:
        return f"{what}, a control law of one's own."
    summary = TEXTS["summaries"].get(
        what, f"{what.replace('_', ' ')}, as pteron.{what}.".capitalize()
    )
    if request.base:
        summary = summary.replace(", from the inertial parameters", "") + " From base parameters."
    if request.name in ("direct_kinematics", "closure_poses"):
        summary += TEXTS["notes"]["modes"]
        return str(summary + ("" if machine.closure.keeps_modes else TEXTS["notes"]["branches"]))
    if "pose" in taken and not {"sqrt", "less"} & {node.operation for node in graph.nodes}:
        summary += " It does not ask whether the legs reach."
    return str(summary)


def _meanings(
    request: ExportRequest, ports: Sequence[Port], shared: Sequence[str], taken: set[str]
) -> dict[str, str]:
    """Return the meanings of inputs and outputs, with their units."""
    robot, what, unit = request.robot, request.function_name, request.output
    meanings: dict[str, str] = {port.name: port_meaning(robot, what, port, unit) for port in ports}
    if request.is_custom:
        readings = {
            name: port_meaning(robot, what, Port(name, (1,)), unit) for name in TEXTS["law"]
        }
        own_tables = {name: f"see the table {what}_{name}" for name in shared}
        meanings = {**readings, **meanings} | own_tables
    if not request.tables:
        makers = {"parameters": PAYLOAD, "base_parameters": PAYLOAD + BASE}
        meanings |= {
            key: f"{TEXTS['carried'][key]}; {makers[key]} returns them"
            for key in makers.keys() & meanings
        }
    if request.controller:
        meanings |= law_meanings(request.controller.law_name, meanings)
    elif {"pose", "joints"} <= taken:
        meanings["pose"] = f"near that of the joints, such as the last: {meanings['pose']}"
    return meanings


def _drop_status(law: Program) -> Program:
    """Return a program without its last output; other results are bitwise equal."""
    symbols = law.function.sx_in()
    results = law.function.call(symbols)[:-1]
    return Program.from_expressions(law.name, symbols, law.inputs, results, law.outputs[:-1])


def _table(
    robot: Manipulator, name: str, base: Identified | None, controller: Controller | Custom | None
) -> NumberTable:
    """Return the machine's values for a shared input, or a controller's parameters."""
    if isinstance(controller, Custom):
        numbers = controller.law(robot).numbers[f"law_{name}"].ravel()
        names = tuple(f"{name}_{k}" for k in range(1, len(numbers) + 1))
        return NumberTable(f"{controller.law_name}_{name}", TEXTS["tables"]["own"], names, numbers)
    comment = TEXTS["tables"][name]
    if name == "gains":
        assert controller is not None
        law = controller.law(robot)
        return NumberTable(f"{controller.law_name}_gains", comment, law.gain_names, law.gains)
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
    """Return inputs at three random poses in reach and at a pose far out of reach."""
    rng = np.random.default_rng(1)
    states = []
    law = controller.law(robot) if controller else None
    # Where the joints are given a pose is but next to theirs.
    offset = 1e-3 if "joints" in {port.name for port in ports} else 0.0
    for pose in random_poses(robot, 3, seed=rng):
        at_drives = to_readings(robot, inverse_kinematics(robot, pose))
        known = {"pose": pose + offset, "joints": at_drives, "motors": at_drives, **fixed}
        if law:
            start = law.memory(pose, np.zeros_like(pose))
            known["memory"] = start + 1e-3 * rng.normal(size=start.shape)
        states.append(
            [np.array(known.get(port.name, rng.normal(size=port.shape))) for port in ports]
        )
    beyond = [
        array + 100.0 * np.arange(1, len(array) + 1) if port.name in ("pose", "joints") else array
        for port, array in zip(ports, states[0], strict=True)
    ]
    return [*states, beyond]


def _example_at(function: Program, graph: Graph, inputs: list[Array]) -> Example:
    """Return a test vector: inputs, results, status (0 valid, 1 invalid), and gains of errors."""
    outputs = function.function.call([np.reshape(array, (-1, 1)) for array in inputs])
    results = tuple(np.array(array).ravel("F") for array in outputs)
    if function.name == "direct_kinematics":  # of several poses one will do
        poses = results[0].reshape(function.outputs[0].shape)
        status = 0 if np.isfinite(poses).all(axis=1).any() else 1
        return Example(tuple(inputs), results, status, _gains(function, inputs, results))
    # What a machine has not is NaN throughout.
    computed = [
        array[[graph.nodes[k].operation != CONSTANT for k in nodes]]
        for array, nodes in zip(results, graph.outputs, strict=True)
    ]
    finite = np.isfinite(np.concatenate(computed)).all()
    return Example(tuple(inputs), results, 0 if finite else 1, _gains(function, inputs, results))


def _gains(function: Program, inputs: list[Array], results: tuple[Array, ...]) -> tuple[float, ...]:
    """Return the gains of an example, from inputs changed at random by a small share."""
    rng = np.random.default_rng(0)
    gains = np.ones(len(results))
    for _ in range(_CHANGES):
        changed = [v * (1.0 + _CHANGE * rng.choice([-1.0, 1.0], np.shape(v))) for v in inputs]
        outputs = function.function.call([np.reshape(array, (-1, 1)) for array in changed])
        for k, (shifted, nominal) in enumerate(zip(outputs, results, strict=True)):
            columns = (
                -1,
                function.outputs[k].shape[-1] if len(function.outputs[k].shape) > 1 else 1,
            )
            size = np.abs(np.nan_to_num(nominal)).reshape(columns).max(axis=0, initial=0.0)
            change = np.nan_to_num(np.array(shifted).ravel("F") - nominal).reshape(columns)
            share = np.abs(change).max(axis=0, initial=0.0) / np.maximum(size, 1e-300)
            gains[k] = max(gains[k], float(share.max(initial=0.0)) / _CHANGE)
    return tuple(gains.tolist())
