"""How a log is treated: what the user asked for, and what the data made of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from pteron.errors import DataError
from pteron.identification.logs import Log
from pteron.identification.signals.assembly import assembly_mode
from pteron.identification.signals.differences import central_differences
from pteron.identification.signals.fourier import FourierSeries, fitted_series
from pteron.identification.signals.lowpass import cutoff_of, smoothed
from pteron.identification.signals.noise import white_noise
from pteron.identification.signals.parallel import Decimation
from pteron.identification.signals.uniform import uniform
from pteron.kernels import Array
from pteron.manipulator import Manipulator

__all__ = ["Derivatives", "Processing", "Treatment", "treatment_of"]

Derivatives = Literal["periodic", "central", "spline"]

_LARGEST_PERIODIC = 4_000_000
"""Rows up to which a periodic log is fitted in one piece."""

_LOOK = 120_000
"""Samples from which cut-offs are found."""

_POWER = 0.999
"""Share of the speed's power that says how fast a motion is."""

_REPEATS = 0.02
"""What a series may leave of a motion, as a share of its span, where it is said to repeat."""

_ROUNDING = 1e-13
"""What it leaves by rounding."""

_MIXED = 1.5
"""How far the positions' filter reaches, its ringing included, in periods of its cut-off."""

_UNSURE = 0.1
"""Within which the smoothed rate may have the wrong sign, likewise."""

_MENTIONED = 0.1
"""Speed, as a share of a slider's root mean square, from which its sign counts."""

_SPARED = 0.15
"""Share of the time between two reversals of a slider that is left out, at most, on each side."""

_PRODUCTS = 10.0
"""Forces are products of positions and accelerations, and friction has steps: they are faster than
the motion. More rows than needed cost little."""


@dataclass(frozen=True)
class Processing:
    """What a user may choose about the treatment of a log; by default the data decide.

    Parameters
    ----------
    derivatives : {"periodic", "central", "spline"}, optional
        Fourier series over the periods (the default where the period is known), low-pass filter and
        central differences (the default else), or a smoothing spline (the default where positions
        have no noise but rounding: it makes least of that).
    cutoff : float, optional
        Of the positions' filter, Hz. By default twice what leaves white noise only.
    band : float, optional
        Of the parallel filter on forces and regressor, Hz. By default ten times the motion's.
    period : float, optional
        Of the motion, s; by default what the log's description says.
    slow : float
        Speed, as a share of each slider's root mean square, below which the slider's equation is
        not used: dry friction holds a slider at rest with any force, and turns in no time.
    """

    derivatives: Derivatives | None = None
    cutoff: float | None = None
    band: float | None = None
    period: float | None = None
    slow: float = 0.02

    def __post_init__(self) -> None:
        if self.derivatives is not None and self.derivatives not in get_args(Derivatives):
            raise DataError(
                f"derivatives: {self.derivatives!r} is not one of "
                f"{', '.join(get_args(Derivatives))}"
            )
        for name in ("cutoff", "band", "period"):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value > 0.0):
                raise DataError(f"{name}: {value} given, a number above 0 expected")
        if not 0.0 <= self.slow < 1.0:
            raise DataError(f"slow: {self.slow} given, a share from 0 to below 1 expected")


@dataclass(frozen=True)
class Treatment:
    """How a log is treated.

    Attributes
    ----------
    derivatives : {"periodic", "central", "spline"}
        See `Processing`.
    mode : int
        The assembly mode, from 0.
    rate : float
        Samples per second.
    cutoff : float or None
        Of the positions' filter, Hz; None where they need none.
    band : float
        Of the parallel filter, Hz.
    period : float or None
        s.
    slider_noise, force_noise : array, shape (n,)
        Standard deviation of the white noise on sliders (m) and forces (N).
    slow : array, shape (n,)
        Speed of each slider below which its friction is not known, m/s.
    stroke : float
        Mean time between two reversals of the slider that reverses most, s.
    """

    derivatives: Derivatives
    mode: int
    rate: float
    cutoff: float | None
    band: float
    period: float | None
    slider_noise: Array
    force_noise: Array
    slow: Array
    stroke: float

    @property
    def settling(self) -> int:
        """Rows before and after a slow one that the positions' filter has mixed with it."""
        return self._rows(_MIXED)

    @property
    def turning(self) -> int:
        """Rows before and after a slow one in which the way a slider moves may not be known."""
        return self._rows(_UNSURE)

    def _rows(self, periods: float) -> int:
        if self.cutoff is None:
            return 0
        # A series ends where noise begins: what a slow motion leaves there mixes nothing.
        fastest = max(self.cutoff, self.band) if self.derivatives == "periodic" else self.cutoff
        return round(min(periods / fastest, _SPARED * self.stroke) * self.rate)

    @property
    def decimation(self) -> Decimation:
        """The parallel filter of a log that is not treated as periodic."""
        return Decimation.to_band(self.rate, self.band)


def treatment_of(
    robot: Manipulator, log: Log, processing: Processing | None = None, *, rows: int | None = None
) -> Treatment:
    """Return how a log is to be treated.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    log : Log
        The log, or its first part.
    processing : Processing, optional
        What the user wants.
    rows : int, optional
        Of the whole log, where `log` is only a part.

    Returns
    -------
    Treatment

    Raises
    ------
    DataError
        If a frequency is beyond what the sampling allows, or there is less than one period.
    """
    wanted = processing or Processing()
    head = log.part(*_longest(log))
    # Noise and cut-offs concern samples as they came: uneven steps are noise to them.
    time, values = uniform(head.time, np.hstack([head.sliders, head.forces]))
    rate = (len(time) - 1) / float(time[-1] - time[0])
    n = head.sliders.shape[1]
    sliders, forces = values[:, :n], values[:, n:]
    period = wanted.period or log.description.period
    derivatives = wanted.derivatives or _derivatives(period, rows or log.rows)
    if derivatives == "periodic":
        _check_period(log, period)
    _check_frequencies(wanted, rate)
    cutoff = wanted.cutoff or cutoff_of(sliders, rate)
    if wanted.derivatives is None and derivatives == "central" and cutoff is None:
        derivatives = "spline"
    series = None
    if derivatives == "periodic" and period is not None:
        series = fitted_series(log.time, log.sliders, period)
        _check_repeats(log, series, period)
        if wanted.derivatives is None and not _is_series(series, sliders):
            derivatives, series = "central" if cutoff is not None else "spline", None
    if series is not None:
        power = (np.arange(1, series.harmonics + 1) ** 2)[:, None] * (
            series.coefficients[1::2] ** 2 + series.coefficients[2::2] ** 2
        )
        frequencies = np.arange(1, series.harmonics + 1) / series.period
        cutoff = float(frequencies[-1])
    else:
        frequencies, power = _speed_power(sliders, rate, cutoff)
    band = wanted.band or min(_PRODUCTS * _edge(frequencies, power), rate / 2.0)
    if wanted.band is None and cutoff is not None and derivatives != "periodic":
        band = min(band, cutoff)
    smooth = sliders if cutoff is None else smoothed(sliders, rate, cutoff)
    rates, _ = central_differences(smooth, rate)
    return Treatment(
        derivatives=derivatives,
        mode=assembly_mode(robot, log),
        rate=rate,
        cutoff=cutoff,
        band=float(band),
        period=period,
        slider_noise=white_noise(sliders),
        force_noise=white_noise(forces),
        slow=wanted.slow * np.sqrt((rates**2).mean(axis=0)),
        stroke=_stroke(rates, rate),
    )


def _derivatives(period: float | None, rows: int) -> Derivatives:
    return "periodic" if period is not None and rows <= _LARGEST_PERIODIC else "central"


def _longest(log: Log) -> tuple[int, int]:
    """Return where the longest part without a gap begins and ends, cut to a usual length."""
    longest = max(log.segments, key=lambda part: part.stop - part.start)
    return longest.start, min(longest.stop, longest.start + _LOOK)


def _check_period(log: Log, period: float | None) -> None:
    if period is None:
        raise DataError(
            f'{log.source}: derivatives "periodic" needs the period; declare it under [motion] in '
            "the log's description, or give period"
        )
    if log.duration < period * (1.0 - 1e-3):
        raise DataError(
            f"{log.source}: lasts {log.duration:g} s, less than its period of {period:g} s; "
            'record a whole period, or choose derivatives "central"'
        )


def _check_repeats(log: Log, series: FourierSeries, period: float) -> None:
    """Refuse a period that is not that of the motion."""
    span = np.ptp(log.sliders, axis=0)
    worst = int(np.argmax(series.noise / span))
    if series.noise[worst] > _REPEATS * span[worst]:
        raise DataError(
            f"{log.source}: does not repeat after its period of {period:g} s: rho{worst + 1} is "
            f"{series.noise[worst]:.2g} m (rms) off; correct the period in the log's description, "
            "or leave it out"
        )


def _is_series(series: FourierSeries, sliders: Array) -> bool:
    """Say whether a Fourier series leaves noise alone: jumps of acceleration take more terms."""
    least = _ROUNDING * np.ptp(sliders, axis=0)
    return bool((series.noise <= np.maximum(3.0 * white_noise(sliders), least)).all())


def _check_frequencies(wanted: Processing, rate: float) -> None:
    for name in ("cutoff", "band"):
        value = getattr(wanted, name)
        if value is not None and value >= rate / 2.0:
            raise DataError(
                f"{name}: {value:g} Hz given; the log has {rate:g} samples a second, so that it "
                f"must be below {rate / 2.0:g} Hz"
            )


def _speed_power(sliders: Array, rate: float, cutoff: float | None) -> tuple[Array, Array]:
    smooth = sliders if cutoff is None else smoothed(sliders, rate, cutoff)
    rates, _ = central_differences(smooth, rate)
    power = np.abs(np.fft.rfft(np.hanning(len(rates))[:, None] * rates, axis=0)) ** 2
    return np.asarray(np.fft.rfftfreq(len(rates), 1.0 / rate), dtype=float), power


def _stroke(rates: Array, rate: float) -> float:
    """Return the mean time between two reversals of the slider that reverses most, s.

    A change of sign counts once the speed is worth mentioning: noise at rest is none.
    """
    fewest = np.inf
    for speed in rates.T:
        signs = np.sign(speed[np.abs(speed) > _MENTIONED * np.sqrt((speed**2).mean())])
        reversals = int((np.diff(signs) != 0.0).sum())
        fewest = min(fewest, len(rates) / rate / (reversals + 1))
    return float(fewest)


def _edge(frequencies: Array, power: Array) -> float:
    """Return the frequency below which nearly all the power of every slider is."""
    share = np.cumsum(power, axis=0) / np.maximum(power.sum(axis=0), np.finfo(float).tiny)
    last = int((share < _POWER).sum(axis=0).max())
    return float(frequencies[min(last, len(frequencies) - 1)])
