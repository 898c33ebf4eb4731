"""Tables of motors: what they must give, and those of a list for each leg or for equal legs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import groupby, islice
from typing import TYPE_CHECKING, Any

from pteron.cli.terminal import plain, significant, table

if TYPE_CHECKING:
    import polars as pl
    import rich.table

    from pteron.manipulator import Manipulator
    from pteron.motion import CommonFit, MotorFit, Sizing

_BEST = 3
"""Motors shown for each joint, the best ones."""

_NUMBERS = ("best ratio", "from", "to", "rated torque", "peak torque", "speed")
"""Headings of a motor's ratios and margins."""

_MARGINS = ("rated_margin", "peak_margin", "speed_margin")

_CAPTIONS = {
    "leg": (
        "Gear ratios: best, and range in which the motor is strong enough. Then, at the best "
        "ratio, what the motor has over what the cycle needs: torques and speed."
    ),
    "legs": "One motor and one ratio for equal legs; torques and speed of the most loaded leg.",
}
"""Captions of the tables, by the heading of their first column."""


def fits_frame(robot: Manipulator, fits: Sequence[MotorFit]) -> pl.DataFrame:
    """Return the motors of each leg as data, SI units."""
    import polars as pl

    rows = [
        {"leg": fit.leg, **_data(robot, _alone(fit)), "inertia_ratio": fit.inertia_ratio}
        for fit in fits
    ]
    return pl.DataFrame(rows, infer_schema_length=None)


def common_rows(robot: Manipulator, fits: Sequence[CommonFit]) -> list[dict[str, Any]]:
    """Return the motors that legs have in common as data, SI units; margins are the least."""
    return [{"legs": list(fit.legs), **_data(robot, fit)} for fit in fits]


def motors_table(robot: Manipulator, fits: Sequence[MotorFit]) -> list[rich.table.Table]:
    """Return the best motors of each leg; none where there are none."""
    return _table(robot, "leg", map(_alone, fits))


def common_table(robot: Manipulator, fits: Sequence[CommonFit]) -> list[rich.table.Table]:
    """Return the best motors for legs that are alike, at one ratio; none where no legs are."""
    return _table(robot, "legs", fits)


def _alone(fit: MotorFit) -> CommonFit:
    """Return one leg's fit of a motor as a common fit of that leg alone."""
    from pteron.motion import CommonFit

    return CommonFit((fit.leg,), fit.motor, fit.span, fit.ratio, (fit,))


def _data(robot: Manipulator, fit: CommonFit) -> dict[str, Any]:
    """Return a common fit as JSON data: motor, gear ratio, its feasible range, and margins."""
    least, greatest = fit.span if fit.span else (None, None)
    return {
        "motor": fit.motor.name,
        "serves": bool(fit.span),
        "ratio": fit.ratio,
        "ratio_unit": _ratio_unit(robot, fit),
        "least_ratio": least,
        "greatest_ratio": greatest,
        **dict(zip(_MARGINS, _margins(fit), strict=True)),
    }


def _table(robot: Manipulator, heading: str, fits: Iterable[CommonFit]) -> list[rich.table.Table]:
    """Return a table of the best motors by leg or group of legs; an empty list without fits."""
    rows = []
    for legs, group in groupby(fits, key=lambda fit: fit.legs):
        for i, fit in enumerate(islice(group, _BEST)):
            ends = tuple(map(significant, fit.span)) if fit.span else ("none", "")
            ratio = f"{significant(fit.ratio)} {_ratio_unit(robot, fit)}"
            margins = (f"{margin:.2f}" for margin in _margins(fit))
            first = "" if i else " ".join(map(str, legs))
            rows.append((first, plain(fit.motor.name), ratio, *ends, *margins))
    numbers, caption = ("leg", *_NUMBERS), _CAPTIONS[heading]
    motor_table = table(heading, "motor", *_NUMBERS, rows=rows, numbers=numbers, caption=caption)
    return [motor_table] if rows else []


def _margins(common: CommonFit) -> tuple[float, ...]:
    """Return the margins of a motor to its limits, each the least among several legs."""
    return tuple(min(getattr(fit, name) for fit in common.fits) for name in _MARGINS)


def _ratio_unit(robot: Manipulator, fit: CommonFit) -> str:
    """Return the unit of the gear ratio of a fit: rad of the motor per m or rad of the joint."""
    return f"rad/{robot.legs[fit.legs[0] - 1].joint.unit}"


def at_motors(sizing: Sizing) -> list[Any]:
    """Return a table of torque and speed at the motors, or a line where their ratio is unknown."""
    if all(drive.ratio is None for drive in sizing.drives):
        if all(leg.joint.unit == "rad" for leg in sizing.robot.legs):
            return []  # the joint's are the motor's
        return [
            "Torque and speed of the motors are not known: the drives have no ratio, which is "
            "2 pi / lead of a ball screw, rad/m (key drive)"
        ]
    to_rpm = 30.0 / math.pi
    names = ("leg", "peak torque", "RMS torque", "peak speed", "RMS speed")
    rms, peak = sizing.motor_torques
    mean, fastest = sizing.motor_speeds
    rows = []
    for i, drive in enumerate(sizing.drives):
        torques = (f"{significant(float(part[i]))} N m" for part in (peak, rms))
        speeds = (f"{significant(to_rpm * float(part[i]))} rpm" for part in (fastest, mean))
        is_known = drive.ratio is not None
        rows.append((str(i + 1), *((*torques, *speeds) if is_known else ("-",) * 4)))
    screws = [drive.screw.efficiency for drive in sizing.drives if drive.screw]
    losses = f", screws with an efficiency of {min(screws):g}" if screws else ""
    return [table(*names, rows=rows, numbers=names, caption=f"At the motors{losses}.")]


def motor_rows(sizing: Sizing) -> list[dict[str, float | None]]:
    """Return torque (N m) and speed (rad/s) of each motor whose ratio is known, as JSON data."""
    rms, peak = sizing.motor_torques
    mean, fastest = sizing.motor_speeds
    return [
        {
            "leg": i + 1,
            "peak_torque": float(peak[i]),
            "rms_torque": float(rms[i]),
            "speed": float(fastest[i]),
            "rms_speed": float(mean[i]),
            "rated_torque": drive.rated_torque,
        }
        for i, drive in enumerate(sizing.drives)
        if drive.ratio is not None
    ]
