"""Simulation: how much faster than real time, alone, in a batch, and beside MuJoCo.

The machines have drives with viscous friction, dry friction that sticks, and rotors; one alone
slides on at 0.05 m/s and rad/s. Steps are Runge and Kutta's of fourth order, 0.1 ms long. MuJoCo
simulates the exported MJCF, the same bodies with all legs closed by equality constraints, with the
same method and step; it is called from C once for all steps of a round, as Pteron's steps are, and
the two take turns. The controlled simulation is `simulate` with computed torque at 1 kHz and
encoders of 1 um or 1 urad: by its own loop, with the same law as a callback from Python at each
sample, and by `simulate_many` for 10 000 machines that differ in masses, friction and payload, in
ns a step of one of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec
from time import perf_counter
from typing import Any

import numpy as np
from measuring import Array, Contestant, contest, quick

import pteron
from pteron.controllers import ComputedTorque
from pteron.motion import (
    Sensors,
    advance,
    machines_about,
    pick_and_place,
    simulate,
    simulate_many,
)
from pteron.workspace import home_pose

STEP = 1e-4
"""s."""

DRIVE = pteron.legs.Drive(coulomb=3.0, viscous=10.0, rotor_inertia=0.1, rest_speed=0.01)
BATCH = 10_000
GOALS = {"quadrupteron": (80.0, 20.0, 200.0)}
"""Times real time, alone and controlled, times MuJoCo's speed, and ns a step of many controlled
machines, that are asked for."""


def main() -> None:
    """Print a row a machine."""
    names = (
        *("alone", "ns a step", "in a batch", "ns a step", "MuJoCo", "ratio"),
        *("controlled", "called back", "ns, many"),
    )
    print(f"{'times real time':<14}{''.join(f'{name:>12}' for name in names)}")
    for name in ("quadrupteron", "delta", "par4", "five-bar"):
        robot = pteron.load(name)
        robot = replace(robot, legs=tuple(replace(leg, drive=DRIVE) for leg in robot.legs))
        times = _times(robot)
        alone, together = (float(np.median(times[key])) for key in ("alone", "batch"))
        peer, ratio, slower = "-", "-", np.inf
        if "mujoco" in times:
            slower = float(np.median(times["mujoco"] / times["alone"]))
            peer, ratio = f"{STEP / float(np.median(times['mujoco'])):.2f}", f"{slower:.0f}"
        controlled = _controlled(robot)
        cells = [
            *(f"{STEP / alone:.0f}", f"{1e9 * alone:.0f}"),
            *(f"{STEP / together:.0f}", f"{1e9 * together:.0f}", peer, ratio),
            *(f"{speed:.1f}" for speed in controlled),
        ]
        print(f"{name:<14}{''.join(f'{cell:>12}' for cell in cells)}")
        fast, faster, most = GOALS.get(name, (0.0, 0.0, np.inf))
        missed = min(STEP / alone, controlled[0]) < fast or slower < faster or controlled[2] > most
        if not quick() and missed:
            raise SystemExit(
                f"{name}: {fast:g} times real time, {faster:g} times MuJoCo, {most:g} ns expected"
            )


def _times(robot: pteron.Manipulator) -> dict[str, Array]:
    """Return the seconds a step in every round: alone, in a batch, and MuJoCo's."""
    home, rest = home_pose(robot), np.zeros(robot.freedom)
    speed = rest + 0.05
    holding = pteron.drive_forces(robot, home, speed, rest)
    count, many, batch = (100, 1, 100) if quick() else (2000, 20, BATCH)
    poses = home + 1e-3 * np.random.default_rng(0).normal(size=(batch, robot.freedom))
    speeds = 0.05 * np.random.default_rng(1).normal(size=poses.shape)
    holdings = np.tile(holding, (batch, 1))
    found = [
        _contestant("alone", lambda: advance(robot, home, speed, holding, STEP, count), count),
        _contestant(
            "batch", lambda: advance(robot, poses, speeds, holdings, STEP, many), many * batch
        ),
    ]
    if find_spec("mujoco") is not None:
        found.append(_contestant("mujoco", _mujoco(robot, holding, count // 20), count // 20))
    return contest(found, 3 if quick() else 15)


def _contestant(name: str, run: Callable[[], Any], count: int) -> Contestant:
    def seconds() -> float:
        begin = perf_counter()
        run()
        return (perf_counter() - begin) / count

    return Contestant(name, seconds, 0.0)


def _mujoco(robot: pteron.Manipulator, holding: Any, count: int) -> Callable[[], Any]:
    """Return what makes steps of MuJoCo's closed-loop model from its keyframe."""
    import mujoco

    from pteron.export import mjcf, tree

    model = mujoco.MjModel.from_xml_string(mjcf(tree(robot)))
    model.opt.timestep = STEP
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    data = mujoco.MjData(model)

    def run() -> None:
        mujoco.mj_resetDataKeyframe(model, data, 0)
        data.ctrl[:] = holding
        mujoco.mj_step(model, data, count)

    return run


class _CalledBack:
    """Computed torque as a controller of one's own: Python calls it at each sample."""

    period = 1e-3

    def law(self, model: pteron.Manipulator) -> Any:
        law = ComputedTorque(period=self.period).law(model)

        class Wrapped:
            memory = staticmethod(law.memory)
            __call__ = staticmethod(law)

        return Wrapped()


def _controlled(robot: pteron.Manipulator) -> tuple[float, float, float]:
    """Return how many times faster than real time a controlled cycle is, and one called back.

    The last is the time of a step of many controlled machines, ns.
    """
    motion = pick_and_place(robot, home_pose(robot), least=0.1)
    found = []
    for controller in (ComputedTorque(period=1e-3), _CalledBack()):
        best = 0.0
        for _ in range(1 if quick() else 9):
            begin = perf_counter()
            run = simulate(robot, motion, controller, sensors=Sensors(1e-6))
            assert run.stopped is None
            best = max(best, motion.duration / (perf_counter() - begin))
        found.append(best)
    count = 16 if quick() else BATCH
    many = machines_about(robot, count, masses=0.1, friction=0.3, payload=(0.0, 0.5))
    spans = []
    for _ in range(2 if quick() else 4):
        begin = perf_counter()
        every = simulate_many(many, motion, ComputedTorque(), sensors=Sensors(1e-6), duration=0.05)
        assert not (every.stopped != "").any()
        spans.append(perf_counter() - begin)
    return found[0], found[1], 1e9 * min(spans) / (count * 0.05 / STEP)


if __name__ == "__main__":
    main()
