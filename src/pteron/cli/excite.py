"""`pteron excite`: an exciting trajectory, from which inertial parameters can be identified."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from pteron.cli.arguments import MachineArgument
from pteron.cli.progress import progress_bar
from pteron.cli.result import CommandResult
from pteron.cli.terminal import note, significant, table
from pteron.errors import ModelError

if TYPE_CHECKING:
    from pathlib import Path

    from rich.table import Table

    from pteron.identification.excitation import (
        Excitation,
        Limits,
        Margins,
        MotionLayout,
        RepeatedCycle,
    )
    from pteron.manipulator import Manipulator

_CLEARANCE = "joint_clearance"
"""The limit of the joints' distance from their limits."""

_MEASURES = {
    "type_i": "stretched or folded leg (type-I measure)",
    "type_ii": "platform not held (type-II measure)",
    "joint_clearance": "joint limits",
    "passive_clearance": "passive joint limits (over half the range)",
}
"""Names of limits in the output, where they are not those of the code."""


@dataclass(frozen=True)
class _SeriesOptions:
    """The Fourier series and its repetition."""

    space: Literal["platform", "joints"] = "platform"
    harmonics: int = 5
    period: float = 5.0
    periods: int = 3
    stribeck: bool = False


@dataclass(frozen=True)
class _LimitOptions:
    """The limits that the motion keeps."""

    speed: float | None = None
    acceleration: float = 10.0
    force: float | None = None
    type_i: float = 0.25
    type_ii: float = 0.3
    clearance: float = 0.005
    keep_off: float = 0.02
    passive_clearance: float = 0.02

    def limits(self, machine: Manipulator) -> Limits:
        """Return the limits of a machine; those of its drives where no option states them."""
        from pteron.identification.excitation import Limits

        return Limits.of(
            machine,
            speed=self.speed,
            acceleration=self.acceleration,
            force=self.force,
            type_i=self.type_i,
            type_ii=self.type_ii,
            joint_clearance=self.clearance,
            joint_share=self.keep_off,
            passive_clearance=self.passive_clearance,
        )


@dataclass(frozen=True)
class _FileOptions:
    """The columns, units and form of the table."""

    rate: float = 1000.0
    contents: Literal["all", "joints", "poses"] = "all"
    columns: str | None = None
    length_unit: Literal["m", "mm", "um"] = "m"
    angle_unit: Literal["rad", "deg"] = "rad"
    time_unit: Literal["s", "ms", "us"] = "s"
    separator: Literal[",", ";", "tab", "|"] | None = None
    decimal: Literal[".", ","] = "."

    @property
    def layout(self) -> MotionLayout:
        """The layout of the table."""
        from pteron.identification.excitation import MotionLayout

        names = None if self.columns is None else tuple(n.strip() for n in self.columns.split(","))
        separator = "\t" if self.separator == "tab" else self.separator
        units = self.length_unit, self.angle_unit, self.time_unit
        return MotionLayout(self.contents, names, *units, separator, self.decimal)


@dataclass(frozen=True)
class _SearchOptions:
    """The search for the best motion."""

    criterion: Literal["condition", "logdet"] = "condition"
    starts: int = 12
    draws: int = 100
    seconds: float = 60.0
    seed: int = 0
    workers: int | None = None


def excite(
    machine: MachineArgument,
    *,
    out: str | None = None,
    series: _SeriesOptions,
    limited: _LimitOptions,
    file: _FileOptions,
    search: _SearchOptions,
    json: bool = False,
) -> CommandResult:
    """Find a motion for identification: periodic, its forces determine the base parameters best.

    The motion leads in from rest, repeats the trajectory, and leads out to rest in the pose where
    it began, all on the same path: move the machine to the first row, and play the file. All limits
    are kept, also between the samples. Beside motion.csv, motion-held-out.csv has pick-and-place
    cycles within the same limits, to validate the identified model; with --stribeck,
    motion-slow.csv has the same path slowly from rest to rest, which shows how friction falls with
    speed: record all of them, then pteron identify log.csv slow.csv --stribeck auto.

    The columns are t rho1 ... x y z phi and their rates (d..., dd..., per s), and force1 ... by the
    machine's nominal inertia and its drives' friction; theta1 ... and torque1 ... of cranks. The
    TOML file beside each motion has units, columns, period and assembly mode. Copy it beside the
    log, log.toml beside log.csv, and pteron identify reads a log in the same layout.

    The search takes about a minute (--seconds). Ctrl-C ends it and keeps the best motion so far.

    Options
    -------
    --out FILE: Write the motion to a .csv or .parquet file, with the others beside it.

    Motion
    ------
    --space: Coordinates that are Fourier series of time: the platform's or the joints'.
    --harmonics: Number of harmonics.
    --period: Period, s.
    --periods: Number of periods between lead-in and lead-out.
    --stribeck: Add slow passages, for friction that falls with speed.

    Limits
    ------
    --speed: Joint speed, m/s or rad/s. [default: max_speed of the drives, else 1]
    --acceleration: Joint acceleration, m/s^2 or rad/s^2.
    --force: Drive force, N or N m. [default: max_force of the drives, else none]
    --type-i: Least type-I measure of every leg: 0 stretched or folded, 1 at best.
    --type-ii: Least type-II measure: 0 where the drives cannot hold the platform.
    --clearance: Least distance of the joints from their limits, m or rad.
    --keep-off: The same as a share of each joint's range; the larger of the two applies.
    --passive-clearance: Least distance of passive joints and platform angles from their limits, as
        a share of half their range.

    File
    ----
    --rate: Samples per second.
    --contents: Write all columns, or t with the joints or the poses only.
    --columns NAMES: Names of the joints' columns, such as A1,A2.
    --length-unit: Unit of sliders and positions.
    --angle-unit: Unit of cranks and the pose's angles.
    --time-unit: Unit of t.
    --separator: Separator of the cells. [default: , or ; with a decimal comma]
    --decimal: Decimal sign.

    Search
    ------
    --criterion: Quantity to minimise: the condition number, or minus the log determinant.
    --starts: Number of random motions that are optimised.
    --draws: Number of random motions that are drawn.
    --seconds: Time of the search, s; three times as long if the motion does not identify all yet.
    --seed: Seed of the random motions.
    --workers: Number of processes. [default: one per core, up to 4]

    Examples
    --------
    pteron excite quadrupteron --out exciting.csv
    pteron excite my-robot.toml --out exciting.csv --period 5 --speed 0.5 --force 60
    pteron excite delta --out exciting.csv --angle-unit deg --time-unit ms --decimal ,
    """
    from pteron.identification.excitation import check_sampling, motion_paths, optimal_excitation

    check_sampling(series.period, file.rate, series.periods)
    file.layout.description(machine)
    if out is not None:
        motion_paths(out, file.layout)
    limits = limited.limits(machine)
    if out is None and not json:
        note("Note: no file will be written; --out FILE.csv saves the motion")
    with progress_bar(f"Searching a motion of {machine.name}") as progress:
        excitation = optimal_excitation(
            machine,
            space=series.space,
            harmonics=series.harmonics,
            period=series.period,
            limits=limits,
            progress=progress,
            **vars(search),
        )
    if excitation.interrupted:
        note("Note: interrupted; this is the best motion found until then")
    return _result(machine, excitation, limits, series, file, out)


def _result(
    machine: Manipulator,
    excitation: Excitation,
    limits: Limits,
    series: _SeriesOptions,
    file: _FileOptions,
    out: str | None,
) -> CommandResult:
    """Check the motions between samples, write them, and return the command's result."""
    import numpy as np

    from pteron.motion.overloads import overloads_of

    rate = file.rate
    led, cycles = excitation.with_leads(series.periods), _held_out_cycles(excitation, rate)
    slow = excitation.slow() if series.stribeck else None
    motions = {"motion": led, "held out": cycles, "slow": slow}
    margins = {name: m.margins(limits, rate) for name, m in motions.items() if m is not None}
    for name, of_motion in margins.items():
        if not of_motion.kept:
            raise ModelError(
                f"{name}: the limits are not kept between samples; choose another --seed"
            )
    time = np.linspace(0.0, led.duration, int(led.duration * rate) + 1)
    for text in overloads_of(machine, led.at(time)):
        note(f"Note: {text}")
    files: list[Path] = []
    if out is not None:
        files = excitation.write(out, rate, series.periods, file.layout, cycles, slow)
    record = {
        **excitation.as_dict(),
        "start": led.start,
        "end": led.end,
        "duration": led.duration,
        "held_out": cycles and cycles.as_dict(),
        "slow": slow and slow.duration,
        "files": [str(path) for path in files],
    }
    lines: list[str | Table] = [
        *(excitation.progress_text, _quality(excitation), _margins(margins)),
        *_clearance_sentence(machine, limits, margins),
        f"Motion: from rest to rest in {led.duration:g} s: lead-in to {led.start:g} s, periodic to "
        f"{led.end:g} s, lead-out.",
    ]
    if cycles is not None:
        lines.append(
            f"Held-out motion, to validate the model: {cycles.count} pick-and-place cycles of "
            f"{cycles.length:.3g} s, {100.0 * cycles.cycle.scale:.0f} % of the standard size."
        )
    if slow is not None:
        lines.append(
            f"Slow motion: the same path in {slow.duration:g} s, for friction that falls with "
            "speed."
        )
    if files:
        lines.append("Next: record these motions, then pteron identify LOG --robot ROBOT --out DIR")
    return CommandResult(record, lines, files)


def _held_out_cycles(excitation: Excitation, rate: float) -> RepeatedCycle | None:
    """Return the motion for validation; None, with a note, where there is none."""
    try:
        return excitation.held_out(rate)
    except ModelError as error:
        note(f"Note: no motion to hold out: {error}")
        return None


def _quality(excitation: Excitation) -> Table:
    """Return a table of condition numbers: optimised motion, best random motion, ratio."""
    headings = ("this motion", f"best of {excitation.draws} random", "improvement")
    best, random = excitation.conditioning, excitation.random
    caption = None
    if not math.isfinite(best.nominal):
        caption = "-: undefined, because a base parameter's nominal value is 0"
    numbers = (
        ("scaled to length 1", best.scaled, random.scaled),
        ("times nominal values", best.nominal, random.nominal),
        ("unscaled, in SI units", best.unscaled, random.unscaled),
    )
    rows = ((n, _number(a, 3), _number(b, 3), _number(b / a, 3)) for n, a, b in numbers)
    title = "condition number, regressor columns"
    return table(title, *headings, rows=rows, numbers=headings, caption=caption)


def _number(number: float, digits: int) -> str:
    """Return a number with significant digits, or `-` where it is not finite."""
    return significant(number, digits) if math.isfinite(number) else "-"


def _clearance_sentence(
    machine: Manipulator, limits: Limits, margins_by_motion: dict[str, Margins]
) -> list[str]:
    """Return a sentence on the joints' least distance from their limits; none without limits.

    A least margin is what is left beyond what was asked for, which is not what a person looks for.
    """
    from pteron.identification.excitation.limits import joint_clearances

    tightest = [
        margin
        for margins in margins_by_motion.values()
        for margin in margins
        if margin.limit == _CLEARANCE
    ]
    if not tightest:
        return []
    least = min(tightest, key=lambda margin: margin.least)
    clearance = float(joint_clearances(limits, machine)[(least.leg or 1) - 1])
    return [
        f"Smallest distance to a joint limit: {clearance + least.least:.3g} {least.unit} (leg "
        f"{least.leg}); at least {clearance:.3g} required (--keep-off, --clearance)."
    ]


def _margins(margins_by_motion: dict[str, Margins]) -> Table:
    """Return a table of each limit's least margin, its leg and time, and those of other motions."""
    headings = ("margin to it", "leg", "at (s)")
    others = list(margins_by_motion)[1:]
    names = [f"margin, {other.replace(' ', '-')} motion" for other in others]
    margin_table = table("limit", *headings, *names, numbers=(*headings, *names))
    for margin in margins_by_motion["motion"]:
        name = _MEASURES.get(margin.limit, margin.limit.replace("_", " "))
        margin_table.add_row(
            f"{name} ({margin.unit})" if margin.unit else name,
            significant(margin.least),
            "-" if margin.leg is None else str(margin.leg),
            f"{margin.time:.2f}",
            *(significant(margins_by_motion[other][margin.limit].least) for other in others),
        )
    return margin_table
