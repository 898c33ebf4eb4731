"""The global conditioning index: the mean over reach of 1 / c, c the condition number."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import ArrayLike

from pteron.arguments import expect_to_fit
from pteron.errors import DataError, ModelError
from pteron.indices.evaluation import evaluate
from pteron.kernels import as_array, numeric
from pteron.kinematics.evaluate import finite_pose
from pteron.manipulator import RobotLike, as_manipulator
from pteron.result import Result
from pteron.shapes import PoseLike, Seed
from pteron.workspace import bounding_box
from pteron.workspace.margins import distance_to_limits

_GROUPS = 16
"""Independent scrambled sequences of poses, whose spread gives the standard error."""


@dataclass(frozen=True, eq=False, repr=False)
class GlobalConditioning(Result):
    """The mean of 1 / c over poses in reach.

    Attributes
    ----------
    value : float
        The mean of 1 / c, in (0, 1]; 1 for a machine that is isotropic everywhere.
    standard_error : float
        Standard error of `value`.
    share : float
        Share of the box that is in reach, within the joints' limits.
    count : int
        Number of poses in the box.
    """

    value: float
    standard_error: float
    share: float
    count: int


def global_conditioning(
    robot: RobotLike,
    pose: PoseLike,
    *,
    box: ArrayLike | None = None,
    points: bool = False,
    count: int = 1 << 16,
    seed: Seed = 0,
) -> GlobalConditioning:
    """Return the global conditioning index: mean of 1 / condition number over poses in reach.

    C. Gosselin, J. Angeles, Journal of Mechanical Design 113 (1991) 220-226. The integrals are
    over the poses in reach within the joints' limits, by scrambled Sobol points.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose : array, shape (m,)
        Gives the orientation, m and rad: all positions in reach at this orientation count.
    box : array, shape (2, m), optional
        Least and greatest pose of a box: then all poses in reach in it count, of any orientation.
    points : bool
        Whether c is that of `condition_points` instead of `condition`.
    count : int
        Number of poses, rounded up to 16 times a power of two.
    seed : int
        Seed of the random numbers.

    Returns
    -------
    GlobalConditioning

    Raises
    ------
    ModelError
        If no pose is in reach.
    DataError
        If the box has a side of no length, or there are no samples.

    Examples
    --------
    >>> from pteron.indices import global_conditioning
    >>> global_conditioning("tripteron", [0.0, 0.0, 0.0], count=1024).value
    1.0
    """
    robot = as_manipulator(robot)
    if count < 1:
        raise DataError(f"count: {count} given, at least 1 expected")
    expect_to_fit("count", count, 4.0 * count / _GROUPS * robot.freedom)
    home = finite_pose(robot, pose, "pose")
    if box is None:
        low, high = np.array([home, home])
        sides = bounding_box(robot, home)
        low[: sides.shape[1]], high[: sides.shape[1]] = sides
        free = np.arange(robot.freedom) < sides.shape[1]
    else:
        low, high = as_array(box, "box", (2, robot.freedom))
        free = high > low
        if not (np.isfinite(high - low).all() and free.any() and (high >= low).all()):
            raise DataError("box: [least, greatest] of every coordinate expected, finite")
    name = "condition_points" if points else "condition"
    power = max(int(np.ceil(np.log2(count / _GROUPS))), 0)
    sums = []
    for generator in np.random.default_rng(seed).spawn(_GROUPS):
        unit = scipy.stats.qmc.Sobol(int(free.sum()), rng=generator).random_base2(power)
        poses = np.tile(low, (len(unit), 1))
        poses[:, free] += unit * (high - low)[free]
        margin = numeric(robot, "reach")(poses)[0]
        inside = np.minimum(margin, distance_to_limits(robot, poses)).min(axis=-1) >= 0.0
        # At the edge of reach the index is not defined, and 1 / c is taken as 0.
        inverse_conditions = np.nan_to_num(
            1.0 / np.asarray(evaluate(robot, name, poses[inside], on_failure="nan"))
        )
        sums.append((inverse_conditions.sum(), inside.sum()))
    total, inside_count = np.array(sums, dtype=float).T
    if not inside_count.any():
        raise ModelError(
            "no pose that was tried is in reach within the joints' limits; move or widen the box, "
            "or give more samples",
            subject=robot.name,
        )
    mean = float(total.sum() / inside_count.sum())
    error = float(np.sqrt(_GROUPS / (_GROUPS - 1) * ((total - mean * inside_count) ** 2).sum()))
    sample_count = _GROUPS << power
    return GlobalConditioning(
        mean,
        error / float(inside_count.sum()),
        float(inside_count.sum()) / sample_count,
        sample_count,
    )
