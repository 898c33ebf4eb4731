"""An optimised excitation has a condition number at least five times lower than random ones.

Of the base regressor of the catalog's Quadrupteron with columns of length 1, against the best of
100 random Fourier motions: the same harmonics, period and limits, each as large as these allow.
In under two minutes on two cores, and without violating a limit at a ten times finer sampling. The
other machines of the catalog follow. `--quick` takes little time, and proves nothing.
"""

from __future__ import annotations

import os
import platform
import time

import casadi
import numpy as np
from measuring import catalog, quick

import pteron
from pteron.identification.excitation import Excitation, Limits, margins, optimal_excitation

_FINE = 40_000
"""Samples of the period at which the limits are looked at again; the search looks at 4000."""


def main() -> None:
    """Print the claim's figures, then those of the other machines."""
    print(
        f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores, Python "
        f"{platform.python_version()}, NumPy {np.__version__}, CasADi {casadi.__version__}"
    )
    names = ["quadrupteron", *(n for n in catalog() if n != "quadrupteron")]
    for name in names[:1] if quick() else names:
        _print(name, *_excited(name, 5.0 if quick() else 90.0 if name == names[0] else 30.0))


def _excited(name: str, seconds: float) -> tuple[Excitation, float]:
    robot = pteron.load(name)
    base = pteron.base_parameters(robot)
    begin = time.perf_counter()
    found = optimal_excitation(robot, base=base, limits=Limits(), seconds=seconds, workers=2)
    return found, time.perf_counter() - begin


def _print(name: str, found: Excitation, seconds: float) -> None:
    best, random = found.conditioning, found.random
    print(
        f"\n{name}: {seconds:.0f} s, {found.motion.harmonics} harmonics in "
        f"{found.motion.period:g} s",
        end="",
    )
    print(f"\n{'condition number, columns':<28}{'optimised':>12}{'random':>12}{'ratio':>8}")
    for scaling, one, other in (
        ("of length 1", best.scaled, random.scaled),
        ("times nominal values", best.nominal, random.nominal),
        ("in SI units", best.unscaled, random.unscaled),
    ):
        print(f"{scaling:<28}{one:>12.1f}{other:>12.1f}{other / one:>8.2f}")
    fine = margins(found.motion, found.limits, _FINE)
    print(f"random: the best of {found.draws} by the first line")
    print(f"limits kept at {_FINE} samples: {fine.kept}; least margins", end="")
    print(", ".join(f" {m.limit} {m.least:.2g} {m.unit}".rstrip() for m in fine))


if __name__ == "__main__":
    main()
