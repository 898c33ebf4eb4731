"""The commands of README and of the tour in a fresh copy of this clone: ``make first``.

What `git` tracks is copied to an empty folder, `make demo` is run there, as README says, and then
each command that README and docs/start/tour.md show, with `.venv/bin/`, one after the other, in an
empty home. `log.csv` and its held-out companion, which a reader records on the machine, are
recorded in simulation. A viewer must answer and is then ended. It takes some minutes; seconds and
commands are printed.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from urllib.error import URLError
from urllib.request import urlopen

ROOT = Path(__file__).parents[2]
RECORDED = {"log.csv": "motion.csv", "held-out-log.csv": "motion-held-out.csv"}
"""Logs that the commands read, and the motions that are recorded for them."""

OPENED = 60.0
"""s, within which a viewer must answer."""


def commands(text: str) -> list[list[str]]:
    """Return a page's commands of the environment, as words."""
    joined = re.sub(r"\\\n +", "", re.sub(r"(?ms)^```.*?^```", "", text))
    lines = re.findall(r"(?m)^ {4}(?:\$ )?(?:\.venv/bin/)?((?:pteron|python) .*)$", joined)
    return [shlex.split(f".venv/bin/{line}") for line in lines]


def copied(folder: Path) -> Path:
    """Return a copy of what this clone tracks."""
    listed = [
        "git",
        "-C",
        str(ROOT),
        "ls-files",
        "-z",
        "--cached",
        "--others",
        "--exclude-standard",
    ]
    names = subprocess.run(listed, capture_output=True, text=True, check=True).stdout
    for name in filter(None, names.split("\0")):
        if (ROOT / name).is_file():
            target = folder / "clone" / name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, target)
    return folder / "clone"


def expect_viewer(words: list[str], clone: Path, environment: dict[str, str]) -> None:
    """Refuse a viewer whose page does not open."""
    with subprocess.Popen(
        [*words, "--port", "8143"], cwd=clone, env=environment, stdout=subprocess.DEVNULL
    ) as viewer:
        try:
            end = time.monotonic() + OPENED
            while viewer.poll() is None and time.monotonic() < end:
                try:
                    with urlopen("http://127.0.0.1:8143") as page:
                        assert b"<html" in page.read()
                    return
                except URLError:
                    time.sleep(0.5)
            raise SystemExit(f"{shlex.join(words)}: no page opens")
        finally:
            viewer.terminate()


def main() -> None:
    """Run everything; exit with 1 at the first command that fails."""
    with tempfile.TemporaryDirectory(prefix="pteron-first-") as name:
        work = Path(name)
        clone, home = copied(work), work / "home"
        home.mkdir()
        kept = {k: os.environ[k] for k in ("PATH", "PIP_CACHE_DIR") if k in os.environ}
        environment = {**kept, "HOME": str(home)}

        def run(*words: str) -> None:
            begin = time.perf_counter()
            done = subprocess.run(
                words, cwd=clone, env=environment, capture_output=True, text=True, check=False
            )
            print(f"{time.perf_counter() - begin:4.0f} s  {shlex.join(words)}", flush=True)
            if done.returncode:
                raise SystemExit(f"exit code {done.returncode}: {done.stdout}{done.stderr}")

        run("make", "demo", f"PYTHON={sys.executable}")
        pages = (ROOT / name for name in ("README.md", "docs/start/tour.md"))
        for words in commands("".join(page.read_text(encoding="utf-8") for page in pages)):
            if "view" in words:
                expect_viewer(words, clone, environment)
                continue
            for log in (word for word in words if word in RECORDED):
                run(words[0], "simulate", "quadrupteron", "--cycle", RECORDED[log], "--out", "run")
                (clone / "run" / "simulation.csv").rename(clone / log)
            run(*words)


if __name__ == "__main__":
    main()
