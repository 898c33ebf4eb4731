"""`film` writes a machine's motion as an MP4 or GIF film: its speed, size and length."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable
from contextlib import closing
from dataclasses import dataclass
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import ArrayLike

from pteron.arguments import expect
from pteron.atomic import checked_file, write_bytes
from pteron.errors import DataError, OutputError, shorten
from pteron.kernels import Array, as_array
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion import Motion
from pteron.plots.film_encoders import ENCODERS, Pixels, checked_encoder
from pteron.plots.film_frames import frames
from pteron.progress import Progress
from pteron.result import Result

_SPEEDS = (1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01)
"""Speeds from which one is chosen where none is given; 1 is real time."""

_LEAST = 2.0
"""Least length, s, of the film at the speed chosen."""

_FPS = 30.0
"""Frames a second where nothing else is asked."""

_SIZES = (160, 3840)
"""Least and greatest side, pixels."""

_MOST = 20_000
"""Most frames of one film; a longer one is refused."""


@dataclass(frozen=True, eq=False, repr=False)
class Film(Result):
    """A film that has been written.

    Attributes
    ----------
    path : Path
        Its file.
    frames : int
        How many there are.
    fps : float
        Frames a second; of a GIF what its file can tell, hundredths of a second a frame.
    speed : float
        Time in the film's world over time on the clock: below 1 is slow motion.
    size : (int, int)
        Width and height, pixels.
    """

    path: Path
    frames: int
    fps: float
    speed: float
    size: tuple[int, int]

    @property
    def duration(self) -> float:
        """Its length, s."""
        return self.frames / self.fps

    def _repr_html_(self) -> str:
        """Return the film as HTML, for notebooks; the name of its file if that is gone."""
        if not self.path.is_file():
            return f"<code>{escape(str(self.path))}</code>"
        encoded = b64encode(self.path.read_bytes()).decode()
        width = f'width="{self.size[0]}"'
        if self.path.suffix.lower() == ".gif":
            return f'<img {width} alt="film" src="data:image/gif;base64,{encoded}">'
        kind = 'type="video/mp4"'
        return (
            f"<video {width} controls loop muted><source {kind} "
            f'src="data:video/mp4;base64,{encoded}"></video>'
        )


def film(
    robot: RobotLike,
    motion: Motion,
    path: str | Path,
    *,
    fps: float = _FPS,
    speed: float | None = None,
    size: tuple[int, int] = (960, 720),
    turns: float = 0.0,
    forces: ArrayLike | None = None,
    progress: Progress | None = None,
) -> Film:
    """Write a film of a machine that goes through a motion.

    The view is the same in all frames, the first frame is the motion's first sample and the last
    one its last. The film says its speed in a corner.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    motion : Motion
        What the platform does.
    path : str or Path
        The file: .mp4 (H.264, which every browser plays) or .gif.
    fps : float
        Frames a second, 1 to 120; a GIF takes the nearest that its file can tell, 50 at most.
    speed : float, optional
        Time in the film's world over time on the clock: 0.4 is slow motion. By default the largest
        of 1, 0.5, 0.2, 0.1 ... at which the film takes 2 s.
    size : (int, int)
        Width and height, pixels, both even.
    turns : float
        How many times the eye goes round the machine; not for planar machines.
    forces : array, shape (T, n), optional
        Forces of the legs at the motion's samples, N or N m: their curves are drawn below.
    progress : callable, optional
        Is told the share that is done, from 0 to 1, after each frame.

    Returns
    -------
    Film

    Raises
    ------
    DataError
        If a number makes no film, or the times of the motion do not ascend.
    UnreachablePose
        If a leg does not reach a pose.
    OutputError
        If the file cannot be written, or its ending is neither .mp4 nor .gif.
    PteronError
        If the encoder of MP4 files is not there; the extra `film` brings it.

    Examples
    --------
    >>> import pteron
    >>> from pteron.motion import pick_and_place
    >>> robot = pteron.load("delta")
    >>> cycle = pick_and_place(robot, [0.0, 0.0, -0.9])
    >>> made = pteron.plots.film(robot, cycle, "cycle.gif", speed=0.2)  # doctest: +SKIP
    """
    robot, target = as_manipulator(robot), checked_film(path)
    motion.expect_ascending()
    _expect_number("fps", fps, 1.0, 120.0)
    if np.shape(size) != (2,) or any(
        not _SIZES[0] <= side <= _SIZES[1] or side % 2 for side in size
    ):
        low, high = _SIZES
        raise DataError(
            f"size: {shorten(size)} given, two even numbers from {low} to {high} expected, pixels"
        )
    if robot.platform.plane_normal is not None and turns:
        raise DataError(
            f"turns: {turns:g} given, but {robot.name} is planar and seen along its plane's "
            "normal; leave it out"
        )
    _expect_number("turns", turns, -100.0, 100.0)
    drawn = None if forces is None else _checked_forces(forces, motion, robot)
    encoder = ENCODERS[target.suffix.lower()]
    rate = encoder.rate(fps)
    if speed is None:
        speed = next((s for s in _SPEEDS if motion.duration >= _LEAST * s), _SPEEDS[-1])
    _expect_number("speed", speed, 1e-4, 1e3)
    steps = max(round(motion.duration / speed * rate), 1)
    if steps >= _MOST:
        raise DataError(
            f"{motion.duration:.4g} s at a speed of {speed:g} make {steps} frames, {_MOST} at "
            "most are possible; give a higher speed, or fewer frames a second"
        )
    times = np.linspace(float(motion.time[0]), float(motion.time[-1]), steps + 1)
    sides = int(size[0]), int(size[1])
    if (steps + 1) * sides[0] * sides[1] > encoder.most:
        raise DataError(
            f"{steps + 1} frames of {sides[0]}x{sides[1]} pixels are too much for a GIF; give an "
            ".mp4, a smaller size, a higher speed or fewer frames a second"
        )
    pictures = frames(
        robot, motion, times, sides, turns=turns, forces=drawn, corner=_speed_text(speed)
    )
    write_film(target, pictures, len(times), sides, rate, progress)
    return Film(target, len(times), rate, speed, sides)


def write_film(
    target: Path,
    pictures: Iterable[Pixels],
    count: int,
    size: tuple[int, int],
    rate: float,
    progress: Progress | None,
) -> None:
    """Write pictures of a size as a film, atomically."""
    # Made elsewhere: a film that is not finished leaves nothing behind.
    with TemporaryDirectory(prefix="pteron-film-") as folder:
        file = Path(folder) / f"film{target.suffix.lower()}"
        with closing(ENCODERS[target.suffix.lower()].writer(file, size, rate)) as writer:
            for done, picture in enumerate(pictures, start=1):
                writer.add(picture)
                if progress is not None:
                    progress(done / count)
        write_bytes(target, file.read_bytes())


def checked_film(path: str | Path) -> Path:
    """Return a path, checked beforehand for whether a film can be written there."""
    target = checked_file(path, ", such as cycle.mp4")
    if target.suffix.lower() not in ENCODERS:
        raise OutputError(f"{path}: {target.suffix or 'no'} ending, .mp4 or .gif expected")
    checked_encoder(target)
    return target


def _speed_text(speed: float) -> str:
    """Return the text of a film's speed in multiples of real time."""
    return "real time" if speed == 1.0 else f"{speed:.3g} \u00d7 real time"


def _expect_number(name: str, number: float, low: float, high: float) -> None:
    """Raise a `DataError` if a number is outside an interval, whose ends are allowed."""
    expect(low <= number <= high, name, f"{number:g}", f"a number from {low:g} to {high:g}")


def _checked_forces(forces: ArrayLike, motion: Motion, robot: Manipulator) -> Array:
    """Return a motion's forces as an array (T, n), checked for its shape."""
    array = as_array(forces, "forces", ())
    expected = len(motion.time), robot.joint_count
    if array.shape != expected:
        raise DataError(
            f"forces: shape {array.shape} given, {expected} expected, as the motion has"
        )
    return array
