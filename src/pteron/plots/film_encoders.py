"""Video encoders that write a film frame by frame: H.264 in MP4 files, and GIF files."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, Protocol

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


class Writer(Protocol):
    """A film that is being written."""

    def add(self, picture: Pixels) -> None:
        """Write one more frame."""

    def close(self) -> None:
        """Finish the file."""


class Encoder(NamedTuple):
    """The encoder of one kind of file."""

    writer: Callable[[Path, tuple[int, int], float], Writer]
    """Takes its path, width and height in pixels, and frames a second."""
    rate: Callable[[float], float]
    """Returns the frames a second nearest to a number that the file can tell."""
    most: float
    """Pixels of all frames together."""


class Mp4:
    """H.264 with the pixels (yuv420p) and the layout (moov first) that browsers want."""

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
        """Write one more frame."""
        self._pipe.send(np.ascontiguousarray(picture))

    def close(self) -> None:
        """Finish the file."""
        self._pipe.close()


class Gif:
    """Frames in the commonest colours of the first one, in a file that starts again at its end."""

    def __init__(self, path: Path, size: tuple[int, int], fps: float) -> None:
        self._path, self._delay = path, round(1000.0 / fps)
        self._frames: list[Image.Image] = []

    def add(self, picture: Pixels) -> None:
        """Write one more frame."""
        coarse = _coarse(picture)
        if not self._frames:
            self._palette = _commonest(coarse)
            self._nearest = _nearest(self._palette)
        image = Image.fromarray(self._nearest[coarse])
        image.putpalette(self._palette.ravel().tolist())
        self._frames.append(image)

    def close(self) -> None:
        """Finish the file."""
        if self._frames:
            first, *others = self._frames
            first.save(
                self._path, save_all=True, append_images=others, duration=self._delay, loop=0
            )


def _coarse(picture: Pixels) -> NDArray[np.uint16]:
    """Return each colour's number among those of 5, 6 and 5 bits."""
    red, green, blue = (picture[..., k] >> bits for k, bits in enumerate((3, 2, 3)))
    return np.asarray(red.astype(np.uint16) << 11 | green.astype(np.uint16) << 5 | blue)


def _colors(numbers: NDArray[np.integer[Any]]) -> NDArray[np.uint8]:
    """Return red, green and blue (K, 3) of colours of 5, 6 and 5 bits: white is white."""
    parts = (numbers >> 11, 31), ((numbers >> 5) & 63, 63), (numbers & 31, 31)
    return np.stack([np.round(255.0 * part / most) for part, most in parts], -1).astype(np.uint8)


def _commonest(coarse: NDArray[np.uint16]) -> NDArray[np.uint8]:
    numbers, counts = np.unique(coarse, return_counts=True)
    return _colors(numbers[np.argsort(-counts, kind="stable")[:_PALETTE]])


def _nearest(palette: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the place in a palette of what is nearest to each colour of 5, 6 and 5 bits."""
    from scipy.spatial import KDTree  # type: ignore[import-untyped]

    every = _colors(np.arange(1 << 16))
    return np.asarray(KDTree(palette.astype(float)).query(every.astype(float))[1], dtype=np.uint8)


def _hundredths(fps: float) -> float:
    return 100.0 / max(round(100.0 / fps), _SHORTEST)


ENCODERS = {".mp4": Encoder(Mp4, float, np.inf), ".gif": Encoder(Gif, _hundredths, _GIF_PIXELS)}
"""Encoders by the ending of the file."""


def checked_encoder(path: Path) -> None:
    """Refuse a file whose encoder is not there.

    Raises
    ------
    PteronError
        If it is not.
    """
    if path.suffix.lower() == ".mp4":
        _ffmpeg()


def _ffmpeg() -> Any:
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
