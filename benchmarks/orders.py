"""Simulation: how fast each integrator's error falls with its step, smooth and at transitions.

A Delta moves under forces that stay; the error is that of its joints at the end, against steps
sixty-four times as short, and the order that of the steepest line through all steps in a double
logarithmic plot (least squares): at a transition it varies from step to step.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from measuring import Array, quick

import pteron
from pteron.legs import Elastic, LuGre
from pteron.motion import simulate
from pteron.workspace import home_pose


def _soft(elastic: Elastic) -> pteron.legs.Drive:
    return pteron.legs.Drive(rotor_inertia=INERTIA, elastic=elastic)


INERTIA = 0.02
"""Of the rotors, kg m^2."""

HARD = Elastic(3e3, 0.0, backlash=2e-3)
CASES = {
    "rk4, no friction": (pteron.legs.Drive(), 0.1, 2e-2, (3.5, 4.6)),
    "rk4, joints slide": (pteron.legs.Drive(coulomb=2.0, viscous=1.0), 3.0, 1e-2, (3.5, 4.6)),
    "rk4, joints stop": (pteron.legs.Drive(coulomb=8.0, viscous=1.0), 0.0, 5e-3, (1.2, 3.0)),
    "rk4, bristles": (pteron.legs.Drive(coulomb=8.0, lugre=LuGre(2e3, 5.0)), 0.0, 2e-3, (1.0, 4.6)),
    "rk4, elastic": (_soft(replace(HARD, backlash=0.0)), 1.0, 2e-3, (3.5, 4.6)),
    "rk4, impacts": (_soft(HARD), -20.0, 2e-3, (1.5, 4.6)),
    "rk4, impacts, damped": (_soft(replace(HARD, damping=4.0)), -20.0, 2e-3, (0.7, 3.0)),
}
"""Drives, their push over what holds the machine (N m), the longest step (s), and the orders that
are expected."""


def main() -> None:
    """Print a row a case."""
    shares = np.geomspace(1.0, 8.0, 3 if quick() else 10)
    print(f"{'order':<24}{'found':>8}{'expected':>14}{'error at the longest step (rad)':>34}")
    for name, (drive, push, longest, (least, most)) in CASES.items():
        robot = pteron.load("delta")
        drive = replace(drive, rotor_inertia=INERTIA)
        robot = replace(robot, legs=tuple(replace(leg, drive=drive) for leg in robot.legs))
        steps = longest / shares
        _row(name, steps, _errors(robot, push, steps), least, most)
    _row("dop853, no friction", *_dop853(), 7.0, 10.0)


def _row(name: str, steps: Array, errors: Array, least: float, most: float) -> None:
    order = float(np.polyfit(np.log(steps), np.log(errors), 1)[0])
    print(f"{name:<24}{order:>8.2f}{f'{least:g} to {most:g}':>14}{errors[0]:>34.1e}", flush=True)
    if not quick() and not least <= order <= most:
        raise SystemExit(f"{name}: an order of {least:g} to {most:g} expected")


def _start(robot: pteron.Manipulator) -> tuple[tuple[Array, Array], Array]:
    home, rest = home_pose(robot), np.zeros(3)
    fast = np.linalg.solve(pteron.jacobian(robot, home), [0.5, 0.3, -0.4])
    return (home, fast), pteron.inverse_dynamics(robot, home, rest, rest)


def _errors(robot: pteron.Manipulator, push: float, steps: Array) -> Array:
    start, holding = _start(robot)
    given: dict[str, Any] = {
        "start": start,
        "forces": holding + push * np.array([1.0, 1.0, -1.0]),
        "duration": 0.1,
        "period": 0.1,
    }

    exact = simulate(robot, step=float(steps[-1]) / 64.0, **given).joints[-1]
    found = [simulate(robot, step=float(step), **given).joints[-1] for step in steps]
    return np.array([np.abs(one - exact).max() for one in found])


def _dop853() -> tuple[Array, Array]:
    """Return steps and errors: one step a sample, as no tolerance asks for more."""
    robot, steps = pteron.load("delta"), 0.16 / np.array([1.0, 2.0, 3.0])
    start, holding = _start(robot)
    given: dict[str, Any] = {"start": start, "forces": holding + 0.1, "duration": 0.16}
    given["method"] = "dop853"
    exact = simulate(robot, period=0.01, tolerance=1e-13, **given).joints[-1]
    found = [simulate(robot, period=h, tolerance=1e6, **given).joints[-1] for h in steps.tolist()]
    return steps, np.array([np.abs(one - exact).max() for one in found])


if __name__ == "__main__":
    main()
