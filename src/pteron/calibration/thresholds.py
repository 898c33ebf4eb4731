"""Thresholds of the verdict on a calibration, with their reasons; the how-to has them as a table.

They are absolute, m and rad: a geometry that is 1 mm off is 1 mm off, however far it was before.
"""

from __future__ import annotations

ORDINARY_ERROR = dict.fromkeys(("position", "closure", "height", "distance"), 1e-3)
ORDINARY_ERROR["angle"] = 3.5e-3
"""Error, m and rad, above which a calibration is not trustworthy.

The ordinary tolerance of a length and of a direction (`unknowns.TOLERANCES`): parts that nobody
measured are that good, so that more than this after a fit is no calibration. Where a greater noise
is stated, twice that noise takes its place."""

FINE_SHARE = 0.5
"""Share of the ordinary error up to which a calibration may be trustworthy.

Chosen: half of what nobody needs to measure for."""

FALLEN_SHARE = 0.5
"""Error after a fit, as a share of that before, above which it did not fall.

It counts for errors that are not fine alone: a machine as good as its drawing has nothing to lose.
Chosen: a fit that leaves half of an error explains another part of it than its cause."""

STATED_NOISE = 2.0
"""Times of a stated noise that a held-out error may be: 99.7 % of six or more normal values."""

AT_THE_NOISE = 1.3
"""Held-out error, over the one expected from noise and intervals, up to which it is trusted.

Of 30 held-out values the ratio's standard deviation is 0.13; 1.3 is beyond two of them."""

SURE = 0.999
"""Probability with which a faultless calibration is trusted, however few its rows are."""

OFF_TOLERANCES = 5.0
"""Distance from the drawing, in tolerances, above which a value is doubted.

A normal value lies farther with a probability of 6e-7; of a machine's 100 values none does."""

FEW_LEFT_OUT = 0.1
"""Share of rows left out above which the verdict is "usable with care" at best.

Touches that fail and targets that are hidden are a few in a hundred."""

MANY_LEFT_OUT = 1.0 / 3.0
"""Share of rows left out above which it is "not trustworthy".

Medians bear half of the rows; from a third on the rows that fit are no plain majority."""

OPEN_SHARE = 0.5
"""Possible error (95 %) of a coordinate, as a share of the ordinary error, from which the first
sentence states it: the same half as `FINE_SHARE`."""

UNDER_PLANE = 5e-3
"""Depth under a plane that other rows touch, m, from which a row cannot be where it says.

A bed gives way by tenths of a millimetre; end stops that are off put a whole log there, no row."""

BEYOND_LIMITS = 0.02
"""Excess over a joint's limits, as a share of its travel, from which a row is first set aside.

Five tolerances of a zero, 2 mm, on a travel of 0.5 m."""

FAR_ROW = 30.0
"""Residual of a row on the drawing, over noise and tolerances, from which it is first set aside.

Chosen: far beyond what noise and tolerances make of a row, where sums of squares are no measure of
it any more. A sound row that is set aside is taken back after the first fit."""


def ordinary_error(kind: str, stated_noise: float | None) -> float:
    """Return the error of a kind of measurement above which nothing is trustworthy, m or rad."""
    return max(ORDINARY_ERROR[kind], STATED_NOISE * (stated_noise or 0.0))
