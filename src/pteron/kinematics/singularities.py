"""Type-II singularities, where the actuators, held still, no longer hold the platform.

`best_type_ii` finds a machine's largest measure, `singular_orientations` the singular angles phi.
"""

from __future__ import annotations

from functools import lru_cache, partial

import numpy as np
from numpy.typing import ArrayLike

from pteron.equations.machine import closure_of
from pteron.errors import DataError, SingularPose
from pteron.kernels import Array, as_array, geometry_only, numeric
from pteron.kernels.bisection import bisect_condition
from pteron.kernels.program_cache import cached_result
from pteron.kinematics.architecture import expect_regular, is_singular_everywhere
from pteron.kinematics.sampling import draw_poses, finite_sizes, holding_measures
from pteron.kinematics.simplex_ascent import climb
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.tolerances import ROUNDING

_VANISHING = 1e-10
"""Size of the type-II measure that counts as zero where no angle in reach has a larger one."""


_DRAWN = 4096
"""Random poses among which the best type-II measure is sought."""

_FOREMOST = 6
"""The best of these poses, each improved by a local search."""

_TRIES = 200.0
"""Evaluations of the measure in each local search."""

_IMPROVED = 1e-7
"""Improvement of the measure below which a local search ends."""

_SHARE, _STEP = 0.05, 0.00025
"""First steps of a local search, as a share of each coordinate; in m or rad where it is zero."""

_ANGLES = 720
"""Samples of the platform's angle phi over a turn."""

_HALVINGS = 50
"""Bisections between two samples, half a degree apart: down to rounding."""


def best_type_ii(robot: Manipulator) -> float:
    """Return the largest absolute type-II measure over poses in reach; 1 if all are singular.

    The best of many random poses are improved by the Nelder-Mead method. Joint limits are ignored,
    so that the value depends on the geometry alone.
    """
    return float(best_holding(robot)[0])


@lru_cache(maxsize=64)
def best_holding(robot: Manipulator) -> Array:
    """Return the largest absolute value of each of the `holding_measures` (k,), as for type II."""
    geometry = geometry_only(robot)
    return np.array(
        [
            cached_result((f"best_{name}", geometry), ("kinematics",), partial(_best, robot, name))
            for name in holding_measures(robot)
        ]
    )


def _best(robot: Manipulator, name: str) -> float:
    """Return the largest absolute value of a measure, by local searches from random poses."""

    def measure(poses: Array) -> Array:
        """Return the measures (K,) of poses (K, m); 0 out of reach."""
        reached = ~np.isnan(numeric(robot, "reach")(poses)[1]).any(axis=-1)
        return np.where(reached, finite_sizes(numeric(robot, name)(poses)[0]), 0.0)

    if is_singular_everywhere(robot):
        return 1.0  # no share of rounding
    drawn = draw_poses(robot, _DRAWN, np.random.default_rng(0), limits=False)
    starts = drawn[np.argsort(-measure(drawn), kind="stable")[:_FOREMOST], None]
    stepped = np.where(starts == 0.0, _STEP, (1.0 + _SHARE) * starts)
    simplices = np.where(np.eye(robot.freedom, dtype=bool), stepped, starts)
    _, sizes = climb(
        measure,
        np.concatenate([starts, simplices], axis=1),
        size=np.inf,
        gain=_IMPROVED,
        evaluations=_TRIES,
    )
    largest = float(sizes.max())
    return 1.0 if largest <= _VANISHING else largest


def singular_orientations(robot: RobotLike, position: ArrayLike | None = None) -> Array:
    """Return the platform angles (A,), rad, at which the machine is singular (type II).

    For P-R-R-R legs under a 3T1R platform det J is a multiple of A cos(phi) + B sin(phi), whatever
    the position: there are two singular orientations, 180 degrees apart. For other legs they depend
    on the position; each is found where det J, sampled over phi within reach, changes its sign.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    position : array, shape (k,), optional
        The pose's lengths, k = 2 or 3, m. Without it only such orientations are returned as are
        singular at every position.

    Returns
    -------
    array, shape (A,)
        The angles in rad, ascending, in (-pi, pi]; none where the platform does not turn, or where
        it tilts, which is singular in whole families of orientations.

    Raises
    ------
    SingularPose
        If every pose is singular, or every orientation at this position.
    DataError
        If the position is not k finite numbers.

    Examples
    --------
    >>> import numpy as np, pteron
    >>> np.degrees(pteron.kinematics.singular_orientations(pteron.load("quadrupteron")))
    array([-90.,  90.])
    """
    robot = as_manipulator(robot)
    expect_regular(robot)
    position_array = None
    if position is not None:
        names = robot.platform.lengths
        position_array = as_array(position, "position", (len(names),), columns=names)
        if position_array.ndim > 1 or not np.isfinite(position_array).all():
            raise DataError(
                f"position: {position_array.tolist()} given, one row of finite numbers expected"
            )
    orientation = closure_of(robot).orientation
    if orientation is not None:
        a, b = (float(coefficient) for coefficient in orientation)
        angle = np.arctan2(b, a) + np.pi / 2
        return np.sort(_wrap_angles(np.array([angle, angle - np.pi])))
    if position_array is None or robot.platform.axis_angle is None:
        return np.empty(0)
    return _sign_changes(robot, position_array)


def _sign_changes(robot: Manipulator, position: Array) -> Array:
    """Return the angles, rad, at which the type-II measure at a position changes its sign."""

    def measure(angles: Array) -> Array:
        """Return the type-II measures (K,) at the position with angles (K,), rad."""
        positions = np.broadcast_to(position, (*angles.shape, len(position)))
        poses = np.concatenate([positions, angles[:, None]], axis=-1)
        return np.asarray(numeric(robot, "type_ii")(poses)[0])

    # Round angles, where many machines are singular, lie between the samples. The last is the first
    # again, but for a platform that slides.
    count = _ANGLES + bool(robot.platform.rotation_axes)
    angles = np.pi * ((2.0 * np.arange(count) + 1.0) / _ANGLES - 1.0)
    measures = measure(angles)
    negative, known = measures < 0.0, ~np.isnan(measures)
    if known.any() and (np.abs(measures[known]) <= _VANISHING).all():
        raise SingularPose(
            f"{robot.name}: singular in every orientation (type II) that is in reach at position "
            f"{position.tolist()}; choose another position",
            kind="II",
            measure=0.0,
            index=(),
        )
    first = np.flatnonzero((negative[1:] != negative[:-1]) & known[1:] & known[:-1])
    low, high, side = angles[first], angles[first + 1], negative[first]
    low, _ = bisect_condition(lambda angle: (measure(angle) < 0.0) == side, low, high, _HALVINGS)
    is_zero = np.abs(measure(low)) <= ROUNDING  # else a gap in the reach lies between two samples
    return np.sort(_wrap_angles(low[is_zero]))


def _wrap_angles(angles: Array) -> Array:
    """Return angles wrapped to (-pi, pi], rad."""
    return np.asarray(np.pi - (np.pi - angles) % (2.0 * np.pi))
