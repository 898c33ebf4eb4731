"""Every excitation keeps its limits from rest to rest, at ten times as many samples as its file.

So does the cycle to be held out. For each machine of the catalog, with drives that have friction,
rotors and hardly more force than it takes to hold the machine; by the public functions, not by
what the search itself looks at. Printed are the worst margins, each a share of its limit (of half
its range for a joint), and which limit it is. `--quick` takes one machine.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from measuring import catalog, quick

import pteron
from pteron.identification.excitation import LedMotion, Limits, RepeatedCycle, optimal_excitation
from pteron.workspace import home_pose, pose_margins

_RATE = 1000.0
"""Samples a second in the file."""

_FINER = 10


def main() -> None:
    """Print the worst margins of each machine."""
    heading = f"{'lead':>6}{'lasts':>7}  {'periodic':<26}{'rest to rest':<26}{'held out':<26}"
    print(f"{'':<22}{heading}")
    for name in ["tripteron"] if quick() else catalog():
        robot = driven(pteron.load(name))
        found = optimal_excitation(
            robot, starts=2, draws=20, seconds=1.0 if quick() else 8.0, workers=1
        )
        led, cycle = found.with_leads(), replace(found.held_out(_RATE), count=1)
        worst = [
            worst_margin(led, found.limits, led.start, led.end),
            worst_margin(led, found.limits, 0.0, led.duration),
            worst_margin(cycle, found.limits, 0.0, cycle.duration),
        ]
        told = "".join(f"{share:<9.2g}{limit:<17}" for share, limit in worst)
        print(f"{name:<22}{led.start:>4g} s{led.duration:>5g} s  {told}", flush=True)
        assert min(share for share, _ in worst) >= 0.0, name
        # The movements' own margins have those of passive joints too.
        assert all(one.margins(found.limits, _RATE).kept for one in (led, cycle)), name


def driven(robot: pteron.Manipulator) -> pteron.Manipulator:
    """Return a machine whose drives have friction, rotors, and a third more force than at rest."""
    home, still = home_pose(robot), np.zeros(robot.freedom)
    held = np.abs(pteron.inverse_dynamics(robot, home, still, still))
    largest = max(float(held.max()), 1.0)  # in a level plane nothing is held
    legs = [
        replace(
            leg,
            drive=pteron.legs.Drive(
                coulomb=0.03 * largest,
                viscous=0.05 * largest,
                rotor_inertia=1e-5,
                ratio=50.0,
                max_force=float(held[k]) + largest / 3.0,
                max_speed=1.5,
            ),
        )
        for k, leg in enumerate(robot.legs)
    ]
    return replace(robot, legs=tuple(legs))


def worst_margin(
    motion: LedMotion | RepeatedCycle, limits: Limits, begin: float, end: float
) -> tuple[float, str]:
    """Return the least margin within some time, and of what, at ten times the file's samples."""
    robot = motion.robot
    times = np.linspace(begin, end, math.ceil((end - begin) * _RATE * _FINER))
    pose, velocity, acceleration, *_ = motion.states(times)
    room, path = pose_margins(robot, pose), (pose, velocity, acceleration)
    moving = {
        "speed": pteron.kinematics.joint_rates(robot, pose, velocity).actuated,
        "acceleration": pteron.kinematics.joint_accelerations(robot, *path).actuated,
        "force": pteron.drive_forces(robot, *path),
    }
    found = {
        name: 1.0 - float((np.abs(values) / getattr(limits, name)).max())
        for name, values in moving.items()
    }
    for name in ("type_i", "type_ii"):
        found[name] = float(getattr(room, name).min()) - getattr(limits, name)
    joints = pteron.inverse_kinematics(robot, pose)
    for leg, values in zip(robot.legs, joints.T, strict=True):
        if leg.limits is not None:
            low, high = leg.limits
            inside = min(float(values.min()) - low, high - float(values.max()))
            share = (inside - limits.joint_clearance) / (0.5 * (high - low))
            found["joint_clearance"] = min(found.get("joint_clearance", np.inf), share)
    limit = min(found, key=lambda name: found[name])
    return found[limit], limit


if __name__ == "__main__":
    main()
