"""The wheel in empty environments: every Python that is here, with each extra alone and with all.

On the oldest Python all extras are tried once more with the lowest versions of everything that
`pyproject.toml` asks for: these are the floors that were tried.

``make wheels`` runs it; it takes half an hour. It builds the wheel, and for each Python and choice
of extras makes an environment, installs the wheel with pip and runs `features.py` there, with no C
compiler in PATH, an empty home and nothing of this clone in reach. It prints a Markdown table:
seconds of the installation and of the trial, or what went wrong.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path
from zipfile import ZipFile

ROOT = Path(__file__).parents[2]
FEATURES = Path(__file__).with_name("features.py")
OLDEST = (3, 11)
LOWEST = "lowest"
"""All extras, each dependency at its floor."""
DEVELOPERS = ("docs", "dev")
"""Extras of those who work on Pteron itself, who have a clone."""


def built_wheel(folder: Path) -> Path:
    """Return the wheel of this clone, built by pip into a folder."""
    pip = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", str(folder)]
    subprocess.run([*pip, str(ROOT)], check=True)
    (wheel,) = folder.glob("pteron-*.whl")
    return wheel


def missing_files(wheel: Path) -> list[str]:
    """Return the package's files that a wheel lacks: templates, pages, machines and code."""
    source = ROOT / "src"
    there = set(ZipFile(wheel).namelist())
    return [
        name
        for path in sorted(source.rglob("*"))
        if path.is_file() and "__pycache__" not in path.parts
        if (name := path.relative_to(source).as_posix()) not in there
    ]


def pythons() -> dict[str, Path]:
    """Return the Pythons that are here and new enough, by version: on PATH and of pyenv."""
    folders = [Path(folder) for folder in os.environ.get("PATH", "").split(os.pathsep)]
    folders += sorted(Path.home().glob(".pyenv/versions/*/bin"))
    found: dict[str, Path] = {}
    for folder in folders:
        for path in sorted(folder.glob("python3*")):
            if not re.fullmatch(r"python3(\.\d+)?", path.name):  # python3-config, python3.11-gdb.py
                continue
            code = "import sys, venv, ensurepip; print(*sys.version_info[:3], sep='.')"
            run = subprocess.run(
                [str(path), "-c", code], capture_output=True, text=True, check=False
            )
            version = run.stdout.strip()
            if run.returncode == 0 and tuple(map(int, version.split(".")[:2])) >= OLDEST:
                found.setdefault(version, path)
    return dict(sorted(found.items(), key=lambda item: [int(n) for n in item[0].split(".")]))


def extras() -> list[str]:
    """Return the choices of extras: none, each alone, all together."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        named = tomllib.load(file)["project"]["optional-dependencies"]
    return ["none", *(name for name in named if name not in ("all", *DEVELOPERS)), "all", LOWEST]


def floors() -> list[str]:
    """Return the lowest version of each dependency of Pteron and its extras: numpy==2.2, ..."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        project = tomllib.load(file)["project"]
    given = project["optional-dependencies"]
    own = [part for name in given if name not in ("all", *DEVELOPERS) for part in given[name]]
    return [wanted.replace(">=", "==") for wanted in (*project["dependencies"], *own)]


def tried(python: Path, wheel: Path, extra: str, work: Path) -> str:
    """Return the seconds of installing the wheel and of trying it, or what went wrong.

    What pip has fetched is kept for the next one, so that the first takes longest.
    """
    environment, home = work / "venv", work / "home"
    for folder in (environment, home):
        shutil.rmtree(folder, ignore_errors=True)
    home.mkdir(parents=True)
    subprocess.run([str(python), "-m", "venv", str(environment)], check=True)
    programs = environment / ("Scripts" if os.name == "nt" else "bin")
    wanted = {"none": str(wheel), LOWEST: f"{wheel}[all]"}.get(extra, f"{wheel}[{extra}]")
    constraints = work / "constraints.txt"
    constraints.write_text("\n".join(floors() if extra == LOWEST else []), encoding="utf-8")
    start = time.perf_counter()
    log = work / "log.txt"
    pip = [str(programs / "python"), "-m", "pip", "install", "--quiet", "--no-compile"]
    # Nothing is built here: a wheel for everything, as where there is no compiler.
    done = subprocess.run(
        [*pip, "--only-binary", ":all:", "--constraint", str(constraints), wanted],
        env={"PIP_CACHE_DIR": str(wheel.parent / "cache"), **os.environ},
        capture_output=True,
        text=True,
        check=False,
    )
    installed = time.perf_counter() - start
    if done.returncode:
        log.write_text(done.stdout + done.stderr, encoding="utf-8")
        return "not installed: " + _last(done.stderr)
    start = time.perf_counter()
    kept = {name: os.environ[name] for name in ("SYSTEMROOT",) if name in os.environ}
    bare = {**kept, "PATH": str(programs), "HOME": str(home), "USERPROFILE": str(home)}
    done = subprocess.run(
        [str(programs / "python"), str(FEATURES), "all" if extra == LOWEST else extra],
        cwd=home,
        env=bare,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        log.write_text(done.stdout + done.stderr, encoding="utf-8")
        return "fails: " + _last(done.stderr)
    return f"{installed:.0f} + {time.perf_counter() - start:.0f} s"


def _last(text: str) -> str:
    return (text.strip().splitlines() or ["no word"])[-1][:150]


def main() -> None:
    """Print the table; exit with 1 where something failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--python", nargs="*", type=Path, help="these Pythons instead of all")
    parser.add_argument("--extra", nargs="*", help="these extras instead of all")
    given = parser.parse_args()
    found = {str(p): p for p in given.python} if given.python else pythons()
    choices = given.extra or extras()
    failed = False
    with tempfile.TemporaryDirectory(prefix="pteron-wheel-") as folder:
        work = Path(folder)
        wheel = built_wheel(work)
        if lacking := missing_files(wheel):
            raise SystemExit(f"{wheel.name} lacks {', '.join(lacking)}")
        print(f"{wheel.name}: seconds to install + to try\n")
        print("| | " + " | ".join(found) + " |\n|" + " --- |" * (len(found) + 1))
        for extra in choices:
            cells = []
            for version, python in found.items():
                if extra == LOWEST and version != next(iter(found)):
                    cells.append("-")
                    continue
                cells.append(tried(python, wheel, extra, work / version.replace(os.sep, "_")))
                print(f"{extra}, {version}: {cells[-1]}", file=sys.stderr, flush=True)
            failed |= any(cell != "-" and not cell.endswith(" s") for cell in cells)
            print(f"| {extra} | " + " | ".join(cells) + " |", flush=True)
    raise SystemExit(failed)


if __name__ == "__main__":
    main()
