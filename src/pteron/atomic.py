"""Writing of files whole or not at all: if writing fails, the former files are unchanged."""

from __future__ import annotations

import os
import shutil
import stat
import tempfile
from collections.abc import Mapping
from pathlib import Path

from pteron.errors import OutputError


def write_texts(folder: str | Path, texts: Mapping[str, str]) -> list[Path]:
    """Write texts as UTF-8 files into a folder, all or none; return their paths.

    Raises
    ------
    OutputError
        If the folder cannot be made or written, or a text cannot be encoded in UTF-8; former files
        are then unchanged.
    """
    target = make_folder(folder)
    return write_files(
        {target / name: _encode(target / name, text) for name, text in texts.items()}
    )


def write_text(path: str | Path, text: str) -> Path:
    """Write a text to a file in UTF-8, atomically; return its path."""
    return write_bytes(path, _encode(path, text))


def write_bytes(path: str | Path, content: bytes) -> Path:
    """Write bytes to a file, atomically; return its path.

    Raises
    ------
    OutputError
        If the folder is missing or cannot be written; a former file is then unchanged.
    """
    return write_files({Path(path): content})[0]


def write_files(files: Mapping[Path, bytes]) -> list[Path]:
    """Write files, all of them or none; return their paths.

    Every file is first written under a temporary name in its folder, and flushed to the disk; then
    all are renamed, so that a full disk loses nothing. Replaced files keep their permissions, and
    are restored if a rename fails.

    Raises
    ------
    OutputError
        If one cannot be written.
    """
    for target in files:
        if target.is_dir():
            raise OutputError(f"{target}: cannot be written (it is a folder); name another file")
    written: dict[Path, Path] = {}
    try:
        for target, content in files.items():
            handle, name = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
            written[target] = Path(name)
            with os.fdopen(handle, "wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            written[target].chmod(_mode_of(target))
        _replace_all(written)
    except OSError as error:
        raise OutputError(f"{target}: cannot be written ({error.strerror or error})") from None
    finally:
        for temporary in written.values():
            temporary.unlink(missing_ok=True)
    return list(written)


def _mode_of(target: Path) -> int:
    """Return the permission bits of an existing file, or the defaults of a new file."""
    try:
        return stat.S_IMODE(target.stat().st_mode)
    except FileNotFoundError:
        return 0o666 & ~_umask()


def _replace_all(written: Mapping[Path, Path]) -> None:
    """Rename temporary files to their targets; if that fails, restore former files."""
    former = {target: _copy_beside(target) for target in written if target.exists()}
    renamed: list[Path] = []
    try:
        for target, temporary in written.items():
            temporary.replace(target)
            renamed.append(target)
    except OSError:
        for target in renamed:
            if target in former:
                former[target].replace(target)
            else:
                target.unlink()
        raise
    finally:
        for copy in former.values():
            copy.unlink(missing_ok=True)


def _copy_beside(target: Path) -> Path:
    """Copy an existing file beside itself under a temporary name; return the copy's path."""
    handle, name = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
    os.close(handle)
    shutil.copy2(target, name)
    return Path(name)


def checked_file(path: str | Path, example: str = "") -> Path:
    """Return the path of an output file; raise if it is a folder or its folder is missing.

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
    """Create the folder if it is missing and check that it is writable; return its path.

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


def _encode(path: str | Path, text: str) -> bytes:
    """Return a text encoded in UTF-8; raise an `OutputError` if it cannot be encoded."""
    try:
        return text.encode("utf-8")
    except UnicodeEncodeError as error:
        raise OutputError(f"{path}: cannot be written in UTF-8 ({error.reason})") from None


def _umask() -> int:
    """Return the process's umask (permission bits that new files lack)."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
