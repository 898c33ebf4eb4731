"""`pteron report`: everything about a machine, on one page."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

from pteron.cli.arguments import MachineArgument
from pteron.cli.motion_argument import Carried, read_playback
from pteron.cli.progress import spinner
from pteron.cli.result import CommandResult
from pteron.cli.terminal import plain, table, warn

if TYPE_CHECKING:
    from rich.table import Table

_SERIES = ("time", "pose", "velocity", "acceleration", "forces")
"""Keys of report.json with a value for each sample of the motion: they are not printed."""


def report(
    machine: MachineArgument, *, out: str, motion: str | None = None, carried: Carried
) -> CommandResult:
    """Write a report on a machine: one page with pictures, and its numbers.

    The page is report.html, the numbers are in report.json beside it. Forces are computed for the
    machine with its payload; if the motion's file has forces too, the page says where they differ.

    Options
    -------
    --out DIR: The folder to write it to.
    --motion FILE: Show this motion in place of the standard cycle: a table of it, or a log.

    Examples
    --------
    pteron report quadrupteron --out report
    pteron report quadrupteron --motion motion.csv --payload 0.5 --out report
    """
    # The name is the page's heading: it says which payload the forces are computed with.
    machine = replace(carried.load_machine(machine), name=f"{machine.name}{carried}")
    with spinner(f"Writing the report on {machine.name}"):
        from pteron.report import write_report

        shown = None if motion is None else read_playback(machine, motion)
        page = write_report(machine, out, motion=shown)
    contents = json.loads((page.parent / "report.json").read_text(encoding="utf-8"))
    warn([*contents["doubts"], *contents["cycle"]["overloads"]])
    cycle = {key: series for key, series in contents["cycle"].items() if key not in _SERIES}
    tables = _machine(contents), _legs(contents["cycle"], contents["joints"])
    lines = [*tables, f"Written to {plain(str(page))}"]
    return CommandResult({"page": str(page), **contents, **asdict(carried), "cycle": cycle}, lines)


vars(report)["warns"] = True


def _machine(contents: dict[str, Any]) -> Table:
    """Return a table of a machine's figures: home, margin, reach, tilt, cycle, base parameters."""
    from pteron.platforms.coordinates import coordinate

    home, reach, base = contents["home"], contents["reach"], contents["base_parameters"]
    singular = ", ".join(f"{math.degrees(a):.4g}" for a in contents["singular_orientations"] or ())
    angles = [name for name in contents["coordinates"] if coordinate(name).unit == "rad"]
    cells = {
        "home pose": " ".join(f"{component:.4g}" for component in home["pose"]),
        "margin there": f"{home['reserve']:.3f} of 1",
        "condition number there": f"{home['condition_number']:.4g}",
    }
    if len(angles) == 1:
        cells[f"singular {angles[0]} there"] = f"{singular} deg" if singular else "none"
    if reach is not None:
        factor, unit = (1e3, "litres") if reach["unit"] == "m^3" else (1e2, "dm^2")
        cells["reach"] = f"{factor * reach['volume']:.4g} {unit}"
    if contents["largest_tilt"] is not None:
        cells["leans to every side by"] = f"{math.degrees(contents['largest_tilt']):.1f} deg"
    cells |= {
        "cycle"
        if contents["cycle"]["standard"]
        else "motion": f"{contents['cycle']['duration']:.3g} s",
        "base parameters": f"{base['rank']} of {base['of']}",
    }
    return table(plain(contents["robot"]), "", rows=cells.items())


def _legs(cycle: dict[str, Any], joints: list[dict[str, str]]) -> Table:
    """Return a table of each leg's peak and RMS force and peak speed over the cycle."""
    force = " or ".join(sorted({joint["force"] for joint in joints}))
    headings = ("leg", f"peak {force}", f"RMS {force}", "peak speed")
    of = "Of the drives, with friction." if cycle["with_drives"] else "Of the bodies, no friction."
    rows = []
    columns = (cycle[key] for key in ("peak_forces", "rms_forces", "peak_speeds"))
    for i, (peak, rms, speed) in enumerate(zip(*columns, strict=True), start=1):
        unit, rate = joints[i - 1]["force_unit"], f"{joints[i - 1]['unit']}/s"
        rows.append((str(i), f"{peak:.3f} {unit}", f"{rms:.3f} {unit}", f"{speed:.3f} {rate}"))
    return table(*headings, rows=rows, numbers=headings, caption=of)
