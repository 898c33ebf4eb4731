"""Names of array shapes, for the type hints of the public functions; and the failure modes.

`...` are the batch axes, n the legs, m the pose coordinates (n = m), k the assembly modes and N the
inertial parameters. SI units and radians; poses are ordered (x, y, z, phi), or (x, y, z) for 3T.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

__all__ = [
    "BatchOfMatrices",
    "BatchOfNumbers",
    "BatchOfPoses",
    "BatchOfRegressors",
    "BatchOfSliders",
    "BatchOfVectors",
    "OnFailure",
    "PoseLike",
    "SliderLike",
]

OnFailure = Literal["raise", "nan"]
"""What a batch function does with a pose it cannot serve: raise the error, or return NaN there."""

PoseLike = ArrayLike
"""(..., m): poses, velocities, accelerations or wrenches, as given."""
SliderLike = ArrayLike
"""(..., n): slider coordinates or actuator forces, as given."""

BatchOfPoses = Float[np.ndarray, "*batch m"]
BatchOfSliders = Float[np.ndarray, "*batch n"]
BatchOfNumbers = Float[np.ndarray, "*batch"]
BatchOfVectors = Float[np.ndarray, "*batch n 3"]
BatchOfMatrices = Float[np.ndarray, "*batch n m"]
BatchOfRegressors = Float[np.ndarray, "*batch n N"]
