"""The verdict on a calibration: from errors at held-out rows, faults, and values far off."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.arguments import join_words
from pteron.calibration import thresholds
from pteron.calibration.calibration_fit import CalibrationFit
from pteron.calibration.fit import BEYOND
from pteron.calibration.guess import UnknownBlock
from pteron.calibration.measurements import Measurements, error_unit
from pteron.calibration.observability import Observability
from pteron.calibration.result import CalibrationFinding, HeldOut, HiddenOrder
from pteron.verdict import Grade, Opinion, Verdict

EVERY = 5
"""One row in so many is held out of the fit as a check."""

_PER_VALUE = {True: 1.0, False: 1.5}
"""Least measured numbers per unknown to hold rows out, by whether their noise is given."""

_FAR = 2.0
"""Held-out error, over the one expected, above which a fit that gained nothing is not trusted."""

_UNEXPLAINED = (
    "No single cause explains the errors: units, order, signs, zeros and scales of the readings, "
    "marks and the instrument's frame were tried."
)


_GREAT_TILT = 0.1
"""Tilt, rad, above which its size is not stated: it means only that nothing shows it."""

_ROD_ADVICE = (
    "Measure both rods of each pair: unequal rods tilt the platform, and without measured "
    "positions a fit attributes that to the geometry."
)


class Evidence(NamedTuple):
    """The results from which a verdict is derived."""

    measurements: Measurements
    fit: CalibrationFit
    blocks: Sequence[UnknownBlock]
    observability: Observability
    held_out: HeldOut | None
    findings: Sequence[CalibrationFinding]
    open_errors: Mapping[str, float]
    """Possible error of each coordinate (95 %), m and rad."""
    hidden_order: HiddenOrder | None
    hidden_tilt: float | None
    """Greatest tilt by unequal rods of a pair that does not show, rad; None where none can be."""
    rows_for_check: int
    """Rows from which on some are held out."""


class _Reason(NamedTuple):
    """A reason of the verdict: its text, advice on what to do next, and the grade it allows."""

    text: str
    step: str = ""
    grade: Grade = "trustworthy"


def rows_for_check(measurements: Measurements, blocks: Sequence[UnknownBlock]) -> int:
    """Return the least number of rows from which some are reserved for validation."""
    counted = sum(int((~np.isnan(array)).sum()) for array in measurements.parts.values())
    least = (
        _PER_VALUE[set(measurements.kinds) <= set(measurements.setup.noise)] * blocks[-1].where.stop
    )
    return max(2 * EVERY, int(np.ceil(least * len(measurements) / counted)))


def verdict_of(evidence: Evidence) -> Verdict:
    """Return the verdict: its first reason is the cause of a bad grade, or what stays open."""
    errors = [*_error_reasons(evidence), *_outlier_reasons(evidence.fit)]
    findings = [
        _Reason(f.text, "", "not trustworthy" if f.effect > 1.0 else "usable with care")
        for f in evidence.findings
    ]
    bad = any(reason.grade == "not trustworthy" for reason in (*errors, *findings))
    first = findings or ([_Reason(_UNEXPLAINED)] if bad else [])
    reasons = [
        *_open_error_reasons(evidence),
        *findings,
        *errors,
        *_far_value_reasons(evidence),
        *_hidden_rod_reasons(evidence),
    ]
    if bad:
        said = [*first, *_open_error_reasons(evidence)]  # that errors remain needs no other words
        reasons = [*first, *(reason for reason in reasons if reason not in said)]
    opinion = Opinion()
    for text, step, grade in (*reasons, *_unseen_reasons(evidence.observability)):
        opinion.add(text, step, grade=grade)
    if "position" not in evidence.measurements.kinds and any(
        leg.bar for leg in evidence.fit.guess.robot.legs
    ):
        opinion.steps.append(_ROD_ADVICE)
    return opinion.verdict()


def _error_reasons(evidence: Evidence) -> Iterator[_Reason]:
    """Yield reasons from the errors after the fit, at held-out rows or, without them, all rows."""
    held_out, stated = evidence.held_out, evidence.measurements.setup.noise
    if not evidence.fit.settled:
        yield _Reason(
            "The search for the geometry does not settle: the measurements contradict the machine "
            "as drawn.",
            "Check units, the order and signs of the joints, and the frame.",
            "not trustworthy",
        )
    if held_out is None:
        yield _Reason(
            "No rows were left for a check: all were needed for the fit.",
            f"Measure at {evidence.rows_for_check} or more poses (fewer where the noise is given), "
            "or give a second log (--held-out).",
            "usable with care",
        )
        for kind, error in fitted_errors(evidence.fit, evidence.measurements).items():
            if error > thresholds.ordinary_error(kind, stated.get(kind)):
                size = _size_text(error, kind)
                text = f"Even at the fitted rows the {kind} error is {size}"
                yield _Reason(f"{text}, more than ordinary tolerances.", "", "not trustworthy")
        return
    for kind, fitted in held_out.after.items():
        expected, drawn = held_out.expected[kind], held_out.before[kind]
        text = (
            f"At {held_out.rows} rows held out of the fit the {kind} error is "
            f"{_size_text(fitted, kind)}, {_size_text(drawn, kind)} before the calibration"
        )
        most = thresholds.ordinary_error(kind, stated.get(kind))
        fine = fitted <= thresholds.FINE_SHARE * most
        if fitted > most:
            yield _Reason(
                f"{text}: more than the {_size_text(most, kind)} of ordinary tolerances.",
                "",
                "not trustworthy",
            )
            continue
        if not fine and fitted > thresholds.FALLEN_SHARE * drawn:
            yield _Reason(f"{text}: it did not fall.", "", "not trustworthy")
            continue
        # The error of few rows strays further by chance.
        chance = np.sqrt(scipy.stats.chi2.ppf(thresholds.SURE, held_out.rows) / held_out.rows)
        ratio = fitted / expected
        if ratio <= max(thresholds.AT_THE_NOISE, chance):
            grade: Grade = "trustworthy" if fine else "usable with care"
            yield _Reason(f"{text}: as expected from noise and intervals.", "", grade)
            continue
        lost = ratio > _FAR and fitted > thresholds.FALLEN_SHARE * drawn
        yield _Reason(
            f"{text}: {ratio:.2g} times as much as expected from noise and intervals.",
            "",
            "not trustworthy" if lost else "usable with care",
        )


def fitted_errors(fit: CalibrationFit, measurements: Measurements) -> dict[str, float]:
    """Return the root mean square residual of each kind, m and rad, at the fitted rows."""
    counted = fit.measured & (fit.kept & (fit.distances != BEYOND))[:, None]
    kinds = {kind: counted & (measurements.kind_of == kind) for kind in measurements.kinds}
    return {
        kind: float(np.sqrt(np.mean(fit.residuals[here] ** 2)))
        for kind, here in kinds.items()
        if here.any()
    }


def _open_error_reasons(evidence: Evidence) -> Iterator[_Reason]:
    """Yield a reason for each kind of coordinate with a large possible error."""
    measurements, fit = evidence.measurements, evidence.fit
    kinds = [k for k, v in measurements.parts.items() if np.isfinite(v[fit.kept]).any()]
    linear = [name for name in evidence.open_errors if name in "xyz"]
    for names, kind in (
        (linear, "position"),
        ([name for name in evidence.open_errors if name not in linear], "angle"),
    ):
        least = thresholds.OPEN_SHARE * thresholds.ORDINARY_ERROR[kind]
        far = [name for name in names if evidence.open_errors[name] > least]
        if far:
            most = max(evidence.open_errors[name] for name in far)
            coordinates = join_words(far, "and")
            measured = " and ".join(f"{name}s" for name in kinds)
            where = "" if measurements.setup.frame_known else " in an unknown frame"
            them = "it" if len(far) == 1 else "them"
            order = ""
            hidden = evidence.hidden_order
            if hidden and kind == "position":
                size = _size_text(hidden.error, "position")
                legs = join_words([*map(str, hidden.legs)], "and")
                order = (
                    f", nor the order of the legs {legs}: if it is another, {coordinates} may be "
                    f"off by {size} more"
                )
            rods = ""
            if kind == "position" and "position" not in kinds and _hides_rod_tilt(evidence):
                rods = f", nor rods of one pair that differ and {_tilt_text(evidence)}"
            yield _Reason(
                f"{coordinates} may be off by {_size_text(most, kind)} (95 %): "
                f"{measured}{where} do not show {them}{rods}{order}.",
                f"Measure {coordinates} too: positions, or distances across the work space.",
                "usable with care" if kinds == ["closure"] else "trustworthy",
            )


def _hides_rod_tilt(evidence: Evidence) -> bool:
    """Return whether rods of a pair may tilt the platform by more than ordinary tolerances."""
    tilt = evidence.hidden_tilt
    return tilt is not None and tilt > thresholds.ORDINARY_ERROR["angle"]


def _tilt_text(evidence: Evidence) -> str:
    """Return a clause on the hidden tilt of the platform, with its size where it is small."""
    tilt = evidence.hidden_tilt or 0.0
    size = f" by up to {_size_text(tilt, 'angle')}" if tilt < _GREAT_TILT else ""
    return f"tilt the platform{size}"


def _hidden_rod_reasons(evidence: Evidence) -> Iterator[_Reason]:
    """Yield a reason if unequal rods may tilt the platform and positions do not show it."""
    if "position" in evidence.measurements.kinds and _hides_rod_tilt(evidence):
        yield _Reason(
            f"Rods of one pair that differ and {_tilt_text(evidence)} would not show in these "
            "positions.",
            "Measure both rods of each pair, or positions of a mark away from the tool.",
        )


def _far_value_reasons(evidence: Evidence) -> Iterator[_Reason]:
    """Yield a reason if values of the geometry are far from the drawing."""
    unknowns = [u for block in evidence.blocks for u in block.unknowns]
    far = [
        u.name
        for u, t in zip(unknowns, evidence.fit.total, strict=True)
        if u.group != "setup" and abs(t) > thresholds.OFF_TOLERANCES * u.tolerance
    ]
    if far:
        several = f"{', '.join(far[:4])}{' ...' if len(far) > 4 else ''}"
        yield _Reason(
            f"More than {thresholds.OFF_TOLERANCES:g} tolerances from the drawing: {several}.",
            "Check these values in the robot's file, or state their tolerances with --prior.",
            "usable with care",
        )


def _outlier_reasons(fit: CalibrationFit) -> Iterator[_Reason]:
    """Yield a reason if many rows do not fit."""
    out, count = int((~fit.kept).sum()), len(fit.kept)
    if out > thresholds.FEW_LEFT_OUT * count:
        many = out > thresholds.MANY_LEFT_OUT * count
        yield _Reason(
            f"{out} of {count} rows do not fit and were left out.",
            "",
            "not trustworthy" if many else "usable with care",
        )


def _unseen_reasons(shown: Observability) -> Iterator[_Reason]:
    """Yield a reason if measurements do not show all combinations of unknowns."""
    open_values = shown.columns - shown.determined_count
    if open_values:
        potential = (
            f"; more poses would determine {shown.rank}"
            if shown.rank > shown.determined_count
            else ""
        )
        yield _Reason(
            f"These measurements determine {shown.determined_count} of {shown.columns} "
            f"combinations of values; the other {open_values} keep their drawn values{potential}."
        )


def _size_text(error: float, kind: str) -> str:
    """Return an error as text in mrad or mm."""
    return f"{1e3 * error:.3g} {error_unit(kind)}"
