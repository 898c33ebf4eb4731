"""Video encoders that write a film frame by frame: H.264 in MP4 files, and GIF files."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from pteron.errors import PteronError
from pteron.extras import install_command

Pixels = NDArray[np.uint8]
"""A picture (height, width, 3): red, green and blue."""

_QUALITY = 7.0
"""FFmpeg's quality, of 10, at which lines on white stay sharp."""

_SHORTEST = 2
"""Least duration of a frame of a GIF, hundredths of a second: browsers show shorter ones slowly."""

_PALETTE = 96
"""Colours of a GIF."""

_GIF_PIXELS = 6e8
"""Most pixels of a GIF's frames, all of which are held in memory."""


class Encoder(NamedTuple):
    """A film encoder for a kind of file."""

    writer: type[Mp4 | Gif]
    """Takes its path, width and height in pixels, and frames a second."""
    rate: Callable[[float], float]
    """Returns the frames a second nearest to a number that the file can tell."""
    most: float
    """Pixels of all frames together."""


class Mp4:
    """H.264 with the pixel format (yuv420p) and layout (moov first) that browsers need."""

    def __init__(self, path: Path, size: tuple[int, int], fps: float) -> None:
        self._pipe: Any = _ffmpeg().write_frames(
            str(path),
            size,
            fps=fps,
            quality=_QUALITY,
            macro_block_size=2,
            ffmpeg_log_level="error",
            output_params=["-movflags", "+faststart"],
        )
        self._pipe.send(None)

    def add(self, picture: Pixels) -> None:
        """Write a frame."""
        self._pipe.send(np.ascontiguousarray(picture))

    def close(self) -> None:
        """Finish the file."""
        self._pipe.close()


class Gif:
    """Frames in the palette of the first frame, in a file that repeats without end."""

    def __init__(self, path: Path, size: tuple[int, int], fps: float) -> None:
        self._path, self._delay = path, round(1000.0 / fps)
        self._frames: list[Image.Image] = []

    def add(self, picture: Pixels) -> None:
        """Write a frame."""
        image = Image.fromarray(picture)
        # The colours that cover the first frame's best: its white stays white.
        first = self._frames or [image.quantize(_PALETTE, Image.Quantize.MAXCOVERAGE)]
        self._frames.append(image.quantize(palette=first[0], dither=Image.Dither.NONE))

    def close(self) -> None:
        """Finish the file."""
        if self._frames:
            first, *others = self._frames
            first.save(
                self._path, save_all=True, append_images=others, duration=self._delay, loop=0
            )


def _rate_in_hundredths(fps: float) -> float:
    """Return the nearest frame rate, Hz, whose frame time is a multiple of 10 ms."""
    return 100.0 / max(round(100.0 / fps), _SHORTEST)


ENCODERS = {
    ".mp4": Encoder(Mp4, float, np.inf),
    ".gif": Encoder(Gif, _rate_in_hundredths, _GIF_PIXELS),
}
"""Encoders by the ending of the file."""


def checked_encoder(path: Path) -> None:
    """Raise if the encoder of a film's file is not installed."""
    if path.suffix.lower() == ".mp4":
        _ffmpeg()


def _ffmpeg() -> Any:
    """Return the module imageio_ffmpeg, or raise an error that says how to install FFmpeg."""
    try:
        import imageio_ffmpeg  # type: ignore[import-untyped]

        if "jax" in sys.modules:
            # It would fork to keep Ctrl-C from FFmpeg; with JAX's threads that may hang for ever.
            os.environ.setdefault("IMAGEIO_FFMPEG_NO_PREVENT_SIGINT", "1")
        imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError) as error:
        raise PteronError(
            f"MP4 films need FFmpeg; {install_command('film')} brings it; or write a .gif"
        ) from error
    return imageio_ffmpeg
