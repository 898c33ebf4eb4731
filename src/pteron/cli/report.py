"""`pteron report`: everything about a machine, on one page."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

from pteron.cli.arguments import MachineArgument, about_pivot
from pteron.cli.motion_argument import Carried, read_playback
from pteron.cli.progress import spinner
from pteron.cli.result import CommandResult
from pteron.cli.terminal import plain, significant, table, warn

if TYPE_CHECKING:
    from rich.table import Table

_SERIES = ("time", "pose", "velocity", "acceleration", "forces")
"""Keys of report.json with a value for each sample of the motion: they are not printed."""


def report(
    machine: MachineArgument,
    *,
    out: str,
    motion: str | None = None,
    carried: Carried,
    pivot: str | None = None,
) -> CommandResult:
    """Write a report on a machine: one HTML page with figures, and its numbers.

    The page is report.html, the numbers are in report.json beside it. Forces are computed for the
    machine with its payload; if the motion's file has forces too, the page shows where they differ.

    Options
    -------
    --out DIR: Folder for report.html and report.json.
    --motion FILE: Show this motion in place of the standard cycle: a table of a motion, or a log.

    Examples
    --------
    pteron report quadrupteron --out report
    pteron report quadrupteron --motion motion.csv --payload 0.5 --out report
    """
    # The name is the page's heading: it says which payload the forces are computed with.
    machine = about_pivot(carried.load_machine(machine), pivot)
    machine = replace(machine, name=f"{machine.name}{carried}")
    with spinner(f"Writing the report on {machine.name}"):
        from pteron.report import write_report

        shown = None if motion is None else read_playback(machine, motion)
        page = write_report(machine, out, motion=shown)
    contents = json.loads((page.parent / "report.json").read_text(encoding="utf-8"))
    warn([*contents["doubts"], *contents["cycle"]["overloads"]])
    cycle = {key: series for key, series in contents["cycle"].items() if key not in _SERIES}
    tables = _machine(contents), _legs(contents["cycle"], contents["joints"])
    lines = [*tables, f"Written: {plain(str(page))} (open it in a browser)"]
    return CommandResult({"page": str(page), **contents, **asdict(carried), "cycle": cycle}, lines)


vars(report)["warns"] = True


def _machine(contents: dict[str, Any]) -> Table:
    """Return a table of a machine's figures: home, margin, reach, tilt, cycle, base parameters."""
    from pteron.platforms.coordinates import coordinate

    home, reach, base = contents["home"], contents["reach"], contents["base_parameters"]
    singular = ", ".join(f"{math.degrees(a):.4g}" for a in contents["singular_orientations"] or ())
    angles = [name for name in contents["coordinates"] if coordinate(name).unit == "rad"]
    cells = {
        "home pose": f"{' '.join(contents['coordinates'])} = "
        + " ".join(f"{round(q, 6) + 0.0:.4g}" for q in home["pose"]),
        "margin there to limits and singularities": f"{100.0 * home['reserve']:.0f} %",
        "condition number there (1 is best)": significant(home["condition_number"]),
    }
    if len(angles) == 1:
        cells[f"singular {angles[0]} there"] = f"{singular} deg" if singular else "none"
    if reach is not None:
        noun = "volume" if reach["unit"] == "m^3" else "area"
        cells[f"workspace {noun}"] = f"{reach['volume']:.3g} {reach['unit']}"
    if contents["largest_tilt"] is not None:
        tilt = f"{math.degrees(contents['largest_tilt']):.1f} deg"
        cells["largest tilt in all directions"] = tilt
    noun = "standard pick-and-place cycle" if contents["cycle"]["standard"] else "motion"
    cells |= {
        noun: f"{contents['cycle']['duration']:.3g} s",
        "base parameters": f"{base['rank']} (of {base['of']} inertial parameters)",
    }
    return table(plain(contents["robot"]), "", rows=cells.items())


def _legs(cycle: dict[str, Any], joints: list[dict[str, str]]) -> Table:
    """Return a table of each leg's peak and RMS force and peak speed over the cycle."""
    force = " or ".join(sorted({joint["force"] for joint in joints}))
    headings = ("leg", f"peak {force}", f"RMS {force}", "peak speed")
    noun = "the cycle" if cycle["standard"] else "the motion"
    drives = "with friction and rotors" if cycle["with_drives"] else "without friction and rotors"
    caption = f"Over {noun}, {drives}."
    rows = []
    columns = (cycle[key] for key in ("peak_forces", "rms_forces", "peak_speeds"))
    for i, (peak, rms, speed) in enumerate(zip(*columns, strict=True), start=1):
        unit, rate = joints[i - 1]["force_unit"], f"{joints[i - 1]['unit']}/s"
        units = zip((peak, rms, speed), (unit, unit, rate), strict=True)
        rows.append((str(i), *(f"{significant(size)} {of}" for size, of in units)))
    return table(*headings, rows=rows, numbers=headings, caption=caption)
