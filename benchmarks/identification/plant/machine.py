"""The machine: MuJoCo's closed mechanism, with friction, under a controller of its sliders.

Forces, positions, rates and accelerations of a sample belong to one instant: the controller and
friction act at every stage of Runge and Kutta's method, and nothing is held over a step.

How near that comes to rigid bodies with F_c sign(v) + F_v v + F_0, `check.py` in the folder above
measures. For the catalog's machines, 20 s at 1 kHz: loops stay closed to 1e-8 m; the force
error's root mean square is at most 4e-5 of the force's, nearly all of it in the milliseconds after
a slider turns round, while the loops' springs settle under the new load; fitted parameters are off
by at most 0.06 of the standard deviations that 1 % of noise gives. This is without samples slower
than 1 mm/s (0.4 %). Some of those stick, at whatever friction holds them, and a fit that takes
sign(v) for them is off by up to 11 standard deviations, or 50 if the controller knows 80 % of the
friction.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

import pteron
from plant.controller import Controller
from plant.friction import Friction, Guides
from plant.inverse import platform_state
from plant.model import Array, joint_damping, leg_axes, legs_of, mujoco_model
from plant.reference import Reference

__all__ = ["Recording", "simulate"]

_STEP = 2e-4
"""Step of the integration, s."""

_DIVISION = 20
"""Into how many a step is divided while a slider is about to turn round."""


@dataclass(frozen=True)
class Recording:
    """What the machine did, sampled at a constant rate.

    Attributes
    ----------
    time : array, shape (T,)
        s, from 0.
    joints, rates, accelerations : array, shape (T, n)
        m, m/s and m/s^2.
    forces : array, shape (T, n)
        What the actuators applied at these instants, N.
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
) -> Recording:
    """Let the machine follow a reference and record it; a repeated call returns the same recording.

    Forces are F = F_ff(t) + K_p (rho_ref - rho) + K_d (rho_ref' - rho'), at every stage of the
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
        The share of the sliders' friction that the controller knows.

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
    model = mujoco_model(robot, _STEP)
    data = mujoco.MjData(model)
    start = -round(settle * rate) / rate
    # Every other instant of the controller's table is a stage in the middle of a step.
    controller = Controller(
        robot, drawn or robot, reference, friction, compensation, start, duration, _STEP / 2.0
    )
    _place(robot, data, reference, start)
    plant = _Plant(robot, friction, controller, model, data)
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
    sliders, rates, accelerations, forces, poses, gaps = (
        np.array(column) for column in zip(*rows, strict=True)
    )
    time = np.arange(samples) / rate
    for column in (time, sliders, rates, accelerations, forces, poses):
        column.flags.writeable = False
    return Recording(time, sliders, rates, accelerations, forces, poses, float(gaps.max()))


class _Plant:
    """MuJoCo's state, how it is loaded and how it goes on."""

    def __init__(
        self,
        robot: pteron.Manipulator,
        friction: Friction,
        controller: Controller,
        model: Any,
        data: Any,
    ) -> None:
        import mujoco

        self.step, self.forward = mujoco.mj_step, mujoco.mj_forward
        self.model, self.data, self.controller = model, data, controller
        m = robot.freedom
        self.guides = Guides(friction, model, data, m)
        self.damping = friction.joints * joint_damping(robot) if friction.joints else None
        # Views: MuJoCo's arrays stay where they are.
        self.poses, self.joints, self.rates = data.qpos[:m], data.qpos[m::3], data.qvel[m::3]
        self.accelerations, self.applied = data.qacc[m::3], data.qfrc_applied[m::3]
        self.forces = np.zeros(m)
        self.sites = [[data.site(f"{a} {i}").id for i in range(m)] for a in ("leg", "platform")]

    def load(self, _model: Any, _data: Any) -> None:
        """Apply the actuators' forces and friction; MuJoCo calls it at every stage."""
        self.forces = self.controller.forces(self.data.time, self.joints, self.rates)
        if self.damping is not None:
            self.data.qfrc_applied[:] = -self.damping @ self.data.qvel
            self.applied += self.forces - self.guides.braking()
        else:
            self.applied[:] = self.forces - self.guides.braking()

    def advance(self, steps: int) -> None:
        """Go on by some steps, finely where a slider is about to turn round."""
        for _ in range(steps):
            parts = _DIVISION if self.guides.turning(_STEP) else 1
            self.model.opt.timestep = _STEP / parts
            for _ in range(parts):
                self.step(self.model, self.data)
                self.guides.turned()

    def sample(self) -> tuple[Array, Array, Array, Array, Array, float]:
        """Return sliders, rates, accelerations, forces, pose and the widest gap."""
        self.forward(self.model, self.data)
        leg, platform = (self.data.site_xpos[sites] for sites in self.sites)
        gap = float(np.linalg.norm(leg - platform, axis=-1).max())
        state = self.joints, self.rates, self.accelerations, self.forces, self.poses
        sliders, rates, accelerations, forces, poses = (column.copy() for column in state)
        return sliders, rates, accelerations, forces, poses, gap


def _place(robot: pteron.Manipulator, data: Any, reference: Reference, start: float) -> None:
    """Put the mechanism on the reference, with its rates."""
    state = platform_state(robot, *reference(np.array([start])))
    pose, velocity = state.pose[0], state.velocity[0]
    rates = pteron.joint_rates(robot, pose, velocity)
    position, motion = [*pose], [*velocity]
    sliders = pteron.inverse_kinematics(robot, pose)
    links = pteron.link_vectors(robot, pose)
    for i, leg in enumerate(legs_of(robot)):
        axes = leg_axes(leg)
        upper, lower = (np.arctan2(*(axes.T @ link[i])[1::-1]) for link in links)
        turns = rates.upper_links[i], rates.lower_links[i]
        position += [sliders[i], upper, lower - upper]
        motion += [rates.actuated[i], turns[0], turns[1] - turns[0]]
    data.qpos[:], data.qvel[:], data.time = position, motion, start
