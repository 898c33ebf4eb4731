"""The nonlinear program behind an exciting trajectory: IPOPT with CasADi's exact gradients."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import casadi as ca
import numpy as np

from pteron.bodies.motion import Expression
from pteron.identification.excitation.draws import sizes
from pteron.identification.excitation.fourier import Space
from pteron.identification.excitation.limits import Limits, drive_load, joint_sizes, per_joint
from pteron.identification.signals.states import home, home_mode
from pteron.kernels import Array, Columns, program
from pteron.kinematics.evaluate import unchecked
from pteron.kinematics.singularities import best_type_ii
from pteron.manipulator import Manipulator, parameters
from pteron.motion.trajectories.fourier import fourier_basis

Criterion = Literal["condition", "logdet"]
"""What is made small: the scaled condition number, or the volume of the confidence ellipsoid."""

_SAMPLES = 20
"""Samples in a period of the highest harmonic. The limits are kept where the regressor is taken:
anywhere else a leg could come close to being stretched, which the regressor would reward."""

_BACK_OFF = 1e-3
"""By what share of its size the program keeps every limit clear at its samples."""

_ITERATIONS = 200

_INTERRUPTED = ("User_Requested_Stop", "NonIpopt_Exception_Thrown")
"""How IPOPT ends when CasADi has taken an interrupt from the keyboard for itself: all other errors
of its callbacks are numbers that are invalid."""


@dataclass(frozen=True)
class Setting:
    """What is optimised: all that does not depend on where the search starts."""

    robot: Manipulator
    columns: Columns
    space: Space
    harmonics: int
    period: float
    limits: Limits
    criterion: Criterion


def minimised(
    setting: Setting,
    start: Array,
    doublings: int,
    watched: tuple[str, ...],
    extra: Array,
    seconds: float,
) -> Array | None:
    """Return coefficients (2 H + 1, n) that are better, but need not keep the limits.

    None if it could not begin at `start` (2 H + 1, n). `doublings` is the sharpness of `measure`.
    The limits `watched` by name are kept, at the `extra` instants (E,) too; the fewer, the faster.
    """
    n, rows = setting.robot.freedom, 2 * setting.harmonics + 1
    count = max(_SAMPLES * setting.harmonics, 3 * _SAMPLES)
    times: Array = np.linspace(0.0, setting.period, count, endpoint=False)
    z = ca.MX.sym("z", rows * n)
    size = sizes(setting.robot, setting.space)
    coefficients = ca.mtimes(ca.reshape(z, rows, n), ca.diag(ca.DM(size)))
    guarded = np.concatenate([times, extra])
    path, low, high = _path(setting, watched)
    bounded = path.map(len(guarded))(*_along(setting, coefficients, guarded))
    blocks = _regressor(setting).map(count)(*_along(setting, coefficients, times))
    information = ca.mtimes(blocks, blocks.T) / count
    nlp = {"x": z, "f": measure(information, setting.criterion, doublings), "g": ca.vec(bounded)}
    solver = ca.nlpsol("excitation", "ipopt", nlp, _options(seconds))
    try:
        found = solver(
            x0=ca.vec(ca.DM(start / size)),
            lbg=np.tile(low, len(guarded)),
            ubg=np.tile(high, len(guarded)),
        )
    except RuntimeError:
        return None
    status = solver.stats()["return_status"]
    if status in _INTERRUPTED:
        raise KeyboardInterrupt
    if status == "Invalid_Number_Detected":
        return None
    result: Array = np.array(ca.reshape(found["x"], rows, n)) * size
    return result if np.isfinite(result).all() else None


def _options(seconds: float) -> dict[str, Any]:
    return {
        "print_time": False,
        "show_eval_warnings": False,  # a step out of reach is NaN, which the line search rejects
        "error_on_fail": False,
        "ipopt": {
            "print_level": 0,
            "sb": "yes",
            "hessian_approximation": "limited-memory",
            "limited_memory_max_history": 6,
            "mu_strategy": "adaptive",
            "tol": 1e-3,
            "acceptable_tol": 1e-2,
            "acceptable_iter": 10,
            "max_iter": _ITERATIONS,
            "max_wall_time": max(seconds, 1e-2),
        },
    }


def _along(setting: Setting, coefficients: Expression, times: Array) -> list[Expression]:
    """Return q, q' and q'' at times (T,), (n, T) each."""
    rows = fourier_basis(times, setting.harmonics, setting.period)
    return [ca.mtimes(ca.DM(row), coefficients).T for row in rows]


@lru_cache(maxsize=16)
def _regressor(setting: Setting) -> ca.Function:
    """Return the base regressor's transpose (rank, n) as a function of q, q' and q''."""
    q, state = _state(setting)
    built = program(setting.robot, "base_regressor", setting.columns)
    return ca.Function("regressor", q, [built.function(*state)], {"cse": True})


@lru_cache(maxsize=32)
def _path(setting: Setting, watched: tuple[str, ...]) -> tuple[ca.Function, Array, Array]:
    """Return limits as a function of q, q' and q'', and the least and greatest values (g,) of it.

    Squared sines stay finite and smooth out of reach.
    """
    robot, limits = setting.robot, setting.limits
    q, state = _state(setting)
    pose, velocity, _ = state
    found: dict[str, tuple[Expression, float | Array, float | Array]] = {}
    squares = program(robot, "squared_type_i").function(pose).T
    found["type_i"] = squares, (limits.type_i + _BACK_OFF) ** 2, np.inf
    # An assembly mode keeps the sign that the measure has in the home pose.
    sign = float(np.sign(unchecked(robot, "type_ii", np.array(home(robot)))))
    type_ii = sign * program(robot, "type_ii").function(pose)
    found["type_ii"] = type_ii / best_type_ii(robot), limits.type_ii + _BACK_OFF, np.inf
    if setting.space == "joints":
        joints, rates, seconds = q
    else:
        joints = program(robot, "joint_coordinates").function(pose).T
        rates = program(robot, "joint_rates").function(pose, velocity)[0].T
        seconds = program(robot, "joint_accelerations").function(*state)[0].T
    ranges = np.array([leg.limits or (-np.inf, np.inf) for leg in robot.legs])
    clearance = limits.joint_clearance + _BACK_OFF * joint_sizes(robot)
    found["joint_clearance"] = joints, ranges[:, 0] + clearance, ranges[:, 1] - clearance
    room = program(robot, "passive_room").function(pose)[0].T
    found["passive_clearance"] = room, limits.passive_clearance + _BACK_OFF, np.inf
    for name, value in (("speed", rates), ("acceleration", seconds)):
        found[name] = value / per_joint(limits, name, robot), _BACK_OFF - 1.0, 1.0 - _BACK_OFF
    dynamics, still = program(robot, "inverse_dynamics").function, ca.SX(pose.shape[0], 1)
    inertia, viscous, offset, dry = map(ca.DM, drive_load(robot))
    values = ca.DM(parameters(robot))
    moving = dynamics(*state, values).T + inertia * seconds + viscous * rates
    held = dynamics(pose, still, still, values).T
    most = ca.DM(per_joint(limits, "force", robot)) - dry
    needed = ca.vertcat(*((forces + offset) / most for forces in (moving, held)))
    found["force"] = needed, _BACK_OFF - 1.0, 1.0 - _BACK_OFF
    values, *sides = zip(*(found[name] for name in watched), strict=True)
    low, high = (
        np.concatenate([np.broadcast_to(b, v.shape[0]) for v, b in zip(values, side, strict=True)])
        for side in sides
    )
    return ca.Function("path", q, [ca.densify(ca.vertcat(*values))], {"cse": True}), low, high


def _state(setting: Setting) -> tuple[list[Expression], list[Expression]]:
    """Return symbols of q, q' and q'', and the platform's motion as expressions of them."""
    robot, n = setting.robot, setting.robot.freedom
    q = [ca.SX.sym(name, n) for name in ("q", "dq", "ddq")]
    if setting.space == "platform":
        return q, q
    poses = program(robot, "closure_poses").function(q[0])
    pose = poses[:, home_mode(robot)]
    return q, [pose, *(rate.T for rate in program(robot, "platform_motion").function(pose, *q[1:]))]


def measure(information: Expression, criterion: Criterion, doublings: int) -> Expression:
    """Return what an optimiser makes small, of the information matrix M = W^T W (p, p).

    R is M with rows and columns divided by the roots of its diagonal, so that the condition number
    of R is the square of the scaled condition number of W.

    ``"logdet"``: -log det M / p. Scaling the columns of W only adds a constant to it.

    ``"condition"``: log(tr(R^q) tr(R^-q)) / (2 q), q = 2^doublings. It is smooth, at least the log
    of the scaled condition number, and at most log(p) / q above it.
    """
    p = information.shape[0]
    scale = 1.0 / ca.sqrt(ca.diag(information))
    equilibrated = information * ca.mtimes(scale, scale.T)
    inverse, logdet = _inverse(p)(equilibrated)
    if criterion == "logdet":
        return (2.0 * ca.sum1(ca.log(scale)) - logdet) / p
    return 0.5 * (_log_trace(equilibrated, doublings) + _log_trace(inverse, doublings))


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
