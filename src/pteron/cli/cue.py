"""`pteron cue`: the motion of a simulator's platform that shows a vehicle's motion (cueing)."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import TYPE_CHECKING

from pteron.cli.arguments import MachineArgument
from pteron.cli.motion_table import motion_frame, peaks_table
from pteron.cli.progress import spinner
from pteron.cli.result import CommandResult
from pteron.cli.terminal import note, percent, plain, significant
from pteron.errors import DataError

if TYPE_CHECKING:
    from pteron.manipulator import Manipulator
    from pteron.motion import Cue


_REDUCED = 1e-3
"""Share of reduced amplitudes from which it is stated."""


def cue(
    motion: str,
    *,
    machine: MachineArgument,
    out: str | None = None,
    page: str | None = None,
    type_ii: float = 0.0,
    scale: float | None = None,
    translation: float | None = None,
    return_speed: float | None = None,
    tilting: float | None = None,
    tilt_rate: float | None = None,
    rotation: float | None = None,
    smoothing: float | None = None,
) -> CommandResult:
    """Show a vehicle's accelerations and turns with a simulator's platform: a classical washout.

    The file holds t (s), accelerations ax ay az without gravity (m/s^2) and angular rates wx wy wz
    (rad/s) in the vehicle's axes: x ahead, y to the left, z up. Quick accelerations are shown by
    translation, lasting ones by tilt, and the platform returns to the middle. It never leaves a box
    of poses that is proved to lie in the workspace: amplitudes too large for it are reduced.

    Arguments
    ---------
    MOTION: The vehicle's motion, a .csv or .parquet file: t ax ay az wx wy wz.

    Options
    -------
    --robot FILE: A machine whose platform moves and turns freely.
    --out FILE: Write poses and joints to a .csv or .parquet file.
    --page FILE: Write a page that shows the motion, a .html file.
    --type-ii: Least type-II measure of the poses used: 0 where the drives cannot hold the platform.

    Filters
    -------
    --scale NUMBER: Factor on accelerations and rates. [default: 0.5]
    --translation NUMBER: Corner frequency of the high-pass filter on translation, rad/s. [default:
        2.5]
    --return-speed NUMBER: Corner frequency of the return to the middle, rad/s. [default: 0.25]
    --tilting NUMBER: Corner frequency of the low-pass filter on tilt, rad/s. [default: 2]
    --tilt-rate NUMBER: Largest rate of that tilt, rad/s. [default: 0.05]
    --rotation NUMBER: Corner frequency of the high-pass filter on rotation, rad/s. [default: 0.7]
    --smoothing NUMBER: Corner frequency of the low-pass filter on the input, rad/s. [default: 30]

    Examples
    --------
    pteron cue drive.csv --robot simulator.toml --out cue.csv
    pteron cue flight.csv --robot simulator.toml --scale 0.3 --page cue.html
    """
    import numpy as np

    from pteron.motion import Washout, cue as shown, limits_of, peaks
    from pteron.tables import check_output

    if out is None and page is None:
        raise DataError("nothing to write; give --out FILE.csv, --page FILE.html or both")
    if out is not None:
        check_output(out)
    if page is not None:
        from pteron.report.write import checked_page

        checked_page(page)
    options = scale, translation, return_speed, tilting, tilt_rate, rotation, smoothing
    named = zip((field.name for field in fields(Washout)), options, strict=True)
    washout = Washout(**{name: setting for name, setting in named if setting is not None})
    with spinner(f"Showing {motion} with {machine.name}"):
        cued = shown(machine, motion, washout=washout, type_ii=type_ii)
        largest = peaks(machine, cued.pose, cued.velocity, cued.acceleration, limits_of(machine))
        files = _write(machine, cued, out, page)
    for peak in largest:
        if peak.share > 1.0:
            note(f"Note: {peak.phrase()}; a smaller --scale asks less")
    low, high = cued.region.box
    box = np.stack([low, high], axis=-1).tolist()
    record = {
        "robot": machine.name,
        "duration": cued.duration,
        "samples": len(cued.time),
        "box": dict(zip(machine.coordinates, box, strict=True)),
        "proved": bool(cued.proof.holds),
        "pressed": cued.pressed,
        "files": files,
    }
    lines = [
        f"[bold]{plain(machine.name)}[/bold], motion of {plain(motion)}: {cued.duration:.4g} s "
        f"({len(cued.time)} samples), in a box of poses proved to be in reach and within limits: "
        f"{_box_text(machine, cued)}.",
        f"Amplitudes are reduced by at most {percent(cued.pressed)} to stay in the box."
        if cued.pressed >= _REDUCED
        else "Amplitudes are not reduced: the motion fits into the box.",
        peaks_table(largest),
    ]
    return CommandResult(record, lines, files)


def _write(machine: Manipulator, cued: Cue, out: str | None, page: str | None) -> list[str]:
    """Write the motion's table and page if requested; return their names."""
    files = []
    if out is not None:
        from pteron.tables import write_table

        write_table(motion_frame(machine, cued), out)
        files.append(out)
    if page is not None:
        from pteron.report.write import write_motion_page

        files.append(str(write_motion_page(machine, cued, page)))
    return files


def _box_text(machine: Manipulator, cued: Cue) -> str:
    """Return the box that the motion stays in, mm and degrees."""
    low, high = cued.region.box
    return ", ".join(
        f"{name} {significant(1e3 * a)} to {significant(1e3 * b)} mm"
        if unit == "m"
        else f"{name} {math.degrees(a):.3g} to {math.degrees(b):.3g} deg"
        for name, unit, a, b in zip(
            machine.coordinates, machine.platform.units, low, high, strict=True
        )
    )
