"""Compiled code on disk, so that a second start does not compile; and texts that took a while.

An entry is a folder of files under the user's cache directory, named by a digest of all that it
was made of. It is built in a folder of its own and moved into place, so that two processes may
build it at once; a manifest of digests tells a damaged one, which is then built again.

A text is one file, which begins with its digest; so many of the latest are kept.

What lies there is loaded and run. So a directory that belongs to somebody else, or that others may
write to, is neither read nor written: a temporary one, gone with the process, takes its place.
"""

from __future__ import annotations

import atexit
import hashlib
import json
import os
import platform
import shutil
import sys
import tempfile
import time
import zlib
from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

import numpy as np
from platformdirs import user_cache_path

from pteron.errors import OutputError

VARIABLE = "PTERON_CACHE"
"""Environment variable with another directory for compiled code."""

_MANIFEST = "manifest.json"

_WORK = ".pteron-work-"
"""Begins the name of a folder that is being built, or being removed."""

_MARK = ".made-by-pteron"
"""A file in each folder that is made here: the sweep touches no other."""

_STALE = 3600.0
"""Seconds after which nobody works on a folder any more."""

TEXTS = "texts"
"""The folder of texts."""

MOST = 3000
"""Texts that are kept, of some 10 kB each."""


def directory() -> Path:
    """Return the directory of compiled code; it need not exist."""
    given = os.environ.get(VARIABLE)
    return Path(given) if given else user_cache_path("pteron") / "kernels"


@lru_cache(maxsize=1)
def host() -> str:
    """Return what compiled code depends on beside its source: processor, Python, NumPy."""
    processor = platform.processor()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    flags = [line for line in lines if line.startswith(("flags", "Features", "model name"))]
    features = "\n".join(sorted(set(flags)))
    return f"{sys.version} {np.__version__} {platform.machine()} {processor} {features}"


def digest(*parts: str) -> str:
    """Return a name for what is made of these texts on this machine."""
    total = hashlib.sha256()
    for part in (*parts, host()):
        total.update(len(part).to_bytes(8, "little") + part.encode())
    return total.hexdigest()[:24]


def find(name: str, file: str) -> Path | None:
    """Return the file of an entry that is there and whole, or None."""
    folder = _root() / name
    try:
        manifest = json.loads((folder / _MANIFEST).read_text(encoding="utf-8"))
        whole = file in manifest and all(_hash(folder / f) == v for f, v in manifest.items())
    except (OSError, ValueError, AttributeError, TypeError):
        return None
    return folder / file if whole else None


def entry(name: str, file: str, build: Callable[[Path], None]) -> Path:
    """Return a file of an entry; `build` fills a new folder where there is none, or no whole.

    Raises
    ------
    OutputError
        If the disk takes no more.
    """
    found = find(name, file)
    if found is not None:
        return found
    root = _root()
    _sweep(root)
    try:
        work = _work_folder(root)
    except OSError:
        root = _private()
        work = _work_folder(root)
    try:
        build(work)
        files = [path for path in sorted(work.rglob("*")) if path.is_file()]
        manifest = {path.relative_to(work).as_posix(): _hash(path) for path in files}
        (work / _MANIFEST).write_text(json.dumps(manifest), encoding="utf-8")
    except OSError as error:
        shutil.rmtree(work, ignore_errors=True)
        raise OutputError(
            f"{root}: compiled code cannot be written ({error.strerror or error}); make room, or "
            f"name another folder in the environment variable {VARIABLE}"
        ) from None
    except BaseException:
        shutil.rmtree(work, ignore_errors=True)
        raise
    return _moved(work, root / name, file) / file


def find_text(name: str) -> str | None:
    """Return a text that is kept and whole, or None."""
    try:
        data = (_root() / TEXTS / name).read_bytes()
        if data[:32] == hashlib.sha256(data[32:]).digest():
            return zlib.decompress(data[32:]).decode()
    except (OSError, zlib.error, UnicodeDecodeError):
        pass
    return None


def keep_text(name: str, text: str, most: int = MOST) -> None:
    """Keep a text where the disk takes it; where there are too many, the oldest give way."""
    data = zlib.compress(text.encode(), 1)
    folder = _root() / TEXTS
    with suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        with tempfile.NamedTemporaryFile(prefix=_WORK, dir=folder, delete=False) as file:
            work = Path(file.name)
            try:
                file.write(hashlib.sha256(data).digest() + data)
                file.close()
                work.replace(folder / name)
            finally:
                work.unlink(missing_ok=True)
        kept = list(os.scandir(folder))
        if len(kept) > most:
            for old in sorted(kept, key=_age)[: len(kept) - 3 * most // 4]:
                Path(old).unlink(missing_ok=True)


def _age(found: os.DirEntry[str]) -> float:
    """Return when a file was written; what another process removed meanwhile counts as oldest."""
    try:
        return found.stat().st_mtime
    except OSError:
        return 0.0


def _root() -> Path:
    """Return the directory of entries: the user's, or a temporary one where that is not safe."""
    folder = directory()
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = folder.stat()
    except OSError:
        return _private()
    # On Windows a user's folders are closed to others, and modes say nothing.
    ours = os.name == "nt" or (found.st_uid == os.geteuid() and not found.st_mode & 0o022)
    return folder if ours else _private()


@lru_cache(maxsize=1)
def _private() -> Path:
    folder = Path(tempfile.mkdtemp(prefix="pteron-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def _work_folder(root: Path) -> Path:
    folder = Path(tempfile.mkdtemp(prefix=_WORK, dir=root))
    (folder / _MARK).touch()
    return folder


def _sweep(root: Path) -> None:
    """Remove what processes that were killed at work have left behind, and nothing else."""
    for mark in root.glob(f"{_WORK}*/{_MARK}"):
        with suppress(OSError):
            if time.time() - mark.stat().st_mtime > _STALE:
                shutil.rmtree(mark.parent, ignore_errors=True)


def _moved(work: Path, target: Path, file: str) -> Path:
    """Move a finished folder into place, unless another process was first."""
    for _ in range(3):
        try:
            work.rename(target)
        except OSError:
            if find(target.name, file) is not None:
                shutil.rmtree(work, ignore_errors=True)
                return target
            # In place, but damaged: out of the way first, so that nobody sees half of it.
            wreck = _work_folder(target.parent)
            with suppress(OSError):
                target.rename(wreck / target.name)
            shutil.rmtree(wreck, ignore_errors=True)
        else:
            return target
    return work


def _hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
