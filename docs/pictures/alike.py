"""Comparison of pictures that different versions of matplotlib have drawn."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from PIL import Image, ImageSequence

Pixels = np.ndarray[tuple[int, ...], np.dtype[np.float64]]

_FRINGE = 2
"""Pixels by which a picture's size may differ, as its text is a little wider."""

_DIFFERENCE = 0.01
"""Mean difference of colours, of 1, that nobody sees."""

_SHIFT = 0.5
"""Greatest shift of a point of an SVG."""


def alike(old: Path, new: Path) -> bool:
    """Return whether two pictures, SVG, PNG or GIF, show the same."""
    if not old.is_file():
        return False
    return _same_drawing(old, new) if new.suffix == ".svg" else _same_pixels(old, new)


def _same_pixels(old: Path, new: Path) -> bool:
    a, b = _frames(old), _frames(new)
    if len(a) != len(b):
        return False
    return all(_same_frame(one, other) for one, other in zip(a, b, strict=True))


def _frames(path: Path) -> list[Pixels]:
    with Image.open(path) as image:
        return [np.asarray(one.convert("RGB")) / 255.0 for one in ImageSequence.Iterator(image)]


def _same_frame(a: Pixels, b: Pixels) -> bool:
    if max(abs(m - n) for m, n in zip(a.shape, b.shape, strict=True)) > _FRINGE:
        return False
    rows, columns = np.minimum(a.shape[:2], b.shape[:2])
    return bool(np.abs(a[:rows, :columns] - b[:rows, :columns]).mean() < _DIFFERENCE)


def _same_drawing(old: Path, new: Path) -> bool:
    a, b = _numbers(old), _numbers(new)
    return len(a) == len(b) and bool((np.abs(a - b) < _SHIFT).all())


def _numbers(path: Path) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    text = re.sub(r"(?s)<metadata>.*?</metadata>", "", path.read_text(encoding="utf-8"))
    return np.array([float(x) for x in re.findall(r"(?<![\w#.-])-?\d+\.\d+", text)])
