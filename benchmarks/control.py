"""Computed torque tracks the pick-and-place cycle to micrometres; adaptive control learns masses.

The cycle is the standard one, 25, 305 and 25 mm where that fits, at up to 10 m/s^2. The machine is
integrated by Runge and Kutta's method, a step a sample, with forces held for the period. Computed
torque has the true model; its largest distance from the path is printed at 1 kHz and at 4 kHz. Then
each body's parameters are off by 20 %, up or down at random, and Slotine and Li's law is given the
cycle ten times. Printed are the largest distances of its first and last cycle at 1 kHz, the ratio,
and how far the estimates went, as a share of the room they have; then the same with friction that
the model has wrong too. `--quick` takes one machine.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from measuring import Array, quick

import pteron
from pteron.controllers import Adaptive, ComputedTorque, Controller, Law, joint_masses
from pteron.kernels import numeric
from pteron.motion import Motion, pick_and_place
from pteron.workspace import home_pose

_MACHINES = ("quadrupteron", "quadrupteron-oblique", "delta", "par4", "five-bar")

_CYCLES = 10


@dataclass(frozen=True)
class Run:
    """Distances from the path (T,), m, and the memories (T, K)."""

    distance: Array
    memories: Array


def main() -> None:
    """Print both tables."""
    names = _MACHINES[-1:] if quick() else _MACHINES
    cycles = {}
    for name in names:
        robot = pteron.load(name)
        cycles[name] = pick_and_place(robot, home_pose(robot), samples=4001)
    print("Computed torque, true model, default gains (bandwidth 0.1/period): largest distance, um")
    print(f"{'':<22}{'scale':>7}{'cycle s':>9}{'1 kHz':>9}{'4 kHz':>9}")
    distances = []
    for name, cycle in cycles.items():
        robot = pteron.load(name)
        found = [largest(robot, ComputedTorque(period), cycle) for period in (1e-3, 2.5e-4)]
        sizes = "".join(f"{1e6 * size:>9.3f}" for size in found)
        print(f"{name:<22}{cycle.scale:>7.3f}{cycle.duration:>9.3f}{sizes}", flush=True)
        assert found[0] < 5e-6, name
        assert found[1] < 1e-6, name
        distances.append(found)
    most = 1e6 * np.max(distances, axis=0)
    print(f"at most {most[0]:.2f} um at 1 kHz, {most[1]:.3f} um at 4 kHz")
    print("\nAdaptive control, every body off by 20 %, 1 kHz, default gains: largest distance, um")
    heading = f"{'seed':>5}{'1st cycle':>11}{'10th':>8}{'ratio':>7}{'room used':>11}"
    print(f"{'':<22}{heading}")
    ratios = []
    for name, cycle in cycles.items():
        robot = pteron.load(name)
        for seed in range(1 if quick() else 3):
            plant, controller = wrong(robot, seed), Adaptive(motion=cycle)
            ratios.append(learnt(name, seed, plant, controller, robot, cycle))
    print(f"ratios {min(ratios):.0f} to {max(ratios):.0f}")
    print(
        "\nThe same with drives, whose friction and rotors are half as large again as modelled, and"
    )
    print(f"{'are estimated too':<22}{heading}")
    for name, cycle in cycles.items():
        robot, heavier = (driven(pteron.load(name), share) for share in (1.0, 1.5))
        controller = Adaptive(motion=cycle, friction=True)
        learnt(name, 0, wrong(heavier, 0), controller, robot, cycle)


def learnt(
    name: str,
    seed: int,
    plant: pteron.Manipulator,
    controller: Adaptive,
    model: pteron.Manipulator,
    cycle: Motion,
) -> float:
    """Print a line of what adaptive control makes of ten cycles, and return the ratio."""
    law = controller.law(model)
    run = tracked(plant, law, cycle.repeat(_CYCLES), 1e-3)
    first, *_, last = (part.max() for part in np.array_split(run.distance, _CYCLES))
    count = law.estimates(run.memories[0]).size
    used = float(np.linalg.norm(run.memories[:, -count:], axis=-1).max() / law.gains[-1])
    sizes = f"{1e6 * first:>11.1f}{1e6 * last:>8.2f}{first / last:>7.0f}{used:>11.2f}"
    print(f"{name:<22}{seed:>5}{sizes}", flush=True)
    assert first > 10.0 * last, name
    assert used < 1.0, name
    return float(first / last)


def driven(robot: pteron.Manipulator, share: float) -> pteron.Manipulator:
    """Return a machine whose drives take a share of a tenth of its weight and of its masses."""
    home, still = home_pose(robot), np.zeros(robot.freedom)
    force = max(float(np.abs(pteron.inverse_dynamics(robot, home, still, still)).max()), 0.05)
    legs = [
        replace(
            leg,
            drive=pteron.legs.Drive(
                *(0.1 * share * force, 0.1 * share * force, 0.02 * share * force),
                rotor_inertia=0.1 * share * mass,
                rest_speed=0.01,
            ),
        )
        for leg, mass in zip(robot.legs, joint_masses(robot), strict=True)
    ]
    return replace(robot, legs=tuple(legs))


def largest(robot: pteron.Manipulator, controller: Controller, cycle: Motion) -> float:
    """Return the largest distance from the path under a controller that knows the machine, m."""
    return float(tracked(robot, controller.law(robot), cycle, controller.period).distance.max())


def wrong(robot: pteron.Manipulator, seed: int) -> pteron.Manipulator:
    """Return a machine whose bodies have all parameters off by 20 %, up or down at random."""
    rng, data = np.random.default_rng(seed), pteron.manipulator.parameter_data(robot)
    shares = {owner: 1 + 0.2 * rng.choice([-1, 1]) for owner in sorted({p.owner for p in data})}
    return pteron.with_parameters(robot, pteron.parameters(robot) * [shares[p.owner] for p in data])


def tracked(plant: pteron.Manipulator, law: Law, motion: Motion, period: float) -> Run:
    """Return how a machine goes along a motion under a law."""
    wanted = motion.at(period * np.arange(round(motion.duration / period)))
    pose, velocity = wanted[0][0], wanted[1][0]
    memory = law.memory(pose, velocity)
    poses, memories = [], []
    joints, rates = numeric(plant, "joint_coordinates"), numeric(plant, "joint_rates")
    for now in zip(*wanted, strict=True):
        poses.append(pose)
        forces, memory = law(*now, joints(pose)[0], rates(pose, velocity)[0], memory)
        memories.append(memory)
        pose, velocity = stepped(plant, pose, velocity, forces, period)
    lengths = plant.freedom - plant.platform.turns
    missed = (wanted[0] - np.array(poses))[:, :lengths]
    return Run(np.linalg.norm(missed, axis=-1), np.array(memories))


def stepped(
    robot: pteron.Manipulator, x: Array, v: Array, forces: Array, h: float
) -> tuple[Array, Array]:
    """Return the state after one step of Runge and Kutta's method."""
    slope = numeric(robot, "drive_accelerations")
    a = slope(x, v, forces)[0]
    b = slope(x + h / 2 * v, v + h / 2 * a, forces)[0]
    c = slope(x + h / 2 * v + h**2 / 4 * a, v + h / 2 * b, forces)[0]
    d = slope(x + h * v + h**2 / 2 * b, v + h * c, forces)[0]
    return x + h * v + h**2 / 6 * (a + b + c), v + h / 6 * (a + 2 * b + 2 * c + d)


if __name__ == "__main__":
    main()
