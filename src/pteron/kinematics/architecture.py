"""`architecture`: whether a machine is singular at every pose (det J = 0), with reason and proof.

One pose at which det J is not zero shows that it is not. That it is, is proved by exact arithmetic
for geometries in simple numbers, or by the closed form det J = A cos(phi) + B sin(phi) of P-R-R-R
legs, up to rounding; else it is concluded from many random poses.
"""

from __future__ import annotations

import random
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from pteron.equations.machine import closure_of
from pteron.errors import ModelError, SingularPose
from pteron.kernels import Array, NoSquareRoot, PrimeField, general_program, numeric
from pteron.kernels.fields import Evaluation
from pteron.kinematics.jacobian_keys import alternatives, jacobian_keys
from pteron.kinematics.modular_geometry import modular_geometry
from pteron.kinematics.ram_figures import balance_of_rams
from pteron.kinematics.ram_motions import self_motions_of_rams
from pteron.kinematics.sampling import draw_poses, joints_limit_reach, type_ii_sizes
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.result import Result

_VANISHING = 1e-10
"""Type-II measures, or singular values over the largest, below this are rounding."""

_SAMPLES = 64
"""Random poses in reach at which det J is evaluated."""


_PRIMES = (
    *(2305843009213690799, 2305843009213690511, 2305843009213689479, 2305843009213688159),
    *(2305843009213687871, 2305843009213686431, 2305843009213685831, 2305843009213684559),
)
"""Primes modulo which 2, 3 and 5 are squares, and -1 is none."""

_ATTEMPTS = 400
"""Random states tried modulo a prime: at most of them a square root does not exist."""

_ZEROS = 3
"""Zeros at random states modulo a prime of 61 bits that prove: chance gives them once in 10^40 or
so."""

Proof = Literal["closed form", "exact arithmetic", "numerical", "one pose"]
"""Grounds on which a layout is known to be singular everywhere or, by one pose, not to be."""


@dataclass(frozen=True, eq=False, repr=False)
class Architecture(Result):
    """Properties of a machine's layout, whatever its pose.

    Attributes
    ----------
    singular : bool
        Whether every pose is singular (type II): with the actuators held still the platform can
        move.
    reason : str
        Why, in words; empty where it is not.
    proof : {"one pose", "exact arithmetic", "closed form", "numerical"}
        The kind of proof. "one pose": it is not singular, as one pose shows. "exact arithmetic":
        det J is zero in exact numbers, at random states modulo primes. "closed form": the
        coefficients of det J vanish but for rounding, or rams of a hexapod balance at every pose.
        "numerical": det J does at many poses.
    type_ii : float
        The largest type-II measure, in size, of the poses that were evaluated.
    holds : bool or None
        Whether the legs' constraints hold the platform's orientation in some pose, joints held or
        not; None where the machine's file does not tell the bars of its parallel rods.
    constraint : float
        The largest constraint measure of these poses; see `constraint_measure`. NaN where `holds`
        is None.
    self_motions : tuple of str
        Kinds of poses, in words, at which the platform of a hexapod can move while all its rams are
        held, though other poses are not singular: those that the figures formed by the rams' ends
        show. There may be more.
    """

    singular: bool
    reason: str
    proof: Proof
    type_ii: float
    holds: bool | None
    constraint: float
    self_motions: tuple[str, ...] = ()


def architecture(robot: RobotLike) -> Architecture:
    """Return whether a machine is singular at every pose, with the reason and the proof.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.

    Returns
    -------
    Architecture

    Raises
    ------
    ModelError
        If no pose is found that all legs reach, unless the layout's numbers tell that it is
        singular.

    Examples
    --------
    >>> import pteron
    >>> found = pteron.kinematics.architecture("quadrupteron")
    >>> found.singular, found.proof
    (False, 'one pose')
    """
    return _architecture(as_manipulator(robot))


@lru_cache(maxsize=256)
def _architecture(robot: Manipulator) -> Architecture:
    """Return whether a machine is singular at every pose, with reason, proof and measures."""
    poses = _poses(robot)
    measures = type_ii_sizes(robot, poses)
    constraints = np.abs(numeric(robot, "constraint")(poses)[0])
    most, constraint = (float(v.max(initial=0.0)) for v in (measures, constraints))
    holds = None if np.isnan(constraint) else constraint > _VANISHING
    if not is_singular_everywhere(robot):
        if not len(poses):
            raise ModelError(
                "no pose was found that all legs reach, so that none shows whether the layout is "
                "singular; `pteron check` says by how much legs miss the nearest one",
                subject=robot.name,
            )
        moving = self_motions_of_rams(robot)
        return Architecture(False, "", "one pose", most, holds, constraint, moving)
    closed_form_reason = closure_of(robot).vanishes() or balance_of_rams(robot)
    proof: Proof = "closed form" if closed_form_reason else "numerical"
    if _vanishes_exactly(robot):
        proof = "exact arithmetic"
    return Architecture(True, _reason(robot), proof, most, holds, constraint)


def is_singular_everywhere(robot: RobotLike) -> bool:
    """Return whether det J of a machine vanishes at every pose; `architecture` has the reason.

    Examples are layouts where the rows of all legs lie in a plane, and P-R-R-R layouts with
    fourfold symmetry about k.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.

    Returns
    -------
    bool
    """
    return _is_singular_everywhere(as_manipulator(robot))


def expect_regular(robot: Manipulator) -> None:
    """Raise, with the reason, for a machine that is singular at every pose."""
    if is_singular_everywhere(robot):
        raise singular_everywhere(robot)


@lru_cache(maxsize=256)
def _is_singular_everywhere(robot: Manipulator) -> bool:
    """Return whether det J vanishes at all poses, in closed form or by random poses."""
    known = closure_of(robot).vanishes()
    if known is not None:
        return known
    if _points_are_in_line(robot) or balance_of_rams(robot):
        return True
    poses = _poses(robot)
    if not len(poses):
        return False  # no pose is in reach: functions that take a pose raise that
    if (type_ii_sizes(robot, poses) > _VANISHING).any():
        return False
    # Where legs are far longer than the platform is wide, det J is small but its rank is full.
    points = np.array([leg.platform_point for leg in robot.legs])
    rows = numeric(robot, "jacobian")(poses)[0]
    rows = rows / np.where(robot.platform.angular, np.linalg.norm(points, axis=1).max() or 1.0, 1.0)
    rows = rows[np.isfinite(rows).all(axis=(1, 2))]
    sigmas = np.linalg.svd(rows / np.linalg.norm(rows, axis=-1, keepdims=True), compute_uv=False)
    return bool((sigmas[:, -1] <= _VANISHING * sigmas[:, 0]).all())


@lru_cache(maxsize=64)
def _poses(robot: Manipulator) -> Array:
    """Return random poses (K, m) in reach, singular (type II) or not; (0, m) if none is found."""
    try:
        # Limits, most of all those of short rams, leave few poses of a platform that tilts.
        limits, rng = not joints_limit_reach(robot), np.random.default_rng(0)
        return draw_poses(robot, _SAMPLES, rng, type_i=1e-3, limits=limits)
    except ModelError:
        return np.empty((0, robot.freedom))


def _vanishes_exactly(robot: Manipulator) -> bool:
    """Return whether the type-II measure is exactly zero at random states, modulo primes."""
    measure = general_program(robot, "type_ii").function
    rng = random.Random(0)
    for prime in _PRIMES:
        field, zeros = PrimeField(prime), 0
        try:
            vector = modular_geometry(robot, field)
        except NoSquareRoot:
            continue
        if vector is None:
            return False
        evaluate = Evaluation(measure, field, [vector])
        for _ in range(_ATTEMPTS):
            pose = [rng.randrange(prime) for _ in range(robot.freedom)]
            try:
                measure_value = evaluate(pose)[0][0]
            except (NoSquareRoot, ZeroDivisionError):
                continue
            if measure_value:
                return False
            zeros += 1
            if zeros == _ZEROS:
                return True
    return False


def _reason(robot: Manipulator) -> str:
    """Return as text why a machine is singular at every pose: the simplest cause that holds."""
    poses = _poses(robot)
    if not len(poses):
        poses = np.zeros((1, robot.freedom))
    lengths = len(robot.platform.lengths)
    jacobian = numeric(robot, "jacobian")(poses)[0]
    forces = jacobian[..., :lengths]
    if lengths == 3 and (axis := _always_free(forces)) is not None:
        return (
            f"the legs' rows all lie across {_round_components(axis)}, along which no actuator "
            "holds the platform"
        )
    if _points_are_in_line(robot):
        where = " through P" if robot.platform.fixed_point else ""
        where = " along the platform's axis" if robot.platform.turning_axis else where
        return f"all platform points lie on one line{where}, about which no force then has a moment"
    if balance := balance_of_rams(robot):
        return balance
    if closure_of(robot).orientation is not None and _has_fourfold_symmetry(robot, forces[0]):
        return (
            "the layout has fourfold symmetry about the platform's axis, for which A = B = 0 in "
            "det J ~ A cos(phi) + B sin(phi)"
        )
    legs = _dependent_legs(jacobian)
    if len(legs) == 1:
        return f"the row of leg {legs[0]} of J is zero: its joint does not move the platform"
    if len(legs) < robot.joint_count:
        *first_legs, last = map(str, legs)
        return f"the rows of legs {', '.join(first_legs)} and {last} of J depend on each other"
    if (axis := _always_free(jacobian)) is not None and lengths < robot.freedom:
        motion_text = ", ".join(f"{v:.3g}" for v in axis + 0.0)
        names = ", ".join(robot.column_names["velocity"])
        return f"no actuator withholds the platform's motion ({names}) = ({motion_text})"
    if closure_of(robot).orientation is not None:
        return "A = B = 0 in det J ~ A cos(phi) + B sin(phi)"
    return "det J vanishes at every pose that was looked at"


def _points_are_in_line(robot: Manipulator) -> bool:
    """Return whether the platform can turn about a line that has all its points."""
    points = np.array([leg.platform_point for leg in robot.legs])
    return bool(robot.wraps.any()) and robot.platform.has_points_in_line(points)


def _always_free(rows: Array) -> Array | None:
    """Return the unit direction (m,) perpendicular to all rows (K, n, m), or None."""
    sizes = np.linalg.norm(rows, axis=-1, keepdims=True)
    stacked = (rows / np.where(sizes > 0.0, sizes, 1.0)).reshape(-1, rows.shape[-1])
    _, sigmas, axes = np.linalg.svd(stacked)
    if len(sigmas) == rows.shape[-1] and sigmas[-1] > _VANISHING * sigmas[0]:
        return None
    axis = axes[-1] * np.sign(axes[-1][np.abs(axes[-1]).argmax()])
    return np.where(np.abs(axis) < 1e-9, 0.0, axis)


def _round_components(axis: Array) -> list[float]:
    """Return an axis (3,) rounded to three decimals, without negative zeros."""
    return [round(float(v), 3) + 0.0 for v in axis]


def _dependent_legs(rows: Array) -> list[int]:
    """Return the legs, from 1, whose Jacobian rows (K, n, m) are dependent at all poses."""
    _, _, axes = np.linalg.svd(np.swapaxes(rows, -1, -2))
    weights = np.abs(axes[:, -1, :]).max(axis=0)
    return [i for i, weight in enumerate(weights, start=1) if weight > 1e-8]


def _has_fourfold_symmetry(robot: Manipulator, bars: Array) -> bool:
    """Return whether a quarter turn about k permutes the legs' row directions and points."""
    x0, y0, k = (np.array(axis) for axis in robot.platform.frame)
    quarter = np.outer(y0, x0) - np.outer(x0, y0) + np.outer(k, k)
    points = np.array([leg.platform_point[:2] for leg in robot.legs])
    lines = np.array([np.outer(bar, bar) for bar in bars])
    rotated_lines = quarter @ lines @ quarter.T
    rotated_points = points @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    sizes = np.abs(lines).max(), max(np.abs(points).max(), 1e-300)
    same = (np.abs(rotated_lines[:, None] - lines).max(axis=(-2, -1)) <= 1e-9 * sizes[0]) & (
        np.abs(rotated_points[:, None] - points).max(axis=-1) <= 1e-9 * sizes[1]
    )
    return bool(same.any(axis=1).all())


def singular_everywhere(robot: Manipulator, index: tuple[int, ...] = ()) -> SingularPose:
    """Return the error that says why a machine is singular at every pose."""
    return SingularPose(
        f"singular at every pose (type II): {architecture(robot).reason}; with the actuators held "
        "still the platform can move; change what the Jacobian depends on, a leg's "
        f"{alternatives(jacobian_keys(robot))}",
        kind="II",
        measure=0.0,
        index=index,
        subject=robot.name,
    )
