"""`consistent_model`: from identified base parameters to a machine of real bodies."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import ArrayLike

from pteron.arguments import expect
from pteron.errors import DataError, ModelError
from pteron.identification.consistency.bodies import (
    Bodies,
    Target,
    bodies_of,
    cad_target,
    parameters_of,
    plain_target,
    real_bodies,
)
from pteron.identification.consistency.bounds import Bounds, LinearLimits
from pteron.identification.consistency.cones import (
    RealBodies,
    closest_to_values,
    deepest_point,
    nearest_to_target,
)
from pteron.identification.consistency.consistency import Consistency
from pteron.kernels import Array
from pteron.manipulator import (
    Manipulator,
    RobotLike,
    as_manipulator,
    parameter_names,
    parameters,
    with_parameters,
)
from pteron.reduction import BaseParameters

_DEEPEST = 2.0
"""Greatest depth of a body inside its cone, over its margin, that is asked for: with it the margin
leaves space for the search of the nearest model."""

_SHALLOW = 0.02
"""Depth, over the margin, below which values count as not feasible."""

_FORCE = 1e-3
"""Share of the largest multiplier from which a body or a bound is said to hold the fit back."""

_TOO_FAR = (
    "values: too far from those of real bodies for the solver; look at their units, and at the "
    "covariance, whose deviations may differ by too many orders of magnitude"
)

_HOLDS = 1e-7
"""Relative error to which a bound must hold; what the solver's answer is checked against."""


def consistent_model(
    robot: RobotLike,
    base: BaseParameters,
    values: ArrayLike,
    covariance: ArrayLike | None = None,
    *,
    cad: RobotLike | ArrayLike | Literal["robot"] | None = "robot",
    bounds: Bounds | None = None,
) -> Consistency:
    """Return real bodies that reproduce identified base parameters.

    First it is decided whether any real bodies within the bounds have the identified values. If
    none have, the closest ones that do are taken instead: least (K p - b)' S^-1 (K p - b), with b
    the identified values, S their covariance, K the grouping and p the parameters of real bodies.
    Then, of all real bodies with these base parameters, those nearest to the CAD model are
    returned. Each body is kept strictly real: in units of its mass and length, the least
    eigenvalue of [[m, |h|], [|h|, I]] stays above a margin of at most 0.001.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine, of the geometry of `base.robot`.
    base : BaseParameters
        Its base parameters. Where they were made with `shared`, the legs returned share theirs.
    values : array, shape (rank,)
        The identified base parameters, in the order of `base.names`, SI units.
    covariance : array, shape (rank, rank), optional
        Their covariance. Without it infeasible values are moved in a relative metric.
    cad : Manipulator, array of shape (N,), "robot" or None
        The CAD model: a machine, parameters that may belong to no real bodies, `robot` itself (the
        default), or nothing: then bodies are near uniform rods and a uniform disc. Where legs
        share parameters, their mean counts.
    bounds : Bounds, optional
        Limits of parameters, boxes that hold the bodies, a total mass.

    Returns
    -------
    Consistency
        The machine, whether the values were feasible, and how far they were moved.

    Raises
    ------
    ModelError
        If no real bodies keep the bounds, a name in them is unknown, or Clarabel is missing.
    DataError
        If the values or their covariance are of the wrong shape or no numbers.

    Notes
    -----
    Sousa, C. D., Cortesao, R.: Physical feasibility of robot base inertial parameter
    identification: a linear matrix inequality approach. Int. J. Robotics Research 33(6), 2014.
    For a body in planar motion the matrix is [[I, 0, hx], [0, I, hy], [hx, hy, m]].

    Examples
    --------
    >>> import pteron
    >>> from pteron.identification.consistency import consistent_model
    >>> robot = pteron.load("tripteron")
    >>> base = pteron.base_parameters(robot)
    >>> result = consistent_model(robot, base, 1.05 * base.values())
    >>> result.feasible, result.distance
    (True, 0.0)
    """
    robot = as_manipulator(robot)
    vector = _check_values(robot, base, values)
    root = None if covariance is None else _square_root(covariance, base.rank)
    problem = _scale_problem(robot, base, vector, root, cad, bounds or Bounds())
    aim = _choose_aim(problem)
    z = _bodies_nearest_target(problem, aim)
    answer, residual = _checked_parameters(problem, aim, z)
    base_values = base.grouping @ answer
    shift = np.zeros(base.rank) if aim.feasible else base_values - vector
    distance = float(np.linalg.norm(np.linalg.solve(problem.spread, shift)))
    p_value = float("nan") if root is None else float(scipy.stats.chi2.sf(distance**2, base.rank))
    cad_violations = _cad_violations(problem)
    return Consistency(
        robot=with_parameters(robot, answer),
        parameters=answer,
        base_values=base_values,
        names=base.names,
        feasible=aim.feasible,
        distance=distance,
        p_value=p_value,
        shifts=shift / np.linalg.norm(problem.spread, axis=1),
        metric="relative" if root is None else "covariance",
        at_border=_names_at_border(problem, aim, z),
        cad_feasible=not cad_violations,
        cad_violations=cad_violations,
        residual=residual,
        nearest_to=problem.target.kind,
    )


@dataclass(frozen=True)
class _Problem:
    """Identified values, and the scaled free parameters z (k,) of bodies that may have them.

    z has the values (rank,) where `grouping` @ z = values: at `inverse` @ (values / sizes), moved
    along the columns of `free`. `sizes` (rank,) are the lengths of the rows of `grouping`,
    `spread` (rank, rank) is the square root of the values' covariance, and `cad` (N,) are the CAD
    model's parameters.
    """

    robot: Manipulator
    values: Array
    spread: Array
    limits: LinearLimits
    cad: Array | None
    target: Target
    real: RealBodies
    grouping: Array
    sizes: Array
    inverse: Array
    free: Array

    @property
    def bodies(self) -> Bodies:
        """The bodies, and how their parameters are shared."""
        return self.real.bodies


@dataclass(frozen=True)
class _Aim:
    """Base parameters (rank,) that real bodies have: the identified ones, or those closest to them.

    `point` (k,) are scaled free parameters that have them, `depth` is how far inside their cones
    bodies shall be, over the margin, and `multipliers` are those of the closest values.
    """

    values: Array
    point: Array
    depth: float
    multipliers: Array | None = None

    @property
    def feasible(self) -> bool:
        """Whether real bodies have the identified values."""
        return self.multipliers is None


def _check_values(robot: Manipulator, base: BaseParameters, base_values: ArrayLike) -> Array:
    """Return identified values (rank,) as an array, after checking that they are the machine's."""
    if parameter_names(robot) != parameter_names(base.robot):
        raise ModelError(
            f"base: made for {base.robot.name}, which has other parameters than {robot.name}"
        )
    vector = np.asarray(base_values, dtype=float)
    expect(vector.shape == (base.rank,), "values", f"shape {vector.shape}", f"({base.rank},)")
    if not np.isfinite(vector).all():
        raise DataError("values: not all are finite numbers; identify the parameters again")
    return vector


def _scale_problem(
    robot: Manipulator,
    base: BaseParameters,
    base_values: Array,
    root: Array | None,
    cad: RobotLike | ArrayLike | None,
    bounds: Bounds,
) -> _Problem:
    """Return the problem in scaled parameters; without a `root` its spread is relative."""
    bodies, limits, prior = bodies_of(base), bounds.limits(robot), _prior(robot, cad)
    target = plain_target(bodies, base, base_values) if prior is None else cad_target(bodies, prior)
    matrix = limits.matrix @ bodies.sharing * target.scale
    lengths = np.linalg.norm(matrix, axis=1)
    real = RealBodies(bodies, target.margins, matrix / lengths[:, None], limits.right / lengths)
    grouping = base.grouping @ bodies.sharing * target.scale
    sizes = np.linalg.norm(grouping, axis=1)
    u, singular, vt = np.linalg.svd(grouping / sizes[:, None])
    return _Problem(
        robot=robot,
        values=base_values,
        spread=np.diag(sizes) if root is None else root,
        limits=limits,
        cad=prior,
        target=target,
        real=real,
        grouping=grouping,
        sizes=sizes,
        inverse=vt[: base.rank].T / singular @ u.T,
        free=vt[base.rank :].T,
    )


def _choose_aim(problem: _Problem) -> _Aim:
    """Return the identified values if they are feasible, else the nearest feasible values."""
    real, target, beta, free = problem.real, problem.target, problem.values, problem.free
    depth, deepest = deepest_point(real, problem.inverse @ (beta / problem.sizes), free, _DEEPEST)
    if depth >= _SHALLOW:
        return _Aim(beta, deepest, 0.5 * depth)
    n = free.shape[0]
    inside = nearest_to_target(real, np.zeros(n), np.eye(n), 1.0, target.matrix, target.right)
    if inside is None:
        raise ModelError(
            "bounds: no real bodies keep them all, whatever the identified values are; "
            f"loosen some of: {', '.join(problem.limits.names)}"
        )
    solution = closest_to_values(real, problem.grouping, beta, problem.spread, _SHALLOW)
    if solution is None:
        raise ModelError(_TOO_FAR)
    point, multipliers = solution
    point = _move_inside(problem.bodies, point, inside, 0.5 * _SHALLOW * target.margins)
    return _Aim(problem.grouping @ point, point, 0.5 * _SHALLOW, multipliers)


def _bodies_nearest_target(problem: _Problem, aim: _Aim) -> Array:
    """Return the bodies z (k,) with the values aimed at that are nearest to the target."""
    bodies, target = problem.bodies, problem.target
    start = problem.inverse @ (aim.values / problem.sizes)
    z = nearest_to_target(problem.real, start, problem.free, aim.depth, target.matrix, target.right)
    if z is not None and not (bodies.least(z) <= 0.0).any():
        return z
    # The closest model is then the only one, to the solver's accuracy; of feasible values that
    # are far from any drawing the answer may be off by more than bodies have to spare.
    if z is None or not aim.feasible:
        return aim.point
    return _move_inside(bodies, z, aim.point, 0.5 * aim.depth * target.margins)


def _checked_parameters(problem: _Problem, aim: _Aim, z: Array) -> tuple[Array, float]:
    """Return the inertial parameters (N,) of a solution z, and the base parameters' greatest error.

    The error is relative. That the bodies are physically consistent is checked independently of the
    solver; ModelError if they are not.
    """
    bodies, limits, target = problem.bodies, problem.limits, problem.target
    error = (problem.grouping @ z - aim.values) / (problem.sizes * np.linalg.norm(z))
    residual = float(np.abs(error).max())
    answer = bodies.sharing @ (target.scale * z)
    failures = list(real_bodies(problem.robot, answer))
    units = np.maximum(np.abs(answer), bodies.sharing @ target.scale)
    failures += limits.violations(answer, 10 * _HOLDS * np.abs(limits.matrix) @ units)
    if residual > _HOLDS:
        failures.append(f"base parameters: relative error {residual:.1e}")
    if (bodies.least(z) <= 0.0).any():
        failures.append("a body has no inertia left")
    if failures:
        raise ModelError(f"consistency: the solver's answer does not hold ({'; '.join(failures)})")
    return answer, residual


def _names_at_border(problem: _Problem, aim: _Aim, z: Array) -> tuple[str, ...]:
    """Return the bodies and limits that are active at the solution, by name."""
    real, target = problem.real, problem.target
    if aim.multipliers is None:
        close = problem.bodies.least(z) < 1.01 * target.margins
        tight = real.matrix @ z > real.right - 1e-6 * np.linalg.norm(z)
        at_border = np.concatenate([close, tight])
    else:
        at_border = aim.multipliers > _FORCE * aim.multipliers.max()
    names = np.array([*problem.bodies.names, *problem.limits.names])
    return tuple(names[at_border].tolist())


def _cad_violations(problem: _Problem) -> tuple[str, ...]:
    """Return why the CAD model's bodies are not real, or do not keep the limits."""
    if problem.cad is None:
        return ()
    limits, sharing = problem.limits, problem.bodies.sharing
    rounding = _HOLDS * np.abs(limits.matrix) @ sharing @ problem.target.scale
    return real_bodies(problem.robot, problem.cad) + limits.violations(problem.cad, rounding)


def _square_root(covariance: ArrayLike, rank: int) -> Array:
    """Return the lower triangular square root of a covariance (rank, rank), after checking it."""
    matrix = np.asarray(covariance, dtype=float)
    expect(matrix.shape == (rank, rank), "covariance", f"shape {matrix.shape}", (rank, rank))
    deviations = np.sqrt(np.abs(np.diag(matrix)))
    if not np.isfinite(matrix).all() or (np.diag(matrix) <= 0.0).any():
        raise DataError("covariance: every variance must be a positive, finite number")
    correlations = matrix / np.outer(deviations, deviations)
    if np.abs(correlations - correlations.T).max() > 1e-8:
        raise DataError("covariance: the matrix is not symmetric")
    try:
        # Correlations, since the variances' units differ by orders of magnitude.
        root = np.linalg.cholesky(0.5 * (correlations + correlations.T))
    except np.linalg.LinAlgError:
        raise DataError(
            "covariance: the matrix is not positive definite; give that of a fit in which every "
            "base parameter is identified"
        ) from None
    return np.asarray(deviations[:, None] * root)


def _prior(robot: Manipulator, cad: RobotLike | ArrayLike | None) -> Array | None:
    """Return a CAD model's inertial parameters, from a machine, its file or an array; or None."""
    if cad is None:
        return None
    if isinstance(cad, str) and cad == "robot":
        return parameters(robot)
    if isinstance(cad, str | Path):
        cad = as_manipulator(cad)
    if isinstance(cad, Manipulator) and len(cad.legs) != len(robot.legs):
        raise ModelError(
            f"cad: {cad.name} has {len(cad.legs)} legs, {robot.name} has {len(robot.legs)}; give "
            "a model of the same machine"
        )
    return parameters_of(robot, parameters(cad) if isinstance(cad, Manipulator) else cad, "cad")


def _move_inside(bodies: Bodies, point: Array, inside: Array, margins: Array) -> Array:
    """Return a point moved towards an interior point by the least step that makes bodies real."""
    # Values that are thousands of deviations off leave the solver little accuracy at the border.
    for part in (0.0, *np.logspace(-12, 0, 37)):
        candidate = (1.0 - part) * point + part * inside
        if (bodies.least(candidate) >= margins).all():
            break
    return np.asarray(candidate)
