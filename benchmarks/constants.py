"""Constants of the sources, a third and three times as large: which of them change a result.

    python benchmarks/constants.py [FOLDER ...] [--jobs N] [--names PART] [--quick]

The value of each numerical constant of a module, and of every module that imports it, is scaled in
a process of its own, which then runs the task of its folder: identifications and calibrations of
simulated logs, home poses, direct kinematics, motions. A share between a half and 1 has its
distance from 1 scaled instead. Printed are the constants that change a grade, a cause, or a number
by more than its stated tolerance, or that make a task fail: each of them must state the reason for
its value.
"""

from __future__ import annotations

import argparse
import ast
import os
import pickle
import sys
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import numpy as np

import pteron

_ROOT = Path(__file__).resolve().parents[1]
_SOURCES = _ROOT / "src" / "pteron"
sys.path[:0] = [str(_ROOT / "tests"), str(_ROOT / "benchmarks" / "identification")]

FACTORS = (1.0 / 3.0, 3.0)
_LARGEST_COUNT = 10_000
"""Larger integers are sizes of memory and primes, which no result depends on."""

Lines = tuple[str, ...]
"""The results of a task: grades, causes and rounded numbers."""


@dataclass(frozen=True)
class Constant:
    """A number at the top level of a module."""

    module: str
    name: str
    number: float

    def scaled(self, factor: float) -> float:
        """Return the value times a factor; of a share near 1, the distance from 1 is scaled."""
        if isinstance(self.number, int):
            return max(1, round(self.number * factor))
        if 0.5 < self.number < 1.0:
            return 1.0 - min((1.0 - self.number) * factor, 0.5)
        return self.number * factor

    def put(self, number: float) -> None:
        """Set the constant, in its module and wherever it has been imported."""
        home = import_module(self.module)
        for module in [*sys.modules.values()]:
            if module is home or (
                getattr(module, "__name__", "").startswith("pteron.")
                and module.__dict__.get(self.name) is home.__dict__[self.name]
            ):
                module.__dict__[self.name] = number


def constants(folder: str) -> Iterator[Constant]:
    """Yield the numbers that a folder's modules name in capitals."""
    for path in sorted((_SOURCES / folder).rglob("*.py")):
        module = ".".join(path.relative_to(_SOURCES.parent).with_suffix("").parts)
        for node in ast.parse(path.read_text()).body:
            if not (isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)):
                continue
            name = node.targets[0].id
            if not name.isupper() or isinstance(node.value, ast.Call | ast.Dict | ast.Tuple):
                continue
            number = getattr(import_module(module), name)
            if isinstance(number, bool) or not isinstance(number, int | float) or not number:
                continue
            if not (isinstance(number, int) and (abs(number) > _LARGEST_COUNT or number < 3)):
                yield Constant(module, name, number)


def _rounded(number: float, tolerance: float) -> str:
    """Return the number of a grid whose steps are as large as the tolerance, a share."""
    return "0" if not number else f"{np.sign(number):.0f} {round(np.log(abs(number)) / tolerance)}"


def identifications() -> Lines:
    """Return grades and causes of logs of two plants: faultless, and with two faults."""
    from own_plants import row_of

    cases = [("five-bar", "none"), ("five-bar", "sign"), ("linear-delta", "zero off")]
    rows = [row_of(name, fault, 1, follow=False) for name, fault in cases]
    return tuple(f"{row.fault}: {row.answer.grade}, right {row.right}" for row in rows)


def calibrations() -> Lines:
    """Return grades and named causes of five logs of calibration."""
    from calibration_faults import judged

    cases = [
        ("printer by heights", "none"),
        ("printer by heights", "swapped"),
        ("cranks by positions", "none"),
        ("cranks by positions", "half the lead"),
        ("cranks by positions", "row 195 mm off"),
    ]
    lines = []
    for case, fault in cases:
        grade, named, error = judged(case, fault, 0) or ("", False, 0.0)
        lines.append(f"{case}, {fault}: {grade}, named {named}, within {error < 1.0}")
    return tuple(lines)


def workspaces() -> Lines:
    """Return home poses, of a machine of each kind, and volumes."""
    from pteron.workspace import home_pose, reach_volume

    names = ("quadrupteron", "delta", "3-rrr", "stewart", "sprint-z3", "agile-wrist")
    known = [name for name in names if name in pteron.catalog()]
    lines = [f"{name}: {home_pose(name).round(3).tolist()}" for name in known]
    volume = reach_volume("delta", home_pose("delta")).volume
    return (*lines, f"volume of the Delta {_rounded(volume, 0.01)}")


def kinematics() -> Lines:
    """Return numbers of assembly modes, verdicts of architectures, and the error of poses."""
    lines = []
    for name, pose in (("3-rrr", [0.02, -0.04, 0.29]), ("delta", [0.05, 0.02, -0.9])):
        joints = pteron.inverse_kinematics(name, pose)
        poses = pteron.direct_kinematics(name, joints, all_branches=True)
        error = np.nanmin(np.abs(poses - pose).max(axis=-1))
        lines.append(f"{name}: {np.isfinite(poses[:, 0]).sum()} modes, exact {error < 1e-9}")
        layout = pteron.kinematics.architecture(name)
        lines.append(f"singular {layout.singular}, holds {layout.holds}, {layout.proof}")
    return tuple(lines)


def motions() -> Lines:
    """Return durations of motions, a bandwidth and loads of drives, to 5 %."""
    from pteron.motion import limits_of, line_path, pick_and_place, size, time_optimal, tune

    corners = [[0.0, 0.0, 0.0], [0.1, 0.05, 0.0], [0.1, 0.0, 0.1]]
    path = line_path("tripteron", corners, 0.02)
    cycle = pick_and_place("delta", [0.0, 0.0, -0.9])
    numbers = {
        "cycle": cycle.time[-1],
        "time optimal": time_optimal(
            "tripteron", path, limits_of("tripteron", force=60.0, speed=1.0)
        ).duration,
        "bandwidth": tune("five-bar").controller.bandwidth,
        "peak force": float(np.abs(size("delta", cycle).forces).max()),
    }
    return tuple(f"{name} {_rounded(number, 0.05)}" for name, number in numbers.items())


TASKS: dict[str, Callable[[], Lines]] = {
    "identification": identifications,
    "calibration": calibrations,
    "workspace": workspaces,
    "kinematics": kinematics,
    "motion": motions,
}


def results(task: Callable[[], Lines], constant: Constant | None, factor: float) -> Lines:
    """Return a task's results in a process of its own, with a constant scaled by a factor."""
    read, write = os.pipe()
    if not (child := os.fork()):
        try:
            warnings.simplefilter("ignore")
            if constant is not None:
                constant.put(constant.scaled(factor))
            lines = task()
        except BaseException as error:  # it is the result
            lines = (f"{type(error).__name__}: {error}"[:200],)
        os.write(write, pickle.dumps(lines))
        os._exit(0)
    os.close(write)
    with os.fdopen(read, "rb") as pipe:
        content = pipe.read()
    os.waitpid(child, 0)
    return tuple(pickle.loads(content)) if content else ("the process ended",)


def deciding(folder: str, part: str = "", jobs: int = 1) -> Iterator[tuple[Constant, float, str]]:
    """Yield constants of a folder that change a result, with the factor and the first change."""
    task = TASKS[folder]
    usual = results(task, None, 1.0)
    print(folder, *usual, sep="\n    ")
    cases = [
        (constant, factor)
        for constant in constants(folder)
        if part in f"{constant.module}.{constant.name}"
        for factor in FACTORS
    ]
    with ThreadPoolExecutor(jobs) as pool:
        scaled = pool.map(lambda case: results(task, *case), cases)
        for (constant, factor), lines in zip(cases, scaled, strict=True):
            for old, new in zip(usual, (*lines, *[""] * len(usual)), strict=False):
                if old != new:
                    yield constant, factor, new
                    break


def main() -> None:
    """Print the constants that change a result, and their numbers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="*", default=[*TASKS])
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--names", default="", help="of constants: those that contain this")
    parser.add_argument("--quick", action="store_true")
    options = parser.parse_args()
    folders = ["kinematics"] if options.quick else options.folders
    for folder in folders:
        count, names = len([*constants(folder)]), set()
        for constant, factor, line in deciding(folder, options.names, options.jobs):
            names.add((constant.module, constant.name))
            print(
                f"  {constant.module}.{constant.name} = {constant.number:g} x {factor:.2g}: {line}"
            )
            sys.stdout.flush()
        print(f"{folder}: {len(names)} of {count} constants change a result")


if __name__ == "__main__":
    main()
