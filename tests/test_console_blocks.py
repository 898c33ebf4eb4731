"""Every command that a page shows runs, a page's commands in order, and prints what is shown.

`console_blocks` tells how a page is read and how outputs are compared. A command that is not run is
in `NOT_RUN`, with the reason and the test that runs it otherwise; what a page takes for granted is
made by `GIVEN`; a tolerance other than that of the last digit is in `TOLERANCES`. docs/from-log-to-
controller.md runs in test_walk.py, where its files are then used.
"""

from __future__ import annotations

import re
import shlex
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from console_blocks import ROOT, Step, Tolerance, blocks, difference, run, steps
from mechanisms import CLIENTS
from test_documents import TEXTS

import pteron
from pteron.kernels.c import compiler

# Commands that are not run.

NOT_RUN = {
    r"pteron view .*": ("stays open until it is ended", "test_viewer.py"),
    r"make .*": ("builds in the clone", "test_release.py"),
    r"pip install .*": ("changes the environment", "installed/matrix.py"),
    r"jupyter .*": ("stays open until it is ended", "test_notebooks.py"),
    r"python docs/notebooks/run\.py": ("takes minutes", "test_notebooks.py"),
    r"halcompile .*": ("is a part of LinuxCNC", "test_tilting_exports.py"),
    r"python benchmarks/genhexkins\.py .*": ("loads LinuxCNC's module", "test_tilting_exports.py"),
    r"python benchmarks/mujoco_convergence\.py": ("takes minutes", "test_benchmarks.py"),
    r"python benchmarks/environment\.py": ("prints times alone", "test_benchmarks.py"),
    r"pteron design .*": ("searches for minutes", "test_design.py"),
    r"pteron choose .*": ("searches for minutes", "test_choosing.py"),
    r"pteron excite (?!.*--seconds).*": (
        "searches for a minute",
        "test_excitation_files.py",
    ),
    r"pteron workspace .* --points 400 .*": ("64 million poses", "test_map_files.py"),
}
"""Patterns of commands, why they are not run, and where they are run otherwise."""


# What a page takes for granted.

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
        "machines/linear-delta.toml": by("pteron new linear-delta --out machines/linear-delta.toml")
    },
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


# Outputs.

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
        Tolerance(0.2, "the search for the motion is ended by the clock", "held-out error"),
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
        target = path.with_name(file) if "/" not in file else path
        if not target.exists():
            target.parent.mkdir(parents=True, exist_ok=True)
            make(target, TEXTS[name])
        if target == path:
            return


ELSEWHERE = {"docs/from-log-to-controller.md": "test_walk.py"}
"""Pages whose commands run in another test, by `run_page` too."""

WITH_COMMANDS = [name for name, text in TEXTS.items() if steps(name, text)]


@CLIENTS
@pytest.mark.parametrize("name", [name for name in WITH_COMMANDS if name not in ELSEWHERE])
def test_commands_run_and_print_what_is_shown(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run_page(name, tmp_path)


PAGE = """
    # a remark
    pteron new delta \\
        --out robot.toml
    .venv/bin/pteron check robot.toml    # another remark

A file:

    name = "no console"

```console
$ pteron inverse delta 0 0 -0.9
x,y,z
0.12,-3.40e-05,7

done ...
```

    $ cp a b
"""


def test_blocks_are_read():
    found = steps("page", PAGE)
    assert [(step.line, step.command) for step in found] == [
        (3, "pteron new delta --out robot.toml"),
        (5, "pteron check robot.toml"),
        (12, "pteron inverse delta 0 0 -0.9"),
        (19, "cp a b"),
    ]
    assert [step.shown for step in found] == [
        (),
        (),
        ("x,y,z", "0.12,-3.40e-05,7", "done ..."),
        (),
    ]


@pytest.mark.parametrize(
    ("shown", "printed", "differs"),
    [
        ("a 0.12 b", "a 0.13\nb", ""),
        ("a 0.12 b", "a 0.14 b", "shown '0.12', printed '0.14'"),
        ("leg 2: 5 boxes", "leg 3: 5 boxes", "shown '2:', printed '3:'"),
        ("at most 3.4e-05", "at most 3.5e-05", ""),
        ("at most 3.4e-05", "at most 3.4e-06", "printed '3.4e-06'"),
        ("-0.01 m", "0.01 m", "printed '0.01'"),
        ("a ... z", "a b c z", ""),
        ("a ... z", "a b c", "shown 'z'"),
        ("a\n...\nk 1.0\n...", "a b k 1.1 c d", ""),
        ("a (y = ..., 2.0)", "a (y = 17.3, 2.1)", ""),
        ("a (y = ..., 2.0)", "a (y = 17.3, 2.4)", "shown '2.0)'"),
        ("a", "a b", "more is printed: b"),
        ("a b", "a", "no more is printed"),
        ("──── 1", "────── 1", ""),
    ],
)
def test_outputs_are_compared(shown, printed, differs):
    found = difference(shown, printed)
    assert differs in found
    assert bool(found) == bool(differs)


def test_a_tolerance_holds_on_its_lines_alone():
    table = (Tolerance(0.1, "an example", "^volume"),)
    assert difference("volume 100 m\ncount 10", "volume 109 m\ncount 10", table) == ""
    assert difference("volume 100 m\ncount 10", "volume 109 m\ncount 11", table)
    assert difference("volume 100 m", "volume 111 m", table)


@CLIENTS
def test_code_for_a_payload_is_that_of_the_exported_header(tmp_path, monkeypatch):
    """The lines of C on the page compile against what the page's command writes."""
    name = "docs/how-to/payloads-and-tools.md"
    if compiler() is None:
        pytest.skip("no C compiler")
    monkeypatch.chdir(tmp_path)
    make_given(name, tmp_path / "robot.toml")
    assert run(Step(name, 0, "pteron export robot.toml --c controller"), tmp_path)[0] == 0
    tool, found = (
        "\n".join(lines) for _, language, lines in blocks(TEXTS[name]) if language == "c"
    )
    start = '#include "my_robot.h"\nvoid carry(const double pose[4], const double velocity[4],'
    start += "const double acceleration[4], double forces[4])\n{\n"
    (tmp_path / "lines.c").write_text(f"{start}{tool}\n{found}\n}}\n", encoding="utf-8")
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "-Icontroller"]
    done = subprocess.run([*compiler(), *flags, "lines.c"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (size,) = re.findall(r"double loaded\[(\d+)\]", tool)
    assert int(size) == len(pteron.parameters(pteron.load("robot.toml")))


def test_tables_name_commands_that_are_shown_and_tests_that_are_there():
    every = [step.command for name in WITH_COMMANDS for step in steps(name, TEXTS[name])]
    for table in (NOT_RUN, EXIT_CODES, TOLERANCES):
        for pattern in table:
            assert any(entry({pattern: True}, command) for command in every), pattern
    for reason, test in NOT_RUN.values():
        assert reason
        assert (ROOT / "tests" / test).is_file(), test
    assert all(t.reason for row in TOLERANCES.values() for t in row)
    for name, files in GIVEN.items():
        words = {word for step in steps(name, TEXTS[name]) for word in step.words}
        assert set(files) <= words, name
