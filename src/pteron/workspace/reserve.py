"""How far a pose is from everything that ends the machine's work, in numbers between 0 and 1."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pteron.conventions import BatchOfNumbers, BatchOfSliders, PoseLike
from pteron.kernels import Array, numeric
from pteron.manipulator import Manipulator

__all__ = ["Reserve", "clearances", "reserve"]


@dataclass(frozen=True)
class Reserve:
    """Three reserves of a pose; each is 1 at best and 0 where the machine fails.

    Attributes
    ----------
    elbow_sines : array, shape (..., n)
        The sine of each elbow's angle: 0 where the leg is stretched or folded (type I). Out of
        reach it is negative: the missing metres over the length of the two links.
    regularity : array, shape (...)
        abs(det J) over its largest value: 0 at a type-II singularity. It is 1 for 3T, whose
        Jacobian is constant.
    slider_clearances : array, shape (..., n)
        Distance of each slider from its nearer limit, over half its range; negative beyond it, and
        1 for a slider without limits.
    smallest : array, shape (...)
        The least of them all, which is what `home_pose` makes as large as it can.
    """

    elbow_sines: BatchOfSliders
    regularity: BatchOfNumbers
    slider_clearances: BatchOfSliders
    smallest: BatchOfNumbers


def reserve(robot: Manipulator, pose: PoseLike) -> Reserve:
    """Return the reserves of poses, in reach or not.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    pose : array, shape (..., m)
        The poses, m and rad.

    Returns
    -------
    Reserve

    Examples
    --------
    >>> import pteron
    >>> from pteron.workspace import reserve
    >>> reserve(pteron.load("quadrupteron"), [0.0, 0.0, 0.0, 0.0]).elbow_sines.round(3)
    array([1.   , 1.   , 0.991, 1.   ])
    """
    _, margin, sine = numeric(robot, "reach")(pose)
    spans = np.array([leg.upper_length + leg.lower_length for leg in robot.legs])
    sines = np.where(margin < 0.0, margin / spans, np.nan_to_num(sine))
    regularity = (
        np.abs(numeric(robot, "regularity")(pose))
        if robot.platform.turns
        else np.ones(sines.shape[:-1])
    )
    metres = clearances(robot, numeric(robot, "slider_coordinates")(pose))
    half = np.array([_half_range(leg.slider_limits) for leg in robot.legs])
    shares = np.where(np.isinf(metres), 1.0, metres) / half
    smallest = np.minimum(np.minimum(sines, shares).min(axis=-1), regularity)
    return Reserve(sines, regularity, shares, smallest)


def clearances(robot: Manipulator, sliders: Array) -> Array:
    """Return the distance (..., n) of sliders from their nearer limit, m.

    It is negative beyond a limit, infinite without limits, and NaN where the slider is.
    """
    limits = [leg.slider_limits or (-np.inf, np.inf) for leg in robot.legs]
    low, high = np.array(limits).T
    distances: Array = np.minimum(sliders - low, high - sliders)
    return distances


def _half_range(limits: tuple[float, float] | None) -> float:
    return 1.0 if limits is None else (limits[1] - limits[0]) / 2.0
