"""Tables of the motors of a list: for each leg, and for legs that are alike together."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any

from pteron.cli.terminal import plain, table
from pteron.json_values import picked

if TYPE_CHECKING:
    import polars as pl
    import rich.table

    from pteron.manipulator import Manipulator
    from pteron.motion import CommonFit, Fit, Motor, Span

_BEST = 3
"""Motors shown for each joint, the best ones."""

_NUMBERS = ("ratio", "from", "to", "rated", "peak", "speed")
"""Headings of a motor's ratios and margins."""


def fits_frame(robot: Manipulator, fits: Sequence[Fit]) -> pl.DataFrame:
    """Return the motors of each leg as data, SI units."""
    import polars as pl

    rows = [
        {
            "leg": fit.leg,
            "motor": fit.motor.name,
            "serves": fit.fits,
            "ratio": fit.ratio,
            "ratio_unit": _ratio_unit(robot, fit.leg),
            **_ends(fit.span),
            **picked(fit, "rated_margin peak_margin speed_margin inertia_ratio"),
        }
        for fit in fits
    ]
    return pl.DataFrame(rows, infer_schema_length=None)


def common_rows(robot: Manipulator, fits: Sequence[CommonFit]) -> list[dict[str, Any]]:
    """Return the motors that legs have in common as data, SI units; margins are the least."""
    return [
        {
            "legs": list(one.legs),
            "motor": one.motor.name,
            "serves": bool(one.span),
            "ratio": one.ratio,
            "ratio_unit": _ratio_unit(robot, one.legs[0]),
            **_ends(one.span),
            **dict(zip(_MARGINS, _margins(one.fits), strict=True)),
        }
        for one in fits
    ]


def motors_table(robot: Manipulator, fits: Sequence[Fit]) -> rich.table.Table:
    """Return the best motors of each leg."""
    rows = []
    for leg, group in groupby(fits, key=lambda fit: fit.leg):
        for i, fit in enumerate(list(group)[:_BEST]):
            cells = _cells(robot, leg, fit.motor, fit.ratio, fit.span, _margins([fit]))
            rows.append(("" if i else str(leg), *cells))
    caption = "Ratios that serve, the best first; then margins at it: rated, peak torque, speed."
    numbers = ("leg", *_NUMBERS)
    return table("leg", "motor", *_NUMBERS, rows=rows, numbers=numbers, caption=caption)


def common_table(robot: Manipulator, fits: Sequence[CommonFit]) -> list[rich.table.Table]:
    """Return the best motors for legs that are alike, at one ratio; none where no legs are."""
    rows = []
    for legs, group in groupby(fits, key=lambda one: one.legs):
        for i, one in enumerate(list(group)[:_BEST]):
            cells = _cells(robot, legs[0], one.motor, one.ratio, one.span, _margins(one.fits))
            rows.append(("" if i else " ".join(map(str, legs)), *cells))
    caption = (
        "Legs that are alike, with one motor and one ratio for all of them; margins are the least."
    )
    made = table("legs", "motor", *_NUMBERS, rows=rows, numbers=_NUMBERS, caption=caption)
    return [made] if rows else []


_MARGINS = ("rated_margin", "peak_margin", "speed_margin")


def _margins(fits: Iterable[Fit]) -> tuple[float, ...]:
    """Return the least margins of fits."""
    every = list(fits)
    return tuple(min(getattr(fit, name) for fit in every) for name in _MARGINS)


def _cells(
    robot: Manipulator, leg: int, motor: Motor, ratio: float, span: Span, margins: Iterable[float]
) -> tuple[str, ...]:
    ends = tuple(f"{end:.4g}" for end in span) if span else ("none", "")
    told = f"{ratio:.4g} {_ratio_unit(robot, leg)}"
    return plain(motor.name), told, *ends, *(f"{value:.2f}" for value in margins)


def _ends(span: Span) -> dict[str, float | None]:
    return {
        "least_ratio": span.least if span else None,
        "greatest_ratio": span.greatest if span else None,
    }


def _ratio_unit(robot: Manipulator, leg: int) -> str:
    return f"rad/{robot.legs[leg - 1].joint.unit}"
