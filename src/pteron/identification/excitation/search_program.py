"""The nonlinear program behind an exciting trajectory: cost and limits, solved by `sequential`.

It has some 30 variables, and a thousand rows that each depend on all of them. Gradients are exact
(CasADi).
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import casadi as ca
import numpy as np

from pteron.bodies.motion import Expression
from pteron.equations.drives import Drives, drives_of
from pteron.identification.excitation.fourier import Space
from pteron.identification.excitation.limits import (
    Limits,
    joint_clearances,
    joint_limits,
    joint_sizes,
)
from pteron.identification.excitation.random_motions import sizes
from pteron.identification.excitation.sequential import NonlinearProgram, sequential_minimum
from pteron.identification.signals.states import home, home_mode
from pteron.kernels import Array, Columns, program
from pteron.kinematics.evaluate import evaluate_unchecked
from pteron.kinematics.singularities import best_type_ii
from pteron.manipulator import Manipulator, parameters
from pteron.motion.trajectories.fourier import fourier_bases

Criterion = Literal["condition", "logdet"]
"""The cost: the scaled condition number, or the volume of the confidence ellipsoid."""

_SAMPLES = 20
"""Samples in a period of the highest harmonic. The limits are kept where the regressor is taken:
anywhere else a leg could come close to being stretched, which the regressor would reward."""

_BACK_OFF = 1e-3
"""Share of its size by which the program keeps every limit clear at its samples."""

_ITERATIONS = 200
"""Most iterations."""

_SETTLED = 1e-6
"""Decrease of the measure, a logarithm, at which the iteration has converged: of the condition
number's last digit."""


@dataclass(frozen=True)
class Setting:
    """The setting of an optimisation: all that does not depend on where the search starts."""

    robot: Manipulator
    columns: Columns
    space: Space
    harmonics: int
    period: float
    limits: Limits
    criterion: Criterion
    short: tuple[float, ...]
    """RMS lengths (p,) below which a column is short for `condition_with_penalty`."""


def minimise(
    setting: Setting,
    start: Array,
    doublings: int,
    watched: tuple[str, ...],
    extra: Array,
    seconds: float,
) -> Array | None:
    """Return improved coefficients (2 H + 1, n), which need not keep the limits.

    None if it could not begin at `start` (2 H + 1, n). `doublings` is the sharpness of `measure`.
    The limits `watched` by name are kept, at the `extra` instants (E,) too; the fewer, the faster.
    """
    size = sizes(setting.robot, setting.space)
    cost = _cost(setting, doublings)
    constraints = _LimitConstraints(setting, watched, np.concatenate([_instants(setting), extra]))
    deadline = time.monotonic() + seconds

    def measure(z: Array) -> tuple[float, Array]:
        """Return the cost and its gradient, flat, at flat coefficients z."""
        size, gradient = cost(z.reshape(start.shape))
        return float(_numbers(size).item()), _numbers(gradient).ravel()

    minimum = sequential_minimum(
        NonlinearProgram(measure, constraints.values, constraints.slopes),
        (start / size).ravel(),
        tolerance=_SETTLED,
        iterations=_ITERATIONS,
        stop=lambda: time.monotonic() > deadline,
    )
    return None if minimum is None else minimum.reshape(start.shape) * size


def _numbers(matrix: ca.DM) -> Array:
    """Return a CasADi matrix as an array; raise KeyboardInterrupt where an interrupt spoiled it."""
    try:
        array: Array | None = matrix.full()
        if array is None:
            raise KeyboardInterrupt  # a SystemError where an exception is pending
    except SystemError:
        raise KeyboardInterrupt from None
    return array


class _LimitConstraints:
    """Inequality constraints of the program at instants (T,): at least 0 where limits are kept."""

    def __init__(self, setting: Setting, watched: tuple[str, ...], times: Array) -> None:
        path, slopes, low, high = _path(setting, watched)
        size = sizes(setting.robot, setting.space)
        self._path, self._slopes = path.map(len(times)), slopes.map(len(times))
        self._rows = _bases(setting, times)
        self._size, self._low, self._high = size, low, high
        self._above, self._below = np.isfinite(low), np.isfinite(high)

    def values(self, z: Array) -> Array:
        """Return the margins (R,) at variables z (v,)."""
        path_values = _numbers(self._path(*self._evaluate_rows(z))).T
        return self._sides(path_values - self._low, self._high - path_values)

    def slopes(self, z: Array) -> Array:
        """Return the margins' derivatives by the variables (R, v)."""
        count, limits, n = self._rows.shape[1], len(self._low), len(self._size)
        blocks = _numbers(self._slopes(*self._evaluate_rows(z))).T.reshape(count, 3, n, limits)
        derivatives = np.einsum("tdig,dtk->tgki", blocks * self._size[:, None], self._rows)
        derivatives = derivatives.reshape(count, limits, -1)
        return self._sides(derivatives, -derivatives)

    def _evaluate_rows(self, z: Array) -> list[Array]:
        """Return q, q' and q'' at the instants, (n, T) each, at the program's variables z (v,)."""
        coefficients = z.reshape(-1, len(self._size)) * self._size
        return [(rows @ coefficients).T for rows in self._rows]

    def _sides(self, above: Array, below: Array) -> Array:
        """Return rows at finite lower bounds, then those at finite upper bounds, flattened."""
        parts = above[:, self._above], below[:, self._below]
        return np.concatenate([part.reshape(-1, *part.shape[2:]) for part in parts])


def _bases(setting: Setting, times: Array) -> Array:
    """Return the Fourier bases (3, T, 2 H + 1): coefficients to q, q' and q'' at instants (T,)."""
    return np.array(list(fourier_bases(times, setting.harmonics, setting.period)))


def _instants(setting: Setting) -> Array:
    """Return the instants (T,) at which the regressor is taken, s."""
    count = max(_SAMPLES * setting.harmonics, 3 * _SAMPLES)
    return np.linspace(0.0, setting.period, count, endpoint=False)


@lru_cache(maxsize=16)
def _cost(setting: Setting, doublings: int) -> ca.Function:
    """Return a CasADi function: the cost and its gradient, of scaled coefficients."""
    times = _instants(setting)
    n = setting.robot.freedom
    z = ca.MX.sym("z", 2 * setting.harmonics + 1, n)
    coefficients = ca.mtimes(z, ca.diag(ca.DM(sizes(setting.robot, setting.space))))
    curve = [ca.mtimes(ca.DM(row), coefficients).T for row in _bases(setting, times)]
    blocks = _regressor(setting).map(len(times))(*curve)
    information = ca.mtimes(blocks, blocks.T) / len(times)
    criterion = measure(information, setting.criterion, doublings, setting.short)
    return ca.Function("cost", [z], [criterion, ca.gradient(criterion, z)])


@lru_cache(maxsize=16)
def _regressor(setting: Setting) -> ca.Function:
    """Return a CasADi function: the base regressor's transpose (rank, n), of q, q' and q''."""
    q, state = _state(setting)
    built = program(setting.robot, "base_regressor", setting.columns)
    return ca.Function("regressor", q, [built.function(*state)], {"cse": True})


@lru_cache(maxsize=32)
def _path(
    setting: Setting, watched: tuple[str, ...]
) -> tuple[ca.Function, ca.Function, Array, Array]:
    """Return CasADi functions of limited quantities (g,) and of their slopes, and their bounds.

    The slopes are a column (3 n g,): the derivatives of all by q1, then those by q2, and so on.
    Squared sines stay finite and smooth out of reach.
    """
    robot, limits = setting.robot, setting.limits
    q, state = _state(setting)
    pose, velocity, _ = state
    limit_terms: dict[str, tuple[Expression, float | Array, float | Array]] = {}
    squares = program(robot, "squared_type_i").function(pose).T
    limit_terms["type_i"] = squares, (limits.type_i + _BACK_OFF) ** 2, np.inf
    # An assembly mode keeps the sign that the measure has in the home pose.
    sign = float(np.sign(evaluate_unchecked(robot, "type_ii", np.array(home(robot)))))
    type_ii = sign * program(robot, "type_ii").function(pose)
    share = type_ii / best_type_ii(robot)
    if any(leg.couples_vary for leg in robot.legs):
        sign = float(np.sign(evaluate_unchecked(robot, "constraint", np.array(home(robot)))))
        share = ca.fmin(share, sign * program(robot, "constraint").function(pose))
    limit_terms["type_ii"] = share, limits.type_ii + _BACK_OFF, np.inf
    if setting.space == "joints":
        joints, rates, seconds = q
    else:
        joints = program(robot, "joint_coordinates").function(pose).T
        rates = program(robot, "joint_rates").function(pose, velocity)[0].T
        seconds = program(robot, "joint_accelerations").function(*state)[0].T
    ranges = np.array([leg.limits or (-np.inf, np.inf) for leg in robot.legs])
    clearance = joint_clearances(limits, robot) + _BACK_OFF * joint_sizes(robot)
    limit_terms["joint_clearance"] = joints, ranges[:, 0] + clearance, ranges[:, 1] - clearance
    passive = program(robot, "passive_room").function(pose)[0].T
    limit_terms["passive_clearance"] = passive, limits.passive_clearance + _BACK_OFF, np.inf
    for name, motion in (("speed", rates), ("acceleration", seconds)):
        share = motion / joint_limits(limits, name, robot)
        limit_terms[name] = share, _BACK_OFF - 1.0, 1.0 - _BACK_OFF
    dynamics, zeros = program(robot, "inverse_dynamics").function, ca.SX(pose.shape[0], 1)
    drives, inertia = Drives(*map(ca.DM, drives_of(robot))), ca.DM(parameters(robot))
    moving = dynamics(*state, inertia).T + drives.inertia * seconds + drives.viscous * rates
    static = dynamics(pose, zeros, zeros, inertia).T
    most = ca.DM(joint_limits(limits, "force", robot)) - (drives.coulomb + drives.stribeck)
    needed = ca.vertcat(*((forces + drives.offset) / most for forces in (moving, static)))
    limit_terms["force"] = needed, _BACK_OFF - 1.0, 1.0 - _BACK_OFF
    terms, *sides = zip(*(limit_terms[name] for name in watched), strict=True)
    low, high = (
        np.concatenate([np.broadcast_to(b, v.shape[0]) for v, b in zip(terms, side, strict=True)])
        for side in sides
    )
    limited = ca.densify(ca.vertcat(*terms))
    slopes = ca.vec(ca.densify(ca.jacobian(limited, ca.vertcat(*q))))
    return (
        ca.Function("path", q, [limited], {"cse": True}),
        ca.Function("slopes", q, [slopes], {"cse": True}),
        low,
        high,
    )


def _state(setting: Setting) -> tuple[list[Expression], list[Expression]]:
    """Return symbols of q, q' and q'', and the platform's motion as expressions of them."""
    robot, n = setting.robot, setting.robot.freedom
    q = [ca.SX.sym(name, n) for name in ("q", "dq", "ddq")]
    if setting.space == "platform":
        return q, q
    poses = program(robot, "closure_poses").function(q[0])
    pose = poses[:, home_mode(robot)]
    return q, [pose, *(rate.T for rate in program(robot, "platform_motion").function(pose, *q[1:]))]


def measure(
    information: Expression, criterion: Criterion, doublings: int, short: Sequence[float]
) -> Expression:
    """Return the criterion to minimise, from the information matrix M = W^T W / T (p, p).

    R is M with rows and columns divided by the roots of its diagonal, so that the condition number
    of R is the square of the scaled condition number of W.

    ``"logdet"``: -log det M / p. Scaling the columns of W only adds a constant to it.

    ``"condition"``: log(tr(R^q) tr(R^-q)) / (2 q), q = 2^doublings. It is smooth, at least the log
    of the scaled condition number, and at most log(p) / q above it. What short columns count is
    added: log(1 + (short / length)^2) / 2 of each.
    """
    p = information.shape[0]
    scale = 1.0 / ca.sqrt(ca.diag(information))
    equilibrated = information * ca.mtimes(scale, scale.T)
    inverse, logdet = _inverse(p)(equilibrated)
    if criterion == "logdet":
        return (2.0 * ca.sum1(ca.log(scale)) - logdet) / p
    shortness = ca.sum1(ca.log1p((ca.DM(short) * scale) ** 2))
    spread = _log_trace(equilibrated, doublings) + _log_trace(inverse, doublings)
    return 0.5 * (spread + shortness)


def _log_trace(matrix: Expression, doublings: int) -> Expression:
    """Return log(tr(A^q)) / q with q = 2^doublings, of a symmetric matrix, free of overflow."""
    total = ca.log(ca.trace(matrix))
    matrix = matrix / ca.trace(matrix)
    for _ in range(doublings):
        matrix = ca.mtimes(matrix, matrix)
        trace = ca.trace(matrix)
        total = 2.0 * total + ca.log(trace)
        matrix = matrix / trace
    return total / 2**doublings


@lru_cache(maxsize=16)
def _inverse(p: int) -> ca.Function:
    """Return the function that inverts a positive definite matrix, and gives its log det."""
    matrix = ca.SX.sym("matrix", p, p)
    upper = ca.chol(matrix)
    inverse = ca.solve(upper, ca.SX.eye(p))
    logdet = 2.0 * ca.sum1(ca.log(ca.diag(upper)))
    return ca.Function(
        "inverse", [matrix], [ca.densify(ca.mtimes(inverse, inverse.T)), logdet], {"cse": True}
    )
