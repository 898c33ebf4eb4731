"""Energy: the balance of free motion, and the energy that the drives give over a sized cycle.

Free motion: 100 random states move without drives by fourth-order steps of 0.1 ms, until a leg's
reach margin falls below 5 % of its size. Sizing: from rest to the middle of a pick-and-place cycle,
what the drives give is stored or lost to friction; the error falls with the number of samples.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
from measuring import Array, quick

import pteron
from pteron.kernels import numeric
from pteron.motion import Motion, Sizing, advance, pick_and_place, size
from pteron.workspace import home_pose

FREE = ("quadrupteron", "tripteron", "delta", "par4", "five-bar")
SIZED = ("quadrupteron-oblique", "par4", "five-bar")
SAMPLES = (51, 101, 201, 401, 801)
STEP, EACH, LONGEST = 1e-4, 10, 2.0
"""s of a step; steps between two looks; s."""

SPEED = 0.5
"""Standard deviation of the initial velocities, m/s and rad/s."""

MARGIN = 0.05
GOAL = 1e-9
"""Greatest error, as a share of the largest kinetic energy."""


def main() -> None:
    """Print both tables."""
    count = 10 if quick() else 100
    print(f"free motion from {count} random states, steps of {STEP:g} s")
    worst = 0.0
    for name in FREE[:2] if quick() else FREE:
        error, longest = kept(pteron.load(name), count)
        worst = max(worst, error)
        print(f"{name:<22} within {error:.1e} of the largest kinetic energy; up to {longest:.2f} s")
    print("\na cycle's first quarter: energy of the drives unaccounted for, as a share of it")
    samples = SAMPLES[:3] if quick() else SAMPLES
    print(f"{'samples of the cycle':<22}" + "".join(f"{k:>9}" for k in samples))
    for name in SIZED[:1] if quick() else SIZED:
        robot = driven(pteron.load(name))
        print(f"{name:<22}" + "".join(f"{unaccounted(robot, k):>9.1e}" for k in samples))
    if not worst < GOAL:
        sys.exit(f"energy is kept within {worst:.1e}, and {GOAL:.0e} is wanted")


def kept(robot: pteron.Manipulator, count: int) -> tuple[float, float]:
    """Return the largest change of energy, over the largest kinetic one, and the longest run, s."""
    pose = pteron.random_poses(robot, count, seed=0)
    velocity = SPEED * np.random.default_rng(0).normal(size=pose.shape)
    kinetic, potential = energies(robot, pose, velocity)
    start, most = kinetic + potential, kinetic
    worst, alive, time, longest = np.zeros(count), np.ones(count, bool), 0.0, 0.0
    least = MARGIN * np.array([leg.size for leg in robot.legs])
    nothing = np.zeros((count, robot.freedom))
    while alive.any() and time < LONGEST:
        then, speed, _, well = advance(robot, pose, velocity, nothing, STEP, EACH)
        time += STEP * EACH
        margin = numeric(robot, "reach")(then)[0]
        alive &= well & (margin > least).all(axis=1)
        pose = np.where(alive[:, None], then, pose)
        velocity = np.where(alive[:, None], speed, velocity)
        kinetic, potential = energies(robot, pose, velocity)
        most = np.maximum(most, kinetic)
        worst = np.where(alive, np.maximum(worst, np.abs(kinetic + potential - start)), worst)
        longest = time if alive.any() else longest
    return float((worst / most).max()), longest


def energies(robot: pteron.Manipulator, pose: Array, velocity: Array) -> tuple[Array, Array]:
    """Return the kinetic and the potential energy of each state, J."""
    return (
        np.asarray(pteron.kinetic_energy(robot, pose, velocity)),
        np.asarray(pteron.potential_energy(robot, pose)),
    )


def driven(robot: pteron.Manipulator) -> pteron.Manipulator:
    """Return the machine with friction and a motor's inertia in every drive."""
    drive = pteron.legs.Drive(
        coulomb=1.0, viscous=2.0, rotor_inertia=3e-5, ratio=50.0, rest_speed=0.05
    )
    return replace(robot, legs=tuple(replace(leg, drive=drive) for leg in robot.legs))


def unaccounted(robot: pteron.Manipulator, samples: int) -> float:
    """Return the share of the energy given that is neither stored nor lost to friction."""
    whole = pick_and_place(robot, home_pose(robot), samples=samples, scale=0.2)
    half = slice(0, samples // 4 + 1)
    parts = (whole.time, whole.pose, whole.velocity, whole.acceleration)
    motion = Motion(*(part[half] for part in parts))
    found = size(robot, motion)
    rotors = (0.5 * found.rotor_inertia * found.speeds[::2] ** 2).sum(axis=1)
    total = sum(energies(robot, motion.pose, motion.velocity)) + rotors
    lost = sum(friction(found, i) for i in range(len(robot.legs)))
    balance = float(found.energy.sum()) - float(total[-1] - total[0]) - lost
    return abs(balance) / float(found.given_energy.sum())


def friction(found: Sizing, leg: int) -> float:
    """Return what a drive's friction takes, J."""
    drive, speed = found.drives[leg], found.speeds[:, leg]
    force = drive.coulomb * np.tanh(speed / drive.rest_speed) + drive.viscous * speed
    return float(found.integral(force * speed))


if __name__ == "__main__":
    main()
