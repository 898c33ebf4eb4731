"""The plant: the motion of machines under their drives' forces."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import ArrayLike

from pteron.arguments import expect
from pteron.dynamics import inverse_dynamics
from pteron.equations.transmissions import DriveKind
from pteron.errors import DataError, shorten
from pteron.kernels import Array, as_array, numeric
from pteron.kernels.kernel import broadcast_lead
from pteron.kernels.loops import Device, Loop, loop
from pteron.kinematics import inverse_kinematics, joint_rates
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion.simulation.machines import Machines
from pteron.shapes import PoseLike

Method = Literal["rk4", "dop853"]
"""Runge and Kutta's method with fixed steps, or SciPy's DOP853, which chooses its steps."""

Loads = Mapping[str, Array]
"""Forces of the drives and wrench on the platform by name, of B machines: (B, size)."""


def advance(
    robot: RobotLike,
    pose: PoseLike,
    velocity: PoseLike,
    forces: ArrayLike,
    step: float,
    count: int,
    wrench: PoseLike | None = None,
    machines: Machines | None = None,
    drives: ArrayLike | None = None,
) -> tuple[Array, Array, Array, Any]:
    """Return machines' states after several fourth-order Runge-Kutta steps.

    Friction and the motors' inertia are included; a joint at rest sticks while the force on it is
    less than its dry friction. With a C compiler the steps run as one loop of machine code,
    compiled at the first call, and several states of a batch share an instruction.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose, velocity : array, shape (..., m)
        The platform's state; m, rad and s.
    forces : array, shape (..., n)
        Of the drives, N at a slider, N m at a crank; they stay as they are.
    step : float
        Length of a step, s; see `longest_step`.
    count : int
        Number of steps.
    wrench : array, shape (..., m), optional
        Load on the platform at P all the while: a force in N and, where it turns, a moment about k
        in N m; of a platform that tilts a force and a moment, (..., 6).
    machines : Machines, optional
        The machine of each state, where they are several; their `robot` is the one that is given.
    drives : array, shape (..., K), optional
        The state of drives that bend or lag, as a call before returned it; by default such as holds
        the machine there.

    Returns
    -------
    pose, velocity : array, shape (..., m)
        At the end; of a machine that cannot go on, its last state.
    drives : array, shape (..., K)
        Coordinates of the motors at the joints and their rates, (n,) each, where a transmission
        bends, and forces of the currents, (n,), where one lags; empty where all are rigid.
    status : array of bool, shape (...)
        Whether all steps were made: not where a leg is out of reach or singular (type I).

    Raises
    ------
    DataError
        If shapes do not fit, a step is not a time, or count is not a whole number of 0 or more.

    Examples
    --------
    >>> import numpy as np, pteron
    >>> from pteron.motion import advance
    >>> robot = pteron.load("tripteron")
    >>> rest = np.zeros(3)
    >>> pose, velocity, _, status = advance(robot, rest, rest, rest, 1e-4, 100)
    >>> bool(status), bool(np.allclose(velocity, [0.0, 0.0, -0.0981], atol=0.1))
    (True, True)
    """
    robot = as_manipulator(robot)
    span = as_array([step, count], "step, count", (2,))
    expect(np.isfinite(span[0]), "step", shorten(step), "a time in s")
    if not span[1] >= 0.0 or span[1] % 1.0:
        raise DataError(f"count: {shorten(count)} given, a whole number of 0 or more expected")
    inputs = {"pose": pose, "velocity": velocity, "forces": forces}
    sizes = dict.fromkeys(inputs, robot.freedom) | {"forces": robot.joint_count}
    columns = robot.column_names
    if wrench is not None:
        inputs["wrench"] = wrench
    sizes["wrench"] = len(columns["wrench"])
    parts = {
        name: as_array(array, name, (sizes[name],), columns=columns.get(name, ()))
        for name, array in inputs.items()
    }
    lead = broadcast_lead({name: part.shape[:-1] for name, part in parts.items()})
    batch = math.prod(lead)
    rows = {
        name: np.broadcast_to(part, (*lead, sizes[name])).reshape(batch, 1, -1)
        for name, part in parts.items()
    }
    general = machines is not None and machines.geometry is not None
    simulator = loop(robot, general=general)
    count_drives = robot.joint_count * len(simulator.kind.extra_states)
    if drives is None:
        drives = drive_states(robot, rows["pose"], rows["velocity"]).reshape(*lead, count_drives)
    drive_rows = as_array(drives, "drives", (count_drives,))
    drive_rows = np.broadcast_to(drive_rows, (*lead, count_drives)).reshape(batch, 1, count_drives)
    state = np.concatenate([rows["pose"], rows["velocity"], drive_rows], axis=-1)
    arrays = {"given": np.ascontiguousarray(rows["forces"])}
    if wrench is not None:
        arrays["wrench"] = np.ascontiguousarray(rows["wrench"])
    if machines is not None:
        if len(machines) != batch or machines.robot != robot:
            raise DataError(
                f"machines: {len(machines)} of {machines.robot.name} given, {batch} of "
                f"{robot.name} expected, one for each state"
            )
        arrays |= machines.numbers
    state, succeeded = advance_states(simulator, robot, state, arrays, step, count)
    m, state = robot.freedom, state.reshape(*lead, -1)
    parts_of_state = state[..., :m], state[..., m : 2 * m], state[..., 2 * m :]
    return *parts_of_state, succeeded.reshape(lead)


def advance_states(
    simulator: Loop,
    robot: Manipulator,
    state: Array,
    arrays: dict[str, Array],
    step: float,
    count: int,
    device: Device = "cpu",
) -> tuple[Array, Any]:
    """Advance states (B, 1, Y) of a loop in place; return them, and if all steps were made (B,).

    `arrays` has the drives' forces, "given", and what else differs from `Loop.idle`.
    """
    inputs = simulator.idle(robot, state) | arrays
    steps_done, piece = 0, count if device == "cuda" else max(1, _PIECE // max(1, len(state)))
    while len(state) and steps_done < count:  # in pieces, between which Ctrl-C is seen
        steps = min(piece, int(count) - steps_done)
        times, counts = [step, 0.0, 0.0, step * steps], [steps, 0, 0, 0, 0, 0, 0, 0, 0]
        simulator.run(inputs, 1, times, counts, device=device)
        steps_done += steps
    return state, inputs["fault"].reshape(-1) == 0.0


def drive_states(robot: Manipulator, pose: Array, velocity: Array) -> Array:
    """Return the states (..., K) of drives that bend or lag, as at zero acceleration."""
    states = motor_states(robot, pose, velocity, np.zeros_like(pose))
    return np.concatenate([np.empty((*pose.shape[:-1], 0)), *states.values()], axis=-1)


def motor_states(
    robot: Manipulator, pose: Array, velocity: Array, acceleration: Array
) -> dict[str, Array]:
    """Return by name the drive states (..., n) that a motion requires beyond joint coordinates."""
    kind = DriveKind.from_robot(robot)
    if not kind.extra_states:
        return {}
    force = inverse_dynamics(robot, pose, velocity, acceleration, on_failure="nan")
    force, motor = np.nan_to_num(force), inverse_kinematics(robot, pose)
    for i, leg in enumerate(robot.legs):
        if leg.drive and leg.drive.elastic:
            bends, load = leg.drive.elastic, force[..., i]
            motor[..., i] += load / bends.stiffness + np.sign(load) * bends.backlash / 2.0
    states = {"motor": motor, "current": force}
    states["motor_rate"] = rates = joint_rates(robot, pose, velocity).actuated
    deflections = [
        leg.drive.coulomb / leg.drive.lugre.stiffness if leg.drive and leg.drive.lugre else 0.0
        for leg in robot.legs
    ]
    states["bristle"] = np.sign(rates) * np.array(deflections)
    return {name: states[name] for name, _ in kind.extra_states}


_PIECE = 200_000
"""Steps, of all machines, that one call of C takes: some 0.5 s."""

_FINEST = 100.0 * float(np.finfo(float).eps)
"""The smallest relative error of a step that SciPy serves."""

_LEAST = 1e-9
"""Adaptive steps shorter than this share of a span count as stuck."""


class AdaptivePlant:
    """DOP853 in place of fixed steps, for a machine whose friction is smooth at rest."""

    def __init__(self, robot: Manipulator, tolerance: float) -> None:
        self._accelerations = numeric(robot, "drive_accelerations", wrench=True)
        self._tolerance = tolerance

    def go(
        self, steps: int, step: float, loads_held: Loads, arrays: Mapping[str, Array], alive: Array
    ) -> None:
        """Advance the state in `arrays` by `steps` steps of `step` s, by an adaptive method."""
        state, clock, span = arrays["state"][0, 0], arrays["clock"][0, 0], steps * step
        m, loads = len(state) // 2, (loads_held["forces"][0], loads_held["wrench"][0])

        def rates(_: float, state: Array) -> Array:
            """Return the time derivative (2 m,) of pose and velocity; NaN without a solution."""
            velocity = state[m:]
            acceleration, status = self._accelerations(state[:m], velocity, *loads)
            return np.concatenate([velocity, acceleration if status else np.full(m, np.nan)])

        if not np.isfinite(rates(0.0, state)).all():
            alive[:] = 0.0
            return
        solver = scipy.integrate.DOP853(
            rates,
            0.0,
            state.copy(),
            span,
            first_step=span,  # its own choice goes on forever where the machine cannot be
            rtol=max(self._tolerance, _FINEST),
            atol=1e-3 * self._tolerance,
        )
        while solver.status == "running":
            solver.step()
            if solver.step_size < _LEAST * span:
                break
        clock += solver.t
        state[:] = solver.y
        alive[:] = solver.status == "finished"
