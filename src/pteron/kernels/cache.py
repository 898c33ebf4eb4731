"""Compiled code on disk, so that a second start does not compile.

An entry is a folder of files under the user's cache directory, named by a digest of all that it
was made of. It is built in a folder of its own and moved into place, so that two processes may
build it at once; a manifest of digests tells a damaged one, which is then built again.
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
from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

import numpy as np
from platformdirs import user_cache_path

__all__ = ["VARIABLE", "digest", "directory", "entry", "find", "host"]

VARIABLE = "PTERON_CACHE"
"""Environment variable with another directory for compiled code."""

_MANIFEST = "manifest.json"

_STALE = 3600.0
"""Seconds after which nobody works on a folder any more."""


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


def find(name: str) -> Path | None:
    """Return the folder of an entry that is there and whole, or None."""
    folder = directory() / name
    try:
        manifest = json.loads((folder / _MANIFEST).read_text(encoding="utf-8"))
        whole = all(_hash(folder / file) == value for file, value in manifest.items())
    except (OSError, ValueError, AttributeError):
        return None
    return folder if whole else None


def entry(name: str, build: Callable[[Path], None]) -> Path:
    """Return the folder of an entry; `build` fills a new folder where there is none, or no whole.

    Where the cache cannot be written, the folder is a temporary one.
    """
    found = find(name)
    if found is not None:
        return found
    target = directory() / name
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        _swept(target.parent)
        work = Path(tempfile.mkdtemp(prefix=f".{name}-", dir=target.parent))
    except OSError:
        work = Path(tempfile.mkdtemp(prefix="pteron-"))
        atexit.register(shutil.rmtree, work, ignore_errors=True)
        target = work
    try:
        build(work)
        files = [path for path in sorted(work.rglob("*")) if path.is_file()]
        manifest = {path.relative_to(work).as_posix(): _hash(path) for path in files}
        (work / _MANIFEST).write_text(json.dumps(manifest), encoding="utf-8")
    except BaseException:
        shutil.rmtree(work, ignore_errors=True)
        raise
    return work if target == work else _moved(work, target)


def _swept(folder: Path) -> None:
    """Remove what processes that were killed at work have left behind."""
    for left in folder.glob(".*-*"):
        with suppress(OSError):
            if time.time() - left.stat().st_mtime > _STALE:
                shutil.rmtree(left, ignore_errors=True)


def _moved(work: Path, target: Path) -> Path:
    """Move a finished folder into place, unless another process was first."""
    for _ in range(3):
        try:
            work.rename(target)
        except OSError:
            if find(target.name) is not None:
                shutil.rmtree(work, ignore_errors=True)
                return target
            # In place, but damaged: out of the way first, so that nobody sees half of it.
            wreck = Path(tempfile.mkdtemp(prefix=".damaged-", dir=target.parent))
            with suppress(OSError):
                target.rename(wreck / target.name)
            shutil.rmtree(wreck, ignore_errors=True)
        else:
            return target
    return work


def _hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
