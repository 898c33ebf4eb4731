"""The declared dialect of a CSV file: separator, decimal sign, encoding and header lines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pteron.errors import DataError, shorten

Separator = Literal[",", ";", "\t", "|", " "]
"""Characters between cells."""

Decimal = Literal[".", ","]
"""Decimal signs."""

SEPARATORS: dict[Separator, str] = {
    ",": "commas",
    ";": "semicolons",
    "\t": "tabs",
    "|": "bars",
    " ": "blanks",
}
"""The separators, each with its name."""


@dataclass(frozen=True)
class Dialect:
    """The dialect of a CSV file; each part that is None is detected.

    Parameters
    ----------
    separator : {",", ";", tab, "|", blank}, optional
        The character between cells; several blanks count as one separator.
    decimal : {".", ","}, optional
        The decimal sign.
    encoding : str, optional
        The name of a text encoding in Python.
    header_lines : int, optional
        Number of lines above the data; the last names the columns. A line of units after the names
        may be counted or not.
    """

    separator: Separator | None = None
    decimal: Decimal | None = None
    encoding: str | None = None
    header_lines: int | None = None

    def __post_init__(self) -> None:
        if self.decimal is not None and self.decimal == self.separator:
            raise DataError('decimal: "," cannot be the separator too')
        if self.header_lines is not None and self.header_lines < 1:
            raise DataError(f"header_lines: {self.header_lines} given, at least 1 expected")
        try:
            "".encode(self.encoding or "utf-8")
        except (LookupError, ValueError):
            raise DataError(
                f"encoding: {shorten(self.encoding)} is no text encoding that Python knows"
            ) from None


PLAIN = Dialect(",", ".", "utf-8")
"""Commas, decimal points and UTF-8; the first line that is not blank names the columns."""


def declaration(table: str, **entries: object) -> str:
    """Return TOML lines for a file beside a log, to be put at the end of a message.

    Examples
    --------
    >>> print("say so:" + declaration("csv", separator=";", header_lines=2))
    say so:
    [csv]
    separator = ";"
    header_lines = 2
    """
    import tomlkit  # slow to load, and for messages alone

    lines = [f"{key} = {tomlkit.item(setting).as_string()}" for key, setting in entries.items()]
    return "\n" + "\n".join([f"[{table}]", *lines])
