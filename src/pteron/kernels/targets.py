"""`compile`: a machine's function made executable on a target."""

from __future__ import annotations

from functools import lru_cache
from typing import Protocol

import numpy as np

from pteron.errors import ModelError
from pteron.kernels.functions import Columns, program
from pteron.kernels.kernel import Array, Kernel
from pteron.kernels.vm import VirtualMachine
from pteron.manipulator import Manipulator, parameters

__all__ = ["TARGETS", "compile"]

TARGETS: dict[str, type[Kernel]] = {"vm": VirtualMachine}
"""The targets by name."""


class Selects(Protocol):
    """A choice of base parameters, such as `pteron.BaseParameters`."""

    @property
    def selection(self) -> Array:
        """(N, rank): base regressor = regressor @ selection."""


def compile(
    robot: Manipulator, what: str, target: str = "vm", *, base: Selects | None = None
) -> Kernel:
    """Compile one of the numeric functions for a machine.

    Parameters
    ----------
    robot : Manipulator
        The machine; its geometry and gravity are folded in, its inertial parameters are inputs of
        the code and fixed to the machine's own in a call.
    what : str
        A function's name: `"inverse_dynamics"`, `"jacobian"`, ...; `pteron.kernels.FUNCTIONS` has
        them all.
    target : str
        What executes it: `"vm"`, CasADi's virtual machine.
    base : BaseParameters, optional
        Which base parameters `"base_regressor"` is for.

    Returns
    -------
    Kernel
        Called with the same arrays as the function (without `robot`); it has `operations`,
        `inputs`, `outputs` and `source`. It does not check poses: NaN where out of reach.

    Raises
    ------
    ModelError
        If there is no such function or target, or `base` is missing or out of place.

    Examples
    --------
    >>> import pteron
    >>> kernel = pteron.compile(pteron.load("quadrupteron"), "inverse_dynamics")
    >>> kernel.operations, [port.name for port in kernel.inputs]
    (385, ['pose', 'velocity', 'acceleration', 'parameters'])
    """
    if target not in TARGETS:
        raise ModelError(f"target: {target!r} is not known; choose from {', '.join(TARGETS)}")
    columns: Columns | None = None
    if base is not None:
        columns = tuple(tuple(np.flatnonzero(column).tolist()) for column in base.selection.T)
    return _compiled(robot, what, target, columns)


@lru_cache(maxsize=512)
def _compiled(robot: Manipulator, what: str, target: str, columns: Columns | None) -> Kernel:
    built = program(robot, what, columns)
    values = parameters(robot)
    values.setflags(write=False)  # the kernel is shared by all who ask for it
    fixed = {port.name: values for port in built.inputs if port.name == "parameters"}
    return TARGETS[target](built.name, built.function, built.inputs, built.outputs, fixed)
