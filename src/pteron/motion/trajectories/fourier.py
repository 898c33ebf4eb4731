"""Finite Fourier series in time: basis, sums, and periodic motions of the platform."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pteron.arguments import checked_arguments
from pteron.errors import DataError
from pteron.kernels import Array
from pteron.manipulator import RobotLike, as_manipulator
from pteron.motion.motion import Motion
from pteron.motion.trajectories.checks import check_motion
from pteron.motion.trajectories.time_law import STEP, sample_curve
from pteron.motion.trajectories.tool import Curve

_BLOCK = 1 << 14
"""Rows of a basis that are held at a time."""


@checked_arguments
@dataclass(frozen=True)
class FourierSeries:
    """x(t) = center + sum over h of a_h cos(h w t) + b_h sin(h w t), with w = 2 pi / period.

    Attributes
    ----------
    center : tuple of float
        The pose in the middle, the mean (m,), m and rad.
    cosines, sines : tuple of tuple of float
        Coefficients a_h and b_h, (H, m) each, of the harmonics 1 to H; m and rad.
    period : float
        s.

    Raises
    ------
    DataError
        If the period is not above 0 or the shapes do not fit.

    Examples
    --------
    >>> import numpy as np
    >>> from pteron.motion import FourierSeries
    >>> swing = FourierSeries((0.0, 0.0), ((0.05, 0.0),), ((0.0, 0.05),), 2.0)
    >>> swing.at(np.array([0.0, 0.5]))[0].round(12)
    array([[0.05, 0.  ],
           [0.  , 0.05]])
    """

    center: tuple[float, ...]
    cosines: tuple[tuple[float, ...], ...]
    sines: tuple[tuple[float, ...], ...]
    period: float

    def __post_init__(self) -> None:
        shapes = [np.shape(part) for part in (self.center, self.cosines, self.sines)]
        m = len(self.center)
        if shapes[1] != shapes[2] or len(shapes[1]) != 2 or shapes[1][1] != m:
            raise DataError(
                f"center, cosines, sines: shapes {shapes} given, (m,), (H, m) and (H, m) expected"
            )
        if not (np.isfinite(self.period) and self.period > 0.0):
            raise DataError(f"period: {self.period} s given, a number above 0 expected")
        object.__setattr__(self, "center", tuple(float(number) for number in self.center))
        for name in ("cosines", "sines"):
            rows = np.asarray(getattr(self, name), dtype=float).tolist()
            object.__setattr__(self, name, tuple(tuple(row) for row in rows))

    @property
    def harmonics(self) -> int:
        """Number of harmonics, H."""
        return len(self.cosines)

    @property
    def coefficients(self) -> Array:
        """Centre, cosine and sine coefficients of the series as one array (2 H + 1, m)."""
        return np.vstack([self.center, self.cosines, self.sines])

    def at(self, time: ArrayLike) -> Curve:
        """Return pose, velocity and acceleration of the series, (T, m) each, at times (T,), s."""
        return fourier_curve(self.coefficients, self.period, np.asarray(time, dtype=float))


def fourier_curve(coefficients: Array, period: float, times: Array) -> Curve:
    """Return sums of Fourier coefficients (2 H + 1, m) at times (T,), s, and two derivatives."""
    harmonics = len(coefficients) // 2
    blocks = [
        [basis @ coefficients for basis in fourier_bases(times[rows], harmonics, period)]
        for rows in row_blocks(len(times))
    ]
    series, first, second = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
    return series, first, second


def fourier_basis(times: Array, harmonics: int, period: float) -> Array:
    """Return 1, the cosine and the sine of each harmonic at times (T,), s: (T, 2 H + 1).

    The columns are 1, then all cosines, then all sines.
    """
    return next(fourier_bases(times, harmonics, period))


def fourier_bases(times: Array, harmonics: int, period: float) -> Iterator[Array]:
    """Yield the Fourier basis (T, 2 H + 1) at times (T,), s, its first and second derivative."""
    w = 2.0 * np.pi / period * np.arange(1, harmonics + 1)
    angles = np.outer(np.remainder(times, period), w)
    cosines, sines = np.cos(angles), np.sin(angles)
    for constant in (1.0, 0.0, 0.0):
        yield np.hstack([np.full((len(times), 1), constant), cosines, sines])
        cosines, sines = -w * sines, w * cosines


def row_blocks(rows: int) -> Iterator[slice]:
    """Yield slices of at most `_BLOCK` rows that cover all rows; one empty slice if rows is 0."""
    for start in range(0, max(rows, 1), _BLOCK):
        yield slice(start, min(start + _BLOCK, rows))


def fourier_motion(robot: RobotLike, series: FourierSeries, step: float = STEP) -> Motion:
    """Return a period of a Fourier series as a motion; its initial velocity is not zero.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    series : FourierSeries
        Of as many coordinates as the machine's poses have.
    step : float
        Time between samples, s.

    Returns
    -------
    Motion

    Raises
    ------
    DataError
        If the series has another number of coordinates.
    UnreachablePose, SingularPose
        If the machine cannot do it; see `check_motion`.

    Examples
    --------
    >>> import pteron
    >>> from pteron.motion import FourierSeries, fourier_motion
    >>> swing = FourierSeries((0.0, 0.0, 0.0), ((0.05, 0.0, 0.0),), ((0.0, 0.05, 0.0),), 2.0)
    >>> fourier_motion(pteron.load("tripteron"), swing).repeat(3).duration
    6.0
    """
    robot = as_manipulator(robot)
    motion = sample_curve(series.at, series.period, step)
    check_motion(robot, motion)
    return motion
