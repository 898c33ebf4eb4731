"""The result of a calibration: the machine, each value with its interval, and a verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import ArrayLike, NDArray

from pteron.calibration.calibration_fit import CalibrationFit
from pteron.calibration.guess import Guess, Unknown, UnknownBlock, tolerances_of, variances
from pteron.calibration.measurements import (
    TOOL,
    Measurements,
    length_columns,
    position_axes,
    spread_rows,
)
from pteron.calibration.observability import Observability
from pteron.calibration.residuals import MachineSlopes
from pteron.calibration.thresholds import OFF_TOLERANCES
from pteron.json_values import json_fields
from pteron.legs import Reading
from pteron.manipulator import Manipulator
from pteron.manipulator.machine_record import machine_record
from pteron.result import Result
from pteron.verdict import Verdict

Array = NDArray[np.float64]

Origin = Literal["data", "both", "tolerance"]
"""The source of a value: the measurements, the drawing with its tolerance, or both."""

_BY_DATA = 0.3
"""Deviation after the fit, as a share of the tolerance, up to which the data made a value: they
weigh ten times as much as the tolerance then, by the squares."""

_BY_TOLERANCE = 0.9
"""Deviation after the fit, as a share of the tolerance, from which the value is the drawing's: the
data weigh less than a quarter of what the tolerance does."""

_OPEN_ROWS = 400
"""Most rows, evenly spread, at which possible errors are taken: errors are smooth over the
workspace, and each row takes an iteration of direct kinematics."""

_QUANTILE = float(scipy.stats.norm.ppf(0.975))


@dataclass(frozen=True, eq=False, repr=False)
class Value(Result):
    """One value of a calibration.

    Attributes
    ----------
    name, group, unit : str
        As in `Unknown`.
    drawn, found : float
        The value in the drawing and after calibration, SI units; for a direction the angle about an
        axis, rad.
    deviation : float
        Standard deviation of `found`.
    origin : {"data", "both", "tolerance"}
        Its source: measurements, both, or the drawing with its tolerance.
    """

    name: str
    group: str
    unit: str
    drawn: float
    found: float
    deviation: float
    origin: Origin

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval."""
        half = _QUANTILE * self.deviation
        return self.found - half, self.found + half


@dataclass(frozen=True, eq=False, repr=False)
class HeldOut(Result):
    """Root mean square errors at held-out rows, by kind of measurement, in SI units.

    `before` is with the machine as drawn, `after` with the calibrated one.
    """

    rows: int
    before: dict[str, float]
    after: dict[str, float]
    expected: dict[str, float]
    """The expected values of `after`, from the noise and the intervals."""


@dataclass(frozen=True, eq=False, repr=False)
class CalibrationFinding(Result):
    """A fault that the measurements show: its kind, and a sentence that says where it is."""

    kind: str
    text: str
    improvement: float = 0.0
    """Fall of the sum of squared residuals with this fault in the fit, in variances."""
    effect: float = 0.0
    """Greatest shift that it makes of a measurement that was fitted, in ordinary errors."""


@dataclass(frozen=True, eq=False, repr=False)
class HiddenOrder(Result):
    """Legs whose readings could stand in another order and nothing would show.

    Attributes
    ----------
    legs : tuple of int
        Their numbers, from 1.
    error : float
        Greatest further error of the tool on the calibrated machine in such an order, m.
    """

    legs: tuple[int, ...]
    error: float


@dataclass(frozen=True, eq=False, repr=False)
class Calibration(Result):
    """A machine's geometry from measurements.

    Attributes
    ----------
    drawn : Manipulator
        The machine as it was given.
    robot : Manipulator
        The calibrated machine; its legs hold the readings' zeros and scales.
    values : tuple of Value
    noise : dict
        Standard deviation by kind of measurement, given or estimated.
    observability : Observability
        The rank of the measurements, and the combinations that they do not show.
    held_out : HeldOut or None
        Errors at rows that were not fitted.
    findings : tuple of Finding
        Faults that the residuals show.
    verdict : Verdict
    measurements : Measurements
    fit : Fit
        The fit of all rows.
    blocks : tuple of Block
        The unknowns, in the order of `values`.
    start : Guess
        The machine as drawn, with its surroundings as described.
    open_errors : dict
        Possible error (95 %) of each coordinate of the pose, of the tool where it is a length, at
        the measured poses, m and rad.
    hidden_order : HiddenOrder or None
        Legs of which the measurements do not show the order.
    """

    ROWS = "values"

    drawn: Manipulator
    robot: Manipulator
    values: tuple[Value, ...]
    noise: dict[str, float]
    observability: Observability
    held_out: HeldOut | None
    findings: tuple[CalibrationFinding, ...]
    verdict: Verdict
    measurements: Measurements
    fit: CalibrationFit
    blocks: tuple[UnknownBlock, ...]
    start: Guess
    open_errors: dict[str, float]
    hidden_order: HiddenOrder | None = None

    def errors(self, poses: ArrayLike) -> tuple[Array, Array]:
        """Return the errors of the tool at poses as drawn, and their uncertainty as calibrated.

        For a platform that only turns, they are those of the pose's angles, rad.

        Parameters
        ----------
        poses : array, shape (N, m)
            The desired poses, m and rad.

        Returns
        -------
        before : array, shape (N, 3) or (N, m)
            Error of the calibrated machine when it is driven as drawn: from the desired place of
            the tool to the actual one, in the base frame, m; or the angles' errors; NaN where the
            pose is out of reach.
        after : array, shape (N,)
            Standard deviation of the tool's place, m, or of the angles, rad, when driven as
            calibrated.
        """
        desired = np.atleast_2d(np.asarray(poses, dtype=float))
        slopes = MachineSlopes(self.drawn, self.blocks)
        measurements = Measurements.from_readings(
            self.drawn, np.zeros((len(desired), len(self.drawn.legs)))
        )
        readings = self.start.readings(slopes.joints(self.start, desired))
        measurements = replace(measurements, readings=readings)
        fitted = self.fit.guess
        actual = slopes.poses(fitted, fitted.joints(readings), desired)
        tools = (TOOL,) * len(desired)
        moves = bool(self.drawn.platform.lengths)
        errors = actual - desired
        if moves:
            errors = fitted.points(tools, actual) - self.start.points(tools, desired)
        slopes_at_poses = slopes.pose_slopes(
            fitted, measurements, np.where(np.isfinite(actual), actual, desired)
        )[moves]
        return errors, np.sqrt(np.maximum(variances(slopes_at_poses, self.fit.covariance), 0.0))

    def misfit(self, other: Guess | Sequence[float]) -> float:
        """Return the growth of the sum of squared residuals, tolerances included, at other values.

        Below the chi-squared quantile of as many degrees as there are values, the other values are
        in the joint region of that probability. Steps from the drawing are given in the order of
        `values`.
        """
        from pteron.calibration.fit import Fitter

        steps = np.asarray(other, dtype=float)
        fitter = Fitter(self.measurements, self.blocks, self.start, self.fit.poses)
        there = self.start.apply_step(self.blocks, steps)
        return fitter.cost(there, steps, self.fit) - fitter.cost(
            self.fit.guess, self.fit.total, self.fit
        )

    def summary(self) -> str:
        """Return the verdict with its reasons and advice, and the rank, for people, as lines."""
        return f"{self.robot.name}: {self.verdict.summary()}\n{self.observability.summary()}"

    def as_dict(self) -> dict[str, Any]:
        """Return the calibration as plain data, as `calibration.json` has it."""
        value_records = [
            {**asdict(known_value), "interval": list(known_value.interval)}
            for known_value in self.values
        ]
        outliers = [self.measurements.places[i] for i in np.flatnonzero(~self.fit.kept)]
        return {
            "name": self.drawn.name,
            "machine": machine_record(self.drawn),
            "calibrated_geometry": machine_record(self.robot)["geometry"],
            "values": value_records,
            **json_fields(zeros=self.fit.guess.zeros, scales=self.fit.guess.scales),
            "noise": self.noise,
            **json_fields(
                rank=self.observability.rank,
                shown=self.observability.determined_count,
                columns=self.observability.columns,
            ),
            "certificate": self.observability.summary(),
            **json_fields(unseen=self.observability.unseen, weak=self.observability.weak),
            **json_fields(
                held_out=self.held_out,
                findings=self.findings,
                verdict=self.verdict,
                open_errors=self.open_errors,
                hidden_order=self.hidden_order,
            ),
            "outliers": outliers,
        }


def open_errors(
    measurements: Measurements, fit: CalibrationFit, blocks: Sequence[UnknownBlock]
) -> dict[str, float]:
    """Return the possible error (95 %) of each coordinate at the measured poses, m and rad."""
    robot = fit.guess.robot
    slopes = MachineSlopes(robot, blocks)
    rows = spread_rows(len(measurements), _OPEN_ROWS)
    tools = Measurements.from_readings(robot, measurements.readings[rows])
    covariance = _contradicted_covariance(fit, blocks)
    poses, moved = slopes.pose_slopes(fit.guess, tools, fit.poses[rows])
    length_slopes = position_axes(robot)[length_columns(robot)] @ moved
    of_each = np.concatenate([length_slopes, poses[:, length_slopes.shape[1] :]], axis=1)
    of_each = of_each[np.isfinite(of_each).all(axis=(1, 2)) & fit.kept[rows]]
    lengths = [name for name in robot.coordinates if name in "xyz"]
    names = [*lengths, *(name for name in robot.coordinates if name not in lengths)]
    possible = {}
    for k, name in enumerate(names if len(of_each) else ()):
        most = variances(of_each[:, k : k + 1], covariance).max()
        possible[name] = _QUANTILE * float(np.sqrt(max(most, 0.0)))
    return possible


def _contradicted_covariance(fit: CalibrationFit, blocks: Sequence[UnknownBlock]) -> Array:
    """Return the covariance (p, p) with tolerances as wide as the values that were found.

    Where a value is far beyond its group's tolerance, measurements contradict that tolerance: its
    group's is widened by the ratio of both (Birge), so that it does not vouch for what they do not
    show.
    """
    tolerances = tolerances_of(blocks)
    groups = np.array([unknown.group for block in blocks for unknown in block.unknowns])
    prior = fit.prior.copy()
    with np.errstate(invalid="ignore"):  # of a value without a tolerance
        shares = np.abs(fit.total) / tolerances
    shown = np.maximum(1.0 - np.diag(fit.covariance) * fit.prior, 0.0)
    for group in set(groups.tolist()) - {"setup"}:
        chosen = (groups == group) & np.isfinite(tolerances)
        if shares[chosen].max(initial=0.0) > OFF_TOLERANCES:
            ratio = float((shares[chosen] ** 2).sum()) / max(float(shown[chosen].sum()), 1.0)
            prior[chosen] /= max(ratio, 1.0)
    return fit.covariance if (prior == fit.prior).all() else replace(fit, prior=prior).covariance


def values_of(
    start: Guess, fit: CalibrationFit, blocks: Sequence[UnknownBlock]
) -> tuple[Value, ...]:
    """Return each unknown of a fit as a `Value`: name, unit, drawn and fitted number, origin."""
    drawn = np.concatenate([block.values(start) for block in blocks])
    deviations = np.sqrt(np.diag(fit.covariance))
    shares = deviations / tolerances_of(blocks)
    unknowns = [unknown for block in blocks for unknown in block.unknowns]
    numbers = np.stack([drawn, drawn + fit.total, deviations, shares], axis=-1).tolist()
    return tuple(
        Value(u.name, u.group, u.unit, old, new, deviation, _origin(share, u))
        for u, (old, new, deviation, share) in zip(unknowns, numbers, strict=True)
    )


def _origin(share: float, unknown: Unknown) -> Origin:
    """Return whether a value comes from the data, its tolerance, or both."""
    if share <= _BY_DATA or unknown.group == "setup":
        return "data"
    return "tolerance" if share >= _BY_TOLERANCE else "both"


def calibrated_robot(guess: Guess) -> Manipulator:
    """Return the machine of a guess, with the zeros of readings in its geometry if possible."""
    legs = []
    each = zip(guess.robot.legs, guess.zeros.tolist(), guess.scales.tolist(), strict=True)
    for leg, zero, scale in each:
        absorbed = leg.with_zero(zero)
        remaining_zero = zero if absorbed is None else 0.0
        reading = Reading(remaining_zero, scale) if remaining_zero or scale != 1.0 else None
        # Stops are where they were read, such as a printer's end stops.
        ends = leg.limits and sorted(remaining_zero + scale * end for end in leg.limits)
        limits = ends and (ends[0], ends[1])
        legs.append(replace(absorbed or leg, reading=reading, limits=limits))
    robot = replace(guess.robot, legs=tuple(legs))
    tool = tuple(guess.marks[TOOL].tolist())
    if any(tool) or robot.platform.tool:
        robot = replace(robot, platform=replace(robot.platform, tool=tool))
    return robot
