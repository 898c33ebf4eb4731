"""How much of its guide each slider uses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pteron.conventions import PoseLike
from pteron.errors import DataError
from pteron.kernels import Array
from pteron.kinematics import inverse_kinematics
from pteron.manipulator import Manipulator
from pteron.workspace.reserve import clearances

__all__ = ["SliderRanges", "slider_ranges"]


@dataclass(frozen=True)
class SliderRanges:
    """The part of its guide that each slider uses.

    Attributes
    ----------
    least, greatest : array, shape (n,)
        Of the slider coordinate, m.
    limits : tuple of ((float, float) or None)
        What the machine allows, m; None where it does not say.
    within : array of bool, shape (n,)
        Whether the range lies within the limits; True where there are none.
    """

    least: Array
    greatest: Array
    limits: tuple[tuple[float, float] | None, ...]
    within: NDArray[np.bool_]


def slider_ranges(robot: Manipulator, poses: PoseLike) -> SliderRanges:
    """Return the least and the greatest slider coordinate over poses.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    poses : array, shape (..., m)
        At least one pose, m and rad.

    Returns
    -------
    SliderRanges

    Raises
    ------
    DataError
        If there is no pose.
    UnreachablePose
        If a leg's links do not reach a pose.

    Examples
    --------
    >>> import pteron
    >>> from pteron.workspace import slider_ranges
    >>> ranges = slider_ranges(pteron.load("tripteron"), [[0.0, 0.1, 0.0], [0.1, 0.0, 0.0]])
    >>> ranges.greatest, bool(ranges.within.all())
    (array([0.1, 0.1, 0. ]), True)
    """
    sliders = inverse_kinematics(robot, poses).reshape(-1, robot.freedom)
    if not len(sliders):
        raise DataError("poses: none given, at least one expected")
    return SliderRanges(
        sliders.min(axis=0),
        sliders.max(axis=0),
        tuple(leg.slider_limits for leg in robot.legs),
        np.asarray((clearances(robot, sliders) >= 0.0).all(axis=0)),
    )
