"""The verdict on a calibration: from errors at held-out rows, faults, and values far off."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.calibration.fit import Fit
from pteron.calibration.guess import Block
from pteron.calibration.measurements import Measurements
from pteron.calibration.observability import Observability
from pteron.calibration.result import Finding, HeldOut
from pteron.verdict import Opinion, Verdict

EVERY = 5
"""One row in so many is held out of the fit for a check."""

_PER_VALUE = {True: 1.0, False: 1.5}
"""Measured numbers for each unknown below which none is, where their noise is given or is not."""

_AT_THE_NOISE = 1.3
"""Held-out error, over the one expected from noise and intervals, up to which it is trusted."""

_SURE = 0.999
"""Probability with which a faultless calibration is trusted, however few its rows are."""

_FAR = 2.0
"""The same ratio above which it is not trusted."""

_OFF = 5.0
"""Distance from the drawing, in tolerances, above which a value is doubted."""


def rows_for_check(given: Measurements, blocks: Sequence[Block]) -> int:
    """Return from how many rows on, like those given, some are held out of the fit."""
    counted = sum(int((~np.isnan(values)).sum()) for values in given.parts.values())
    least = _PER_VALUE[set(given.kinds) <= set(given.setup.noise)] * blocks[-1].where.stop
    return max(2 * EVERY, int(np.ceil(least * len(given) / counted)))


def verdict_of(
    fit: Fit,
    blocks: Sequence[Block],
    shown: Observability,
    held_out: HeldOut | None,
    findings: Sequence[Finding],
    checked: int,
) -> Verdict:
    """Return the verdict."""
    found = Opinion()
    if held_out is None:
        found.add(
            "No rows were left for a check: all were needed for the fit.",
            f"Measure at {checked} or more poses (fewer where the noise is given), or give a "
            "second log (--held-out).",
            grade="usable with care",
        )
    else:
        for kind, after in held_out.after.items():
            expected, before = held_out.expected[kind], held_out.before[kind]
            ratio = after / expected
            unit = "mrad" if kind == "angle" else "mm"
            text = (
                f"At {held_out.rows} rows that the fit did not see the {kind} error is "
                f"{1e3 * after:.3g} {unit}, {1e3 * before:.3g} before"
            )
            # The error of few rows strays further by chance.
            chance = np.sqrt(scipy.stats.chi2.ppf(_SURE, held_out.rows) / held_out.rows)
            if ratio <= max(_AT_THE_NOISE, chance):
                found.add(f"{text}: as noise and intervals expect.")
            else:
                lost = ratio > _FAR and after > 0.5 * before
                found.add(
                    f"{text}: {ratio:.2g} times what noise and intervals expect.",
                    grade="not trustworthy" if lost else "usable with care",
                )
    unknowns = [u for block in blocks for u in block.unknowns]
    far = [
        u.name
        for u, t in zip(unknowns, fit.total, strict=True)
        if u.group != "setup" and abs(t) > _OFF * u.tolerance
    ]
    if far:
        several = f"{', '.join(far[:4])}{' ...' if len(far) > 4 else ''}"
        found.add(
            f"More than {_OFF:g} tolerances from the drawing: {several}.",
            "Check the robot's file at these values, or say by `prior` how far off they may be.",
            grade="usable with care",
        )
    for finding in findings:
        found.add(finding.text, grade="usable with care")
    out = int((~fit.kept).sum())
    if out > 0.1 * len(fit.kept):
        text = f"{out} of {len(fit.kept)} rows do not fit and were left out."
        found.add(text, grade="usable with care")
    open_values = shown.columns - shown.shown
    if open_values:
        more = f"; at more poses {shown.rank} would" if shown.rank > shown.shown else ""
        found.add(
            f"{shown.shown} of {shown.columns} combinations show in these measurements, the other "
            f"{open_values} are kept at the drawing{more}."
        )
    return found.verdict()
