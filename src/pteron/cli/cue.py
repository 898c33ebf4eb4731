"""`pteron cue`: the motion of a simulator's platform that shows a vehicle's motion (cueing)."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

from pteron.cli.arguments import MachineArgument, about_pivot
from pteron.cli.cue_options import FilterOptions, LiveOptions
from pteron.cli.motion_argument import Carried, given_pose
from pteron.cli.motion_table import box_lines, box_record, motion_frame, peaks_table
from pteron.cli.motor_tables import at_motors, motor_rows
from pteron.cli.progress import spinner
from pteron.cli.result import CommandResult
from pteron.cli.terminal import note, percent, plain
from pteron.errors import DataError
from pteron.json_values import json_fields
from pteron.tolerances import SAME

if TYPE_CHECKING:
    from pteron.manipulator import Manipulator
    from pteron.motion import Cue, Peak, Sizing

_REDUCED = 1e-3
"""Share of reduced amplitudes from which it is stated."""

_DENSE = 4
"""Moments per sample at which peaks are sought: samples are at most 0.01 s apart."""


def cue(
    motion: str | None = None,
    *,
    machine: MachineArgument,
    around: str | None = None,
    pivot: str | None = None,
    carried: Carried,
    out: str | None = None,
    page: str | None = None,
    type_ii: float = 0.0,
    live: LiveOptions,
    filters: FilterOptions,
) -> CommandResult:
    """Show a vehicle's accelerations and turns with a simulator's platform: a classical washout.

    The file holds t (s), accelerations ax ay az without gravity (m/s^2) and angular rates wx wy wz
    (rad/s) in the vehicle's axes: x ahead, y to the left, z up. Quick accelerations are shown by
    translation, lasting ones by tilt, and the platform returns to the middle. It never leaves a box
    of poses that is proved to lie in the workspace: amplitudes too large for it are reduced.

    With --listen the motion comes from a running simulator, as datagrams, and set points of the
    drives go out 250 times a second. The platform starts from home when datagrams come, returns
    when they stop, and rests there after Ctrl-C. A recorded MOTION gives the box its proportions.

    Arguments
    ---------
    MOTION: The vehicle's motion, a .csv or .parquet file: t ax ay az wx wy wz.

    Options
    -------
    --robot FILE: A machine whose platform moves and turns freely.
    --around POSE: Middle of the box, or home. [default: where the largest box of the motion's
        proportions fits]
    --out FILE: Write poses and joints to a .csv or .parquet file.
    --page FILE: Write a page that shows the motion, a .html file.
    --type-ii: Least type-II measure of the poses used: 0 where the drives cannot hold the platform.

    Live
    ----
    --listen PORT: Receive the vehicle's motion as UDP datagrams at this port.
    --send HOST:PORT: Send set points there, as UDP datagrams. [default: none are sent]
    --layout NAME: Layout of the datagrams: json, csv (FlightGear), forza, outsim (Live for Speed).
    --flip NAMES: Columns whose sign is changed, such as ay,wz. [default: none]
    --set-points NAME: Format of set points: csv (number, s, joints) or json.
    --timeout: Time without datagrams after which the platform returns home, s.
    --duration: Time after which the live cue ends, s. [default: until Ctrl-C]
    --host: Address at which datagrams are received; the default takes those of this computer alone.

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
    pteron cue flight.csv --robot simulator.toml --scale 0.3 --payload 90@0,0,0.4 --page cue.html
    pteron cue --listen 4123 --robot simulator.toml --layout forza --send 127.0.0.1:4124
    """
    _check_requests(motion, out, page, live)
    machine = _with_pivot(carried.load_machine(machine), pivot)
    where: dict[str, Any] = {"washout": filters.washout(), "type_ii": type_ii}
    if around is not None:
        where["pose"] = given_pose(machine, around, "--around")
    if live.listen is not None:
        from pteron.cli.cue_live import run_live

        return run_live(machine, motion, carried, where, live)
    from pteron.motion import cue as shown

    assert motion is not None
    with spinner(f"Showing {motion} with {machine.name}"):
        cued = shown(machine, motion, **where)
        largest, sizing = _drive_peaks(machine, cued)
        files = _write(machine, cued, out, page)
    return _result(machine, motion, carried, cued, largest, sizing, files)


def _with_pivot(machine: Manipulator, pivot: str | None) -> Manipulator:
    """Return the machine with poses about the pivot; it rests in the same home as without one."""
    if pivot is None:
        return machine
    from pteron.workspace import home_pose

    return about_pivot(replace(machine, home=tuple(home_pose(machine).tolist())), pivot)


def _check_requests(
    motion: str | None, out: str | None, page: str | None, live: LiveOptions
) -> None:
    """Raise DataError unless what is to be read and written is stated and can be written."""
    if live.listen is not None:
        if out is not None or page is not None:
            raise DataError("--out and --page are for a recorded motion; leave them out")
        return
    if live.send is not None:
        raise DataError("--send is for a live cue; give --listen PORT too")
    if motion is None:
        raise DataError("no motion given; give a file of t ax ay az wx wy wz, or --listen PORT")
    if out is None and page is None:
        raise DataError("nothing to write; give --out FILE.csv, --page FILE.html or both")
    if out is not None:
        from pteron.tables import check_output

        check_output(out)
    if page is not None:
        from pteron.report.write import checked_page

        checked_page(page)


def _drive_peaks(machine: Manipulator, cued: Cue) -> tuple[tuple[Peak, ...], Sizing]:
    """Return the peaks of the whole motion, and the loads of its drives."""
    import numpy as np

    from pteron.motion import limits_of, peaks, size

    fine = np.linspace(0.0, cued.duration, _DENSE * (len(cued.time) - 1) + 1)
    return peaks(machine, *cued.at(fine), limits_of(machine)), size(machine, cued)


def _result(
    machine: Manipulator,
    motion: str,
    carried: Carried,
    cued: Cue,
    largest: tuple[Peak, ...],
    sizing: Sizing,
    files: list[str],
) -> CommandResult:
    """Return the summary of a recorded motion's cue."""
    from pteron.motion.sizing.friction_sentence import friction_sentence

    if cued.resampling:
        note(f"Note: {motion}: {cued.resampling}")
    for peak in largest:
        if peak.share > 1.0 + SAME:
            note(f"Note: {peak.phrase()}; a smaller --scale asks less")
    record = {
        "robot": machine.name,
        **asdict(carried),
        "duration": cued.duration,
        "samples": len(cued.time),
        "resampling": cued.resampling,
        "center": cued.center.tolist(),
        "box": box_record(machine, cued.region),
        "proved": bool(cued.proof.holds),
        "pressed": cued.pressed,
        "peaks": [
            json_fields(quantity=p.name, size=p.size, unit=p.unit, limit=p.limit, share=p.share)
            | {"leg": p.leg or None}
            for p in largest
        ],
        "motors": motor_rows(sizing),
        "friction": friction_sentence(machine),
        "files": files,
    }
    lines: list[Any] = [
        f"[bold]{plain(machine.name)}[/bold]{plain(str(carried))}, motion of {plain(motion)}: "
        f"{cued.duration:.4g} s ({len(cued.time)} samples)",
        *box_lines(machine, cued.region),
        f"Amplitudes are reduced by at most {percent(cued.pressed)} to stay in the box; a smaller "
        "--scale asks for less."
        if cued.pressed >= _REDUCED
        else "Amplitudes are not reduced: the motion fits into the box.",
        peaks_table(largest),
        *at_motors(sizing),
        friction_sentence(machine),
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
