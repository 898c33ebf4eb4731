"""`pteron excite`: a trajectory from which the inertial parameters can be identified."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from rich.table import Table

from pteron.cli.arguments import Elbows, Json, Robot, load_robot, option
from pteron.cli.screen import note, plain, progress_bar, show, show_json, table
from pteron.errors import OutputError

if TYPE_CHECKING:
    from pteron.identification.excitation import Excitation

_MEASURES = {
    "type_i": "type-I measure",
    "type_ii": "type-II measure",
    "passive_clearance": "passive clearance (of half the range)",
}

_STEPS = 1000
"""Steps of the progress bar."""


def excite(
    robot: Robot,
    out: Annotated[
        str | None,
        option("out", "Write it to a .csv or .parquet file, and a .toml file beside it.", "FILE"),
    ] = None,
    space: Annotated[
        Literal["platform", "joints"],
        option("space", "Whose coordinates the Fourier series are of."),
    ] = "platform",
    harmonics: Annotated[int, option("harmonics", "How many.")] = 5,
    period: Annotated[float, option("period", "In s.")] = 5.0,
    speed: Annotated[float, option("speed", "The joints' limit, m/s or rad/s.")] = 1.0,
    acceleration: Annotated[float, option("acceleration", "Their limit, the same per s.")] = 10.0,
    force: Annotated[
        float | None, option("force", "The actuators' limit, N or N m.", show_default=False)
    ] = None,
    type_i: Annotated[float, option("type-i", "Least type-I measure of every leg.")] = 0.25,
    type_ii: Annotated[float, option("type-ii", "Least type-II measure.")] = 0.3,
    clearance: Annotated[
        float, option("clearance", "Of the joints from their limits, m or rad.")
    ] = 0.005,
    passive_clearance: Annotated[
        float, option("passive-clearance", "Of passive joints and phi, share of half their range.")
    ] = 0.02,
    criterion: Annotated[
        Literal["condition", "logdet"], option("criterion", "What is made small.")
    ] = "condition",
    rate: Annotated[float, option("rate", "Samples a second in the file.")] = 1000.0,
    periods: Annotated[int, option("periods", "Periods in the file.")] = 1,
    starts: Annotated[int, option("starts", "Random motions improved.")] = 12,
    draws: Annotated[int, option("draws", "Random motions drawn.")] = 100,
    seconds: Annotated[float, option("seconds", "Time for the search.")] = 60.0,
    seed: Annotated[int, option("seed", "Of the random motions.")] = 0,
    workers: Annotated[
        int | None, option("workers", "Processes at a time.", show_default="one a core, up to 4")
    ] = None,
    elbows: Elbows = None,
    json: Json = False,
) -> None:
    """Find a periodic trajectory from whose forces the base parameters are seen best.

    It keeps every limit throughout the period, and does not begin at rest. The file has the columns
    t rho1 ... x y z phi and their rates (d..., dd...), and force1 ... by the machine's nominal
    inertia; theta1 ... and torque1 ... of cranks. The period and the assembly mode go to a TOML
    file beside it, for the evaluation of the log.

    Ctrl-C ends the search and keeps the best until then.
    """
    machine = load_robot(robot, elbows)
    if out is not None:
        from pteron.tables import check_output

        if check_output(out).with_suffix(".toml").is_dir():
            raise OutputError(f"{Path(out).with_suffix('.toml')}: is a folder; name another file")
    from pteron.identification.excitation import Limits, check_sampling, optimal_excitation

    check_sampling(period, rate, periods)
    limits = Limits(speed, acceleration, force, type_i, type_ii, clearance, passive_clearance)
    if out is None and not json:
        note("Note: no file will be written; to have the trajectory, add --out FILE.csv")
    with progress_bar(f"Exciting {machine.name}", _STEPS) as advance:
        done = 0

        def progress(share: float) -> None:
            nonlocal done
            advance(round(_STEPS * share) - done)
            done = round(_STEPS * share)

        found = optimal_excitation(
            machine,
            space=space,
            harmonics=harmonics,
            period=period,
            limits=limits,
            criterion=criterion,
            starts=starts,
            draws=draws,
            seed=seed,
            seconds=seconds,
            workers=workers,
            progress=progress,
        )
    if found.interrupted:
        note("Note: interrupted; this is the best until then")
    files = []
    if out is not None:
        description = Path(out).with_suffix(".toml")
        files = [found.write_csv(out, rate, periods), found.write_toml(description)]
    if json:
        show_json({**found.as_dict(), "files": [str(path) for path in files]})
        return
    show(_quality(found), _margins(found))
    show(*(f"Written: {plain(str(path))}" for path in files))


def _quality(found: Excitation) -> Table:
    headings = ("optimised", f"best of {found.draws} random", "ratio")
    best, random = found.conditioning, found.random
    caption = None
    if not math.isfinite(best.nominal):
        caption = "-: no number, as a base parameter's nominal value is 0"
    made = table("condition number, columns", *headings, numbers=headings, caption=caption)
    for name, one, other in (
        ("of length 1", best.scaled, random.scaled),
        ("times nominal values", best.nominal, random.nominal),
        ("in SI units", best.unscaled, random.unscaled),
    ):
        made.add_row(name, _number(one, 4), _number(other, 4), _number(other / one, 3))
    return made


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}g}" if math.isfinite(value) else "-"


def _margins(found: Excitation) -> Table:
    headings = ("least margin", "leg", "at (s)")
    made = table("limit", *headings, numbers=headings)
    for margin in found.margins:
        name = _MEASURES.get(margin.limit, margin.limit.replace("_", " "))
        made.add_row(
            f"{name} ({margin.unit})" if margin.unit else name,
            f"{margin.least:.4g}",
            "-" if margin.leg is None else str(margin.leg),
            f"{margin.time:.3f}",
        )
    return made
