"""`pteron play`: an HTML page that shows a motion of the machine in 3-D."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pteron.cli.arguments import STANDARD, MachineArgument, about_pivot
from pteron.cli.motion_argument import Carried, cycle_text, read_playback
from pteron.cli.progress import spinner
from pteron.cli.result import CommandResult
from pteron.cli.terminal import plain
from pteron.errors import DataError

if TYPE_CHECKING:
    from pteron.manipulator import Manipulator
    from pteron.playback import Playback


def play(
    machine: MachineArgument,
    motion: str | None = None,
    *,
    out: str = "motion.html",
    cycle: str | None = None,
    carried: Carried,
    pivot: str | None = None,
) -> CommandResult:
    """Show a motion in 3-D: one HTML page that needs no other file or network.

    The page shows the moving machine, in real time or slower, with its forces, joints and pose at
    each moment, and joints and drives over time. The motion is a file of pteron cycle, simulate or
    excite, a table of your own (t and x y z phi, or t and rho1 theta2 ...), or a log with the TOML
    file that describes it. Forces are those of the file if it has them; else those computed for the
    drives. Without a file the page shows the standard cycle.

    Arguments
    ---------
    MOTION: A table of a motion or of joints, or a log: a .csv or .parquet file.

    Options
    -------
    --out FILE: The page to write, a .html file.
    --cycle CYCLE: adept, the standard pick-and-place cycle, in place of a file.

    Examples
    --------
    pteron play quadrupteron
    pteron play quadrupteron motion.csv --out motion.html
    pteron play my-robot.toml log.parquet --out log.html
    """
    from pteron.report.write import checked_page, write_motion_page

    machine = about_pivot(carried.load_machine(machine), pivot)
    if motion is not None and cycle is not None:
        raise DataError("MOTION and --cycle given; give one of them")
    checked_page(out)
    with spinner(f"Drawing {machine.name}"):
        playback = _playback(machine, motion or cycle or STANDARD)
        page = write_motion_page(machine, playback, out)
    samples, size = len(playback.motion.time), page.stat().st_size
    record = {
        "robot": machine.name,
        "page": str(page),
        "bytes": size,
        "source": playback.source or STANDARD,
        "log": playback.log,
        "duration": playback.motion.duration,
        "samples": samples,
    }
    shown = plain(cycle_text(motion or cycle or STANDARD))
    duration = playback.motion.duration
    summary = f"{plain(machine.name)}, {shown}: {duration:.4g} s, {samples} samples"
    written = f"Written: {plain(str(page))}, {size / 1e6:.1f} MB (open it in a browser)"
    return CommandResult(record, [summary, written])


def _playback(machine: Manipulator, motion: str) -> Playback:
    """Return a table's motion as a playback, or the standard cycle if no file has its name."""
    from pteron.motion import pick_and_place
    from pteron.playback import Playback

    if motion == STANDARD and not Path(motion).exists():
        return Playback(pick_and_place(machine))
    return read_playback(machine, motion)
