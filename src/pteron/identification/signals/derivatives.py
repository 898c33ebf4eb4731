"""Differentiators: from measured positions to smooth positions, rates and accelerations.

There are three: Fourier series, central differences, and splines. `whole` says whether one takes a
log as a whole, not in blocks; `edge` is how many rows it loses at each end of a block;
`differentiated` is a block's motion, at the forces' own instants: those of the samples less the
forces' `delay`, s; `curve` is the log's motion as a curve; above the frequency `fastest`, Hz,
nothing of the positions is left. The band is that of the parallel filter, Hz.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import ceil
from typing import ClassVar, Literal, NamedTuple

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.identification.logs import Log
from pteron.identification.signals.filters import SETTLING, lowpass
from pteron.identification.signals.fourier import FittedSeries, fitted_series
from pteron.kernels import Array
from pteron.motion.trajectories.fourier import fourier_bases

Derivatives = Literal["periodic", "central", "spline"]
"""The differentiators' names."""

LOST = 4
"""Samples at each end that have no central difference."""

_FIRST = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])
"""Central difference of eighth order for the first derivative."""

_SECOND = np.array([-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560])
"""The same for the second derivative."""

EVEN = 1e-3
"""Deviation from even steps, in steps, that is a matter of how stamps were written."""

_DEGREE = 7
"""Degree of splines: the error of the second derivative falls with the sixth power of the
sampling."""

_SPLINE_SETTLING = 20.0
"""Knots at a block's ends that feel where it ends; the feeling halves from each to the next."""

_ENDS = 2.0
"""Knots at each end of a fitted spline whose samples say little: few samples hold it there."""

_AGREES = 1e-7
"""Relative difference of two second derivatives that is their error on a smooth motion."""

_FEW = 0.5
_ROUNDING = 1e-14
_SMEARED = 24
"""Samples to each side of a jump that a spline of degree 7 spreads it over, to 1e-7 of it."""


class Differentiated(NamedTuple):
    """A block of a log without its edges: R samples."""

    time: Array
    motion: tuple[Array, Array, Array]
    """Coordinates, rates and accelerations (R, n)."""
    forces: Array
    smooth: NDArray[np.bool_]
    """False where positions without noise have a jump in a derivative, which a spline smears."""


@dataclass(frozen=True)
class Curve:
    """A motion as `coefficients` (C, n), m, of basis functions, at the T samples of a log.

    `bases` are the functions and their first and second derivatives (T, C) each; at `ends` samples
    at each end the curve is not well known.
    """

    coefficients: Array
    bases: tuple[scipy.sparse.csr_matrix, scipy.sparse.csr_matrix, scipy.sparse.csr_matrix]
    ends: int

    @property
    def motion(self) -> tuple[Array, Array, Array]:
        """Coordinates, rates and accelerations (T, n)."""
        q, dq, ddq = (np.asarray(basis @ self.coefficients) for basis in self.bases)
        return q, dq, ddq


@dataclass(frozen=True)
class _Sampled:
    """A differentiator with a sampling rate and a cut-off, Hz, and the forces' delay, s."""

    rate: float
    cutoff: float | None
    delay: float = 0.0
    whole: ClassVar[bool] = False

    @property
    def shift(self) -> int:
        """Rows at each end whose motion a delay of the forces, s, moves out of a block."""
        return ceil(abs(self.delay) * self.rate)

    def curve(self, log: Log) -> Curve:
        """Return the least-squares spline of the log's positions."""
        spline = fitted_spline(log.time, log.joints, self.cutoff)
        bases = tuple(_design(spline, log.time, k) for k in range(3))
        ends = ceil(_ENDS * self.rate / (2.0 * self.cutoff)) if self.cutoff else 0
        return Curve(spline.c, (bases[0], bases[1], bases[2]), ends)

    def fastest(self, band: float) -> float | None:
        """Return the cut-off, Hz: above it nothing passes, whatever the band; None without one."""
        return self.cutoff


@dataclass(frozen=True)
class CentralDifferences(_Sampled):
    """A low-pass filter without phase, then central differences of eighth order."""

    @property
    def edge(self) -> int:
        """Rows lost at each end: the filter's settling, the differences' own ends and the delay."""
        settling = ceil(SETTLING * self.rate / self.cutoff) if self.cutoff else 0
        return LOST + settling + self.shift

    def differentiate(self, block: Log, edge: int) -> Differentiated:
        """Return a block's motion and forces at even times, without `edge` rows at each end."""
        time, joints = uniform(block.time, block.joints)
        even = joints is block.joints
        forces = block.forces if even else uniform(block.time, block.forces)[1]
        rate = (len(time) - 1) / float(time[-1] - time[0])
        joints = lowpass(joints, rate, self.cutoff)
        first, second = central_differences(joints, rate)
        inner, lost = slice(edge, len(time) - edge), slice(edge - LOST, len(first) - (edge - LOST))
        parts = [joints[LOST:-LOST], first, second]
        if self.delay:
            known = time[LOST:-LOST]
            spline = partial(scipy.interpolate.make_interp_spline, known, k=5)
            parts = [spline(part)(known - self.delay) for part in parts]
        motion = parts[0][lost], parts[1][lost], parts[2][lost]
        return Differentiated(
            time[inner], motion, forces[inner], np.ones(len(motion[0]), dtype=bool)
        )


@dataclass(frozen=True)
class SmoothingSpline(_Sampled):
    """A spline of degree 7, through all samples or smoother where there is a cut-off."""

    @property
    def edge(self) -> int:
        """Rows lost at each end, where the spline depends on the block's end, and by the delay."""
        knot = 1.0 / (2.0 * self.cutoff) if self.cutoff else 1.0 / self.rate
        return ceil(_SPLINE_SETTLING * knot * self.rate) + self.shift

    def differentiate(self, block: Log, edge: int) -> Differentiated:
        """Return a block's motion and forces at its own times, without `edge` rows at each end."""
        inner = slice(edge, block.rows - edge)
        q, dq, ddq = spline_motion(block.time, block.joints, self.cutoff, self.delay)
        smooth = np.ones(block.rows, dtype=bool)
        if self.cutoff is None:
            smooth = _smooth_sections(block.time, block.joints)
        motion = q[inner], dq[inner], ddq[inner]
        return Differentiated(block.time[inner], motion, block.forces[inner], smooth[inner])


@dataclass(frozen=True)
class FourierFit:
    """A Fourier series over all periods of the log, with harmonics up to the cut-off."""

    period: float
    cutoff: float | None
    delay: float = 0.0
    whole: ClassVar[bool] = True
    edge: ClassVar[int] = 0

    def series(self, log: Log) -> FittedSeries:
        """Return the Fourier series of the log's positions, delayed as its forces are."""
        series = fitted_series(log.time, log.joints, self.period, highest=self.cutoff)
        return series.later(self.delay)

    def differentiate(self, block: Log, edge: int) -> Differentiated:
        """Return the log's motion and forces at its own times, all of them."""
        motion = self.series(block).at(block.time)
        return Differentiated(block.time, motion, block.forces, np.ones(block.rows, dtype=bool))

    def curve(self, log: Log) -> Curve:
        """Return the series at the log's samples."""
        series = self.series(log)
        q, dq, ddq = map(
            scipy.sparse.csr_matrix, fourier_bases(log.time, series.harmonics, self.period)
        )
        return Curve(series.coefficients, (q, dq, ddq), 0)

    def fastest(self, band: float) -> float | None:
        """Return the highest frequency that passes, Hz: cut-off or band; None without a cut-off."""
        return None if self.cutoff is None else max(self.cutoff, band)


Differentiator = CentralDifferences | SmoothingSpline | FourierFit


def uniform(time: Array, signal: Array) -> tuple[Array, Array]:
    """Return even times and the signals (T, k) there, by a quintic spline through the samples.

    Samples that are even already are returned as they are; the log's findings tell of uneven ones.
    """
    even = np.linspace(time[0], time[-1], len(time))
    step = (time[-1] - time[0]) / (len(time) - 1)
    if np.abs(time - even).max() <= EVEN * step:
        return even, signal
    return even, scipy.interpolate.make_interp_spline(time, signal, k=5)(even)


def central_differences(signal: Array, rate: float) -> tuple[Array, Array]:
    """Return first and second derivatives of uniform samples (T, k), central and of eighth order.

    They stand at the samples 4 to T - 5. At a hundredth of the sampling rate (Hz) they are wrong by
    1e-12, where the usual ones of second order are wrong by 1e-3.
    """
    first, second = (
        scipy.ndimage.correlate1d(signal, weights, axis=0)[LOST : len(signal) - LOST]
        for weights in (_FIRST, _SECOND)
    )
    return first * rate, second * rate**2


def fitted_spline(time: Array, signal: Array, cutoff: float | None) -> scipy.interpolate.BSpline:
    """Return the spline of degree 7 that is nearest to samples (T, k), or through them all.

    Its knots are half a period of the cut-off (Hz) apart: what is faster is taken for noise.
    """
    if cutoff is not None:
        pieces = int(np.ceil((time[-1] - time[0]) * 2.0 * cutoff))
        if pieces + _DEGREE < len(time) // 2:
            inner = np.linspace(time[0], time[-1], pieces + 1)
            knots = np.r_[[time[0]] * _DEGREE, inner, [time[-1]] * _DEGREE]
            return scipy.interpolate.make_lsq_spline(time, signal, knots, k=_DEGREE, method="qr")
    return scipy.interpolate.make_interp_spline(time, signal, k=_DEGREE)


def spline_motion(
    time: Array, signal: Array, cutoff: float | None, delay: float = 0.0
) -> tuple[Array, Array, Array]:
    """Return value, first and second derivative (T, k) of the fitted spline, `delay` s earlier."""
    spline = fitted_spline(time, signal, cutoff)
    at = time - delay
    return spline(at), spline(at, 1), spline(at, 2)


def _design(
    spline: scipy.interpolate.BSpline, time: Array, derivative: int
) -> scipy.sparse.csr_matrix:
    """Return a spline's basis functions (T, C) at times, or their derivatives."""
    if derivative == 0:
        return scipy.sparse.csr_matrix(
            scipy.interpolate.BSpline.design_matrix(time, spline.t, spline.k)
        )
    # A derivative is a spline of lower degree, whose coefficients are differences of these.
    slopes = scipy.interpolate.BSpline(spline.t, np.eye(len(spline.c)), spline.k).derivative(
        derivative
    )
    design = scipy.interpolate.BSpline.design_matrix(time, slopes.t, slopes.k)
    return scipy.sparse.csr_matrix(design @ scipy.sparse.csr_matrix(slopes.c[: design.shape[1]]))


def _smooth_sections(time: Array, joints: Array) -> NDArray[np.bool_]:
    """Return the samples (T,) at which a spline and central differences agree."""
    spline = fitted_spline(time, joints, None)
    even = np.linspace(time[0], time[-1], len(time))
    rate = (len(even) - 1) / float(even[-1] - even[0])
    _, second = central_differences(spline(even), rate)
    rounding = _ROUNDING * np.abs(joints).max() * rate**2
    least = _AGREES * np.abs(second).max(axis=0) + rounding
    differs = (np.abs(spline(even[LOST:-LOST], 2) - second) > least).any(axis=1)
    # They err in different ways next to a jump, as at the ends of a rest. Jumps are few: where most
    # samples are apart it is for another reason, such as the rounding of the stamps.
    if differs.mean() > _FEW:
        return np.ones(len(time), dtype=bool)
    differs = (
        scipy.ndimage.maximum_filter1d(np.pad(differs, LOST).astype(int), 2 * _SMEARED + 1) > 0
    )
    return np.asarray(~differs)
