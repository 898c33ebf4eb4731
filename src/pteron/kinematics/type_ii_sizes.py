"""The absolute type-II measure of poses, to compare with a least value (a floor)."""

from __future__ import annotations

import numpy as np

from pteron.kernels import Array, numeric
from pteron.manipulator import Manipulator
from pteron.shapes import PoseLike


def type_ii_sizes(robot: Manipulator, poses: PoseLike) -> Array:
    """Return the size (...) of the type-II measure of poses (..., m), 0 where it is not finite.

    So a pose out of reach, or where a leg loses its force, passes no floor.
    """
    sizes = np.abs(numeric(robot, "type_ii")(poses)[0])
    return np.where(np.isfinite(sizes), sizes, 0.0)
