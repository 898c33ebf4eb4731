"""Drive gains, N or N m per unit of current, from motions with and without a known payload."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from typing import Any, NamedTuple

import numpy as np

from pteron.identification.estimators import (
    Estimate,
    ordinary,
    qr_factor,
    weighted_least_squares,
)
from pteron.identification.estimators.least_squares import actuator_noise
from pteron.identification.estimators.total import smallest_corrections
from pteron.identification.logs import Log
from pteron.identification.logs.description import KnownPayload
from pteron.identification.model import Model, Terms, identification_model
from pteron.identification.observation import Observations
from pteron.identification.payload_phases import currents_by_drive, observations_with_payload
from pteron.identification.signals import Processing, States
from pteron.json_values import json_fields
from pteron.kernels import Array
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.reduction import BaseParameters
from pteron.result import Result
from pteron.tolerances import LAST_DIGITS

_UNSEEN = 1e-10
"""Singular value, relative to the largest, below which gains cannot be told from inertia."""

_ITERATIONS = 50
"""Most iterations; gains that have not settled by then are refused."""

_SETTLED = 1e-3
"""Change of the predicted currents, over the residuals, below which an iteration is the last
one."""


_STEADY = 0.01
"""Relative change of the currents' noise below which an iteration may be the last one: weights off
by 1 % change no interval by more."""

_NOISELESS = 1e-10
"""Noise of currents, relative to the greatest, that counts as rounding and gives no weights."""

_LEAST_NOISE = 1e-3
"""Least noise of a drive's currents over the greatest, so that none counts as exact."""

_UNUSED = 1e-300
"""Least variance of an equation; that of an equation that is not used is 0, as it is itself."""


@dataclass(frozen=True, eq=False, repr=False)
class DriveGains(Result):
    """Gains g of the drives: force_i = g_i current_i.

    Attributes
    ----------
    gains : array, shape (n,)
        By maximum likelihood, N or N m per `unit`; negative for a drive that pushes backwards.
    deviations : array, shape (n,)
        Standard deviations, for a payload that is known exactly: its relative error is one of all
        gains beside these.
    total_least_squares : array, shape (n,)
        The gains by total least squares, from which the search began.
    unit : str
        The unit of the log's force columns: A, V or %.
    estimate : Estimate
        The fit of the gains (``g1`` ..., N per unit) and of the model's values without payload;
        its noise and residuals are in `unit`.
    residual : array, shape (n,)
        Standard deviation of each current's residual, in `unit`, before the filter.
    condition : float
        Ratio of the largest to the second smallest singular value of the homogeneous equations:
        how well gains are told from inertia.
    gap : float
        Ratio of the smallest to the second smallest: 0 without noise, 1 where noise hides it all.
    """

    ROWS = "gains deviations residual"

    gains: Array
    deviations: Array
    total_least_squares: Array
    unit: str
    estimate: Estimate = field(repr=False)
    residual: Array
    condition: float
    gap: float

    @property
    def note(self) -> str:
        """The line that declares the gains, for [forces] in the log's description."""
        return f"gains = [{', '.join(f'{gain:.10g}' for gain in self.gains)}]"

    def summary(self) -> str:
        """Return the gains, for people, as lines of text."""
        lines = ["Drive gains:"]
        triples = zip(self.gains, self.deviations, self.total_least_squares, strict=True)
        for i, (gain, deviation, start) in enumerate(triples, 1):
            lines.append(
                f"  g{i}  {gain:.6g} +- {deviation:.2g} {self.estimate.units[i - 1]} "
                f"(total least squares {start:.6g})"
            )
        residuals = ", ".join(f"{residual:.2g}" for residual in self.residual)
        lines.append(f"Left of the currents: {residuals} {self.unit}.")
        lines.append(f"Condition number {self.condition:.3g}, gap {self.gap:.2g}.")
        lines.append("The gains are as exact as the payload's mass and inertia at best.")
        lines.append(f"In the log's description, under [forces]: {self.note}")
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """Return everything but the residuals as plain data."""
        units = {"units": list(self.estimate.units[: len(self.gains)])}
        return json_fields(
            gains=self.gains,
            standard_deviations=self.deviations,
            total_least_squares=self.total_least_squares,
        ) | {
            **units,
            **json_fields(
                residual=self.residual,
                condition_number=self.condition,
                gap=self.gap,
                estimate=self.estimate,
            ),
        }


def identify_drive_gains(
    robot: RobotLike,
    log: Log,
    with_payload: Log | None = None,
    *,
    payload: KnownPayload | None = None,
    terms: Terms | None = None,
    processing: Processing | None = None,
    base: BaseParameters | None = None,
) -> DriveGains:
    """Return the drive gains of a machine from a log of its motor currents.

    diag(current) g = W beta, + W_L theta_L where a payload of known theta_L is carried: without it
    gains and inertia could both be doubled. The homogeneous equations in (g, beta, 1) are solved by
    total least squares, as currents are noisy; then the likelihood is maximised for noise in the
    currents alone, current_i = (W_i beta + w_i) / g_i, by Gauss's and Newton's steps, each actuator
    weighted by its noise.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine: its geometry counts, its inertial parameters play no part.
    log : Log
        A log of currents (A, V or %), whose payload column has both phases, 0 and 1; or one
        without payload.
    with_payload : Log, optional
        A log of the same machine with the payload, where the first has none.
    payload : KnownPayload, optional
        The payload; by default that of the log's description.
    terms : Terms, optional
        Friction, offsets and other terms beside the base parameters.
    processing : Processing, optional
        Choices about the preprocessing; by default the data decide.
    base : BaseParameters, optional
        Another choice of base parameters, such as that of legs which share theirs.

    Raises
    ------
    LogError
        If the forces are newtons already, the payload is not known, a phase is missing, or the
        motion does not tell gains from inertia.

    References
    ----------
    M. Gautier and S. Briot, "Global identification of joint drive gains and dynamic parameters of
    robots", Journal of Dynamic Systems, Measurement, and Control 136 (2014).
    """
    robot = as_manipulator(robot)
    logs = [log] if with_payload is None else [log, with_payload]
    unit = _current_unit(logs)
    known = payload or logs[-1].description.payload or log.description.payload
    if known is None:
        raise logs[-1].fault(
            "no payload",
            "the payload is not known, and without it gains and inertia cannot be told apart; "
            "declare [payload] in the log's description",
        )
    if robot.platform.angles and not known.inertia:
        raise logs[-1].fault(
            "no payload",
            f"only the payload's mass is known, but {robot.name} turns its platform; declare its "
            "center_of_mass (or first_moment) and inertia about P too",
        )
    plain = identification_model(robot, replace(terms or Terms(), payload=False), base=base)
    # All columns of the payload: none is solved for, so that none need be independent.
    model = Model(plain.base, replace(plain.terms, payload=True), plain.joins)
    arguments = log, with_payload, processing
    observations, felt_currents = observations_with_payload(model, *arguments), None
    if robot.redundancy:
        felt_currents = _felt_currents(robot, *arguments)
    carried = observations.matrix[..., -len(known.values) :] @ np.array(known.values)
    observations = observations.columns(range(len(plain.names)))
    start, condition, gap = _fit_total_least_squares(observations, carried, felt_currents)
    units = [f"{leg.joint.force_unit}/{unit}" for leg in robot.legs]
    estimate = _fit_likelihood(observations, carried, start, units, felt_currents)
    n = observations.actuators
    return DriveGains(
        gains=estimate.values[:n],
        deviations=estimate.deviations[:n],
        total_least_squares=start[:n],
        unit=unit,
        estimate=estimate,
        residual=estimate.noise,
        condition=condition,
        gap=gap,
    )


def _current_unit(logs: list[Log]) -> str:
    """Return the unit of the currents in all logs; raise LogError if they differ or are newtons."""
    for log in logs:
        if log.description.force_unit == "N":
            raise log.fault(
                "currents",
                "its forces are in newtons already, motor currents (A, V or %) are expected; "
                "declare their unit, and no gains, under [forces] in its description",
            )
    units = {log.description.force_unit for log in logs}
    if len(units) > 1:
        raise logs[1].fault(
            "currents",
            f"its forces are in {logs[1].description.force_unit}, those of {logs[0].source} in "
            f"{logs[0].description.force_unit}; give both in one unit",
        )
    return units.pop()


class _FeltCurrents(NamedTuple):
    """The load that currents put on the platform of a machine with more legs than coordinates."""

    currents: Array
    """Each drive's alone, (R, n, n)."""
    maps: Array
    """The map (R, n, n) from currents to what is felt, of rank m."""
    directions: Array
    """An orthonormal basis (R, n, m) of what can be felt."""

    def linear_model(
        self, observations: Observations, carried: Array, beta: Array, noise: Array
    ) -> tuple[Observations, Array]:
        """Return whitened equations (R, m) of (1/g, beta), and the currents' errors (R, n).

        The errors are the least, in units of their noise, with which diag(current - error) g is
        felt as W beta + carried.
        """
        gains = 1.0 / beta[: len(noise)]
        across = self.directions.mT @ self.maps * gains * noise
        variances, axes = np.linalg.eigh(across @ across.mT)
        root = (axes / np.sqrt(np.maximum(variances, _UNUSED))[:, None]).mT
        whitened = root @ self.directions.mT
        misfits = self.currents @ gains - observations.matrix @ beta[len(noise) :] - carried
        residuals = (whitened @ misfits[..., None])[..., 0]
        errors = noise * ((root @ across).mT @ residuals[..., None])[..., 0]
        currents = self.currents - self.maps * errors[:, None]
        tangent = whitened @ np.concatenate([currents * gains**2, observations.matrix], axis=-1)
        linear = replace(
            observations,
            matrix=tangent,
            forces=residuals + tangent @ beta,
            gain=observations.gain[:, : residuals.shape[1]],
            independent=1.0,
        )
        return linear, errors

    def noise(self, beta: Array, noise: Array, errors: Array) -> Array:
        """Return the noise (n,) of currents, from their errors with a former noise (Helmert)."""
        across = self.directions.mT @ self.maps / beta[: len(noise)] * noise
        shares = np.einsum("rin,rin->rn", np.linalg.pinv(across).mT, across).sum(axis=0)
        degrees = 1.0 - len(beta) / shares.sum()
        deviations = np.sqrt((errors**2).sum(axis=0) / shares / degrees)
        is_exact = (deviations <= _NOISELESS * np.abs(self.currents).max(axis=(0, 1))).all()
        return noise if is_exact else np.maximum(deviations, _LEAST_NOISE * deviations.max())


class _AnyForces(NamedTuple):
    """A linear model whose n values are the forces of the drives themselves."""

    robot: Manipulator
    names: tuple[str, ...]
    units: tuple[str, ...]
    kinds: tuple[str, ...] = ()

    def matrix(self, states: States) -> Array:
        """Return unit matrices (R, n, n)."""
        n = len(self.names)
        return np.broadcast_to(np.eye(n), (len(states), n, n))


def _felt_currents(
    robot: Manipulator, log: Log, with_payload: Log | None, processing: Processing | None
) -> _FeltCurrents:
    """Return what the platform of a redundant machine feels of the currents in logs."""
    model = _AnyForces(robot, robot.force_names, ("",) * robot.joint_count)
    arguments = model, log, with_payload, processing
    observations = observations_with_payload(*arguments)
    # The filter has scaled them where it has left samples out: the trace of a projection is m.
    trace = np.trace(observations.matrix, axis1=1, axis2=2)[:, None, None]
    maps = robot.freedom * observations.matrix / np.where(trace > 0.0, trace, 1.0)
    directions = np.linalg.svd(maps)[0][..., : robot.freedom]
    return _FeltCurrents(currents_by_drive(*arguments), maps, directions)


def _fit_total_least_squares(
    observations: Observations, carried: Array, felt_currents: _FeltCurrents | None
) -> tuple[Array, float, float]:
    """Return (g, beta) by total least squares (n + p,), the condition number and the gap."""
    # The columns W are exact, as in the likelihood: noise is in the currents alone. Else the
    # weakest of dozens of inertial parameters would pass for the null vector.
    n, p = observations.actuators, len(observations.names)
    currents, sizes_of_noise = observations.forces[..., None] * np.eye(n), np.ones(n)
    if felt_currents is not None:
        currents = felt_currents.currents
        sizes_of_noise = np.sqrt((felt_currents.maps**2).sum(axis=1).mean(axis=0))
    homogeneous = replace(
        observations,
        names=(*observations.names, *(f"g{i}" for i in range(1, n + 1))),
        units=(*observations.units, *("",) * n),
        matrix=np.concatenate([-observations.matrix, currents], axis=-1),
        forces=carried,
    )
    factor = qr_factor(homogeneous)
    length = np.sqrt(factor.image @ factor.image + factor.rest)
    if length == 0.0:
        said = "the actuators do not feel the payload; move it about"
        raise observations.fault("no payload", said)
    # W has to be seen by itself, and its message names what is not.
    qr_factor(observations).check_seen()
    upper = np.zeros((p + n + 1, p + n + 1))
    upper[:-1, :-1] = factor.factor
    upper[:, -1] = np.r_[factor.image, np.sqrt(factor.rest)]
    corrections = smallest_corrections(upper, p, np.r_[sizes_of_noise, length])
    sizes = corrections.sizes
    if sizes[-2] <= _UNSEEN * sizes[0] or corrections.share <= _UNSEEN:
        raise observations.fault(
            "too little motion",
            "the payload does not tell the gains from the inertia; carry a heavier one, and move "
            "all coordinates in both phases",
        )
    solution = corrections.values / np.where(factor.scale > 0.0, factor.scale, 1.0)
    return np.roll(solution, n), float(sizes[0] / sizes[-2]), float(sizes[-1] / sizes[-2])


def _fit_likelihood(
    observations: Observations,
    carried: Array,
    start: Array,
    units: Sequence[str],
    felt_currents: _FeltCurrents | None,
) -> Estimate:
    """Return the maximum-likelihood estimate of (g, beta), with noise in the currents alone."""
    n = observations.actuators
    names = (*(f"g{i}" for i in range(1, n + 1)), *observations.names)
    named = (*units, *observations.units)
    # In 1 / g the currents are bilinear: what is left out of each step is only a product.
    beta, noise, steady = np.r_[1.0 / start[:n], start[n:]], np.ones(n), True
    size = LAST_DIGITS * np.linalg.norm(observations.forces)
    for iteration in count(1):
        if felt_currents is None:
            inverse, inertia = beta[:n], beta[n:]
            force = observations.matrix @ inertia + carried
            tangent = np.concatenate(
                [force[..., None] * np.eye(n), inverse[:, None] * observations.matrix], axis=-1
            )
            # J v = current - f(v0) + J v0, and J v0 = f(v0) + (W beta) / g.
            images = observations.forces + inverse * (force - carried)
            linear = replace(observations, matrix=tangent, forces=images)
            noise = actuator_noise(linear, beta)
            weights, residuals = 1.0 / noise, observations.forces - inverse * force
        else:
            linear, errors = felt_currents.linear_model(observations, carried, beta, noise)
            last_noise, noise = noise, felt_currents.noise(beta, noise, errors)
            weights, residuals = np.ones(linear.actuators), linear.forces - linear.matrix @ beta
            steady = bool(np.abs(noise / last_noise - 1.0).max() < _STEADY)
        linear = replace(linear, names=names, units=named)
        step = qr_factor(linear, weights).values() - beta
        beta = beta + step
        change = np.linalg.norm(linear.matrix @ step)
        if steady and change <= max(_SETTLED * np.linalg.norm(residuals), size):
            break
        if iteration == _ITERATIONS:
            raise observations.fault(
                "unsettled", "the gains do not settle; record longer, or carry a heavier payload"
            )
    if felt_currents is None:
        estimate = weighted_least_squares(linear)
    else:  # the equations are whitened
        estimate = replace(ordinary(linear), noise=noise, residuals=errors)
    beta = estimate.values
    slopes = np.r_[-1.0 / beta[:n] ** 2, np.ones(len(beta) - n)]
    return replace(
        estimate,
        method="likelihood",
        values=np.r_[1.0 / beta[:n], beta[n:]],
        covariance=estimate.covariance * np.outer(slopes, slopes),
        iterations=iteration,
    )
