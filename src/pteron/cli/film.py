"""`pteron film`: a film of a machine that goes through a cycle."""

from __future__ import annotations

from typing import Any

from pteron.cli.arguments import STANDARD, MachineArgument, about_pivot
from pteron.cli.motion_argument import Carried, cycle_of
from pteron.cli.progress import progress_bar, spinner
from pteron.cli.result import CommandResult
from pteron.cli.terminal import plain
from pteron.errors import DataError
from pteron.extras import expect_extra
from pteron.json_values import json_fields


def film(
    machine: MachineArgument,
    *,
    out: str,
    cycle: str = STANDARD,
    duration: float | None = None,
    speed: float | None = None,
    fps: float = 30.0,
    size: str = "960x720",
    turns: float = 0.0,
    forces: bool = False,
    carried: Carried,
    pivot: str | None = None,
) -> CommandResult:
    """Film a machine that goes through a cycle, in real time or slow motion, as MP4 or GIF.

    The view is the same from the first frame to the last, or goes round the machine with --turns;
    the film says its speed in a corner. Ctrl-C leaves no file. An MP4 is H.264 as browsers and
    slides play it, and needs FFmpeg, which comes with Pteron's extra named film.

    Options
    -------
    --out, -o FILE: The film: .mp4 (H.264) or .gif.
    --speed: Speed of the film: 1 is real time, 0.4 slow motion. [default: the largest of 1, 0.5,
        0.2, 0.1 ... with which the film takes 2 s or more]
    --fps: Frames per second.
    --size WIDTHxHEIGHT: Width and height, pixels, both even.
    --turns: Turns of the view round the machine over the film; not for planar machines.
    --forces: Draw the drives' forces below the machine.

    Examples
    --------
    pteron film delta -o cycle.mp4
    pteron film quadrupteron --speed 0.4 --forces --turns 0.5 -o slow.mp4
    pteron film robot.toml --cycle motion.csv --size 640x480 -o motion.gif
    """
    from pteron.dynamics import drive_forces
    from pteron.plots import film as filmed
    from pteron.plots.films import checked_film

    checked_film(out)
    sides = _sides(size)
    both = carried.mount_tool(machine), carried.load_machine(machine)
    machine, carrying = (about_pivot(robot, pivot) for robot in both)
    with spinner(f"Planning the cycle of {machine.name}"):
        motion = cycle_of(machine, cycle, duration)
        state = motion.pose, motion.velocity, motion.acceleration
        drawn = drive_forces(carrying, *state, smooth=True) if forces else None
    look: dict[str, Any] = {"fps": fps, "speed": speed, "size": sides, "turns": turns}
    with progress_bar(f"Filming {machine.name}") as tell:
        written = filmed(machine, motion, out, **look, forces=drawn, progress=tell)
    record = {
        "robot": machine.name,
        "cycle": cycle,
        **json_fields(
            duration=written.duration,
            speed=written.speed,
            frames=written.frames,
            fps=written.fps,
            size=written.size,
        ),
        "file": str(written.path),
    }
    pace = "in real time" if written.speed == 1.0 else f"at {written.speed:.3g} times real speed"
    summary = (
        f"{plain(machine.name)}: {motion.duration:.4g} s of motion {pace}; the film has "
        f"{written.duration:.3g} s, {written.frames} frames of {written.size[0]}x{written.size[1]}"
    )
    return CommandResult(record, [summary], [written.path])


def _expect_ffmpeg(options: dict[str, Any]) -> None:
    """Raise where an MP4 film is requested and the extra with FFmpeg is not installed."""
    if options["out"].lower().endswith(".mp4"):
        expect_extra("film", "imageio_ffmpeg", "MP4 films need FFmpeg (a .gif does not)")


vars(film)["before"] = _expect_ffmpeg


def _sides(text: str) -> tuple[int, int]:
    """Return width and height in pixels of a text such as `960x720`."""
    parts = text.lower().replace("\u00d7", "x").split("x")
    try:
        width, height = (int(part) for part in parts)
    except ValueError:
        raise DataError(
            f"--size: {text!r} given, width and height in pixels expected, such as 960x720"
        ) from None
    return width, height
