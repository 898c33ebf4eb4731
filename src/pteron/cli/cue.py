"""`pteron cue`: the motion of a vehicle as a motion of its simulator's platform."""

from __future__ import annotations

from dataclasses import fields
from functools import partial
from typing import Annotated

from typer import Argument

from pteron.cli.arguments import Elbows, Json, load_robot, option
from pteron.cli.motion_table import motion_frame, peaks_table
from pteron.cli.progress import spinner
from pteron.cli.terminal import note, show, show_json, written
from pteron.errors import DataError

_filter = partial(option, metavar="NUMBER", rich_help_panel="Filters", show_default=False)


def cue(
    motion: Annotated[
        str,
        Argument(
            metavar="MOTION",
            help="The vehicle's motion, a .csv or .parquet file: t ax ay az wx wy wz.",
            show_default=False,
        ),
    ],
    robot: Annotated[
        str, option("robot", "A machine whose platform moves and turns freely.", "FILE")
    ],
    out: Annotated[
        str | None, option("out", "Write poses and joints to a .csv or .parquet file.", "FILE")
    ] = None,
    page: Annotated[
        str | None, option("page", "Write a page that shows the motion, a .html file.", "FILE")
    ] = None,
    type_ii: Annotated[
        float, option("type-ii", "Least type-II measure of the poses that it keeps within.")
    ] = 0.0,
    scale: Annotated[
        float | None, _filter("scale", "Share of accelerations and rates that is shown: 0.5.")
    ] = None,
    translation: Annotated[
        float | None, _filter("translation", "What is quicker is moved: 2.5 rad/s.")
    ] = None,
    return_speed: Annotated[
        float | None, _filter("return-speed", "It comes back to the middle with: 0.25 rad/s.")
    ] = None,
    tilting: Annotated[
        float | None, _filter("tilting", "What lasts longer is tilted into: 2 rad/s.")
    ] = None,
    tilt_rate: Annotated[
        float | None, _filter("tilt-rate", "Greatest rate of that tilt: 0.05 rad/s.")
    ] = None,
    rotation: Annotated[
        float | None, _filter("rotation", "Turns that are quicker are turned: 0.7 rad/s.")
    ] = None,
    smoothing: Annotated[
        float | None, _filter("smoothing", "Nothing quicker is shown: 30 rad/s.")
    ] = None,
    elbows: Elbows = None,
    json: Json = False,
) -> None:
    """Show a vehicle's accelerations and turns with a simulator's platform: a classical washout.

    The file holds t (s), accelerations ax ay az without gravity (m/s^2) and angular rates wx wy wz
    (rad/s) in the vehicle's axes: x ahead, y to the left, z up. What is quick is moved, what lasts
    is tilted into, and the platform comes back to the middle. It never leaves a box of poses that
    is proved to lie in the workspace: what is too large for it is pressed together.
    """
    from pteron.motion import Washout, limits_of, peaks
    from pteron.motion import cue as shown
    from pteron.tables import check_output, write_table

    machine = load_robot(robot, elbows)
    if out is None and page is None:
        raise DataError("nothing to write; give --out FILE.csv, --page FILE.html or both")
    if out is not None:
        check_output(out)
    if page is not None:
        from pteron.report.write import checked_page

        checked_page(page)
    given = scale, translation, return_speed, tilting, tilt_rate, rotation, smoothing
    named = zip((field.name for field in fields(Washout)), given, strict=True)
    washout = Washout(**{name: value for name, value in named if value is not None})
    with spinner(f"Showing {motion} with {machine.name}"):
        found = shown(machine, motion, washout=washout, type_ii=type_ii)
        largest = peaks(machine, found.pose, found.velocity, found.acceleration, limits_of(machine))
        files = []
        if out is not None:
            write_table(motion_frame(machine, found), out)
            files.append(out)
        if page is not None:
            from pteron.report.write import write_motion_page

            files.append(str(write_motion_page(machine, found, page)))
    for peak in largest:
        if peak.share > 1.0:
            note(f"Note: {peak.told()}; a smaller --scale asks less")
    low, high = found.region.box
    if json:
        show_json(
            {
                "robot": machine.name,
                "duration": found.duration,
                "samples": len(found.time),
                "box": {
                    name: [float(a), float(b)]
                    for name, a, b in zip(machine.coordinates, low, high, strict=True)
                },
                "proved": bool(found.proof.holds),
                "pressed": found.pressed,
                "files": files,
            }
        )
        return
    units = (machine.platform.units, low, high)
    sides = ", ".join(
        f"{name} {1e3 * a:.4g} to {1e3 * b:.4g} mm"
        if unit == "m"
        else f"{name} {57.29578 * a:.4g} to {57.29578 * b:.4g} deg"
        for name, unit, a, b in zip(machine.coordinates, *units, strict=True)
    )
    show(
        f"{found.duration:.4g} s, {len(found.time)} samples, within a box that is proved: {sides}",
        f"pressed together by at most {found.pressed:.0%}",
        peaks_table(largest),
        *written(*files),
    )
