"""Unknowns in which the forces are not linear: speeds of Stribeck's friction, and a delay.

Fs sign(q') exp(-(q'/v)^2) is linear in Fs and not in v. The speeds v, and the delay of the forces
against the positions, are found by least squares with all other values projected out (variable
projection). Speeds are first searched on a grid; then both are refined by Gauss's and Newton's
steps, with the slopes of the forces as columns. What their uncertainty adds to that of the values
comes with the steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.identification.estimators import weighted_least_squares
from pteron.identification.estimators.least_squares import actuator_noise
from pteron.identification.model import Model, extend_model
from pteron.identification.observation import LinearModel, Observations, scale_columns
from pteron.identification.signals import States
from pteron.identification.signals.preprocessing import LATEST
from pteron.kernels import Array
from pteron.tolerances import ROUNDING

_SLOWEST, _FASTEST = 3e-3, 3.0
"""Least and greatest speed of the search, over each joint's root mean square speed: friction that
falls at slower speeds is dry friction to the data, at faster ones viscous."""

_COLUMNS = 24
"""Speeds of the grid whose columns are computed: 1.35 times the one before, over which a column
changes smoothly enough for interpolation."""

_FINE = 200
"""Speeds that are tried, with columns interpolated between those."""

_ROUNDS = 8
"""Most rounds through the joints one by one, and most steps on exact columns: joints influence each
other little, and `_SETTLED` ends the iteration before."""

_CLEAR = 30.0
"""Least increase of twice the log-likelihood for Stribeck's friction of a joint to count as
seen."""

_STEP = 0.5
"""Largest change of a speed's logarithm in a step."""

_SETTLED = 0.02
"""Step, in standard deviations, below which the iteration ends."""

_TWO_SIDED = 1.959963984540054
"""Standard deviations of an interval of 95 %."""

Observe = Callable[[LinearModel], Observations]
"""Makes the observations of all recordings, with the columns of a model or of more."""


@dataclass(frozen=True)
class Unknowns:
    """Speeds and a delay, as the data show them.

    Attributes
    ----------
    speeds : array, shape (n,), optional
        Speeds of Stribeck's friction, m/s or rad/s; infinite where it is not seen to fall.
    delay : float
        Delay of the forces behind the positions, s.
    speed_deviations : array, shape (n,), optional
        Standard deviations of the speeds' logarithms.
    delay_deviation : float
        s.
    """

    speeds: Array | None = None
    delay: float = 0.0
    speed_deviations: Array | None = None
    delay_deviation: float = 0.0

    def speed_intervals(self) -> tuple[Array, Array]:
        """Return the ends (n,) of the speeds' intervals at 95 %, which are as large in ratio."""
        assert self.speeds is not None
        assert self.speed_deviations is not None
        factor = np.exp(_TWO_SIDED * self.speed_deviations)
        return self.speeds / factor, self.speeds * factor

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain data, null where friction is not seen to fall."""
        record: dict[str, Any] = {"delay": self.delay, "delay_deviation": self.delay_deviation}
        if self.speeds is not None:
            ends = np.array([self.speeds, *self.speed_intervals()]).T.tolist()
            rows = [row if np.isfinite(row[0]) else None for row in ends]
            record["stribeck_speeds"] = [row and row[0] for row in rows]
            record["stribeck_intervals_95"] = [row and row[1:] for row in rows]
        return record


def fit_nonlinear_terms(
    model: Model,
    observe: Callable[[LinearModel, float], Observations],
    begin: Unknowns,
    beta: Array,
    *,
    late: bool,
) -> tuple[Model, Observations, Unknowns, Array]:
    """Return a model with the unknowns that suit the data best.

    Parameters
    ----------
    model : Model
        The model, with the speeds to begin with where it has such friction.
    observe : callable
        Makes the observations of all recordings, with the columns of a model or of more, of forces
        that are so late, s.
    begin : Unknowns
        Unknowns to begin with.
    beta : array, shape (p,)
        Values of a fit there.
    late : bool
        Whether the delay is unknown.

    Returns
    -------
    tuple
        The model, its observations, the unknowns, and the part of the values' covariance (p, p)
        that comes from them.
    """
    unknowns, p = begin, len(model.names)
    speeds = None if unknowns.speeds is None else unknowns.speeds.copy()
    seen = np.flatnonzero(np.isfinite(speeds)) if speeds is not None else np.zeros(0, dtype=int)
    for _ in range(_ROUNDS):
        if speeds is not None:
            model = model.with_speeds(speeds)
        columns = partial(_slopes, model, seen, beta, late)
        rows = observe(extend_model(model, len(seen) + late, columns), unknowns.delay)
        plain = rows.columns(range(p))
        extended_fit, part = weighted_least_squares(rows), weighted_least_squares(plain)
        beta, covariance = part.values, extended_fit.covariance[:p, :p] - part.covariance
        step, deviations = extended_fit.values[p:], extended_fit.deviations[p:]
        if speeds is not None:
            forces = np.array([part.value(f"Fs{i + 1}") for i in seen])
            step[: len(seen)] /= forces
            deviations[: len(seen)] /= np.abs(forces)
            spread = np.full(len(speeds), np.nan)
            spread[seen] = deviations[: len(seen)]
            unknowns = replace(unknowns, speeds=speeds.copy(), speed_deviations=spread)
        if late:
            unknowns = replace(unknowns, delay_deviation=float(deviations[-1]))
        if not (np.abs(step) > np.maximum(_SETTLED * deviations, ROUNDING)).any():
            break
        if speeds is not None:
            speeds[seen] *= np.exp(np.clip(step[: len(seen)], -_STEP, _STEP))
        if late:
            unknowns = replace(
                unknowns, delay=float(np.clip(unknowns.delay + step[-1], -LATEST, LATEST))
            )
    return model, plain, unknowns, covariance


def search_speeds(model: Model, observe: Observe, usual: Array) -> Array:
    """Return approximate least-squares speeds (n,); infinite where friction does not fall.

    `model` has none of that friction yet, and `usual` (n,) are the root mean squares of the joints'
    rates.
    """
    n, p = len(usual), len(model.names)
    shares = np.geomspace(_SLOWEST, _FASTEST, _COLUMNS)

    def columns(states: States) -> Array:
        """Return the model's columns and those of falling friction at the states."""
        rates = states.joint_rates[..., None]
        falls = np.sign(rates) * np.exp(-((rates / (usual[:, None] * shares)) ** 2))
        if is_mixed:
            falls = each_alone(falls).reshape(*falls.shape[:2], -1)
        return np.concatenate([model.matrix(states), falls], axis=-1)

    def each_alone(of_joints: Array) -> Array:
        """Return joints' columns (R, n, c) as those of all forces by joint (R, n, n, c)."""
        return np.asarray(np.einsum("ric,ij->rijc", of_joints, np.eye(n)))

    is_mixed = model.robot.redundancy > 0  # a joint's friction is then in the equations of all
    rows = observe(extend_model(model, _COLUMNS * (n if is_mixed else 1), columns))
    plain = rows.columns(range(p))
    noise = weighted_least_squares(plain).noise
    falling = rows.matrix[..., p:]
    falling = falling.reshape(-1, n, n, _COLUMNS) if is_mixed else each_alone(falling)
    tried = np.geomspace(_SLOWEST, _FASTEST, _FINE)
    spline = scipy.interpolate.make_interp_spline(np.log(shares), np.eye(_COLUMNS), k=5)(
        np.log(tried)
    )
    speeds = np.full(n, np.inf)
    for _ in range(2):
        # Of all columns, and the forces, what the others leave; the noise is that of the last fit.
        weighed = plain.matrix / noise[:, None]
        basis = np.linalg.qr(scale_columns(weighed.reshape(-1, p))[0])[0]
        forces = (plain.forces / noise).ravel()
        each = falling / noise[:, None, None]
        joint_columns = each.reshape(len(forces), -1)
        inner = basis.T @ joint_columns
        gram = (joint_columns.T @ joint_columns - inner.T @ inner).reshape(n, _COLUMNS, n, _COLUMNS)
        image = (joint_columns.T @ forces - inner.T @ (basis.T @ forces)).reshape(n, _COLUMNS)
        chosen = _coordinatewise(spline, gram, image, _CLEAR / rows.independent)
        speeds = np.where(chosen >= 0, usual * tried[np.maximum(chosen, 0)], np.inf)
        extra = np.einsum("rijc,jc->rij", falling, spline[chosen])[..., chosen >= 0]
        with_friction = plain.with_matrix(np.concatenate([plain.matrix, extra], axis=-1))
        noise = actuator_noise(with_friction, weighted_least_squares(with_friction).values)
    return speeds


def _coordinatewise(spline: Array, gram: Array, image: Array, clear: float) -> NDArray[np.int64]:
    """Return the index of each joint's best speed (n,), joint by joint; -1: none is significant."""
    n = len(image)
    chosen = np.full(n, -1)

    def gain(picked: NDArray[np.int64]) -> float:
        """Return the drop of the squared residuals with friction at these speeds; -1: it rises."""
        seen = np.flatnonzero(picked >= 0)
        if not len(seen):
            return 0.0
        mix = spline[picked[seen]]
        normal = np.einsum("ig,igjh,jh->ij", mix, gram[seen][:, :, seen], mix)
        right = np.einsum("ig,ig->i", mix, image[seen])
        sizes = np.linalg.lstsq(normal, right, rcond=1e-12)[0]
        return float(right @ sizes) if (sizes > 0.0).all() else -1.0

    for _ in range(_ROUNDS):
        previous = chosen.copy()
        for i in range(n):
            without = chosen.copy()
            without[i] = -1
            gains = []
            for k in range(len(spline)):
                without[i] = k
                gains.append(gain(without))
            without[i] = -1
            best = int(np.argmax(gains))
            chosen[i] = best if gains[best] > gain(without) + clear else -1
        if (chosen == previous).all():
            break
    return chosen


def _slopes(
    model: Model, seen: NDArray[np.int64], beta: Array, late: bool, states: States
) -> Array:
    """Return a model's columns, and how friction changes with speeds' logarithms, by its size.

    And, where forces are late, how those of a fit change with the delay, but for dry friction.
    """
    rates, matrix = states.joint_rates, model.matrix(states)
    slopes = np.zeros((*rates.shape, len(seen) + late))
    if len(seen):
        square = (rates[:, seen] / np.asarray(model.stribeck_speeds)[seen]) ** 2
        slope = 2.0 * np.sign(rates[:, seen]) * square * np.exp(-square)
        slopes[:, seen, np.arange(len(seen))] = slope
    if late:
        dry = np.isin(model.kinds, ("coulomb", "stribeck"))
        smooth = matrix @ np.where(dry, 0.0, beta)
        slopes[..., -1] = -np.gradient(smooth, states.time, axis=0, edge_order=2)
    return np.concatenate([matrix, slopes], axis=-1)
