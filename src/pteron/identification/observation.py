"""The observations of a log, F = W beta, filtered, decimated and stacked: what estimators solve.

W is the observation matrix (Gautier): the regressors of all samples below one another.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.identification.errors import LogSourceMixin
from pteron.identification.felt_forces import felt_part, usable_samples
from pteron.identification.logs import Log
from pteron.identification.signals import Preprocessing, States
from pteron.identification.signals.derivatives import EVEN, FourierFit
from pteron.identification.signals.fourier import Projection, most_harmonics
from pteron.identification.signals.samples import BLOCK, SampleBlock, samples
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.motion.trajectories.fourier import fourier_basis
from pteron.renamed import former_attribute
from pteron.result import Result


class LinearModel(Protocol):
    """A model that is linear in its values: a `Model`, or one with more columns."""

    @property
    def robot(self) -> Manipulator:
        """The machine."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the p values."""

    @property
    def units(self) -> tuple[str, ...]:
        """SI units of the values."""

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of the values, as `Model.kinds`."""

    def matrix(self, states: States) -> Array:
        """Return the regressor (R, n, p) at states: the columns of the values."""


_LEAST_SHARE = 0.3
"""Least noise of an equation that is used, over the usual noise: one below it has few samples."""


_ROWS = ("matrix", "forces", "time", "gain", "payload")
"""Fields of observations with an entry for each row."""


@dataclass(frozen=True, eq=False, repr=False)
class Observations(LogSourceMixin, Result):
    """Rows of F = W beta, after the parallel filter.

    Rows are divided by the filter's gain for white noise: the residuals of a fit have the standard
    deviation of the noise on the measured samples, whatever the filter.

    Attributes
    ----------
    names, units : tuple of str
        Names of the p values, and their SI units.
    matrix : array, shape (R, n, p)
        The observation matrix W.
    forces : array, shape (R, n)
        The filtered drive forces F, N or N m, over the gain.
    time : array, shape (R,)
        Times of the rows, s.
    gain : array, shape (R, n)
        The divisors of the rows; 0 for an equation that is not used, whose row is 0 too.
    payload : array of int, shape (R,)
        The payload phase of each row: 0 without payload, 1 with it.
    source : str
        Name of their log in messages.
    kinds : tuple of str
        Kinds of the values, as `Model.kinds`; empty where they are not known.
    independent : float
        Share of a sample's n equations that are independent: m/n of a redundant machine, of whose
        forces only what the platform feels counts.
    """

    ROWS = "time forces:1 matrix:2 payload"

    names: tuple[str, ...]
    units: tuple[str, ...]
    matrix: Array
    forces: Array
    time: Array
    gain: Array
    payload: NDArray[np.int64]
    source: str = "the log"
    kinds: tuple[str, ...] = ()
    independent: float = 1.0

    @property
    def equation_counts(self) -> Array:
        """Number of equations of each actuator that are used, (n,)."""
        return np.asarray((self.gain > 0.0).sum(axis=0))

    @property
    def rows(self) -> int:
        """Number of equations that are used."""
        return int(self.equation_counts.sum())

    @property
    def actuators(self) -> int:
        """Number of actuators n."""
        return int(self.forces.shape[1])

    def columns(self, keep: Sequence[int]) -> Observations:
        """Return the observations of some of the values."""
        return replace(
            self,
            names=tuple(self.names[k] for k in keep),
            units=tuple(self.units[k] for k in keep),
            kinds=tuple(self.kinds[k] for k in keep) if self.kinds else (),
            matrix=np.ascontiguousarray(self.matrix[..., list(keep)]),
        )

    def with_matrix(self, matrix: Array) -> Observations:
        """Return the observations with other columns (R, n, k), whose names are their numbers."""
        names = tuple(map(str, range(matrix.shape[-1])))
        return replace(self, matrix=matrix, names=names, units=names, kinds=())

    def with_forces(self, forces: Array) -> Observations:
        """Return the observations with other forces (R, n)."""
        return replace(self, forces=forces)

    def part(self, rows: slice) -> Observations:
        """Return some of the rows."""
        parts: dict[str, Any] = {name: getattr(self, name)[rows] for name in _ROWS}
        return replace(self, **parts)

    used = former_attribute("used", "equation_counts")


def observations_of(
    model: LinearModel,
    log: Log | Iterable[Log],
    preprocessing: Preprocessing,
    *,
    block: int = BLOCK,
) -> Observations:
    """Return the observations of a log.

    Parameters
    ----------
    model : Model or another that is linear in what is identified
        The model.
    log : Log or iterable of Log
        The log, or its pieces in order, read one at a time.
    preprocessing : Preprocessing
        Its preprocessing, from `preprocessing_for_log`.
    block : int
        Number of rows filtered at a time, about.

    Raises
    ------
    LogError
        If a sample has no pose or is next to a singularity, or the log is too short.
    """
    fit = preprocessing.differentiator
    if isinstance(fit, FourierFit):
        assert isinstance(log, Log)  # `preprocessing_for_log` takes no other for periodic
        parts = [
            _periodic(model, part, preprocessing, fit)
            for part in _phases(log, preprocessing.rate, fit)
        ]
        return replace(stack_observations(parts), source=log.source)
    # The mask of a row depends on the rows around it, in the next block too.
    margin = preprocessing.decimation.margin + preprocessing.settling_rows
    observations, source = [], "the log"
    for sample_block in samples(model.robot, log, preprocessing, margin=margin, block=block):
        observations.append(_filter_block(model, sample_block, preprocessing))
        source = sample_block.source
    return replace(stack_observations(observations), source=source)


def stack_observations(parts: Sequence[Observations]) -> Observations:
    """Return the observations of several logs, or parts of one, as one."""
    first = parts[0]
    if len(parts) == 1:
        return first
    joined: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in _ROWS
    }
    return replace(first, **joined)


def motion_mask(rates: Array, slow: Array, rows: int, *, wraps: bool = False) -> Array:
    """Return a mask (R, n): 1 where a joint moves, 0 where it is `slow`, and `rows` rows around.

    Both sides of F = W beta are multiplied with it before the parallel filter.
    """
    moves = (np.abs(rates) >= slow).astype(float)
    size, mode = 2 * rows + 1, "wrap" if wraps else "nearest"
    return np.asarray(scipy.ndimage.minimum_filter1d(moves, size, axis=0, mode=mode))


def _filter_block(
    model: LinearModel, block: SampleBlock, preprocessing: Preprocessing
) -> Observations:
    """Return a block's observations: slow rows masked, then filtered and decimated."""
    decimation = preprocessing.decimation
    settling = preprocessing.settling_rows
    inner = slice(settling, len(block.states) - settling)
    moving = motion_mask(block.states.joint_rates, preprocessing.slow, settling)
    moving = usable_samples(model.robot, (moving * block.smooth[:, None])[inner])
    states, forces = block.states.part(inner), block.forces[inner]
    matrix, forces = (
        felt_part(model.robot, states.pose, part) for part in (model.matrix(states), forces)
    )
    centers = decimation.centers(len(states))
    return assemble_observations(
        model,
        decimation(moving[..., None] * matrix),
        decimation(moving * forces),
        decimation.noise(moving),
        states.time[centers],
        states.payload[centers],
        np.linalg.norm(decimation.taps),
    )


def assemble_observations(
    model: LinearModel,
    matrix: Array,
    forces: Array,
    noise: Array,
    time: Array,
    payload: NDArray[np.int64],
    usual: float | np.floating[Any],
) -> Observations:
    """Return observations whose rows are divided by their noise (R, n).

    The noise is the standard deviation that white noise of unit variance on the samples gives each
    equation; `usual` is that of an equation all of whose samples count.
    """
    gain = np.where(noise >= _LEAST_SHARE * usual, noise, 0.0)
    factor = np.divide(1.0, gain, out=np.zeros_like(gain), where=gain > 0.0)
    return Observations(
        model.names,
        model.units,
        factor[..., None] * matrix,
        factor * forces,
        time,
        gain,
        payload,
        kinds=model.kinds,
        independent=model.robot.freedom / model.robot.joint_count,
    )


def _phases(log: Log, rate: float, fit: FourierFit) -> list[Log]:
    """Return the stretches of a periodic log with a constant payload and at least a period."""
    parts = [log.part(start, stop) for start, stop in log.phases]
    long_enough = [p for p in parts if p.duration + 1.0 / rate >= fit.period * (1.0 - 1e-3)]
    if not long_enough:
        raise log.fault(
            "too short",
            f"no stretch with one payload lasts its period of {fit.period:g} s; record longer, or "
            'choose derivatives "central"',
        )
    return long_enough


def _periodic(
    model: LinearModel, log: Log, preprocessing: Preprocessing, fit: FourierFit
) -> Observations:
    """Return the observations of a period, with noise averaged over all recorded periods."""
    # The parallel filter is a projection of both sides onto the harmonics up to the band, with as
    # many rows as coefficients, so that white noise stays white.
    period, rate = fit.period, preprocessing.rate
    start = float(log.time[0])
    periods = int((log.duration + 1.0 / rate) / period + 1e-3)
    log = log.part(0, int(np.searchsorted(log.time, start + periods * period - 0.5 / rate)))
    per_period = round(period * rate)
    harmonics = max(min(int(preprocessing.band * period), most_harmonics(log.time, period)), 1)
    series = fit.series(log)
    fine = np.linspace(start, start + period, per_period, endpoint=False)
    moving = motion_mask(
        series.at(fine)[1], preprocessing.slow, preprocessing.settling_rows, wraps=True
    )
    moving = usable_samples(model.robot, moving)
    count = 2 * harmonics + 1
    instants = np.linspace(start, start + period, count, endpoint=False)

    places = (log.time - start) * (per_period / period)
    used = moving[np.round(places).astype(int) % per_period]
    time, shown = log.time, used
    if log.rows == periods * per_period and np.abs(places - np.arange(log.rows)).max() <= EVEN:
        # All periods have their samples at the same instants: one period is enough.
        time, shown = fine, moving

    def states_at(at: Array, first: int) -> States:
        """Return the states at times (R,), s, of the period; the first is the row `first`."""
        phases = None if log.payload is None else np.full(len(at), log.payload[0])
        about: dict[str, Any] = {"source": log.source, "first_row": log.first_row + first}
        motion = series.at(at)
        return States.from_joints(
            model.robot, motion, at, preprocessing.start, payload=phases, **about
        )

    def regressor(part: slice) -> Array:
        """Return the regressor (rows, n p) at a slice of the period's samples."""
        states = states_at(time[part], part.start)
        matrix = felt_part(model.robot, states.pose, model.matrix(states))
        return np.asarray(shown[part][..., None] * matrix).reshape(len(states), -1)

    def felt_forces(part: slice) -> Array:
        """Return the forces (rows, n) at a slice of the log's samples."""
        forces: Array = used[part] * log.forces[part]
        if not model.robot.redundancy:
            return forces
        states = states_at(np.mod(log.time[part] - start, period) + start, part.start)
        return felt_part(model.robot, states.pose, forces)

    n, p = used.shape[1], len(model.names)
    basis = fourier_basis(instants, harmonics, period)
    projection, force_projection = (Projection(t, period, harmonics) for t in (time, log.time))
    matrix = (basis @ projection.coefficients(regressor, n * p)).reshape(count, n, p)
    rows = basis @ force_projection.coefficients(felt_forces, n)
    noise = projection.noise(shown, instants) * np.sqrt(len(time) / log.rows)
    payload = np.full(count, 0 if log.payload is None else log.payload[0], dtype=np.int64)
    return assemble_observations(
        model, matrix, rows, noise, instants, payload, np.sqrt(count / log.rows)
    )


def scale_columns(columns: Array) -> tuple[Array, Array]:
    """Return columns (R, k) divided by their lengths, and these (k,); 1 for a column of zeros."""
    lengths = np.linalg.norm(columns, axis=0)
    lengths = np.where(lengths > 0.0, lengths, 1.0)
    return columns / lengths, lengths


def triangle(pieces: Iterable[Array], size: int) -> Array:
    """Return the QR decomposition's R (k, k) of rows (R, k) in pieces, k being `size`."""
    factor: Array = np.zeros((size, size))
    for piece in pieces:
        factor = np.asarray(np.linalg.qr(np.vstack([factor, piece]), mode="r"))
    return factor
