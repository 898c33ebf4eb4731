"""Writing of exported files: those that Pteron wrote are replaced, others are not touched."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from pteron.atomic import make_folder, write_files
from pteron.errors import OutputError

_MARK = b"Pteron"
"""The word that each exported text, but a data file, has in its first lines."""

_REPLACED: ContextVar[list[Path] | None] = ContextVar("replaced", default=None)
"""The files that exports have replaced by other contents, within `recorded_replacements`."""


def write_export(folder: str | Path, contents: Mapping[str, str | bytes]) -> list[Path]:
    """Write exported files into a folder, all or none; return their paths.

    Raises
    ------
    OutputError
        If a file of one of the names is there that Pteron did not write, or the folder cannot be
        written; nothing is then changed.
    """
    target = make_folder(folder)
    files = {
        target / name: content.encode("utf-8") if isinstance(content, str) else content
        for name, content in contents.items()
    }
    replaced = []
    for path, content in files.items():
        former = path.read_bytes() if path.is_file() else content
        if _MARK in content and _MARK not in former:
            raise OutputError(
                f"{path}: is there already, and Pteron did not write it; name another folder, or "
                "move it away"
            )
        if former != content:
            replaced.append(path)
    written = write_files(files)
    recorded = _REPLACED.get()
    if recorded is not None:
        recorded += replaced
    return written


@contextmanager
def recorded_replacements() -> Iterator[list[Path]]:
    """In this context, record the files whose contents exports replace in the list returned."""
    recorded: list[Path] = []
    token = _REPLACED.set(recorded)
    try:
        yield recorded
    finally:
        _REPLACED.reset(token)
