"""How well a machine's drives hold its platform at home: in absolute terms, not of its own best."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from pteron.dynamics import inverse_dynamics
from pteron.errors import ModelError
from pteron.kernels import Array, geometry_only
from pteron.kinematics.ram_figures import similarity
from pteron.kinematics.sampling import draw_poses
from pteron.kinematics.singular_distance import coordinate_distances
from pteron.kinematics.unit_rows import least_singular_values, unit_rows
from pteron.manipulator import Manipulator
from pteron.thresholds import (
    HOLDING_FORCE,
    HOLDING_FORCE_NEAR,
    INACCURATE,
    LEAST_SINGULAR_VALUE,
    NEARBY,
    rounding_tolerance,
)
from pteron.workspace.margins import pose_margins

_POSES = 64
"""Random poses in reach at which the distance to singular coordinates is sought."""

_NEAR = 512
"""Random poses about home at which the weight is held."""


@dataclass(frozen=True)
class Holding:
    """How well the drives hold the platform, in quantities comparable between machines.

    Attributes
    ----------
    length : float
        L, m, which moments of the unit rows are divided by.
    least_singular_value : float
        Of the unit rows at home: a load takes leg forces up to its inverse times as great.
    distance : float
        Change of every point's coordinates and every length, m, that makes home singular.
    everywhere : float
        The greatest such change of many poses, m: no pose is farther from singular coordinates.
    rounding : float
        Rounding of coordinates, m, that these are compared with.
    weight : float
        Of all moving bodies, N.
    force : float
        Greatest force along a leg, referred to its platform point, that holds the weight at home,
        over the weight; NaN without gravity.
    force_near : float
        The greatest of the poses about home that are in reach, within limits.
    """

    length: float
    least_singular_value: float
    distance: float
    everywhere: float
    rounding: float
    weight: float
    force: float
    force_near: float


def measure_holding(robot: Manipulator, home: Array) -> Holding:
    """Return how well the drives hold the platform at home (m,) and near it."""
    poses = home[None]
    length, distance, everywhere = _singular_distances(geometry_only(robot), tuple(home.tolist()))
    nearby = _poses_near_home(robot, home)
    weight = _weight(robot)
    relative_forces = (
        _holding_forces(robot, np.vstack([poses, nearby])) / weight
        if weight > 0.0
        else np.array([np.nan])
    )
    return Holding(
        length,
        float(least_singular_values(robot, poses)[0]),
        distance,
        everywhere,
        rounding_tolerance(length),
        weight,
        float(relative_forces[0]),
        float(np.nanmax(relative_forces)) if weight > 0.0 else np.nan,
    )


@lru_cache(maxsize=256)
def _singular_distances(robot: Manipulator, home: tuple[float, ...]) -> tuple[float, float, float]:
    """Return the length L and the distances to singularity at home and at the best pose, m."""
    poses = np.array([home])
    drawn = draw_poses(robot, _POSES, np.random.default_rng(0), limits=False)
    distances = coordinate_distances(robot, np.vstack([poses, drawn]))
    length = unit_rows(robot, poses).length
    return length, float(distances[0]), float(np.nanmax(distances))


def _poses_near_home(robot: Manipulator, home: Array) -> Array:
    """Return random poses (K, m) about home that are in reach, within limits."""
    share, radians = NEARBY
    size = share * max(leg.size for leg in robot.legs)
    widths = np.where(robot.platform.angular, radians, size)
    poses = home + widths * np.random.default_rng(0).uniform(-1.0, 1.0, (_NEAR, robot.freedom))
    return poses[pose_margins(robot, poses).least > 0.0]


def _weight(robot: Manipulator) -> float:
    """Return the weight, N, of the platform and all bodies of the legs."""
    masses = [getattr(body, "mass", 0.0) for leg in robot.legs for body in leg.bodies.values()]
    mass = robot.platform.total_inertia.mass + sum(masses)
    return float(mass * np.linalg.norm(robot.gravity))


def _holding_forces(robot: Manipulator, poses: Array) -> Array:
    """Return the greatest force (K,) of a leg at its platform point that holds the weight, N."""
    zero_rates = np.zeros_like(poses)
    forces = inverse_dynamics(robot, poses, zero_rates, zero_rates, on_failure="nan")
    return np.asarray(np.abs(forces * unit_rows(robot, poses).sizes).max(axis=-1))


def expect_regular(robot: Manipulator, home: Array) -> None:
    """Raise ModelError if a machine is singular in every pose, up to the rounding of its file.

    Raises
    ------
    ModelError
        If no pose is farther from singular coordinates than files are rounded to.
    """
    length, _, everywhere = _singular_distances(geometry_only(robot), tuple(home.tolist()))
    rounding = rounding_tolerance(length)
    if everywhere > rounding:
        return
    similar = similarity(robot)
    figures = ""
    if similar is not None and similar[1] <= rounding:
        figures = (
            f"guide points and platform points are similar figures within {_length(similar[1])}, "
            f"the latter {similar[0]:.4g} times the former; "
        )
    least = float(least_singular_values(robot, home[None])[0])
    raise ModelError(
        f"singular everywhere within {_length(everywhere)} of these coordinates (type II), less "
        f"than the {_length(rounding)} that files are rounded to: {figures}leg forces are up to "
        f"{1.0 / least:.2g} times a load at the best pose found; "
        "change the figure of the platform points or that of the guide points",
        subject=robot.name,
    )


def holding_warnings(of: Holding) -> tuple[str, ...]:
    """Return warnings of drives that hold the platform badly at home, or of a near singularity."""
    warnings = []
    if of.everywhere <= INACCURATE * of.rounding:
        warnings.append(
            f"legs: coordinates that differ by {_length(of.everywhere)} make the machine singular "
            "(type II) at every pose: parts of ordinary accuracy may not hold the platform"
        )
    elif of.distance <= INACCURATE * of.rounding:
        warnings.append(
            f"home: coordinates that differ by {_length(of.distance)} make this pose singular "
            "(type II)"
        )
    if of.least_singular_value < LEAST_SINGULAR_VALUE:
        warnings.append(
            f"home: leg forces are up to {1.0 / of.least_singular_value:.2g} times a load, and "
            "errors of the legs move the platform by as much (least singular value "
            f"{of.least_singular_value:.2g} of the unit rows; 1 for three perpendicular legs)"
        )
    if of.force > HOLDING_FORCE:
        warnings.append(
            f"home: to hold the weight of the bodies, {of.weight:.3g} N, a leg has to push or pull "
            f"with {of.force:.3g} times as much"
        )
    elif of.force_near > HOLDING_FORCE_NEAR:
        warnings.append(
            f"home: near it a leg has to push or pull with {of.force_near:.3g} times the weight of "
            f"the bodies, {of.weight:.3g} N, to hold them: a singularity is near"
        )
    return tuple(warnings)


def _length(metres: float) -> str:
    """Return the text of a length, in um below 0.1 mm."""
    return f"{1e6 * metres:.2g} um" if metres < 1e-4 else f"{1e3 * metres:.2g} mm"
