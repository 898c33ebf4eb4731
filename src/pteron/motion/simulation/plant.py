"""The plant of a simulation: a machine's equations of motion, integrated under its drives' forces.

`Plant` steps one machine, `advance` many states at once, `longest_step` says how long a step may be
where there is friction.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import DOP853  # type: ignore[import-untyped]

from pteron.dynamics import mass_matrix
from pteron.equations.drives import drives_of
from pteron.errors import DataError, PteronError, shown
from pteron.kernels import Array, as_array, numeric
from pteron.kernels.steps import steps
from pteron.kinematics import jacobian
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.shapes import PoseLike

Method = Literal["rk4", "dop853"]
"""Runge and Kutta's method with fixed steps, or SciPy's DOP853, which chooses its steps."""

_STABLE = 2.0
"""Greatest decay rate times step; Runge and Kutta's method of fourth order is stable to 2.78."""

_SHORTEST = 1e-8
"""A step that must be shorter than this, s, points to a mistake in the drives' numbers."""


def advance(
    robot: RobotLike,
    pose: PoseLike,
    velocity: PoseLike,
    forces: ArrayLike,
    step: float,
    count: int,
    wrench: PoseLike | None = None,
) -> tuple[Array, Array, Any]:
    """Return the states of machines after some steps of Runge and Kutta's method of fourth order.

    The equations are those of `drive_accelerations`: friction and the motors' inertia count. Where
    there is a C compiler the steps are one loop of machine code, which is compiled when it is first
    asked for, and several states of a batch are computed by one instruction.

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

    Returns
    -------
    pose, velocity : array, shape (..., m)
        At the end; of a machine that cannot go on, its last state.
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
    >>> pose, velocity, status = advance(robot, np.zeros(3), np.zeros(3), np.zeros(3), 1e-4, 100)
    >>> bool(status), bool(np.allclose(velocity, [0.0, 0.0, -0.0981], atol=0.1))
    (True, True)
    """
    robot = as_manipulator(robot)
    span = as_array([step, count], "step, count", (2,))
    if not np.isfinite(span[0]):
        raise DataError(f"step: {shown(step)} given, a time in s expected")
    if not span[1] >= 0.0 or span[1] % 1.0:
        raise DataError(f"count: {shown(count)} given, a whole number of 0 or more expected")
    given = [pose, velocity, forces, *([] if wrench is None else [wrench])]
    found = steps(robot, wrench=wrench is not None)(*given, span)
    return found[0], found[1], found[2] == count


def longest_step(robot: RobotLike, poses: PoseLike) -> float:
    """Return the longest step that friction allows, s: infinite for a machine without friction.

    Next to rest a drive's dry friction is like a damper of coulomb / rest_speed, which makes a rate
    decay fast; the steps must follow that. The poses, (..., m), are where it may come to rest.
    """
    robot = as_manipulator(robot)
    own = drives_of(robot)
    damping = own.viscous + (own.coulomb + own.stribeck) / own.rest_speed
    if not damping.any():
        return float("inf")
    rows = jacobian(robot, poses)
    mass = mass_matrix(robot, poses) + rows.mT @ (own.inertia[:, None] * rows)
    decay = np.linalg.eigvals(np.linalg.solve(mass, rows.mT @ (damping[:, None] * rows)))
    return _STABLE / float(np.abs(decay).max())


_FINEST = 100.0 * float(np.finfo(float).eps)
"""The smallest relative error of a step that SciPy serves."""

_LEAST = 1e-9
"""Adaptive steps shorter than this share of a span count as stuck."""


class Plant:
    """A machine's state, integrated from sample to sample."""

    def __init__(
        self, pose: Array, velocity: Array, method: Method, step: float, tolerance: float
    ) -> None:
        self.pose, self.velocity, self.time = pose, velocity, 0.0
        self.step = step if method == "rk4" else float("nan")
        self._tolerance = tolerance
        self._go = self._fixed if method == "rk4" else self._adaptive

    def go(self, robot: Manipulator, span: float, forces: Array, wrench: Array) -> bool:
        """Go on by a span, as the machine is now; return whether it was made whole."""
        return span <= 0.0 or self._go(robot, span, forces, wrench)

    def _fixed(self, robot: Manipulator, span: float, forces: Array, wrench: Array) -> bool:
        count = int(np.ceil(span / self.step - 1e-9))
        how = np.array([span / count, count])
        moved = steps(robot, wrench=True)(self.pose, self.velocity, forces, wrench, how)
        self.pose, self.velocity, done = moved
        self.time += float(done) * span / count
        return bool(done == count)

    def _adaptive(self, robot: Manipulator, span: float, forces: Array, wrench: Array) -> bool:
        accelerations = numeric(robot, "drive_accelerations", wrench=True)
        m = len(self.pose)

        def rates(_: float, state: Array) -> Array:
            velocity = state[m:]
            found, status = accelerations(state[:m], velocity, forces, wrench)
            return np.concatenate([velocity, found if status else np.full(m, np.nan)])

        state = np.concatenate([self.pose, self.velocity])
        if not np.isfinite(rates(0.0, state)).all():
            return False
        solver = DOP853(
            rates,
            self.time,
            state,
            self.time + span,
            first_step=span,  # its own choice goes on forever where the machine cannot be
            rtol=max(self._tolerance, _FINEST),
            atol=1e-3 * self._tolerance,
        )
        while solver.status == "running":
            solver.step()
            if solver.step_size < _LEAST * span:
                break
        self.time, self.pose, self.velocity = float(solver.t), solver.y[:m], solver.y[m:]
        return bool(solver.status == "finished")


def allowed_step(robot: Manipulator, poses: Array, step: float) -> float:
    """Return the given step, or the longest that friction allows, or refuse a drive's numbers."""
    try:
        longest = longest_step(robot, poses)
    except PteronError:
        return step  # the first sample says what is wrong with the pose
    if longest < _SHORTEST:
        raise DataError(
            f"drives: their friction at rest asks for steps below {_SHORTEST:g} s; make rest_speed "
            "larger, or coulomb smaller"
        )
    return min(step, longest)
