"""`pteron film`: a film of a machine that goes through a cycle."""

from __future__ import annotations

from typing import Annotated, Any

from typer import Option

from pteron.cli.arguments import STANDARD, Cycle, Duration, Elbows, Json, Robot, load_robot, option
from pteron.cli.motion_argument import cycle_of, loaded
from pteron.cli.progress import progress_bar, spinner
from pteron.cli.terminal import plain, show, show_json, written
from pteron.errors import DataError

_OUT = Option(
    *("--out", "-o"), help="The film: .mp4 (H.264) or .gif.", metavar="FILE", show_default=False
)
"""The option `--out`."""


def film(
    robot: Robot,
    out: Annotated[str, _OUT],
    cycle: Cycle = STANDARD,
    duration: Duration = None,
    speed: Annotated[
        float | None,
        option(
            "speed",
            "Of the film: 1 is real time, 0.4 slow motion.",
            show_default="the largest of 1, 0.5, 0.2, 0.1 ... that takes 2 s",
        ),
    ] = None,
    fps: Annotated[float, option("fps", "Frames a second.")] = 30.0,
    size: Annotated[
        str, option("size", "Width and height, pixels, both even.", "WIDTHxHEIGHT")
    ] = "960x720",
    turns: Annotated[
        float, option("turns", "How often the eye goes round the machine; not of planar ones.")
    ] = 0.0,
    forces: Annotated[bool, option("forces", "Draw the drives' forces below.")] = False,
    payload: Annotated[
        float, option("payload", "At the tool's centre point, kg: the forces carry it.")
    ] = 0.0,
    elbows: Elbows = None,
    json: Json = False,
) -> None:
    """Film a machine that goes through a cycle, in real time or slow motion, as MP4 or GIF.

    The view is the same from the first frame to the last, or goes round the machine with --turns;
    the film says its speed in a corner. Ctrl-C leaves no file. An MP4 is H.264 as browsers and
    slides play it, and needs FFmpeg, which the extra film brings.
    """
    machine = load_robot(robot, elbows)
    from pteron.dynamics import drive_forces
    from pteron.plots import film as filmed
    from pteron.plots.films import checked_film

    checked_film(out)
    sides = _sides(size)
    carrying = loaded(machine, payload)
    with spinner(f"A cycle of {machine.name}"):
        motion = cycle_of(machine, cycle, duration)
        state = motion.pose, motion.velocity, motion.acceleration
        drawn = drive_forces(carrying, *state, smooth=True) if forces else None
    look: dict[str, Any] = {"fps": fps, "speed": speed, "size": sides, "turns": turns}
    with progress_bar(f"Filming {machine.name}") as tell:
        made = filmed(machine, motion, out, **look, forces=drawn, progress=tell)
    data = {
        "robot": machine.name,
        "cycle": cycle,
        "duration": made.duration,
        "speed": made.speed,
        "frames": made.frames,
        "fps": made.fps,
        "size": list(made.size),
        "file": str(made.path),
    }
    if json:
        show_json(data)
        return
    pace = "in real time" if made.speed == 1.0 else f"at {made.speed:.3g} times its speed"
    show(
        f"{motion.duration:.4g} s of {plain(machine.name)} {pace}: {made.duration:.3g} s, "
        f"{made.frames} frames of {made.size[0]}x{made.size[1]}",
        *written(made.path),
    )


def _sides(text: str) -> tuple[int, int]:
    """Return width and height from a text such as 960x720."""
    parts = text.lower().replace("\u00d7", "x").split("x")
    try:
        width, height = (int(part) for part in parts)
    except ValueError:
        raise DataError(
            f"--size: {text!r} given, width and height in pixels expected, such as 960x720"
        ) from None
    return width, height
