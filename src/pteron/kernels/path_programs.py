"""Three kernels for the direct kinematics of machines whose platforms tilt.

`path_kernel` makes a step along a path from a known pose of another machine, `rows_kernel` returns
the residuals of a pose's closures and their slopes, both for a kind of closures (see
`equations.pose_paths`); `spheres_kernel` returns the spheres on which given joint coordinates hold
the platform points of one machine.
"""

from __future__ import annotations

from functools import lru_cache

import casadi as ca

from pteron.equations.closing import held_spheres
from pteron.equations.machine import Machine
from pteron.equations.pose_paths import Closed, PathState, advance_path, numbers, rows
from pteron.kernels.choice import TieredKernel, tiered_kernel
from pteron.kernels.program_cache import Program
from pteron.kernels.programs import geometry_only
from pteron.manipulator import Manipulator

Parts = tuple[tuple[float, ...], tuple[float, ...]]
"""Real and imaginary parts of the numbers of the machine that a path starts from."""


@lru_cache(maxsize=8)
def path_kernel(closed: Closed, start: Parts | None) -> TieredKernel:
    """Return the kernel of one step of the path tracker between machines of a closure kind.

    It maps a `PathState` to the next one. With a start machine, its numbers are constants in the
    kernel, and the target machine is a real input. With start None both machines are complex
    inputs: real parts first.
    """
    count = closed.numbers

    def build() -> Program:
        """Build the program of a path step: from a path state to the next, with its correction."""
        at = ca.SX.sym("at", closed.path_state_size)
        ends, inputs = [], {"at": at}
        for name, fixed in (("start", start), ("target", None)):
            if fixed is not None:
                ends.append(numbers(*(ca.SX(list(part)) for part in fixed)))
                continue
            real = start is not None
            inputs[name] = ca.SX.sym(name, count if real else 2 * count)
            ends.append(numbers(inputs[name][:count], None if real else inputs[name][count:]))
        after, correction = advance_path(
            closed, ends[0], ends[1], PathState.from_vector(at, closed)
        )
        return Program.from_named_expressions(
            "path_step", inputs, {"after": after.vector(), "left": correction}
        ).optimise()

    return tiered_kernel(("path_step", *closed, start), build)


@lru_cache(maxsize=8)
def rows_kernel(closed: Closed) -> TieredKernel:
    """Return the kernel of the closure equations' residuals and Jacobian at a real z."""

    def build() -> Program:
        """Build the program of the closure equations' Jacobian and residuals at z."""
        z, machine = ca.SX.sym("z", closed.size), ca.SX.sym("machine", closed.numbers)
        slopes, missed = rows(closed, numbers(machine), numbers(z))
        return Program.from_named_expressions(
            "path_rows", {"z": z, "machine": machine}, {"rows": slopes, "missed": missed}
        ).optimise()

    return tiered_kernel(("path_rows", *closed), build)


def spheres_kernel(robot: Manipulator) -> TieredKernel:
    """Return the kernel of centres and squared radii of the spheres that joints hold points on."""
    return _spheres(geometry_only(robot))


@lru_cache(maxsize=64)
def _spheres(robot: Manipulator) -> TieredKernel:
    """Return the kernel of spheres (centre, squared radius) at joint coordinates, cached."""

    def build() -> Program:
        """Build the program of the spheres' centres and squared radii at joint coordinates."""
        joints = ca.SX.sym("joints", robot.joint_count)
        centers, squares = held_spheres(Machine.numeric(robot), joints)
        return Program.from_named_expressions(
            "held_spheres", {"joints": joints}, {"centers": centers, "squares": squares}
        ).optimise()

    return tiered_kernel(("held_spheres", robot), build)
