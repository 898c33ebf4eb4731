"""Fonts for letters that the usual font lacks: another font of this computer, or else a warning."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache

from matplotlib import font_manager
from matplotlib.figure import Figure
from matplotlib.text import Text

from pteron.errors import shorten

_NO_LETTERS = ("Last Resort", "STIXNonUnicode", "STIXSize", "cm")
"""Families of fonts not to use: their letters are boxes, or mathematical signs."""


def take_fonts(figure: Figure) -> str:
    """Set fonts that have the letters of each text of a figure; return letters without a font."""
    absent: set[str] = set()
    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        letters = text.get_text()
        if letters.isascii():
            continue
        usual = font_manager.findfont(text.get_fontproperties())
        lacking = _missing_letters(usual, frozenset(c for c in letters if not c.isspace()))
        if lacking:
            families, missing = _fallback_families(lacking)
            first_families = [name for name in text.get_fontfamily() if name not in families]
            text.set_fontfamily([*first_families, *families])
            absent |= missing
    return "".join(sorted(absent))


def warn_of_absent(letters: str) -> None:
    """Issue a warning of letters that are drawn as boxes, if there are any."""
    if letters:
        some = shorten(letters, bare=True, longest=8)
        warnings.warn(
            f"no font on this machine has {some}: boxes stand for them in the picture; install "
            "one that has, such as Noto Sans, or write an .svg, which takes the reader's fonts",
            stacklevel=4,
        )


@contextmanager
def silence_glyph_warnings() -> Iterator[None]:
    """Silence matplotlib's warnings of missing letters in a block."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"(?s)(Glyph|Matplotlib currently does not).*")
        yield


@lru_cache(maxsize=64)
def _fallback_families(letters: frozenset[str]) -> tuple[list[str], frozenset[str]]:
    """Return fallback font families for letters, and the letters that no installed family has."""
    families: list[str] = []
    for name, path in _font_files().items():
        unprinted = _missing_letters(path, letters)
        if unprinted < letters:
            families, letters = [*families, name], unprinted
        if not letters:
            break
    return families, letters


@lru_cache(maxsize=1)
def _font_files() -> dict[str, str]:
    """Return a font file of each family, upright if available; symbol fonts are excluded."""
    listed = sorted(font_manager.fontManager.ttflist, key=lambda font: font.style == "normal")
    files = {font.name: font.fname for font in listed if not font.name.startswith(_NO_LETTERS)}
    return dict(sorted(files.items()))


@lru_cache(maxsize=1024)
def _missing_letters(path: str, letters: frozenset[str]) -> frozenset[str]:
    """Return the letters that a font file lacks."""
    try:
        known = font_manager.get_font(path).get_charmap()
    except (OSError, RuntimeError):  # a file that is gone, or no font that matplotlib draws
        return letters
    return frozenset(c for c in letters if ord(c) not in known)
