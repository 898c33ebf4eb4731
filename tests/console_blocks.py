"""The console blocks of a page: their commands, run in order in one folder, and their outputs.

A block is fenced as `console` or indented by four columns. Its commands stand after `$ `, with
their output below; where no line has a `$ `, each line is a command whose output the page does not
show. A line that begins with `# ` is a remark, one that ends with a backslash goes on in the next.

Outputs agree if their words do and their numbers do within a tolerance: a number with a decimal
point or an exponent within one unit of its last digit that is shown, an integer exactly, or as
`Tolerance` says. `...` in a shown output stands for anything.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl
from documentation import TEXTS
from typer.testing import CliRunner

import pteron
from pteron.cli.main import app
from pteron.kernels.c import compiler

ROOT = Path(__file__).parent.parent

PROGRAMS = ("pteron", "python", "cp", "cc", "grep", "controller/test")
"""Programs that are run."""

OTHERS = ("make", "pip", "jupyter", "halcompile", "dask")
"""Programs that change the machine, or that few machines have."""

_FENCE = re.compile(r"^(`{3,}|:{3,})\s*(\S*)")
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\d.]*\w)|[-+]?\d+\.\d+")


@dataclass(frozen=True)
class Step:
    """A command of a page and the lines that are shown below it."""

    page: str
    line: int
    command: str
    shown: tuple[str, ...] = ()

    @property
    def words(self) -> list[str]:
        """The command's words."""
        return shlex.split(self.command)


@dataclass(frozen=True)
class Tolerance:
    """A tolerance for the numbers of an output, and the reason that it has its size.

    `relative` is of the number that is shown; `only` is a regular expression of the shown lines
    that have it, by default all.
    """

    relative: float
    reason: str
    only: str = ""


def blocks(text: str) -> Iterator[tuple[int, str, list[str]]]:
    """Yield the line number, language and lines of each block; an indented one has no language."""
    lines = text.split("\n")
    k = 0
    while k < len(lines):
        fence = _FENCE.match(lines[k])
        if fence:
            end = next(
                (j for j in range(k + 1, len(lines)) if lines[j].startswith(fence[1])), len(lines)
            )
            yield k + 2, fence[2], lines[k + 1 : end]
            k = end + 1
        elif lines[k].startswith("    ") and (k == 0 or not lines[k - 1].strip()):
            end = k
            while end < len(lines) and (lines[end].startswith("    ") or not lines[end].strip()):
                end += 1
            while not lines[end - 1].strip():
                end -= 1
            yield k + 1, "", [line[4:] for line in lines[k:end]]
            k = end
        else:
            k += 1


def is_console(language: str, lines: list[str]) -> bool:
    """Return whether a block shows commands."""
    if language:
        return language == "console"
    if any(line.startswith("$ ") for line in lines):
        return True
    commands = [line for line in lines if line.strip() and not line.startswith("# ")]
    return bool(commands) and _bare(commands[0]).split()[0] in (*PROGRAMS, *OTHERS)


def _bare(command: str) -> str:
    """Return a command without its environment's folder and without a remark behind it."""
    return re.split(r" +# ", command)[0].rstrip().removeprefix(".venv/bin/")


def steps(page: str, text: str) -> list[Step]:
    """Return the commands of a page, in order."""
    result: list[Step] = []
    for first, language, lines in blocks(text):
        if not is_console(language, lines):
            continue
        prompts = any(line.startswith("$ ") for line in lines)
        k = 0
        while k < len(lines):
            line, begin = lines[k], first + k
            k += 1
            if not line.strip() or line.startswith("# "):
                continue
            command = line.removeprefix("$ ")
            while command.endswith("\\"):
                command = command[:-1] + lines[k].strip()
                k += 1
            shown = []
            while prompts and k < len(lines) and not lines[k].startswith(("$ ", "# ")):
                shown.append(lines[k])
                k += 1
            result.append(Step(page, begin, _bare(command), tuple(x for x in shown if x.strip())))
    return result


def run(step: Step, folder: Path) -> tuple[int, str]:
    """Return the exit code and the output of a step in a folder, which is the working one."""
    program, *words = step.words
    if program == "pteron":
        result = CliRunner().invoke(app, words)
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        return result.exit_code, result.output
    if program == "cp":
        shutil.copy(*words)
        return 0, ""
    before = {"python": [sys.executable], "cc": list(compiler() or ["cc"]), "grep": ["grep"]}
    done = subprocess.run(
        [*before.get(program, [f"./{program}"]), *words],
        cwd=folder,
        env={**os.environ, "PYTHONWARNINGS": "error"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout


def difference(shown: str, printed: str, tolerances: tuple[Tolerance, ...] = ()) -> str:
    """Return the first difference of a shown output and a printed one; nothing where they agree."""
    parts: list[list[_Word]] = [[]]
    for line in shown.split("\n"):
        relative = _relative(line, tolerances)
        for word in line.split():
            if word == "...":
                parts.append([])
            else:
                parts[-1].append((word, relative))
    given = printed.split()
    at = 0
    for k, part in enumerate(parts):
        last = k == len(parts) - 1
        places = list(range(at, max(at, len(given) - len(part)) + 1))
        if k == 0:
            places = places[:1]
        elif last and part:
            places = places[-1:]
        common = {place: _common(part, given[place:]) for place in places}
        place = max(places, key=lambda p: (common[p], -p))
        if common[place] < len(part):
            return _told(part[common[place]][0], given, place + common[place])
        at = place + len(part)
    if parts[-1] and at != len(given):
        return f"more is printed: {' '.join(given[at : at + 12])}"
    return ""


_Word = tuple[str, float | None]
"""A shown word, and the relative tolerance of its numbers; None for that of the last digit."""


def _relative(line: str, tolerances: tuple[Tolerance, ...]) -> float | None:
    """Return the relative tolerance of a shown line, None for that of the last digit."""
    return next((t.relative for t in tolerances if re.search(t.only, line)), None)


def _common(part: list[_Word], given: list[str]) -> int:
    """Return how many words agree from the first on."""
    k = 0
    while k < min(len(part), len(given)) and agrees(part[k][0], given[k], part[k][1]):
        k += 1
    return k


def _told(word: str, given: list[str], k: int) -> str:
    if k >= len(given):
        return f"shown {word!r}, and no more is printed"
    return f"shown {word!r}, printed {given[k]!r} in {' '.join(given[max(0, k - 4) : k + 5])!r}"


def agrees(shown: str, printed: str, relative: float | None = None) -> bool:
    """Return whether a printed word is the shown one, its numbers within the tolerance.

    `...` in a word stands for any letters; the rule below a table's head may have any length.
    """
    if shown == printed or not (set(shown) | set(printed)) - {"─"}:
        return True
    return _numbers_agree(shown, printed, relative)


def _numbers_agree(shown: str, printed: str, relative: float | None) -> bool:
    head, dots, tail = shown.partition("...")
    parts = [re.escape(_NUMBER.sub("#", part)) for part in (head, tail)]
    if not re.fullmatch((".*" if dots else "").join(parts), _NUMBER.sub("#", printed)):
        return False
    theirs = _NUMBER.findall(printed)
    first, last = _NUMBER.findall(head), _NUMBER.findall(tail)
    pairs = [
        *zip(first, theirs, strict=False),
        *zip(reversed(last), reversed(theirs), strict=False),
    ]
    return all(abs(float(a) - float(b)) <= _allowed(a, relative) for a, b in pairs)


def _allowed(number: str, relative: float | None) -> float:
    """Return by how much a number may be off."""
    if relative is not None:
        return relative * abs(float(number)) * (1.0 + 1e-12)
    mantissa, _, exponent = number.partition("e")
    decimals = len(mantissa.partition(".")[2])
    if not decimals and not exponent:
        return 0.0
    return 10.0 ** (int(exponent or 0) - decimals) * (1.0 + 1e-9)


NOT_RUN = {
    r"pteron view .*": ("stays open until it is ended", "test_viewer.py"),
    r"make .*": ("builds in the clone", "test_release.py"),
    r"pip install .*": ("changes the environment", "installed/matrix.py"),
    r"jupyter .*": ("stays open until it is ended", "test_notebooks.py"),
    r"python docs/notebooks/run\.py": ("takes minutes", "test_notebooks.py"),
    r"halcompile .*": ("is a part of LinuxCNC", "test_tilting_exports.py"),
    r"python benchmarks/genhexkins\.py .*": ("loads LinuxCNC's module", "test_tilting_exports.py"),
    r"python benchmarks/linuxcnc_moves\.py .*": ("runs LinuxCNC", "test_tilting_exports.py"),
    r"python benchmarks/mujoco_convergence\.py": ("takes minutes", "test_benchmarks.py"),
    r"python benchmarks/environment\.py": ("prints times alone", "test_benchmarks.py"),
    r"pteron cue --listen .*": ("stays open until it is ended", "test_live_cue.py"),
    r"pteron design .*": ("searches for minutes", "test_design.py"),
    r"pteron choose .*": ("searches for minutes", "test_choosing.py"),
    r"pteron excite (?!.*--seconds).*": (
        "searches for a minute",
        "test_excitation_files.py",
    ),
    r"pteron workspace .* --points 400 .*": ("64 million poses", "test_map_files.py"),
}
"""Patterns of commands, why they are not run, and where they are run otherwise."""


Maker = Callable[[Path, str], None]


EXCITE = "pteron excite --starts 1 --draws 20 --workers 1 --seconds 600 --period 4"
"""A short search that ends by itself, and so with the same motion at any speed."""


def by(command: str) -> Maker:
    """Return what makes a file by a command."""

    def make(path: Path, text: str) -> None:
        code, output = run(Step("", 0, command), path.parent)
        assert code == 0, f"{command}\n{output}"

    return make


def block(begin: str) -> Maker:
    """Return what writes the page's block that begins so."""

    def make(path: Path, text: str) -> None:
        (lines,) = (lines for _, _, lines in blocks(text) if lines and lines[0].startswith(begin))
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")

    return make


def with_gripper(path: Path, text: str) -> None:
    """Write a Quadrupteron, `my robot`, with the tool of the page."""
    code, robot = run(Step("", 0, "pteron new quadrupteron"), path.parent)
    assert code == 0
    block("[[tools]]")(path, text)
    tool = path.read_text(encoding="utf-8")
    renamed = re.sub(r'(?m)^name = ".*"', 'name = "my robot"', robot, count=1)
    path.write_text(f"{renamed}\n{tool}", encoding="utf-8")


def printer_cfg(path: Path, text: str) -> None:
    """Write a printer.cfg whose stable positions are of a printer with wrong zeros."""
    drawn = pteron.load("printer.toml")
    rng = np.random.default_rng(0)
    r, turn = np.sqrt(rng.uniform(0.0, 0.08**2, 40)), rng.uniform(0.0, 2.0 * np.pi, 40)
    poses = np.stack([r * np.cos(turn), r * np.sin(turn), 0.0 * r], axis=1)
    off = np.array([3e-4, -2e-4, 1e-4])
    sliders = pteron.inverse_kinematics(drawn, poses) + off
    ends = 1e3 * np.array([leg.limits[1] for leg in drawn.legs])
    counts = np.round((ends - 1e3 * sliders) / 0.01)
    begin = "[printer]\nkinematics: delta\ndelta_radius: 99.8\n"
    parts = [
        f"[stepper_{tower}]\nstep_distance: 0.01\nposition_endstop: {end}\narm_length: 229.4\n"
        for tower, end in zip("abc", ends, strict=True)
    ]
    saved = ["#*# <---------------------- SAVE_CONFIG ---------------------->", "#*#"]
    saved.append("#*# [delta_calibrate]")
    for k, row in enumerate(counts):
        at = ",".join(f"{count:.1f}" for count in row)
        saved += [f"#*# height{k} = 0.0", f"#*# height{k}_pos = {at}"]
    path.write_text(begin + "".join(parts) + "\n".join(saved) + "\n", encoding="utf-8")


def scope_export(path: Path, text: str) -> None:
    """Write a log as TwinCAT Scope exports it: a column of times for each channel."""
    by(f"{EXCITE} quadrupteron --out scoped.csv")(path, text)
    by("pteron simulate quadrupteron --cycle scoped.csv --out plain.csv")(path, text)
    log = pl.read_csv(path.with_name("plain.csv"))
    names = [f"Axis{i}.{what}" for what in ("ActPos", "ActForce") for i in range(1, 5)]
    joints = 1e3 * log.select(f"rho{i}" for i in range(1, 5)).to_numpy()
    forces = log.select(f"force{i}" for i in range(1, 5)).to_numpy()
    times = np.round(1e3 * log["t"].to_numpy()).astype(int)
    keys = {
        "Name": names,
        "SymbolComment": [""] * 8,
        "Data-Type": ["REAL64"] * 8,
        "SampleTime[ms]": ["1"] * 8,
        "VariableSize": ["8"] * 8,
        "SymbolBased": ["1"] * 8,
        "IndexGroup": ["0"] * 8,
        "Unit": ["mm (Length)"] * 4 + ["(None)"] * 4,
        "Unit Offset": ["0"] * 8,
    }
    top = ["Name\tmotion", "File\tmotion.csv", "Starttime of export\t0\tMontag", "", ""]
    head = ["\t".join(f"{key}\t{value}" for value in values) for key, values in keys.items()]
    body = [
        "\t".join(f"{t}\t{value:.6f}".replace(".", ",") for value in row)
        for t, row in zip(times, np.hstack([joints, forces]), strict=True)
    ]
    path.write_text("\n".join([*top, *head, "", *body, "EOF"]) + "\n", encoding="utf-8")


def far_motion(path: Path, text: str) -> None:
    """Write a motion that leaves the reach of a leg."""
    t = np.linspace(0.0, 2.0, 21)
    poses = {name: a * t for name, a in zip(("x", "y", "z", "phi"), FAR, strict=True)}
    pl.DataFrame({"t": t, **poses}).write_csv(path)


FAR = (0.036, 0.012, 0.12, 0.1)
"""Rates of a motion that ends out of reach, m/s and rad/s."""


def flight(path: Path, text: str) -> None:
    """Write the motion of a vehicle that accelerates and turns."""
    t = np.arange(0.0, 8.0, 0.01)
    swing = np.sin(0.8 * t)
    moving = {"ax": 2.0 * swing, "ay": 0.5 * swing, "az": 0.0 * t}
    turning = {"wx": 0.0 * t, "wy": 0.1 * swing, "wz": 0.0 * t}
    pl.DataFrame({"t": t, **moving, **turning}).write_csv(path)


LOGGED = {
    "motion.csv": by(f"{EXCITE} quadrupteron --out motion.csv"),
    "log.csv": by("pteron simulate quadrupteron --cycle motion.csv --out log.csv"),
    "held-out-log.csv": by(
        "pteron simulate quadrupteron --cycle motion-held-out.csv --out held-out-log.csv"
    ),
}
"""A motion and logs of it, for pages whose search of a minute is not run."""


GIVEN: dict[str, dict[str, Maker]] = {
    "docs/start/tour.md": LOGGED,
    "docs/identification.md": {"scope.csv": scope_export, **LOGGED},
    "docs/how-to/calibrate-a-printer.md": {
        "printer.cfg": printer_cfg,
        "loose.toml": block("# loose.toml"),
    },
    "docs/how-to/from-a-task-to-a-machine.md": {
        "machines/linear-delta.toml": by(
            "pteron new linear-delta --out machines/linear-delta.toml"
        ),
        "machines/linear-delta-cycle.csv": by(
            "pteron cycle machines/linear-delta.toml --out machines/linear-delta-cycle.csv"
        ),
    },
    "docs/how-to/motion-simulators.md": {"drive.csv": flight},
    "docs/how-to/payloads-and-tools.md": {
        "robot.toml": with_gripper,
        "motion.csv": by(f"{EXCITE} robot.toml --out motion.csv"),
        "without.csv": by("pteron simulate robot.toml --cycle motion.csv --out without.csv"),
        "with.csv": by(
            "pteron simulate robot.toml --cycle motion.csv --payload 0.35@0.01,0,0@2e-4 "
            "--out with.csv"
        ),
    },
    "docs/how-to/platforms-that-tilt.md": {
        "flight.csv": flight,
        "simulator.toml": by("pteron new stewart --out simulator.toml"),
    },
    "docs/play.md": {
        "motion.csv": by("pteron cycle quadrupteron --out motion.csv"),
        "far.csv": far_motion,
        "robot.toml": by("pteron new delta --out robot.toml"),
        "log.csv": by("pteron simulate robot.toml --out log.csv"),
    },
    "docs/plots.md": {
        "robot.toml": by("pteron new delta --out robot.toml"),
        "motion.csv": by("pteron cycle robot.toml --out motion.csv"),
    },
    "docs/simulation.md": {
        "robot.toml": by("pteron new delta --out robot.toml"),
        "drawing.toml": by("pteron new delta --out drawing.toml"),
        "motion.csv": by("pteron cycle quadrupteron --out motion.csv"),
    },
    "docs/sizing.md": {
        "robot.toml": by("pteron new delta --out robot.toml"),
        "motors.csv": block("name,rotor_inertia"),
        "pick.csv": by("pteron cycle robot.toml --out pick.csv"),
        "home.csv": by("pteron cycle robot.toml --out home.csv"),
    },
}
"""By page the files that its commands read and that none of them writes, in the order of making."""


EXIT_CODES = {
    r"pteron workspace quadrupteron --prove x=0:0\.2,.*": (1, "not proved, as the page says"),
}
"""Commands that end with another code than 0, or 2 after `Error:`."""


TOLERANCES: dict[str, tuple[Tolerance, ...]] = {
    r"pteron workspace quadrupteron --certify.*": (
        Tolerance(0.005, "proved bounds depend on where the paving stops", "Proved volume"),
        Tolerance(0.1, "boxes that are left when the paving stops", "boxes inside"),
        Tolerance(0.1, "shares of the boxes that are left when the paving stops", "%"),
    ),
    r"pteron identify simulated\.csv .*": (
        Tolerance(0.2, "the search for the motion is ended by the clock", "held-out data"),
    ),
    r"pteron identify without\.csv .*": (
        Tolerance(0.2, "what the model misses where forces are held for a sample", "held-out"),
        Tolerance(1e-5, "what rounding and the search leave of values without noise"),
    ),
    r"pteron inverse delta 0 0 -0\.9": (Tolerance(1e-9, "the last digits are the processor's"),),
    r"pteron size quadrupteron .*": (
        Tolerance(0.02, "a search over places ends within 2 % of the worst"),
    ),
    r"python examples/identify\.py": (
        Tolerance(0.02, "estimates of iterations; 2 % is far below their intervals"),
    ),
    r"python benchmarks/control\.py": (
        Tolerance(0.05, "distances of a simulation that learns, which amplifies rounding"),
    ),
    r"python benchmarks/time_optimal\.py": (
        Tolerance(0.005, "linear programs on a grid; what is slowed between samples differs"),
    ),
    r"python benchmarks/fmu\.py": (
        Tolerance(1e3, "rounding of two integrators that agree: its size is what is shown"),
    ),
}
"""By pattern of the command; the reason stands in each."""


def entry(table: dict[str, object], command: str) -> object:
    """Return a table's entry for a command, None if there is none."""
    words = shlex.join(shlex.split(command))
    return next((value for p, value in table.items() if re.fullmatch(p, words)), None)


def run_page(name: str, folder: Path) -> dict[str, str]:
    """Run a page's commands in a folder, compare what they print, and return it."""
    for shared in ("benchmarks", "docs", "examples"):
        (folder / shared).symlink_to(ROOT / shared)
    printed: dict[str, str] = {}
    for step in steps(name, TEXTS[name]):
        if entry(NOT_RUN, step.command):
            continue
        for file in (word for word in step.words if word in GIVEN.get(name, {})):
            make_given(name, folder / file)
        where = f"{name}:{step.line}: {step.command}"
        code, output = run(step, folder)
        shown = "\n".join(step.shown)
        expected = entry(EXIT_CODES, step.command)
        wanted = expected[0] if expected else 2 if shown.startswith("Error:") else 0
        assert code == wanted, f"{where}\n{output}"
        if shown:
            other = difference(shown, output, entry(TOLERANCES, step.command) or ())
            assert not other, f"{where}\n{other}\n{output}"
        printed[step.command] = output
    return printed


def make_given(name: str, path: Path) -> None:
    """Make a file that a page takes for granted, and those before it in its table."""
    for file, make in GIVEN[name].items():
        target = path.with_name(Path(file).name)
        if not target.exists():
            target.parent.mkdir(parents=True, exist_ok=True)
            make(target, TEXTS[name])
        if target == path:
            return
