"""What the joints of a machine measure, for the labels of a figure."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pteron.legs.kind import SLIDER, ActuatedJoint
from pteron.manipulator import RobotLike, as_manipulator


def joints_of(robot: RobotLike | None, values: ArrayLike) -> list[ActuatedJoint]:
    """Return each leg's joint; without a machine, a slider for each column of values (..., n)."""
    if robot is None:
        return [SLIDER] * np.shape(values)[-1]
    return [leg.joint for leg in as_manipulator(robot).legs]
