"""`pteron excite`: a trajectory from which the inertial parameters can be identified."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from rich.markup import escape
from rich.table import Table
from typer import Option

from pteron.cli.arguments import Elbows, Json, Robot
from pteron.cli.progress import progress_bar
from pteron.cli.robots import load_robot
from pteron.cli.screen import note, show, show_json, table
from pteron.errors import OutputError

if TYPE_CHECKING:
    from pteron.identification.excitation import Excitation

__all__ = ["excite"]

_STEPS = 1000
"""Of the progress bar."""


class _Space(StrEnum):
    PLATFORM = "platform"
    SLIDERS = "sliders"


class _Criterion(StrEnum):
    CONDITION = "condition"
    LOGDET = "logdet"


def excite(
    robot: Robot,
    out: Annotated[
        str | None,
        Option("--out", metavar="FILE", help="Write it to FILE.csv, and FILE.toml beside it."),
    ] = None,
    space: Annotated[
        _Space, Option("--space", help="Whose coordinates the Fourier series are of.")
    ] = _Space.PLATFORM,
    harmonics: Annotated[int, Option("--harmonics", help="How many.")] = 5,
    period: Annotated[float, Option("--period", help="In s.")] = 5.0,
    speed: Annotated[float, Option("--speed", help="The sliders' limit, m/s.")] = 1.0,
    acceleration: Annotated[
        float, Option("--acceleration", help="The sliders' limit, m/s^2.")
    ] = 10.0,
    force: Annotated[
        float | None,
        Option("--force", help="The actuators' limit, N; none if left out.", show_default=False),
    ] = None,
    elbow_sine: Annotated[
        float, Option("--elbow-sine", help="Least sine of every elbow's angle.")
    ] = 0.25,
    regularity: Annotated[
        float, Option("--regularity", help="Least abs(det J), of its largest value.")
    ] = 0.3,
    clearance: Annotated[
        float, Option("--clearance", help="Of the sliders from their ends, m.")
    ] = 0.005,
    criterion: Annotated[
        _Criterion, Option("--criterion", help="What is made small.")
    ] = _Criterion.CONDITION,
    rate: Annotated[float, Option("--rate", help="Samples a second in the file.")] = 1000.0,
    periods: Annotated[int, Option("--periods", help="Periods in the file.")] = 1,
    starts: Annotated[int, Option("--starts", help="Random motions improved.")] = 12,
    draws: Annotated[int, Option("--draws", help="Random motions drawn.")] = 100,
    seconds: Annotated[float, Option("--seconds", help="Time for the search.")] = 60.0,
    seed: Annotated[int, Option("--seed", help="Of the random motions.")] = 0,
    workers: Annotated[
        int | None,
        Option("--workers", help="Processes at a time.", show_default="one a core, up to 4"),
    ] = None,
    elbows: Elbows = None,
    json: Json = False,
) -> None:
    """Find a periodic trajectory from whose forces the base parameters are seen best.

    It keeps every limit throughout the period, and does not begin at rest. The file has the columns
    t rho1 ... x y z phi and their rates (d..., dd...), and force1 ... by the machine's nominal
    inertia. The period and the assembly mode go to a TOML file beside it, for the evaluation of the
    log.

    Ctrl-C ends the search and keeps the best until then.
    """
    machine = load_robot(robot, elbows)
    if out is not None:
        from pteron.tables import check_output

        if check_output(out).with_suffix(".toml").is_dir():
            raise OutputError(f"{Path(out).with_suffix('.toml')}: is a folder; name another file")
    from pteron.identification.excitation import Limits, check_sampling, optimal_excitation

    check_sampling(period, rate, periods)
    with progress_bar(f"Exciting {machine.name}", _STEPS) as advance:
        done = 0

        def progress(share: float) -> None:
            nonlocal done
            advance(round(_STEPS * share) - done)
            done = round(_STEPS * share)

        found = optimal_excitation(
            machine,
            space=space.value,
            harmonics=harmonics,
            period=period,
            limits=Limits(speed, acceleration, force, elbow_sine, regularity, clearance),
            criterion=criterion.value,
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
        files = [
            found.write_csv(out, rate, periods),
            found.write_toml(Path(out).with_suffix(".toml")),
        ]
    if json:
        show_json({**found.as_dict(), "files": [str(path) for path in files]})
        return
    show(_quality(found), _margins(found))
    show(*(f"Written: {escape(str(path))}" for path in files))


def _quality(found: Excitation) -> Table:
    headings = ("optimised", f"best of {found.draws} random", "ratio")
    made = table("condition number, columns", *headings, numbers=headings)
    best, random = found.conditioning, found.random
    for name, one, other in (
        ("of length 1", best.scaled, random.scaled),
        ("times nominal values", best.nominal, random.nominal),
        ("in SI units", best.unscaled, random.unscaled),
    ):
        made.add_row(name, f"{one:.4g}", f"{other:.4g}", f"{other / one:.3g}")
    return made


def _margins(found: Excitation) -> Table:
    headings = ("least margin", "leg", "at (s)")
    made = table("limit", *headings, numbers=headings)
    for margin in found.margins:
        name = margin.limit.replace("_", " ")
        made.add_row(
            f"{name} ({margin.unit})" if margin.unit else name,
            f"{margin.least:.4g}",
            "-" if margin.leg is None else str(margin.leg),
            f"{margin.time:.3f}",
        )
    return made
