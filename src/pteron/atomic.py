"""Files that are written whole or not at all."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from pteron.errors import OutputError


def write_text(path: str | Path, text: str) -> Path:
    """Write `text` to `path` in UTF-8, through a temporary file beside it and a rename."""
    try:
        data = text.encode("utf-8")
    except UnicodeEncodeError as error:
        raise OutputError(f"{path}: cannot be written in UTF-8 ({error.reason})") from None
    return write_bytes(path, data)


def write_bytes(path: str | Path, data: bytes) -> Path:
    """Write `data` to `path`, through a temporary file beside it and a rename.

    Raises
    ------
    OutputError
        If the folder is missing or cannot be written; a file that was there is left as it was.
    """
    target = Path(path)
    temporary = None
    try:
        handle, temporary = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        Path(temporary).chmod(0o666 & ~_umask())
        Path(temporary).replace(target)
    except OSError as error:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)
        raise OutputError(f"{target}: cannot be written ({error.strerror or error})") from None
    return target


def make_folder(path: str | Path) -> Path:
    """Return the folder `path`, made if it is missing, after a check that it can be written.

    Raises
    ------
    OutputError
        If it cannot be made, is a file, or cannot be written.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError as error:
        reason = "it is a file" if folder.is_file() else error.strerror or str(error)
        raise OutputError(f"{folder}: cannot be written to as a folder ({reason})") from None


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
