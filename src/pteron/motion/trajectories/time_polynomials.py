"""Time laws from rest to rest: polynomials of degree five (quintic) or seven."""

from __future__ import annotations

from typing import Literal, Protocol, get_args, runtime_checkable

import numpy as np

from pteron.arguments import expect_one_of
from pteron.kernels import Array

PolynomialLaw = Literal["quintic", "seventh"]
"""The polynomial of a motion from rest to rest, by its degree."""


@runtime_checkable
class Progress(Protocol):
    """A time law from rest to rest: the fraction of the path covered, over a unit of time."""

    def __call__(self, tau: Array, /) -> tuple[Array, Array, Array]:
        """Return the covered share of the path (0 to 1) and two derivatives at tau, (T,) each."""


def polynomial(law: PolynomialLaw) -> Progress:
    """Return the time law: the polynomial from 0 to 1 whose derivatives vanish at both ends.

    The quintic, 10 t^3 - 15 t^4 + 6 t^5, has two such derivatives; the polynomial of the seventh
    degree, 35 t^4 - 84 t^5 + 70 t^6 - 20 t^7, has three, so that the jerk is zero at both ends too.

    Examples
    --------
    >>> import numpy as np
    >>> from pteron.motion.trajectories.time_polynomials import polynomial
    >>> [float(v[0]) for v in polynomial("seventh")(np.array([0.5]))]
    [0.5, 2.1875, 0.0]
    """
    expect_one_of(get_args(PolynomialLaw), law=law)
    factors = {
        "quintic": [0.0, 0.0, 0.0, 10.0, -15.0, 6.0],
        "seventh": [0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0],
    }
    s = np.polynomial.Polynomial(factors[law])
    ds, dds = s.deriv(1), s.deriv(2)

    def progress(tau: Array) -> tuple[Array, Array, Array]:
        """Return the covered share of the path and its first two derivatives by tau, (T,) each."""
        t = np.clip(tau, 0.0, 1.0)
        return s(t), ds(t), dds(t)

    return progress
