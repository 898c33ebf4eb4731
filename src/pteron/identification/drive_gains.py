"""Drive gains, N or N m per unit of current, from motions with and without a known payload."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from typing import Any

import numpy as np

from pteron.identification.estimators import Estimate, qr_factor, weighted_least_squares
from pteron.identification.estimators.least_squares import actuator_noise
from pteron.identification.estimators.total import smallest_corrections
from pteron.identification.logs import Log
from pteron.identification.logs.description import KnownPayload
from pteron.identification.model import Model, Terms, identification_model
from pteron.identification.observation import Observations
from pteron.identification.payload_phases import observations_with_payload
from pteron.identification.signals import Processing
from pteron.json_values import json_fields
from pteron.kernels import Array
from pteron.manipulator import RobotLike, as_manipulator
from pteron.manipulator.manipulator import refuse_redundant
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
    refuse_redundant(robot, "identification of drive gains")
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
    observations = observations_with_payload(model, log, with_payload, processing)
    carried = observations.matrix[..., -len(known.values) :] @ np.array(known.values)
    observations = observations.columns(range(len(plain.names)))
    start, condition, gap = _fit_total_least_squares(observations, carried)
    units = [f"{leg.joint.force_unit}/{unit}" for leg in robot.legs]
    estimate = _fit_likelihood(observations, carried, start, units)
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


def _fit_total_least_squares(
    observations: Observations, carried: Array
) -> tuple[Array, float, float]:
    """Return (g, beta) by total least squares (n + p,), the condition number and the gap."""
    # The columns W are exact, as in the likelihood: noise is in the currents alone. Else the
    # weakest of dozens of inertial parameters would pass for the null vector.
    n, p = observations.actuators, len(observations.names)
    currents = observations.forces[..., None] * np.eye(n)
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
    corrections = smallest_corrections(upper, p, np.r_[np.ones(n), length])
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
    observations: Observations, carried: Array, start: Array, units: Sequence[str]
) -> Estimate:
    """Return the maximum-likelihood estimate of (g, beta), with noise in the currents alone."""
    n = observations.actuators
    names = (*(f"g{i}" for i in range(1, n + 1)), *observations.names)
    named = (*units, *observations.units)
    # In 1 / g the currents are bilinear: what is left out of each step is only a product.
    beta = np.r_[1.0 / start[:n], start[n:]]
    for iteration in count(1):
        inverse, inertia = beta[:n], beta[n:]
        force = observations.matrix @ inertia + carried
        tangent = np.concatenate(
            [force[..., None] * np.eye(n), inverse[:, None] * observations.matrix], axis=-1
        )
        # J v = current - f(v0) + J v0, and J v0 = f(v0) + (W beta) / g.
        images = observations.forces + inverse * (force - carried)
        linear = replace(observations, names=names, units=named, matrix=tangent, forces=images)
        noise = actuator_noise(linear, beta)
        step = qr_factor(linear, 1.0 / noise).values() - beta
        beta = beta + step
        change = np.linalg.norm(tangent @ step)
        residual = np.linalg.norm(observations.forces - inverse * force)
        if change <= max(_SETTLED * residual, LAST_DIGITS * np.linalg.norm(observations.forces)):
            break
        if iteration == _ITERATIONS:
            raise observations.fault(
                "unsettled", "the gains do not settle; record longer, or carry a heavier payload"
            )
    estimate = weighted_least_squares(linear)
    beta = estimate.values
    slopes = np.r_[-1.0 / beta[:n] ** 2, np.ones(len(beta) - n)]
    return replace(
        estimate,
        method="likelihood",
        values=np.r_[1.0 / beta[:n], beta[n:]],
        covariance=estimate.covariance * np.outer(slopes, slopes),
        iterations=iteration,
    )
