"""A controller's law linearised where the machine is as it is wanted, from the law's expression."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from pteron.controllers import Law
from pteron.equations.drives import drive_numbers
from pteron.kernels import Array, Columns, geometry_only, program
from pteron.kernels.targets import columns_of
from pteron.kinematics import inverse_kinematics, joint_rates
from pteron.manipulator import Manipulator, parameters
from pteron.motion.tuning.linear_plant import with_linear_drives

_ASIDE = 1e-9
"""Size of what is learnt where a law is linearised, as a share of its bound: at zero that has no
derivative."""


@dataclass(frozen=True)
class LinearLaw:
    """A controller linearised at a state: m' = A m + B (q, q'), F = C m + D (q, q') per sample.

    All are small changes: of its memory, m (K,) and m' at the next sample, of the measured joints
    and their rates, (2 n,), and of the forces F (n,) that it asks for.
    """

    matrix: Array
    inputs: Array
    outputs: Array
    feedthrough: Array


def linearised_law(law: Law, pose: Array, velocity: Array, acceleration: Array) -> LinearLaw:
    """Return a control law linearised at a reference state, (m,) each, measured without error.

    The derivatives are exact. Dry friction is neglected, as in the linear plant.
    """
    model, size = law.model, law.model.freedom
    memory = law.memory(pose, velocity)
    memory[2 * size :] = _ASIDE * law.gains[-1] / np.sqrt(max(len(memory) - 2 * size, 1))
    if law.what != "pd_gravity":
        acceleration_slots = (
            slice(0, size) if law.what == "feed_forward_pd" else slice(size, 2 * size)
        )
        memory[acceleration_slots] = acceleration
    inputs = {
        "pose": pose,
        "velocity": velocity,
        "acceleration": acceleration,
        "memory": memory,
        "joints": inverse_kinematics(model, pose),
        "gains": law.gains,
        "joint_rates": joint_rates(model, pose, velocity).actuated,
        "parameters": parameters(model),
        "drives": drive_numbers(with_linear_drives(model)),
    }
    columns = None if law.base is None else columns_of(law.base)
    function = _derivatives(geometry_only(model), law.what, columns)
    derivatives = function(*(inputs[name] for name in function.name_in()))
    by_memory, by_joints = (np.asarray(part, dtype=float) for part in derivatives)
    n = model.joint_count
    return LinearLaw(by_memory[n:], by_joints[n:], by_memory[:n], by_joints[:n])


@lru_cache(maxsize=16)
def _derivatives(robot: Manipulator, what: str, columns: Columns | None) -> ca.Function:
    """Return a CasADi function: Jacobians of (forces, next memory) by memory and measurements."""
    law_program = program(robot, what, columns, plain=True)
    names = [port.name for port in law_program.inputs]
    symbols = dict(zip(names, law_program.function.sx_in(), strict=True))
    results = ca.vertcat(
        *(ca.vec(part) for part in law_program.function.call(list(symbols.values())))
    )
    measured = ca.vertcat(symbols["joints"], symbols["joint_rates"])
    parts = [ca.cse(ca.jacobian(results, by)) for by in (symbols["memory"], measured)]
    return ca.Function("derivatives", list(symbols.values()), parts, names, ["m", "q"])
