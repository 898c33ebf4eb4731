"""Writing of files whole or not at all: if writing fails, the former files are unchanged."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path

from pteron.errors import OutputError


def write_texts(folder: str | Path, texts: Mapping[str, str]) -> list[Path]:
    """Write texts in UTF-8 to files of a folder, by their names: all of them, or none.

    Raises
    ------
    OutputError
        If the folder cannot be made or written, or a text cannot be encoded in UTF-8; former files
        are then unchanged.
    """
    target = make_folder(folder)
    return write_files(
        {target / name: _encoded(target / name, text) for name, text in texts.items()}
    )


def write_text(path: str | Path, text: str) -> Path:
    """Write `text` to `path` in UTF-8, through a temporary file beside it and a rename."""
    return write_bytes(path, _encoded(path, text))


def write_bytes(path: str | Path, data: bytes) -> Path:
    """Write `data` to `path`, through a temporary file beside it and a rename.

    Raises
    ------
    OutputError
        If the folder is missing or cannot be written; a former file is then unchanged.
    """
    return write_files({Path(path): data})[0]


def write_files(files: Mapping[Path, bytes]) -> list[Path]:
    """Write files, all of them or none, and return their paths.

    Every file is first written under a temporary name in its folder, then all are renamed: a full
    disk loses nothing.

    Raises
    ------
    OutputError
        If one cannot be written.
    """
    written: dict[Path, Path] = {}
    try:
        for target, data in files.items():
            handle, name = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
            written[target] = Path(name)
            with os.fdopen(handle, "wb") as file:
                file.write(data)
            written[target].chmod(0o666 & ~_umask())
        for target, temporary in written.items():
            temporary.replace(target)
    except OSError as error:
        for temporary in written.values():
            temporary.unlink(missing_ok=True)
        raise OutputError(f"{target}: cannot be written ({error.strerror or error})") from None
    return list(written)


def checked_file(path: str | Path, example: str = "") -> Path:
    """Return a path after a check, before the work begins, that a file may be there.

    Raises
    ------
    OutputError
        If it is a folder, or its folder is missing.
    """
    target = Path(path)
    if target.is_dir():
        raise OutputError(f"{path}: is a folder; name a file in it{example}")
    if not target.parent.is_dir():
        raise OutputError(f"{path}: there is no folder {target.parent}; make it first")
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


def _encoded(path: str | Path, text: str) -> bytes:
    try:
        return text.encode("utf-8")
    except UnicodeEncodeError as error:
        raise OutputError(f"{path}: cannot be written in UTF-8 ({error.reason})") from None


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
