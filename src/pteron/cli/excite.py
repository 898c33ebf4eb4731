"""`pteron excite`: an exciting trajectory, from which inertial parameters can be identified."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from pteron.cli.arguments import MachineArgument
from pteron.cli.progress import progress_bar
from pteron.cli.result import CommandResult
from pteron.cli.terminal import note, table
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
    "type_i": "type-I measure",
    "type_ii": "type-II measure",
    "passive_clearance": "passive clearance (of half the range)",
}
"""Names of limits in the output, where they are not those of the code."""


@dataclass(frozen=True)
class _SeriesOptions:
    """Of the Fourier series and its repetition."""

    space: Literal["platform", "joints"] = "platform"
    harmonics: int = 5
    period: float = 5.0
    periods: int = 3
    stribeck: bool = False


@dataclass(frozen=True)
class _LimitOptions:
    """Of the limits that the motion keeps."""

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
    """Of the table's columns and form."""

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
    """Of the search for the best motion."""

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
    """Find a periodic trajectory from whose forces the base parameters are seen best.

    The file leads in from rest, repeats the trajectory, and leads out to rest in the pose where it
    began, all on the trajectory's own way: take the machine to the first row, and play it. Every
    limit is kept, at ten times as many samples too. Beside motion.csv, motion-held-out.csv has
    pick-and-place cycles within the same limits, to judge the identified model by; and, with
    --stribeck, motion-slow.csv the same way slowly from rest to rest, which shows how friction
    falls with speed: record all, and pteron identify log.csv slow.csv --stribeck auto.

    The columns are t rho1 ... x y z phi and their rates (d..., dd..., per s), and force1 ... by the
    machine's nominal inertia and its drives' friction; theta1 ... and torque1 ... of cranks. The
    TOML file beside each motion tells units, columns, period and assembly mode. Copy it beside the
    log, log.toml beside log.csv, and pteron identify reads a log in the same layout.

    The search takes about a minute: --seconds. Ctrl-C ends it and keeps the best until then.

    Options
    -------
    --out FILE: Write it to a .csv or .parquet file, with others beside it.

    Motion
    ------
    --space: Whose coordinates the Fourier series are of.
    --harmonics: How many.
    --period: In s.
    --periods: Between lead-in and lead-out.
    --stribeck: Slow passages too, for friction that falls with speed.

    Limits
    ------
    --speed: Of the joints, m/s or rad/s. [default: the drives', else 1]
    --acceleration: The same per s.
    --force: Of the drives, N or N m. [default: the drives', else none]
    --type-i: Least type-I measure of every leg.
    --type-ii: Least type-II measure.
    --clearance: Of the joints from their limits, m or rad.
    --keep-off: The same, share of each joint's range; the larger of the two is kept.
    --passive-clearance: Of passive joints and the platform's angles, share of half their range.

    File
    ----
    --rate: Samples a second.
    --contents: All columns, or t with the joints or the poses only.
    --columns NAMES: Names of the joints' columns, such as A1,A2.
    --length-unit: Of sliders and poses.
    --angle-unit: Of cranks and the pose's angles.
    --time-unit: Of t.
    --separator: Of the cells. [default: , or ; with a decimal comma]
    --decimal: The decimal sign.

    Search
    ------
    --criterion: What is made small.
    --starts: Random motions improved.
    --draws: Random motions drawn.
    --seconds: Time for the search; three times as long where it would not identify the machine.
    --seed: Of the random motions.
    --workers: Processes at a time. [default: one a core, up to 4]

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
        note("Note: no file will be written; to have the trajectory, add --out FILE.csv")
    with progress_bar(f"Exciting {machine.name}") as progress:
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
        note("Note: interrupted; this is the best until then")
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
        *(_quality(excitation), excitation.progress_text, _margins(margins)),
        *_clearance_sentence(machine, limits, margins),
        f"From rest to rest in {led.duration:g} s: periodic from {led.start:g} to {led.end:g} s, "
        "lead-in before, lead-out behind.",
    ]
    if cycles is not None:
        lines.append(
            f"To hold out: {cycles.count} pick-and-place cycles of {cycles.length:.4g} s, "
            f"{cycles.cycle.scale:.0%} of the standard size."
        )
    if slow is not None:
        slowly = f"the same way in {slow.duration:g} s, for friction that falls with speed."
        lines.append(f"Slowly: {slowly}")
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
    headings = ("optimised", f"best of {excitation.draws} random", "ratio")
    best, random = excitation.conditioning, excitation.random
    caption = None
    if not math.isfinite(best.nominal):
        caption = "-: no number, as a base parameter's nominal value is 0"
    numbers = (
        ("of length 1", best.scaled, random.scaled),
        ("times nominal values", best.nominal, random.nominal),
        ("in SI units", best.unscaled, random.unscaled),
    )
    rows = ((n, _number(a, 4), _number(b, 4), _number(b / a, 3)) for n, a, b in numbers)
    title = "condition number, columns"
    return table(title, *headings, rows=rows, numbers=headings, caption=caption)


def _number(number: float, digits: int) -> str:
    """Return a number with significant digits, or `-` where it is not finite."""
    return f"{number:.{digits}g}" if math.isfinite(number) else "-"


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
        f"Leg {least.leg} comes nearest to its joint's limits: {clearance + least.least:.3g} "
        f"{least.unit}, where {clearance:.3g} was to be kept (--keep-off, --clearance)."
    ]


def _margins(margins_by_motion: dict[str, Margins]) -> Table:
    """Return a table of each limit's least margin, its leg and time, and those of other motions."""
    headings = ("least margin", "leg", "at (s)")
    others = list(margins_by_motion)[1:]
    margin_table = table("limit", *headings, *others, numbers=(*headings, *others))
    for margin in margins_by_motion["motion"]:
        name = _MEASURES.get(margin.limit, margin.limit.replace("_", " "))
        margin_table.add_row(
            f"{name} ({margin.unit})" if margin.unit else name,
            f"{margin.least:.4g}",
            "-" if margin.leg is None else str(margin.leg),
            f"{margin.time:.3f}",
            *(f"{margins_by_motion[other][margin.limit].least:.4g}" for other in others),
        )
    return margin_table
