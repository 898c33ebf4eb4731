"""Type hints that recur in public functions: array shapes, tables, seeds, numbers of workers.

`...` are the batch axes, n the legs, m the pose coordinates (n = m), k the assembly modes and N the
inertial parameters. SI units and radians; poses are ordered (x, y, z, phi), without z in a plane,
without phi where the platform does not turn, with three angles, or two, where it tilts.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from pteron.arguments import Between

if TYPE_CHECKING or "jaxtyping" in sys.modules:
    from jaxtyping import Float as Float, Int as Int
else:

    class _Unchecked:
        """An array's type hint where nobody who checks shapes has imported jaxtyping.

        Its import takes most of a tenth of a second, and what it says is for type checkers.
        """

        def __class_getitem__(cls, subscript: tuple[Any, str]) -> Any:
            return subscript[0]

    Float = Int = _Unchecked

OnFailure = Literal["raise", "nan"]
"""The action of a batch function at a pose that fails: raise the error, or return NaN there."""

Seed = Annotated[int, Between(0)] | None
"""The seed of random numbers: the same seed, the same result; None for others at every call."""


def seed_number(seed: Seed) -> int:
    """Return a seed as an integer; a random one for None."""
    return int(np.random.SeedSequence().generate_state(1)[0]) if seed is None else seed


Workers = Annotated[int, Between(1, 1024)]
"""Processes or threads that share the work."""


@runtime_checkable
class HasColumns(Protocol):
    """A table with named columns, such as a DataFrame."""

    @property
    def columns(self) -> Any:
        """Names of the table's columns."""


Columns = HasColumns | Mapping[str, Any]
"""A table whose columns are read by their names, as `Manipulator.column_names` has them: a
DataFrame of pandas or polars, or a mapping. Others than those asked for do not matter."""

PoseLike = ArrayLike | Columns
"""(..., m): poses, velocities, accelerations or wrenches, as given."""
JointsLike = ArrayLike | Columns
"""(..., n): joint coordinates or actuator forces, as given."""

PerCoordinate = Float[np.ndarray, "*batch m"]
PerJoint = Float[np.ndarray, "*batch n"]
Numbers = Float[np.ndarray, "*batch"] | np.float64
"""One number a state: NumPy makes a scalar of an array without axes wherever it computes."""
Series = Float[np.ndarray, " T"]
"""One number for each of T samples."""
Vectors = Float[np.ndarray, "*batch n 3"]
Matrices = Float[np.ndarray, "*batch n m"]
Poses = Float[np.ndarray, "*batch k m"]
Regressors = Float[np.ndarray, "*batch n N"]
