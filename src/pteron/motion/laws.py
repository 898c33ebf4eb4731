"""The time law of a move from rest to rest, with its exact derivatives."""

from __future__ import annotations

import numpy as np

from pteron.kernels import Array


def quintic(tau: Array, begin: float, end: float) -> tuple[Array, Array, Array]:
    """Return a move from 0 to 1 within [begin, end], and its first two derivatives.

    s = 10 t^3 - 15 t^4 + 6 t^5 with t = (tau - begin) / (end - begin): velocity and acceleration
    are zero at both ends, so that it joins rest without a jump of either.

    Parameters
    ----------
    tau : array
        Time, in any unit.
    begin, end : float
        When the move starts and ends, in the same unit.

    Returns
    -------
    s, ds, dds : array
        With the shape of `tau`; per unit of time, and per unit squared.

    Examples
    --------
    >>> import numpy as np
    >>> [float(v) for v in quintic(np.array(0.5), 0.0, 1.0)]
    [0.5, 1.875, 0.0]
    """
    span = end - begin
    t = np.clip((tau - begin) / span, 0.0, 1.0)
    rest = 1.0 - t
    return (
        t**3 * (10.0 - 15.0 * t + 6.0 * t**2),
        30.0 * t**2 * rest**2 / span,
        60.0 * t * rest * (rest - t) / span**2,
    )
