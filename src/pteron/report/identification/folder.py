"""The folder of a result: checked before the work, and not left behind empty if that fails."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from pteron.atomic import make_folder
from pteron.errors import OutputError

__all__ = ["prepared_folder"]


@contextmanager
def prepared_folder(path: str | Path) -> Iterator[Path]:
    """Make a folder, check that it can be written, and take it back if the work in it fails.

    Raises
    ------
    OutputError
        If it cannot be made or written.
    """
    if str(path) == "":
        raise OutputError("the folder's name is empty; name one")
    target = Path(path)
    missing = [folder for folder in (target, *target.parents) if not folder.exists()]
    try:
        yield make_folder(target)
    except BaseException:
        for folder in missing:
            with suppress(OSError):  # unless somebody has put something there meanwhile
                folder.rmdir()
        raise
