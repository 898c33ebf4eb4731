"""A model with more columns behind its own, which `observations_of` takes as a model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pteron.identification.model import Model
from pteron.identification.signals import States
from pteron.kernels import Array
from pteron.manipulator import Manipulator


@dataclass(frozen=True)
class ExtendedModel:
    """A model with so many columns more; `matrix` returns all of them (R, n, p + count)."""

    model: Model
    count: int
    matrix: Callable[[States], Array]

    @property
    def robot(self) -> Manipulator:
        """The machine."""
        return self.model.robot

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the values; those of further columns are numbers."""
        return (*self.model.names, *map(str, range(self.count)))

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the values; further columns have none."""
        return (*self.model.units, *("",) * self.count)

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of the values, as `Model.kinds`."""
        return (*self.model.kinds, *("further",) * self.count)


def extended(model: Model, count: int, columns: Callable[[States], Array]) -> ExtendedModel:
    """Return a model with further columns (R, n, count) at states."""
    return ExtendedModel(
        model, count, lambda states: np.concatenate([model.matrix(states), columns(states)], -1)
    )
