"""Free motion against MuJoCo's closed loops: how the two come together as step and softness shrink.

From random states each machine moves without drives and friction for 0.5 s, or until a leg's reach
margin is below 5 % of its longest reach; half of the states are weightless, as most machines fall
to the edge of their reach in a fifth of a second. One motion is by `pteron.forward_dynamics` and
SciPy's DOP853, the other by MuJoCo on the exported MJCF, whose loops are held by soft constraints.
MuJoCo shares with Pteron the bodies and where their loops close; the passive joints' motion and the
constraint forces are its own. Its constraints pull gaps back at a rate of a fifth of 1 / step.
Names of machines, if given, are those that move.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np
from measuring import Array, quick
from scipy.integrate import solve_ivp  # type: ignore[import-untyped]

import pteron
from pteron.export import Tree, coordinates, mjcf, tree
from pteron.kernels import numeric
from pteron.legs.kind import LegKind
from pteron.legs.ram import RamLeg

MACHINES = ("quadrupteron", "delta", "par4", "five-bar")
TILTING = (
    *("stewart", "rubin-camera-hexapod", "rubin-m2-hexapod", "hexaglide", "hexa"),
    *("reachy-mini", "sprint-z3", "ball-table", "wrist", "ankle"),
)
STEPS = (1e-3, 5e-4, 2.5e-4, 1.25e-4)
DURATION, SAMPLE = 0.5, 0.01
"""s; errors are taken at each sample."""

LEAST_MARGIN = 0.05
"""Least margin of the reach, as a share of the sum of a leg's links."""

SPEED = 0.15
"""Standard deviation of the initial velocities, m/s; of angles ten times that, rad/s, or so that
platform points further than 0.1 m from P are as fast, where a platform tilts."""

LONGER = 0.3
"""Share by which rams may be shorter and longer than in the file; a motion ends there."""

MOMENT = 1e-3
"""Between the poses, s, from which the rates at the beginning are taken."""

GOAL = 1e-4
"""m or rad."""


class Free(NamedTuple):
    """A free motion: poses (T, m) at the samples until it ended."""

    start: Array
    velocity: Array
    poses: Array


def main() -> None:
    """Print the largest errors of all states for each machine and step."""
    if find_spec("mujoco") is None:
        print("MuJoCo convergence: left out, the package mujoco is not installed")
        return
    import mujoco

    count, steps = (2, STEPS[1:3]) if quick() else (20, STEPS)
    print(f"MuJoCo {mujoco.__version__}, Runge-Kutta 4; free motion from {count} random states")
    print(f"{'':<21}{'whole':>7}{'mean s':>8}{'step':>10}{'platform m':>12}{'rad':>9}{'gap m':>9}")
    chosen = [name for name in sys.argv[1:] if not name.startswith("-")]
    for name in chosen or (*MACHINES, *(TILTING[-1:] if quick() else TILTING)):
        robot = freed(pteron.load(name))
        pair = tree(robot), tree(replace(robot, gravity=(0.0, 0.0, 0.0)))
        motions = [free_motion(pair[seed % 2].robot, seed) for seed in range(count)]
        lasted = np.array([(len(motion.poses) - 1) * SAMPLE for motion in motions])
        whole = f"{int((lasted > DURATION - SAMPLE / 2).sum())}/{count}"
        off = []
        for step in steps:
            all_errors = [errors(pair[k % 2], one, step) for k, one in enumerate(motions)]
            found = np.array(all_errors).max(axis=0)
            cells = "".join(f"{x:>{n}.0e}" for x, n in zip(found, (12, 9, 9), strict=True))
            print(f"{name:<21}{whole:>7}{lasted.mean():>8.2f}{step:>10g}{cells}", flush=True)
            off.append(float(found[:2].max()))
            name = whole = ""
        if not off[-1] < GOAL:
            sys.exit(f"the platform is {off[-1]:.0e} m or rad off, more than {GOAL:g}")
        if not off[-1] < off[0] / 2.0 ** (len(steps) - 1):
            sys.exit(f"the platform's error does not shrink with the step: {off}")


def freed(robot: pteron.Manipulator) -> pteron.Manipulator:
    """Return the machine without drives and limits, which MuJoCo would keep; rams become longer."""

    def limits(leg: LegKind) -> tuple[float, float] | None:
        if not isinstance(leg, RamLeg):
            return None
        shortest, longest = leg.limits
        return (1.0 - LONGER) * shortest, (1.0 + LONGER) * longest

    legs = tuple(replace(leg, drive=None, limits=limits(leg)) for leg in robot.legs)
    return replace(robot, legs=legs, platform=replace(robot.platform, limits=None))


def free_motion(robot: pteron.Manipulator, seed: int) -> Free:
    """Return what `forward_dynamics` makes of a random state."""
    m, rng = robot.freedom, np.random.default_rng(seed)
    reach = np.array([leg.size for leg in robot.legs])
    rest = np.zeros(m)
    low, high = np.array([leg.limits or (-np.inf, np.inf) for leg in robot.legs]).T

    def room(_time: float, state: Array) -> float:
        margin = numeric(robot, "reach")(state[:m])[0]
        joints = pteron.inverse_kinematics(robot, state[:m], on_failure="nan")
        kept = np.minimum(joints - low, high - joints) / reach
        return float(np.minimum(margin / reach - LEAST_MARGIN, kept).min())

    def rates(_time: float, state: Array) -> Array:
        acceleration = pteron.forward_dynamics(robot, state[:m], state[m:], rest)
        return np.concatenate([state[m:], acceleration])

    room.terminal = True  # type: ignore[attr-defined]
    while True:
        pose = pteron.random_poses(robot, 1, seed=rng, type_i=0.3, type_ii=0.1)[0]
        if room(0.0, pose) > LEAST_MARGIN:
            break
    velocity = SPEED * rng.normal(size=m)
    arms = np.linalg.norm([leg.platform_point for leg in robot.legs], axis=-1)
    arm = max(0.1, arms.mean()) if robot.platform.tilts else 0.1
    velocity[len(robot.platform.lengths) :] /= arm
    times = np.arange(0.0, DURATION + SAMPLE / 2, SAMPLE)
    found = solve_ivp(
        rates,
        (0.0, times[-1]),
        np.concatenate([pose, velocity]),
        "DOP853",
        times,
        events=room,
        rtol=1e-12,
        atol=1e-14,
    )
    return Free(pose, velocity, found.y[:m].T)


def errors(opened: Tree, motion: Free, step: float) -> tuple[float, float, float]:
    """Return how far MuJoCo's platform is off, m and rad, and the widest gap of a loop, m."""
    import mujoco

    model: Any = mujoco.MjModel.from_xml_string(mjcf(opened, step=step))
    data: Any = mujoco.MjData(model)
    instants = MOMENT * np.arange(-2.0, 3.0)[:, None]
    rows = coordinates(opened, motion.start + instants * motion.velocity)
    data.qpos[:] = rows[2]
    turns = np.remainder(rows - rows[2] + np.pi, 2.0 * np.pi) - np.pi
    data.qvel[:] = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) @ turns / (12.0 * MOMENT)
    lengths, names = len(opened.robot.platform.lengths), [j.name for j in opened.joints]
    places = [names.index(name) for name in opened.robot.coordinates]
    off, turned, gap = 0.0, 0.0, 0.0
    for pose in motion.poses:
        mujoco.mj_forward(model, data)
        away = data.qpos[places] - pose
        off = max(off, float(np.linalg.norm(away[:lengths])))
        turned = max([turned, *np.abs(away[lengths:])])
        for closing in opened.closings:
            end, seat = (data.site(f"{closing.name}_{side}").xpos for side in ("end", "seat"))
            gap = max(gap, float(np.linalg.norm(end - seat)))
        mujoco.mj_step(model, data, round(SAMPLE / step))
    return off, turned, gap


if __name__ == "__main__":
    main()
