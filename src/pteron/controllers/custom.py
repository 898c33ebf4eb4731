"""`Custom`: a controller of one's own, written as a CasADi function, in the simulation's loop."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pteron.controllers.joint_numbers import period_of
from pteron.errors import DataError, shorten
from pteron.kernels import Array, Port, Program, as_array
from pteron.kernels.code import C
from pteron.kernels.exponential import with_lowered_exponentials
from pteron.kernels.graph import graph_of
from pteron.kernels.loop_code import LOOP_INPUTS
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.toml import joined_faults

_REFERENCE = ("pose", "velocity", "acceleration")
_MEMORY = ("memory", "next_memory")


@dataclass(frozen=True, eq=False)
class Custom:
    """A controller's law written as a CasADi function, which becomes C in the loop of `simulate`.

    The function's inputs have names. Readings are `joints` and `joint_rates` (n,), what drives tell
    a controller, and `motors` and `motor_rates` (n,), of encoders at motors, counted at the joints;
    the reference is `pose`, `velocity`, `acceleration` (m,); what it kept at the last sample is
    `memory` (K,); every other one is a parameter, whose numbers are given. Its outputs are
    `forces` (n,) and, where it has a memory, `next_memory` (K,).

    Parameters
    ----------
    function : casadi.Function
        Of plain operations, for which `casadi_functions(robot)` of `pteron.export` has a machine's
        kinematics and dynamics.
    period : float
        Time between two samples, for which forces are held, s.
    parameters : dict of array
        Numbers of the inputs that are neither readings, reference nor memory.
    memory : array, shape (K,), or callable
        What it keeps before the first sample: numbers, or (pose, velocity) -> numbers.

    Raises
    ------
    DataError
        If the function needs what no sensor gives, has other outputs, or operations that C has not.

    Examples
    --------
    >>> import casadi as ca, numpy as np, pteron
    >>> from pteron.controllers import Custom
    >>> from pteron.motion import simulate
    >>> q, rate, stiffness = ca.SX.sym("q", 3), ca.SX.sym("rate", 3), ca.SX.sym("k")
    >>> spring = ca.Function(
    ...     "spring", [q, rate, stiffness], [-stiffness * q - 20 * rate],
    ...     ["joints", "joint_rates", "stiffness"], ["forces"],
    ... )
    >>> controller = Custom(spring, parameters={"stiffness": 500.0})
    >>> rest = np.zeros(3)
    >>> simulate("tripteron", None, controller, start=(rest, rest), duration=0.1)
    <Simulation of 'tripteron': 0.1 s, 101 samples>
    """

    function: ca.Function
    period: float = 1e-3
    parameters: Mapping[str, ArrayLike] = field(default_factory=dict)
    memory: ArrayLike | Callable[[Array, Array], ArrayLike] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.function, ca.Function):
            raise DataError(f"function: {shorten(self.function)} given, a casadi.Function expected")
        object.__setattr__(self, "period", period_of(self.period))
        parameter_names, faults = set(self.parameters), []
        names = self.function.name_in(), self.function.name_out()
        unknown = [name for name in names[0] if name not in {*LOOP_INPUTS, *parameter_names}]
        if unknown:
            faults.append(
                f"{', '.join(unknown)}: no sensor gives it; there are the readings joints, "
                "joint_rates, motors, motor_rates, the reference pose, velocity, acceleration, and "
                "memory; for a parameter give its numbers in `parameters`"
            )
        faults += [
            f"parameters: {n}: no input has that name" for n in parameter_names - set(names[0])
        ]
        faults += [
            f"parameters: {n}: is a reading or the reference"
            for n in parameter_names & set(LOOP_INPUTS)
        ]
        needed = ["forces", *_MEMORY[1:]] if _MEMORY[0] in names[0] else ["forces"]
        if sorted(names[1]) != sorted(needed):
            faults.append(f"outputs: {', '.join(names[1])} given, {', '.join(needed)} expected")
        if faults:
            raise DataError(f"controller: {joined_faults(faults)}")
        _ = self._program

    @property
    def law_name(self) -> str:
        """The name of the user's CasADi function."""
        return str(self.function.name())

    def law(self, model: RobotLike) -> CustomLaw:
        """Return the control law of this controller for a machine, after checks of sizes.

        Raises
        ------
        DataError
            If an input or an output has not as many numbers as the machine has joints or
            coordinates.
        """
        model = as_manipulator(model)
        sizes = dict.fromkeys(LOOP_INPUTS, model.joint_count) | {"forces": model.joint_count}
        sizes |= dict.fromkeys(_REFERENCE, model.freedom)
        for name in _MEMORY:
            sizes.pop(name, None)
        ports = (*self._program.inputs, *self._program.outputs)
        wrong = [
            f"{port.name}: {port.size} numbers, {sizes[port.name]} expected"
            for port in ports
            if port.size != sizes.get(port.name, port.size)
        ]
        if wrong:
            raise DataError(f"controller: {joined_faults(wrong)} for {model.name}")
        return CustomLaw(self, model)

    @cached_property
    def _program(self) -> Program:
        """The user's function as a program with inputs as columns and outputs sorted by name."""
        try:
            function = self.function.expand()
        except RuntimeError:
            raise DataError(
                "controller: its function is not one of plain operations alone (expand() fails); "
                "leave out what iterates or calls other programs"
            ) from None
        # Each input and output is a column, and forces come first.
        columns = [
            ca.SX.sym(name, function.numel_in(k)) for k, name in enumerate(function.name_in())
        ]
        symbols = zip(columns, function.sx_in(), strict=True)
        outputs = function.call([ca.reshape(column, *like.shape) for column, like in symbols])
        by_name = dict(zip(function.name_out(), outputs, strict=True))
        names = sorted(by_name)
        function = ca.Function(
            function.name(), columns, [ca.vec(ca.densify(by_name[name])) for name in names],
            function.name_in(), names,
        )  # fmt: skip
        function = with_lowered_exponentials(function)
        graph = graph_of(function)
        missing = sorted({graph.nodes[k].operation for k in graph.operations()} - {*C})
        if missing:
            codes = {str(getattr(ca, name)): name[3:] for name in dir(ca) if name.startswith("OP_")}
            raise DataError(
                f"controller: {', '.join(codes.get(code, code).lower() for code in missing)} "
                f"cannot be C here; there are {', '.join(C)}, tanh, sign and tan"
            )
        input_ports = tuple(
            Port(name, (function.numel_in(k),), name in self.parameters)
            for k, name in enumerate(function.name_in())
        )
        output_ports = tuple(
            Port(name, (function.numel_out(k),)) for k, name in enumerate(function.name_out())
        )
        return Program(function.name(), function, input_ports, output_ports)


@dataclass(frozen=True, eq=False)
class CustomLaw:
    """The law of a `Custom` controller for one machine, which runs in the loop alone."""

    controller: Custom
    model: Manipulator

    @property
    def program(self) -> Program:
        """The control law as a program, for `pteron.kernels.loops.Loop`."""
        return self.controller._program

    @property
    def numbers(self) -> dict[str, Array]:
        """The law's parameters as arrays by name, for `pteron.kernels.loops.Loop.run`."""
        return {
            f"law_{port.name}": _port_numbers(self.controller.parameters[port.name], port)
            for port in self.program.inputs
            if port.shared
        }

    def memory(self, pose: Array, velocity: Array) -> Array:
        """Return the controller's initial memory (K,) at a pose and velocity of the platform."""
        initial = self.controller.memory
        numbers = initial(pose, velocity) if callable(initial) else initial
        size = sum(port.size for port in self.program.inputs if port.name == _MEMORY[0])
        return _port_numbers(numbers, Port(_MEMORY[0], (size,))).ravel()


def _port_numbers(array: ArrayLike, port: Port) -> Array:
    """Return an input's numbers as (1, 1, size), matrices by columns; raise if of wrong size."""
    column = as_array(array, port.name, ()).ravel("F")
    if column.size != port.size or not np.isfinite(column).all():
        raise DataError(
            f"controller: {port.name}: {shorten(array)} given, {port.size} finite numbers expected"
        )
    return column.reshape(1, 1, -1)
