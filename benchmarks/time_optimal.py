"""The time-optimal cycle keeps every limit between its samples, and is never slower than others.

For each machine of the catalog, with drives that have friction and rotors, force limits a third
above what the pick-and-place cycle at 10 m/s^2 takes, and speed limits likewise: the durations of
the cycle slowed as a whole until it keeps them, of one quintic along its way and another back, of
the time-optimal motion along the same way, and its bound, where the acceleration may jump.
The share is the largest of any limit at ten times as many samples, by the public functions.
`--quick` takes two machines.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
from measuring import catalog, quick

import pteron
from pteron.motion import (
    Motion,
    MotionLimits,
    cycle_path,
    limits_of,
    pick_and_place,
    polynomial_motion,
    shortest,
    time_optimal,
)
from pteron.workspace import home_pose

_FINER = 10


def main() -> None:
    """Print the durations of each machine's cycles, and the largest share of a limit."""
    print(
        f"{'':<22}{'cycle':>8}{'quintic':>9}{'optimal':>9}{'bound':>9}{'saved':>7}"
        f"{'share of limits':>17}"
    )
    saved, searches = [], []
    for name in ["tripteron", "3-rrr"] if quick() else catalog():
        robot = driven(pteron.load(name))
        found = pick_and_place(robot, home_pose(robot))
        rates, forces = sizes(robot, found)
        limits = limits_of(robot, speed=4.0 / 3.0 * rates + 0.1, force=4.0 / 3.0 * forces)
        path = cycle_path(found)
        slowed = shortest(robot, found.cycle.at, limits)
        quintic = polynomial_motion(robot, path, limits=limits)
        begin = time.perf_counter()
        fastest = time_optimal(robot, path, limits)
        took = time.perf_counter() - begin
        share = used(robot, fastest, limits)
        best = min(slowed.duration, quintic.duration)
        print(
            f"{name:<22}{slowed.duration:>6.3f} s{quintic.duration:>7.3f} s"
            f"{fastest.duration:>7.3f} s{fastest.bound:>7.3f} s{1 - fastest.duration / best:>7.0%}"
            f"{share:>17.5f}",
            flush=True,
        )
        assert share <= 1.0 + 1e-8, name
        assert fastest.duration <= best, name
        saved.append(1 - fastest.duration / best)
        searches.append(took)
    print(f"{len(saved)} machines: {min(saved):.0%} to {max(saved):.0%} saved")
    print(f"A search takes {min(searches):.2f} to {max(searches):.2f} s.")


def driven(robot: pteron.Manipulator) -> pteron.Manipulator:
    """Return a machine whose drives have friction and rotors, by what holds it at home."""
    home, still = home_pose(robot), np.zeros(robot.freedom)
    held = np.abs(pteron.inverse_dynamics(robot, home, still, still))
    largest = max(float(held.max()), 1.0)  # in a level plane nothing is held
    drive = pteron.legs.Drive(coulomb=0.03 * largest, viscous=0.05 * largest, rotor_inertia=1e-5)
    return replace(robot, legs=tuple(replace(leg, drive=drive) for leg in robot.legs))


def sizes(robot: pteron.Manipulator, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest speeds and forces (n,) of a motion, between its samples too."""
    fine = motion.at(np.linspace(0.0, motion.duration, _FINER * (len(motion.time) - 1) + 1))
    rates = pteron.kinematics.joint_rates(robot, *fine[:2]).actuated
    forces = pteron.drive_forces(robot, *fine)
    return np.abs(rates).max(axis=0), np.abs(forces).max(axis=0)


def used(robot: pteron.Manipulator, motion: Motion, limits: MotionLimits) -> float:
    """Return the largest share of a limit that a motion takes."""
    rates, forces = sizes(robot, motion)
    return float(max((rates / limits.speed).max(), (forces / limits.force).max()))


if __name__ == "__main__":
    main()
