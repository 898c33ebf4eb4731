"""Tables of the motors of a list: for each leg, and for legs that are alike together."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby, islice
from typing import TYPE_CHECKING, Any

from pteron.cli.terminal import plain, table

if TYPE_CHECKING:
    import polars as pl
    import rich.table

    from pteron.manipulator import Manipulator
    from pteron.motion import CommonFit, Fit

_BEST = 3
"""Motors shown for each joint, the best ones."""

_NUMBERS = ("ratio", "from", "to", "rated", "peak", "speed")
"""Headings of a motor's ratios and margins."""

_MARGINS = ("rated_margin", "peak_margin", "speed_margin")

_CAPTIONS = {
    "leg": "Ratios that serve, the best first; then margins at it: rated, peak torque, speed.",
    "legs": (
        "Legs that are alike, with one motor and one ratio for all of them; margins are the least."
    ),
}
"""Captions of the tables, by the heading of their first column."""


def fits_frame(robot: Manipulator, fits: Sequence[Fit]) -> pl.DataFrame:
    """Return the motors of each leg as data, SI units."""
    import polars as pl

    rows = [
        {"leg": fit.leg, **_data(robot, _alone(fit)), "inertia_ratio": fit.inertia_ratio}
        for fit in fits
    ]
    return pl.DataFrame(rows, infer_schema_length=None)


def common_rows(robot: Manipulator, fits: Sequence[CommonFit]) -> list[dict[str, Any]]:
    """Return the motors that legs have in common as data, SI units; margins are the least."""
    return [{"legs": list(one.legs), **_data(robot, one)} for one in fits]


def motors_table(robot: Manipulator, fits: Sequence[Fit]) -> list[rich.table.Table]:
    """Return the best motors of each leg; none where there are none."""
    return _table(robot, "leg", map(_alone, fits))


def common_table(robot: Manipulator, fits: Sequence[CommonFit]) -> list[rich.table.Table]:
    """Return the best motors for legs that are alike, at one ratio; none where no legs are."""
    return _table(robot, "legs", fits)


def _alone(fit: Fit) -> CommonFit:
    from pteron.motion import CommonFit

    return CommonFit((fit.leg,), fit.motor, fit.span, fit.ratio, (fit,))


def _data(robot: Manipulator, one: CommonFit) -> dict[str, Any]:
    least, greatest = one.span if one.span else (None, None)
    return {
        "motor": one.motor.name,
        "serves": bool(one.span),
        "ratio": one.ratio,
        "ratio_unit": _ratio_unit(robot, one),
        "least_ratio": least,
        "greatest_ratio": greatest,
        **dict(zip(_MARGINS, _margins(one), strict=True)),
    }


def _table(robot: Manipulator, heading: str, fits: Iterable[CommonFit]) -> list[rich.table.Table]:
    rows = []
    for legs, group in groupby(fits, key=lambda one: one.legs):
        for i, one in enumerate(islice(group, _BEST)):
            ends = tuple(f"{end:.4g}" for end in one.span) if one.span else ("none", "")
            told = f"{one.ratio:.4g} {_ratio_unit(robot, one)}"
            margins = (f"{value:.2f}" for value in _margins(one))
            first = "" if i else " ".join(map(str, legs))
            rows.append((first, plain(one.motor.name), told, *ends, *margins))
    numbers, caption = ("leg", *_NUMBERS), _CAPTIONS[heading]
    made = table(heading, "motor", *_NUMBERS, rows=rows, numbers=numbers, caption=caption)
    return [made] if rows else []


def _margins(one: CommonFit) -> tuple[float, ...]:
    """Return the margins of a motor, the least of several legs."""
    return tuple(min(getattr(fit, name) for fit in one.fits) for name in _MARGINS)


def _ratio_unit(robot: Manipulator, one: CommonFit) -> str:
    return f"rad/{robot.legs[one.legs[0] - 1].joint.unit}"
