"""Preprocessing of a log: differentiator, filters and rates, chosen by the user or by the data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from pteron.arguments import expect, expect_one_of
from pteron.errors import DataError
from pteron.identification.logs import Log
from pteron.identification.signals.derivatives import (
    CentralDifferences,
    Derivatives,
    Differentiator,
    FourierFit,
    SmoothingSpline,
    central_differences,
    uniform,
)
from pteron.identification.signals.filters import (
    Decimation,
    bins_below,
    cutoff_of,
    lowpass,
    position_noise,
    white_noise,
)
from pteron.identification.signals.fourier import FittedSeries, fitted_series
from pteron.identification.signals.states import start_pose
from pteron.kernels import Array
from pteron.manipulator import RobotLike, as_manipulator
from pteron.renamed import former_attribute
from pteron.result import Result
from pteron.tolerances import LAST_DIGITS

_LARGEST_PERIODIC = 4_000_000
"""Rows up to which a periodic log is fitted in one piece: it takes 1 GB of memory."""

_LOOK = 120_000
"""Samples from which cut-offs are found: two minutes at 1 kHz show all that a motion has."""

_POWER = 0.999
"""Share of the speed's power within the bandwidth of a motion: what is beyond is 3 % of its
size."""

_HARMLESS = 0.2
"""Noise of the accelerations, relative to that of the forces, that adds next to nothing to it."""

_TOLERABLE = 0.5
"""The same up to which a cut-off above that of least error is worth it: with it the noise of forces
grows by a ninth, the root of 1 + 0.5^2."""

_REPEATS = 0.02
"""Largest residual of a series, as a share of the span, of a motion that repeats: a controller that
tracks badly leaves up to 1 % of it, another motion tens of percent."""

_NOISE_ALONE = 1.25
"""Largest residual, over the positions' noise, that is noise alone: stick and slip above the last
harmonic are little beside jitter in positions, and much in forces."""

_MIXED = 1.5
"""Reach of the positions' filter, its ringing included, in periods of its cut-off."""

_UNSURE = 0.1
"""Time about a reversal, in periods of the cut-off, within which the smoothed rate may have the
wrong sign: the delay of the positions' filter there."""

_MENTIONED = 0.1
"""Speed, over a joint's root mean square speed, above which its sign is not that of noise."""

_SPARED = 0.25
"""Share of the time between two reversals of a joint that is left out, at most, on each side, so
that half of the rows stay."""

LATEST = 1.0
"""Delay, s, beyond which milliseconds were meant."""

_PRODUCTS = 10.0
"""Forces are products of positions and accelerations, and friction has steps: they are faster than
the motion. More rows than needed cost little."""


@dataclass(frozen=True)
class Processing:
    """Choices about the preprocessing of a log; by default the data decide.

    Parameters
    ----------
    derivatives : {"periodic", "central", "spline"}, optional
        Fourier series over the periods (the default where the period is known), low-pass filter and
        central differences (the default else), or a smoothing spline (the default where positions
        have no noise but rounding: it makes least of that).
    cutoff : float, optional
        Cut-off frequency of the low-pass filter on the positions, Hz. By default twice the lowest
        frequency above which there is white noise only.
    band : float, optional
        Cut-off frequency of the parallel filter on forces and regressor, Hz. By default ten times
        the bandwidth of the motion.
    period : float, optional
        Time after which the motion repeats, s; by default what the log's description says.
    slow : float
        Speed, as a share of each joint's root mean square, below which the joint's equation is
        not used: dry friction holds a joint at rest with any force, and turns in no time.
    delay : float or "auto", optional
        By how much the log's forces are late for its positions, s: they belong to the motion of so
        much before; negative where positions are late. By default `identify` finds it and takes it
        out where the residuals show one, half the sample by which forces are held among them; 0.0
        leaves it in. "auto" fits one in any case, and intervals allow for it.
    """

    derivatives: Derivatives | None = None
    cutoff: float | None = None
    band: float | None = None
    period: float | None = None
    slow: float = 0.02
    delay: float | Literal["auto"] | None = None

    def __post_init__(self) -> None:
        if self.derivatives is not None:
            expect_one_of(get_args(Derivatives), derivatives=self.derivatives)
        for name in ("cutoff", "band", "period"):
            setting = getattr(self, name)
            expect(setting is None or 0.0 < setting < np.inf, name, setting, "a number above 0")
        expect(0.0 <= self.slow < 1.0, "slow", self.slow, "a share from 0 to below 1")
        small = self.delay in (None, "auto") or abs(float(self.delay)) <= LATEST
        expect(small, "delay", f"{self.delay} s", f'at most {LATEST:g} s or "auto"')


@dataclass(frozen=True, eq=False, repr=False)
class Preprocessing(Result):
    """The preprocessing of a log.

    Attributes
    ----------
    derivatives : {"periodic", "central", "spline"}
        The differentiator of positions; see `Processing`.
    start : tuple of float
        A pose (m,) of the assembly mode.
    rate : float
        Samples per second.
    cutoff : float or None
        Cut-off frequency of the low-pass filter on the positions, Hz; None where they need none.
    band : float
        Cut-off frequency of the parallel filter on forces and regressor, Hz.
    period : float or None
        Time after which the motion repeats, s; None where it is not known to.
    joint_noise, force_noise : array, shape (n,)
        Root mean square of the noise on joints (m) and forces (N).
    slow : array, shape (n,)
        Speed of each joint below which its friction is not known, m/s.
    usual : array, shape (n,)
        Root mean square rate of each joint, m/s.
    stroke : float
        Mean time between two reversals of the joint that reverses most, s.
    delay : float
        Delay of the forces behind the positions, s.
    """

    derivatives: Derivatives
    start: tuple[float, ...]
    rate: float
    cutoff: float | None
    band: float
    period: float | None
    joint_noise: Array
    force_noise: Array
    slow: Array
    usual: Array
    stroke: float
    delay: float = 0.0

    @property
    def differentiator(self) -> Differentiator:
        """The differentiator of the positions."""
        if self.derivatives == "periodic":
            assert self.period is not None  # `preprocessing_for_log` sees to it
            return FourierFit(self.period, self.cutoff, self.delay)
        kind = CentralDifferences if self.derivatives == "central" else SmoothingSpline
        return kind(self.rate, self.cutoff, self.delay)

    @property
    def decimation(self) -> Decimation:
        """The parallel filter of a log that is not taken as periodic."""
        return Decimation.to_band(self.rate, self.band)

    @property
    def settling_rows(self) -> int:
        """Rows before and after a slow one that the positions' filter has mixed with it."""
        return self._rows(_MIXED)

    @property
    def turning_rows(self) -> int:
        """Rows before and after a slow one in which the direction of a joint may not be known."""
        return self._rows(_UNSURE)

    def _rows(self, periods: float) -> int:
        """Return the number of rows in so many periods of the fastest frequency that passes."""
        fastest = self.differentiator.fastest(self.band)
        if fastest is None:
            return 0
        return round(min(periods / fastest, _SPARED * self.stroke) * self.rate)

    settling = former_attribute("settling", "settling_rows")
    turning = former_attribute("turning", "turning_rows")


def preprocessing_for_log(
    robot: RobotLike,
    log: Log,
    processing: Processing | None = None,
    *,
    rows: int | None = None,
    start: tuple[float, ...] | None = None,
) -> Preprocessing:
    """Return the preprocessing of a log.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    log : Log
        The log, or its first part.
    processing : Processing, optional
        The user's choices.
    rows : int, optional
        Number of rows of the whole log, where `log` is only a part.
    start : tuple of float, optional
        A pose (m,) of its assembly mode, where it is known.

    Raises
    ------
    DataError
        If a frequency is beyond what the sampling allows, or there is less than one period.
    """
    robot = as_manipulator(robot)
    settings = processing or Processing()
    # Noise and cut-offs concern samples as they came: uneven steps are noise to them.
    head = _longest_part(log)
    time, channels = uniform(head.time, np.hstack([head.joints, head.forces]))
    rate = (len(time) - 1) / float(time[-1] - time[0])
    joints, forces = np.hsplit(channels, 2)
    _check_frequencies(settings, rate)
    noise = white_noise(forces)
    # A median, which single wild forces do not change.
    size = np.median(np.abs(forces - np.median(forces, axis=0)), axis=0)
    relative = float((noise / np.maximum(size, np.finfo(float).tiny)).min())
    cutoff = settings.cutoff or cutoff_of(
        joints, rate, harmless=_HARMLESS * relative, tolerable=_TOLERABLE * relative
    )

    # How positions are differentiated
    period = settings.period or log.description.period
    derivatives = settings.derivatives or ("spline" if cutoff is None else "central")
    small = (rows or log.rows) <= _LARGEST_PERIODIC
    series = None
    if settings.derivatives == "periodic" or (settings.derivatives is None and period and small):
        series = _checked_series(log, period)
        if settings.derivatives is None and not _is_series(series, joints):
            series = None
    if series is not None:
        derivatives, cutoff = "periodic", series.harmonics / series.period

    # How fast the motion is
    rates, _ = central_differences(lowpass(joints, rate, cutoff), rate)
    frequencies, power = _rate_spectrum(rates, rate, series)
    edge = float(frequencies[min(bins_below(power, _POWER), len(frequencies) - 1)])
    band = settings.band or min(_PRODUCTS * edge, rate / 2.0)
    if settings.band is None and cutoff is not None and series is None:
        band = min(band, cutoff)
    usual = np.sqrt((rates**2).mean(axis=0))
    return Preprocessing(
        derivatives=derivatives,
        start=start or start_pose(robot, log),
        rate=rate,
        cutoff=cutoff,
        band=float(band),
        period=period,
        joint_noise=position_noise(joints),
        force_noise=noise,
        slow=settings.slow * usual,
        usual=usual,
        stroke=_stroke(rates, rate),
        delay=0.0 if settings.delay in (None, "auto") else float(settings.delay),
    )


def _longest_part(log: Log) -> Log:
    """Return the first two minutes' worth of samples of the longest stretch without a gap."""
    longest = max(log.segments, key=lambda part: part.stop - part.start)
    return log.part(longest.start, min(longest.stop, longest.start + _LOOK))


def _checked_series(log: Log, period: float | None) -> FittedSeries:
    """Return the series of the positions; refuse a period that is not that of the motion."""
    if period is None:
        raise log.fault(
            "no period",
            'derivatives "periodic" needs the period; declare it under [motion] in the log\'s '
            "description, or give period",
        )
    if log.duration < period * (1.0 - 1e-3):
        raise log.fault(
            "too short",
            f"lasts {log.duration:g} s, less than its period of {period:g} s; record a whole "
            'period, or choose derivatives "central"',
        )
    series = fitted_series(log.time, log.joints, period)
    span = np.ptp(log.joints, axis=0)
    worst = int(np.argmax(series.noise / span))
    if series.noise[worst] > _REPEATS * span[worst]:
        raise log.fault(
            "not repeating",
            f"does not repeat after its period of {period:g} s: {log.joint_names[worst]} "
            f"is {series.noise[worst]:.2g} (rms, m or rad) off; correct the "
            "period in the log's description, or leave it out",
        )
    return series


def _is_series(series: FittedSeries, joints: Array) -> bool:
    """Return whether a series leaves only noise of the positions as residuals."""
    least = LAST_DIGITS * np.ptp(joints, axis=0)
    return bool((series.noise <= np.maximum(_NOISE_ALONE * position_noise(joints), least)).all())


def _rate_spectrum(rates: Array, rate: float, series: FittedSeries | None) -> tuple[Array, Array]:
    """Return frequencies (F,), Hz, and the power (F, n) of the joints' rates at each."""
    if series is None:
        frequencies = np.asarray(np.fft.rfftfreq(len(rates), 1.0 / rate), dtype=float)
        windowed = np.hanning(len(rates))[:, None] * rates
        return frequencies, np.abs(np.fft.rfft(windowed, axis=0)) ** 2
    order = np.arange(1, series.harmonics + 1)
    power = (order**2)[:, None] * (np.square(series.cosines) + np.square(series.sines))
    return order / series.period, power


def _check_frequencies(settings: Processing, rate: float) -> None:
    """Raise DataError where a frequency in the settings is not below half the sampling rate."""
    for name in ("cutoff", "band"):
        frequency = getattr(settings, name)
        if frequency is not None and frequency >= rate / 2.0:
            raise DataError(
                f"{name}: {frequency:g} Hz given; the log has {rate:g} samples a second, so that "
                f"it must be below {rate / 2.0:g} Hz"
            )


def _stroke(rates: Array, rate: float) -> float:
    """Return the mean time between two reversals of the joint that reverses most, s."""
    most = 0
    for speed in rates.T:
        signs = np.sign(speed[np.abs(speed) > _MENTIONED * np.sqrt((speed**2).mean())])
        most = max(most, int((np.diff(signs) != 0.0).sum()))
    return len(rates) / rate / (most + 1)
