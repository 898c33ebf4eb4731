"""`compile`: a machine's function, such as its inverse dynamics, made executable on a target."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any, Literal, Protocol, get_args, runtime_checkable

import casadi as ca
import numpy as np

from pteron.equations.drives import drive_numbers
from pteron.equations.machine import numbers
from pteron.equations.topology import stored_numbers
from pteron.equations.transmissions import actuator_numbers
from pteron.errors import ModelError
from pteron.kernels.c import Compiled
from pteron.kernels.cuda import DeviceKernel
from pteron.kernels.fields import Exact
from pteron.kernels.hoisting import hoist_invariants
from pteron.kernels.intervals import Boxed
from pteron.kernels.jax import Traced
from pteron.kernels.kernel import Array, Kernel
from pteron.kernels.numba import Jitted
from pteron.kernels.program_cache import Program
from pteron.kernels.programs import (
    BY_CASES,
    Columns,
    general_program,
    geometry_only,
    program,
    specialise_program,
)
from pteron.kernels.vm import VirtualMachine
from pteron.manipulator import Manipulator, RobotLike, as_manipulator, parameters

TARGETS: dict[str, type[Kernel]] = {
    "vm": VirtualMachine,
    "numba": Jitted,
    "c": Compiled,
    "jax": Traced,
    "cuda": DeviceKernel,
    "exact": Exact,
    "intervals": Boxed,
}
"""Executors of a function, by name: CasADi's virtual machine, Numba, C, JAX, CUDA, fractions,
intervals."""

Grade = Literal["specialised", "parametric", "general"]
"""Numbers folded into the code: all of the machine's, its geometry and gravity, or none."""

FIXED: dict[str, Callable[[Manipulator], Array]] = {
    "parameters": parameters,
    "drives": drive_numbers,
    "actuators": actuator_numbers,
    "geometry": lambda robot: np.array(numbers(robot)),
    "stored": lambda robot: np.array(stored_numbers(geometry_only(robot))),
}
"""The inputs that have a machine's own values unless a call gives others."""

_TRANSPARENT = ("jax", "exact")
"""Targets whose numbers may be traced or fractions, and enter the code unconverted."""

_DOUBLE = ("vm", "numba", "exact", "intervals")
"""Targets that compute in double precision alone."""


@runtime_checkable
class Selects(Protocol):
    """A choice of base parameters, such as `pteron.reduction.BaseParameters`."""

    @property
    def robot(self) -> Manipulator:
        """The machine that the base parameters belong to."""

    @property
    def selection(self) -> Array:
        """The 0/1 matrix (N, rank) with base regressor = regressor @ selection."""

    def values(self, robot: Manipulator | None = None) -> Array:
        """Return the values of the base parameters (rank,), SI units."""


def compile(
    robot: RobotLike,
    what: str,
    target: str = "vm",
    *,
    base: Selects | None = None,
    wrench: bool = False,
    grade: Grade = "specialised",
    dtype: str = "float64",
    threads: int = 1,
    fast: bool = False,
) -> Kernel:
    """Return a kernel: a numeric function of a machine compiled for a target.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    what : str
        A function's name: `"inverse_dynamics"`, `"jacobian"`, ...; `pteron.kernels.FUNCTIONS` has
        them all.
    target : {"vm", "numba", "c", "jax", "cuda", "exact", "intervals"}
        What executes it: CasADi's virtual machine, ready at once; Numba; the machine's C compiler,
        fastest, from Python too; JAX, which differentiates and runs on accelerators; an NVIDIA GPU,
        one thread a state, on arrays of CuPy, PyTorch or JAX; fractions; intervals, which take
        boxes of states and give proved bounds.
    base : BaseParameters, optional
        For `"inverse_dynamics"`, `"drive_forces"`, `"feed_forward"`, `"joint_feed_forward"`:
        compute from these base parameters alone, in the cheapest form that they allow (see
        `pteron.reduction.cheapest_parameters`). For `"base_regressor"`: whose columns.
    wrench : bool
        For these, `"forward_dynamics"` and `"drive_accelerations"`: whether a wrench on the
        platform is an input too, after the state.
    grade : {"specialised", "parametric", "general"}
        What is folded into the code: all of the machine's numbers, for fewest operations; its
        geometry and gravity, so that inertial parameters are an input; or nothing, so that one
        compilation serves every machine of that topology. The inputs in question are fixed to the
        machine's own values, so that a kernel of any grade is called alike; a call may give others,
        by name: `kernel(pose, velocity, acceleration, parameters=values)`.
    dtype : {"float64", "float32"}
        Of the numbers; `"float32"` for C, JAX and CUDA.
    threads : int
        Threads that share a large batch (not for JAX and CUDA, which have their own).
    fast : bool
        For CUDA: whether products and sums are contracted to fused operations. The results then
        differ from those of other targets by rounding.

    Returns
    -------
    Kernel
        Called with the same arrays as the function (without `robot`); it has `operations`,
        `inputs`, `outputs` and `source`. It does not check poses: NaN where out of reach. All
        float64 targets but JAX return the same bits; CUDA but for its arctangents. C, Numba and
        CUDA compile at the first call, which takes from half a second to some seconds; the result
        is kept in the user's cache directory (`PTERON_CACHE` names another; CUDA's is CuPy's).

    Raises
    ------
    ModelError
        If there is no such function, target, grade or dtype, or `base` is missing or out of place;
        in a call, if the target's compiler or library is not installed.

    Examples
    --------
    >>> import pteron
    >>> robot = pteron.load("quadrupteron")
    >>> kernel = pteron.compile(robot, "inverse_dynamics")
    >>> kernel.operations, [port.name for port in kernel.inputs]
    (385, ['pose', 'velocity', 'acceleration'])
    >>> kernel = pteron.compile(robot, "inverse_dynamics", grade="parametric")
    >>> kernel.operations, [port.name for port in kernel.ports]
    (409, ['pose', 'velocity', 'acceleration', 'parameters'])
    """
    robot = as_manipulator(robot)
    if target not in TARGETS:
        raise ModelError(f"target: {target!r} is not known; choose from {', '.join(TARGETS)}")
    if grade not in get_args(Grade):
        raise ModelError(f"grade: {grade!r} is not one of {', '.join(get_args(Grade))}")
    allowed = ("float64",) if target in _DOUBLE else ("float64", "float32")
    if dtype not in allowed:
        raise ModelError(f'dtype: {dtype!r} given, target "{target}" has {", ".join(allowed)}')
    if threads < 1:
        raise ModelError(f"threads: {threads} given, 1 or more expected")
    if fast and target != "cuda":
        raise ModelError(f'fast: target "{target}" has no fused operations; only "cuda"')
    options = wrench, grade, dtype, threads, fast
    if base is None:
        return _cached_kernel(robot, what, target, None, None, *options)
    if grade == "general":
        raise ModelError('base: a choice for one machine; use grade "specialised" or "parametric"')
    if not same_layout(base.robot, robot):
        raise ModelError(OTHER_LAYOUT.format(base.robot.name, robot.name))
    columns = columns_of(base)
    base_values = tuple(base.values(robot).tolist())
    return _cached_kernel(robot, what, target, columns, base_values, *options)


OTHER_LAYOUT = (
    "base: belongs to {}, whose layout or gravity differ from those of {}; ask for base_parameters "
    "of this one"
)


def columns_of(base: Selects) -> Columns:
    """Return, for each base parameter, the indices of the inertial parameters it adds up."""
    return tuple(tuple(np.flatnonzero(column).tolist()) for column in base.selection.T)


@lru_cache(maxsize=512)
def _cached_kernel(
    robot: Manipulator,
    what: str,
    target: str,
    columns: Columns | None,
    base_values: tuple[float, ...] | None,
    wrench: bool,
    grade: Grade,
    dtype: str,
    threads: int,
    fast: bool,
) -> Kernel:
    """Return the kernel of a function for a target, cached, its parameters fixed inputs."""
    folded = grade == "specialised"
    built = program(robot, what, columns, wrench=wrench, plain=folded)
    fixed: dict[str, Array] = {}
    for port in built.inputs:
        if port.name in FIXED:
            fixed[port.name] = FIXED[port.name](robot)
        elif port.name == "base_parameters":
            fixed[port.name] = np.array(base_values)
    derived: dict[str, ca.Function] = {}
    if folded:
        built, fixed = specialise_program(built, fixed), {}
    elif base_values is not None and target not in _TRANSPARENT and "base_parameters" in fixed:
        # Operations on base parameters alone are evaluated once.
        built, derived["base_parameters"] = hoist_invariants(built, "base_parameters")
        fixed["base_parameters"] = np.array(derived["base_parameters"](base_values)).ravel()
    elif grade == "general":
        if wrench:
            raise ModelError('wrench: not with grade "general"; use "specialised" or "parametric"')
        if what in BY_CASES:
            raise ModelError(
                f"grade: {what!r} has other equations where a machine's numbers are zero, so that "
                'no topology shares it; use "specialised" or "parametric"'
            )
        built = general_program(robot, what)
        own = {port.name for port in built.inputs} & {"geometry", "stored"}
        fixed |= {name: FIXED[name](robot) for name in own}
    for array in fixed.values():
        array.setflags(write=False)  # the kernel is shared by all who ask for it
    kernel = _instantiate_kernel(TARGETS[target], built, fixed, dtype, threads)
    if isinstance(kernel, DeviceKernel):
        kernel.fast = fast
    kernel.made.update(derived)
    return kernel


def _instantiate_kernel(
    kind: type[Kernel], built: Program, fixed: dict[str, Array], dtype: str, threads: int
) -> Kernel:
    """Return a kernel of class `kind` for a program, with fixed inputs moved to the end."""
    # Fixed inputs come last, so that a call may append them to what it is given.
    order = sorted(range(len(built.inputs)), key=lambda k: built.inputs[k].name in fixed)
    if order != sorted(order):
        symbols, inputs = built.function.sx_in(), [built.inputs[k] for k in order]
        outputs, reordered = built.function.call(symbols), [symbols[k] for k in order]
        built = Program.from_expressions(built.name, reordered, inputs, outputs, built.outputs)
    return kind(built.name, built.function, built.inputs, built.outputs, fixed, dtype, threads)


def same_layout(one: RobotLike, other: RobotLike) -> bool:
    """Return whether two machines have equal layout and gravity, hence equal base parameters."""
    return _layout(as_manipulator(one)) == _layout(as_manipulator(other))


def _layout(robot: Manipulator) -> tuple[Any, ...]:
    """Return the data that base parameters depend on: no inertia, guide points or elbows."""
    legs = [
        (
            leg.type,
            leg.platform_point,
            *(tuple(q.value) for q in leg.quantities if q.role in ("direction", "length")),
        )
        for leg in robot.legs
    ]
    platform = robot.platform
    platform_data = platform.motion, platform.frame, platform.angle_order, platform.second_axis
    return (*platform_data, robot.gravity, *legs)
