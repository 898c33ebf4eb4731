"""A machine's motion under its drives' forces, in steps of Runge and Kutta's fourth-order method.

The equations are those of `drive_accelerations`. In C all steps are one loop without calls from
Python; in a batch each lane of a vector register holds a machine. Without a C compiler NumPy makes
the same steps, to the same bits, with accelerations from CasADi's virtual machine.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pteron.equations.drives import Drives
from pteron.kernels.c import Code, c_language, compiler, module_of
from pteron.kernels.choice import VARIABLE
from pteron.kernels.code import module_values
from pteron.kernels.exponential import straight
from pteron.kernels.graph import graph_of
from pteron.kernels.kept import Program
from pteron.kernels.kernel import Array, ArrayKernel, Port
from pteron.kernels.programs import bare, program
from pteron.kernels.targets import FIXED
from pteron.kernels.vm import VirtualMachine
from pteron.manipulator import Manipulator

_STATE = ("pose", "velocity")

_SPAN = Port("steps", (2,), shared=True)
"""The input with the length of a step, s, and the number of steps."""


class Steps(ArrayKernel):
    """Steps of a machine, or of a batch of machines that differ in their numbers alone.

    It takes pose, velocity, forces of the drives, where asked a wrench, and `steps`, the length of
    a step in s and how many there are: an array of two numbers. It returns pose and velocity at
    the end, and how many steps were made: fewer where a state on the way was out of reach or
    singular (type I), and there the last state before. Forces and wrench stay as they are.

    Parameters
    ----------
    robot : Manipulator
        The machine; its inertial parameters may be given in a call, by name, and its drives, which
        then have no Stribeck friction where the machine's have none.
    wrench : bool
        Whether a wrench on the platform is an input too.
    """

    _strided = True

    def __init__(self, robot: Manipulator, *, wrench: bool) -> None:
        stribeck = any(leg.drive and leg.drive.stribeck for leg in robot.legs)
        self._code = _code(bare(robot), wrench, stribeck)
        built = self._code.built
        fixed = {port.name: FIXED[port.name](robot) for port in built.inputs if port.shared}
        super().__init__("steps", built.function, self._code.ports, self._code.outputs, fixed)
        self._rates = VirtualMachine(built.name, built.function, built.inputs, built.outputs, fixed)

    @property
    def is_compiled(self) -> bool:
        """Whether C makes the steps."""
        return os.environ.get(VARIABLE) != "vm" and compiler() is not None

    @property
    def source(self) -> str:
        """The C code."""
        return self._code.source

    def _evaluate(self, *values: ArrayLike, **fixed: ArrayLike) -> Any:
        if not self.is_compiled:
            return self.checked(*values, **fixed)
        self.call = self._code.bound(self.fixed, self.checked)
        return self.call(*values, **fixed)

    def _run(self, batch: int, inputs: Sequence[Array], outputs: Sequence[Array]) -> None:
        if self.is_compiled:
            self._code.module.run(*inputs, *outputs)
            return
        given = {port.name: value for port, value in zip(self.ports, inputs, strict=True)}
        step, most = given[_SPAN.name].tolist()
        old, done = [given[name] for name in _STATE], np.zeros(batch)
        for _ in range(int(most)):
            new, good = self._step(given, old, step)
            old = [np.where(good[:, None], *pair) for pair in zip(new, old, strict=True)]
            done += good
            if not good.any():
                break
        for whole, part in zip(outputs, [*old, done[:, None]], strict=True):
            whole[:] = part

    def _step(
        self, given: dict[str, Array], old: list[Array], step: float
    ) -> tuple[list[Array], Array]:
        """Return the state after a step, and where all that it met was sound."""
        batch, freedom = old[0].shape
        at, total = old, [np.zeros_like(part) for part in old]
        good = np.ones(batch, dtype=bool)
        for ahead, weight in zip(
            (0.5 * step, 0.5 * step, step, 0.0),
            (step / 6.0, step / 3.0, step / 3.0, step / 6.0),
            strict=True,
        ):
            state = given | dict(zip(_STATE, at, strict=True))
            growth, status = np.empty((batch, freedom)), np.empty((batch, 1))
            inputs = [np.ascontiguousarray(state[port.name]) for port in self._rates.ports]
            self._rates._run(batch, inputs, [growth, status])
            good &= status[:, 0] != 0.0
            rates = at[1], growth
            total = [part + weight * rate for part, rate in zip(total, rates, strict=True)]
            at = [part + ahead * rate for part, rate in zip(old, rates, strict=True)]
        return [part + more for part, more in zip(old, total, strict=True)], good


class _Code(Code):
    """The C code of the steps of a layout."""

    def __init__(self, built: Program) -> None:
        self.built = built
        states = [port for port in built.inputs if not port.shared]
        numbers = [port for port in built.inputs if port.shared]
        self.outputs = (*(port for port in states if port.name in _STATE), Port("done", ()))
        inputs = (*states, _SPAN, *numbers)
        super().__init__("steps", built.function, inputs, self.outputs)

    @cached_property
    def source(self) -> str:
        """The C code."""
        built = self.built
        graph = graph_of(straight(built.function), built.inputs)
        language = c_language(self.dtype)
        values = module_values(self.name, graph, built.inputs, built.outputs, language)
        freedom = built.outputs[0].size
        values |= {"inputs": self.ports, "outputs": self.outputs}
        values |= {"freedom": freedom, "status": freedom}
        return module_of("steps.c.j2", values, self.dtype)


@lru_cache(maxsize=64)
def _code(layout: Manipulator, wrench: bool, stribeck: bool) -> _Code:
    """Return the code that machines of one layout share, whatever their numbers."""
    built = program(layout, "drive_accelerations", wrench=wrench, guarded=True)
    return _Code(built if stribeck else _without_stribeck(built))


def _without_stribeck(built: Program) -> Program:
    """Return the program for drives that lose no friction as they move: a sixth of it, saved."""
    symbols = built.function.sx_in()
    k = [port.name for port in built.inputs].index("drives")
    parts = Drives.of(symbols[k])
    given = list(symbols)
    given[k] = ca.vertcat(*parts._replace(stribeck=ca.SX.zeros(*parts.stribeck.shape)))
    names = built.function.name_in(), built.function.name_out()
    outputs = ca.cse(built.function.call(given))
    return replace(built, function=ca.Function(built.name, symbols, outputs, *names))


@lru_cache(maxsize=64)
def steps(robot: Manipulator, *, wrench: bool = False) -> Steps:
    """Return the steps of a machine; see `Steps`."""
    return Steps(robot, wrench=wrench)
