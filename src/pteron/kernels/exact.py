"""Target `exact`: rational arithmetic, one state at a time, for proofs and for reference."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pteron.errors import DataError
from pteron.kernels.fields import RationalField, evaluate
from pteron.kernels.kernel import Kernel, unmasked


class Exact(Kernel):
    """A kernel in fractions.

    It takes one state: integers, fractions and floats (as the fractions they are), and returns
    fractions. An angle phi is given as tan(phi / 2), so that its sine and cosine are rational.
    `NoSquareRoot` says that a root is not rational, `ZeroDivisionError` that a denominator
    vanishes.
    """

    @property
    def source(self) -> str:
        """The instructions, one a line, as CasADi prints them."""
        return str(self.function.str(True))

    def _evaluate(self, *values: ArrayLike, **fixed: ArrayLike) -> Any:
        given = self._by_name(values, fixed)
        inputs = []
        for port in self.ports:
            array = np.asarray(unmasked(given[port.name], port.name), dtype=object)
            if array.shape != port.shape:
                raise DataError(
                    f"{port.name}: shape {array.shape} given, {port.shape} expected: one state"
                )
            inputs.append([Fraction(value) for value in array.ravel().tolist()])
        found = evaluate(self.function, RationalField(), inputs)
        results = tuple(
            np.array(value, dtype=object).reshape(port.shape)
            for value, port in zip(found, self.outputs, strict=True)
        )
        return results[0] if len(results) == 1 else results
