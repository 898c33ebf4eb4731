"""`consistent_model`: from identified base parameters to a machine of real bodies."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import ArrayLike

from pteron.arguments import expect
from pteron.errors import DataError, ModelError
from pteron.identification.consistency.bodies import (
    Bodies,
    bodies_of,
    cad_target,
    parameters_of,
    plain_target,
    real_bodies,
)
from pteron.identification.consistency.bounds import Bounds
from pteron.identification.consistency.cones import RealBodies, closest, nearest, widest
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
    # Arguments: values, their spread, the bodies, the limits, the CAD model
    robot = as_manipulator(robot)
    names = parameter_names(robot)
    if names != parameter_names(base.robot):
        raise ModelError(
            f"base: made for {base.robot.name}, which has other parameters than {robot.name}"
        )
    vector = np.asarray(values, dtype=float)
    expect(vector.shape == (base.rank,), "values", f"shape {vector.shape}", f"({base.rank},)")
    if not np.isfinite(vector).all():
        raise DataError("values: not all are finite numbers; identify the parameters again")
    root = None if covariance is None else _square_root(covariance, base.rank)
    bodies = bodies_of(base)
    limits = (bounds or Bounds()).limits(robot)
    prior = _prior(robot, cad)
    target = plain_target(bodies, base, vector) if prior is None else cad_target(bodies, prior)
    cad_violations: tuple[str, ...] = ()
    if prior is not None:
        rounding = _HOLDS * np.abs(limits.matrix) @ bodies.sharing @ target.scale
        cad_violations = real_bodies(robot, prior) + limits.violations(prior, rounding)

    # Scaled free parameters z: the set of real bodies, and grouping z = values
    matrix = limits.matrix @ bodies.sharing * target.scale
    lengths = np.linalg.norm(matrix, axis=1)
    real = RealBodies(bodies, target.margins, matrix / lengths[:, None], limits.right / lengths)
    grouping = base.grouping @ bodies.sharing * target.scale
    sizes = np.linalg.norm(grouping, axis=1)
    left, singular, right = np.linalg.svd(grouping / sizes[:, None])
    inverse, free = right[: base.rank].T / singular @ left.T, right[base.rank :].T

    # Have any real bodies these values? If none, those of the closest ones are aimed at
    depth, border = widest(real, inverse @ (vector / sizes), free, _DEEPEST)
    feasible = depth >= _SHALLOW
    spread = np.diag(sizes) if root is None else root
    if feasible:
        aim, inner = vector, 0.5 * depth
    else:
        deep = nearest(
            real, np.zeros(free.shape[0]), np.eye(free.shape[0]), 1.0, target.matrix, target.right
        )
        if deep is None:
            raise ModelError(
                "bounds: no real bodies keep them all, whatever the identified values are; "
                f"loosen some of: {', '.join(limits.names)}"
            )
        least = closest(real, grouping, vector, spread, _SHALLOW)
        if least is None:
            raise ModelError(_TOO_FAR)
        border = _inside(bodies, least[0], deep, 0.5 * _SHALLOW * target.margins)
        forces = least[1]
        aim, inner = grouping @ border, 0.5 * _SHALLOW

    # Of all real bodies with these values, those nearest to the target
    start = inverse @ (aim / sizes)
    found = nearest(real, start, free, inner, target.matrix, target.right)
    if found is None or (bodies.least(found) <= 0.0).any():
        # The closest model is then the only one, to the solver's accuracy; of feasible values that
        # are far from any drawing the answer may be off by more than bodies have to spare.
        margins = 0.5 * inner * target.margins
        found = border if found is None or not feasible else _inside(bodies, found, border, margins)

    # The answer, checked without the solver
    residual = float(np.abs((grouping @ found - aim) / (sizes * np.linalg.norm(found))).max())
    answer = bodies.sharing @ (target.scale * found)
    failed = list(real_bodies(robot, answer))
    units = np.maximum(np.abs(answer), bodies.sharing @ target.scale)
    failed += limits.violations(answer, 10 * _HOLDS * np.abs(limits.matrix) @ units)
    if residual > _HOLDS:
        failed.append(f"base parameters: relative error {residual:.1e}")
    if (bodies.least(found) <= 0.0).any():
        failed.append("a body has no inertia left")
    if failed:
        raise ModelError(f"consistency: the solver's answer does not hold ({'; '.join(failed)})")
    if feasible:
        close = bodies.least(found) < 1.01 * target.margins
        tight = real.matrix @ found > real.right - 1e-6 * np.linalg.norm(found)
        held = np.concatenate([close, tight])
    else:
        held = forces > _FORCE * forces.max()
    at_border = tuple(np.array([*bodies.names, *limits.names])[held].tolist())

    base_values = base.grouping @ answer
    moved = np.zeros(base.rank) if feasible else base_values - vector
    distance = float(np.linalg.norm(np.linalg.solve(spread, moved)))
    return Consistency(
        robot=with_parameters(robot, answer),
        parameters=answer,
        base_values=base_values,
        names=base.names,
        feasible=feasible,
        distance=distance,
        p_value=float("nan")
        if root is None
        else float(scipy.stats.chi2.sf(distance**2, base.rank)),
        shifts=moved / np.linalg.norm(spread, axis=1),
        metric="relative" if root is None else "covariance",
        at_border=at_border,
        cad_feasible=not cad_violations,
        cad_violations=cad_violations,
        residual=residual,
        nearest_to=target.kind,
    )


def _square_root(covariance: ArrayLike, rank: int) -> Array:
    """Return the lower triangular square root of a covariance (rank, rank), after checking it."""
    matrix = np.asarray(covariance, dtype=float)
    wanted = rank, rank
    expect(matrix.shape == wanted, "covariance", f"shape {matrix.shape}", wanted)
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


def _inside(bodies: Bodies, point: Array, deep: Array, margins: Array) -> Array:
    """Return the point, moved towards a deep one as little as its bodies need to be real."""
    # Values that are thousands of deviations off leave the solver little accuracy at the border.
    for part in (0.0, *np.logspace(-12, 0, 37)):
        moved = (1.0 - part) * point + part * deep
        if (bodies.least(moved) >= margins).all():
            break
    return np.asarray(moved)
