"""The cache on disk: compiled code, so that a second start does not compile, and texts of programs.

An entry is a folder of files under the user's cache directory, named by a digest of all its
sources. It is built in a temporary folder and moved into place, so that two processes may build it
at once; a manifest of digests detects a damaged one, which is then rebuilt. The least recently used
entries are removed when all of them exceed 512 MB.

A text, such as a serialised CasADi function, is one file, which begins with its digest; the latest
3000 are kept.

Cached code is loaded and run. So a directory that belongs to somebody else, or that others may
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
from itertools import count
from pathlib import Path

import numpy as np
from platformdirs import user_cache_path

from pteron.errors import OutputError

VARIABLE = "PTERON_CACHE"
"""Environment variable with another directory for compiled code."""

_WORK = ".pteron-work-"
"""Beginning of the name of a folder that is being built, or being removed."""

_MANIFEST = "manifest.json"
"""The file of an entry that has the digests of the others."""

_MARK = ".made-by-pteron"
"""A file in each folder that is made here, which says whose process works on it: the sweep touches
no other folder."""

_STALE = 3600.0
"""Seconds after which a work folder counts as abandoned."""

TEXTS = "texts"
"""The folder of texts."""

MOST = 3000
"""Maximum number of cached texts, of some 10 kB each."""

_WRITTEN = count()
"""Number of texts that this process has written."""

MOST_BYTES = 1 << 29
"""Size of all entries above which the least recently used are removed, bytes."""


def directory() -> Path:
    """Return the directory for compiled code on disk; it need not exist."""
    setting = os.environ.get(VARIABLE)
    return Path(setting) if setting else user_cache_path("pteron") / "kernels"


@lru_cache(maxsize=1)
def host() -> str:
    """Return a text on processor, Python and NumPy, which compiled code depends on."""
    processor = platform.processor()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    flags = [line for line in lines if line.startswith(("flags", "Features", "model name"))]
    features = "\n".join(sorted(set(flags)))
    return f"{sys.version} {np.__version__} {platform.machine()} {processor} {features}"


def digest(*parts: str) -> str:
    """Return a name for a cache entry: a digest of texts and of this computer."""
    total = hashlib.sha256()
    for part in (*parts, host()):
        total.update(len(part).to_bytes(8, "little") + part.encode())
    return total.hexdigest()[:24]


def find(name: str, file: str) -> Path | None:
    """Return the path of `file` in an intact cache entry, or None."""
    folder = _root() / name
    try:
        manifest = json.loads((folder / _MANIFEST).read_text(encoding="utf-8"))
        is_intact = file in manifest and all(_hash(folder / f) == v for f, v in manifest.items())
    except (OSError, ValueError, AttributeError, TypeError):
        return None
    with suppress(OSError):  # used now, and as old as ever
        os.utime(folder / _MANIFEST, ns=(time.time_ns(), (folder / _MANIFEST).stat().st_mtime_ns))
    return folder / file if is_intact else None


def entry(name: str, file: str, build: Callable[[Path], None]) -> Path:
    """Return the path of `file` in a cache entry; `build` makes the entry if it is missing.

    Raises
    ------
    OutputError
        If the disk takes no more.
    """
    cached = find(name, file)
    if cached is not None:
        return cached
    root, work = _prepare_work_folder()
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
    return _move_into_place(work, root / name, file) / file


def find_text(name: str) -> str | None:
    """Return an intact cached text by its name, or None."""
    try:
        content = (_root() / TEXTS / name).read_bytes()
        if content[:32] == hashlib.sha256(content[32:]).digest():
            return zlib.decompress(content[32:]).decode()
    except (OSError, zlib.error, UnicodeDecodeError):
        pass
    return None


def store_text(name: str, text: str, most: int = MOST) -> None:
    """Store a text in the cache under a name, if possible.

    If there are more than `most` texts, the oldest are removed.
    """
    content = zlib.compress(text.encode(), 1)
    folder = _root() / TEXTS
    with suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        with tempfile.NamedTemporaryFile(prefix=_WORK, dir=folder, delete=False) as file:
            work = Path(file.name)
            try:
                file.write(hashlib.sha256(content).digest() + content)
                file.close()
                work.replace(folder / name)
            finally:
                work.unlink(missing_ok=True)
        # To list the folder takes as long as to write: a process does so for its first text and for
        # every fiftieth part of `most`.
        if next(_WRITTEN) % max(most // 50, 1):
            return
        texts = list(os.scandir(folder))
        if len(texts) > most:
            for old in sorted(texts, key=_age)[: len(texts) - 3 * most // 4]:
                Path(old).unlink(missing_ok=True)


def _age(listed: os.DirEntry[str]) -> float:
    """Return a file's modification time, s; 0 if another process has removed it."""
    try:
        return listed.stat().st_mtime
    except OSError:
        return 0.0


def _root() -> Path:
    """Return the cache directory: the user's, or a temporary one where that is not safe."""
    folder = directory()
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = folder.stat()
    except OSError:
        return _private()
    # On Windows a user's folders are closed to others, and modes say nothing.
    ours = os.name == "nt" or (status.st_uid == os.geteuid() and not status.st_mode & 0o022)
    return folder if ours else _private()


@lru_cache(maxsize=1)
def _private() -> Path:
    """Return a temporary directory of this process, removed at its exit."""
    folder = Path(tempfile.mkdtemp(prefix="pteron-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def _prepare_work_folder() -> tuple[Path, Path]:
    """Return the cache directory, tidied up, and a new work folder in it."""
    root = _root()
    _sweep(root)
    _limit_size(root, MOST_BYTES)
    try:
        return root, _work_folder(root)
    except OSError:
        root = _private()
        return root, _work_folder(root)


def _work_folder(root: Path) -> Path:
    """Return a new work folder in the cache, marked by this computer's name and the process id."""
    folder = Path(tempfile.mkdtemp(prefix=_WORK, dir=root))
    (folder / _MARK).write_text(f"{platform.node()} {os.getpid()}", encoding="utf-8")
    return folder


def _sweep(root: Path) -> None:
    """Remove the cache's work folders of processes that were killed."""
    for mark in root.glob(f"{_WORK}*/{_MARK}"):
        with suppress(OSError):
            if time.time() - mark.stat().st_mtime > _STALE or not _may_be_running(mark.read_text()):
                shutil.rmtree(mark.parent, ignore_errors=True)


def _may_be_running(mark: str) -> bool:
    """Return whether the process that a work folder's mark names may still be running."""
    node, _, number = mark.rpartition(" ")
    if os.name != "posix" or node != platform.node() or not number.isdigit():
        return True
    try:
        os.kill(int(number), 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True


def _limit_size(root: Path, most: int) -> None:
    """Remove the least recently used cache entries until they take at most `most` bytes.

    An entry that a process is about to load may be removed: it is then rebuilt.
    """
    entries = []
    for manifest in root.glob(f"*/{_MANIFEST}"):
        with suppress(OSError):
            size = sum(path.stat().st_size for path in manifest.parent.iterdir())
            used = max(manifest.stat().st_atime, manifest.stat().st_mtime)
            entries.append((used, size, manifest.parent))
    total = sum(size for _, size, _ in entries)
    for _, size, folder in sorted(entries):
        if total <= most:
            return
        _remove_folder(folder)
        total -= size


def _remove_folder(folder: Path) -> None:
    """Remove a folder atomically: rename it first, so that no process sees it incomplete."""
    wreck = _work_folder(folder.parent)
    with suppress(OSError):
        folder.rename(wreck / folder.name)
    shutil.rmtree(wreck, ignore_errors=True)


def _move_into_place(work: Path, target: Path, file: str) -> Path:
    """Rename a finished cache folder to `target`, unless another process did; return its path."""
    for _ in range(3):
        try:
            work.rename(target)
        except OSError:
            if find(target.name, file) is not None:
                shutil.rmtree(work, ignore_errors=True)
                return target
            _remove_folder(target)  # in place, but damaged
        else:
            return target
    return work


def _hash(path: Path) -> str:
    """Return the SHA-256 digest of a file, in hexadecimal."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
