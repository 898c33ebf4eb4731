"""The machine: MuJoCo's closed mechanism, with friction, under a controller of its actuated joints.

Forces, positions, rates and accelerations of a sample belong to one instant: the controller and
friction act at every stage of Runge and Kutta's method, and nothing is held over a step.

How near that comes to rigid bodies with F_c sign(v) + F_v v + F_0, `check.py` in the folder above
measures. For the catalog's machines, 20 s at 1 kHz: loops stay closed to 1e-8 m; the force
error's root mean square is at most 4e-5 of the force's, nearly all of it in the milliseconds after
a joint turns round, while the loops' springs settle under the new load; fitted parameters are off
by at most 0.06 of the standard deviations that 1 % of noise gives. This is without samples slower
than 1 mm/s (0.4 %). Some of those stick, at whatever friction holds them, and a fit that takes
sign(v) for them is off by up to 11 standard deviations, or 50 if the controller knows 80 % of the
friction.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol

import numpy as np

import pteron
from plant.controller import BANDWIDTH, Controller, FeedForward
from plant.friction import Friction, Guides
from plant.inverse import platform_state
from plant.model import (
    Array,
    actuated_coordinates,
    joint_damping,
    loop_rows,
    mujoco_model,
    opened,
)
from plant.reference import Reference
from pteron.export import Tree, coordinates

__all__ = ["Plant", "Recording", "simulate"]

_STEP = 2e-4
"""Step of the integration, s."""

_MOMENT = 1e-5
"""Between the places, s, from which the rates at the beginning are taken."""

_DIVISION = 20
"""Into how many a step is divided while a joint is about to turn round."""


@dataclass(frozen=True)
class Recording:
    """The machine's motion and forces, sampled at a constant rate.

    Attributes
    ----------
    time : array, shape (T,)
        s, from 0.
    joints, rates, accelerations : array, shape (T, n)
        m and s; rad at a crank.
    forces : array, shape (T, n)
        What the actuators applied at these instants, N; N m at a crank.
    poses : array, shape (T, m)
        Where the platform was, m and rad.
    gap : float
        The most by which a loop was ever open, m.
    """

    time: Array
    joints: Array
    rates: Array
    accelerations: Array
    forces: Array
    poses: Array
    gap: float


class Plant(Protocol):
    """A simulation of the machine: `simulate` here in MuJoCo, `plant.own.Own` in Pteron."""

    def __call__(
        self,
        robot: pteron.Manipulator,
        reference: Reference,
        friction: Friction,
        *,
        duration: float,
        drawn: pteron.Manipulator | None,
        compensation: float,
        bandwidth: float = BANDWIDTH,
        feed_forward: FeedForward | None = None,
    ) -> Recording:
        """Let the machine follow a reference and record it; arguments are those of `simulate`."""


@lru_cache(maxsize=16)
def simulate(
    robot: pteron.Manipulator,
    reference: Reference,
    friction: Friction,
    *,
    duration: float = 20.0,
    rate: float = 1000.0,
    settle: float = 1.0,
    drawn: pteron.Manipulator | None = None,
    compensation: float = 1.0,
    bandwidth: float = BANDWIDTH,
    feed_forward: FeedForward | None = None,
) -> Recording:
    """Let the machine follow a reference and record it; a repeated call returns the same recording.

    Forces are F = F_ff(t) + K_p (q_ref - q) + K_d (q_ref' - q'), at every stage of the
    integration; F_ff is what `drawn` needs for the reference, with the known share of friction.

    Parameters
    ----------
    robot : Manipulator
        The machine as built.
    reference : callable
        What it is to follow, such as `fourier_reference` returns.
    friction : Friction
        What brakes it.
    duration : float
        Of the recording, s.
    rate : float
        Samples a second; a sample must fall on a step of 0.2 ms.
    settle : float
        How long it moves before the recording begins, s; it starts at the reference's motion.
    drawn : Manipulator, optional
        What the controller takes the machine for; by default, what it is.
    compensation : float
        The share of the actuated joints' friction that the controller knows.
    bandwidth : float
        Of the feedback, rad/s: K_p = m w^2 and K_d = 2 m w, with the masses m (kg m^2 at a crank)
        that `drawn` has at its joints.
    feed_forward : callable, optional
        What gives F_ff instead, of the reference's joint coordinates, rates and accelerations.

    Returns
    -------
    Recording

    Raises
    ------
    ValueError
        If samples would not fall on steps.
    """
    import mujoco

    every = round(1.0 / (rate * _STEP))
    if abs(every * rate * _STEP - 1.0) > 1e-9:
        raise ValueError(f"rate: {rate:g} Hz given, but 5000 Hz over a whole number expected")
    machine = opened(robot)
    model = mujoco_model(machine, _STEP)
    data = mujoco.MjData(model)
    start = -round(settle * rate) / rate
    # Every other instant of the controller's table is a stage in the middle of a step.
    controller = Controller(
        robot,
        drawn or robot,
        reference,
        friction,
        compensation,
        start,
        duration,
        _STEP / 2.0,
        bandwidth,
        feed_forward,
    )
    _place(machine, data, reference, start)
    plant = _Plant(machine, friction, controller, model, data)
    before, samples = round(settle * rate), round(duration * rate)
    rows = []
    previous = mujoco.get_mjcb_control()
    mujoco.set_mjcb_control(plant.load)
    try:
        for _ in range(before):
            plant.advance(every)
        for _ in range(samples):
            rows.append(plant.sample())
            plant.advance(every)
    finally:
        mujoco.set_mjcb_control(previous)
    joints, rates, accelerations, forces, poses, gaps = (
        np.array(column) for column in zip(*rows, strict=True)
    )
    time = np.arange(samples) / rate
    for column in (time, joints, rates, accelerations, forces, poses):
        column.flags.writeable = False
    return Recording(time, joints, rates, accelerations, forces, poses, float(gaps.max()))


class _Plant:
    """MuJoCo's state, how it is loaded and how it goes on."""

    def __init__(
        self,
        machine: Tree,
        friction: Friction,
        controller: Controller,
        model: Any,
        data: Any,
    ) -> None:
        import mujoco

        self.step, self.forward = mujoco.mj_step, mujoco.mj_forward
        self.model, self.data, self.controller = model, data, controller
        m, self.at = machine.robot.freedom, actuated_coordinates(machine)
        self.guides = Guides(friction, model, data, self.at, loop_rows(machine))
        self.damping = friction.joints * joint_damping(machine) if friction.joints else None
        names = [joint.name for joint in machine.joints]
        self.places = [names.index(name) for name in machine.robot.coordinates]
        self.forces = np.zeros(m)
        self.sites = [
            [data.site(f"leg{i}_{side}").id for i in range(1, m + 1)] for side in ("end", "seat")
        ]

    def load(self, _model: Any, _data: Any) -> None:
        """Apply the actuators' forces and friction; MuJoCo calls it at every stage."""
        self.forces = self.controller.forces(self.data.time, self.guides.joints, self.guides.rates)
        if self.damping is not None:
            self.data.qfrc_applied[:] = -self.damping @ self.data.qvel
            self.data.qfrc_applied[self.at] += self.forces - self.guides.braking()
        else:
            self.data.qfrc_applied[self.at] = self.forces - self.guides.braking()

    def advance(self, steps: int) -> None:
        """Go on by some steps, finely where a joint is about to turn round."""
        for _ in range(steps):
            parts = _DIVISION if self.guides.turning(_STEP) else 1
            self.model.opt.timestep = _STEP / parts
            for _ in range(parts):
                self.step(self.model, self.data)
                self.guides.turned()

    def sample(self) -> tuple[Array, Array, Array, Array, Array, float]:
        """Return joints, rates, accelerations, forces, pose and the widest gap."""
        self.forward(self.model, self.data)
        leg, platform = (self.data.site_xpos[sites] for sites in self.sites)
        gap = float(np.linalg.norm(leg - platform, axis=-1).max())
        guides = self.guides
        poses = self.data.qpos[self.places]
        state = guides.joints, guides.rates, guides.accelerations, self.forces, poses
        joints, rates, accelerations, forces, poses = (column.copy() for column in state)
        return joints, rates, accelerations, forces, poses, gap


def _place(machine: Tree, data: Any, reference: Reference, start: float) -> None:
    """Put the mechanism on the reference, with its rates."""
    moments = start + _MOMENT * np.array([-1.0, 0.0, 1.0])
    poses = platform_state(machine.robot, *reference(moments)).pose
    before, now, after = coordinates(machine, poses)
    data.qpos[:], data.time = now, start
    data.qvel[:] = (np.remainder(after - before + np.pi, 2.0 * np.pi) - np.pi) / (2.0 * _MOMENT)
