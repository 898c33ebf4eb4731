"""The same machine in Pteron's own simulation, whose friction sticks and whose controller samples.

Of MuJoCo's plant it has the controller's law, and nothing of what moves: bodies, closed loops and
sticking are those of `pteron.motion.simulate`. The law is evaluated at samples and held between.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import pteron
from plant.controller import BANDWIDTH, Controller, FeedForward
from plant.friction import Friction
from plant.inverse import platform_state
from plant.machine import Recording
from plant.model import Array
from plant.reference import Reference
from pteron.legs import Drive, Stribeck
from pteron.motion import Sensors, simulate

__all__ = ["Own"]


@dataclass(frozen=True)
class Own:
    """Pteron's simulation as a plant; called as `plant.simulate` is.

    Attributes
    ----------
    rate : float
        Samples of the controller in a second; a whole number of times the recording's.
    encoder : float
        Step of the encoders that the controller sees, m or rad: rates are then differences. 0 for
        exact ones.
    delay : float
        From a sample to the drives' force for it, s.
    """

    rate: float = 10_000.0
    encoder: float = 0.0
    delay: float = 0.0

    def __call__(
        self,
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
        """Return the recording; arguments are those of `plant.simulate`."""
        machine = driven(robot, friction)
        start, period = -round(settle * rate) / rate, 1.0 / self.rate
        law = Controller(
            robot,
            drawn or robot,
            reference,
            friction,
            compensation,
            start,
            duration,
            period,
            bandwidth,
            feed_forward,
        )
        at = platform_state(robot, *reference(np.array([start])))
        found = simulate(
            machine,
            None,
            _Sampled(law, start, period),
            start=(at.pose[0], at.velocity[0]),
            duration=duration - start + period,
            sensors=Sensors(self.encoder),
            delay=self.delay,
        )
        if found.stopped is not None:
            raise ValueError(f"the machine {found.stopped}")
        every = round(self.rate / rate)
        before, samples = round(settle * rate), round(duration * rate)
        kept = slice(before * every, (before + samples) * every, every)
        state = found.pose[kept], found.velocity[kept]
        seconds = pteron.kinematics.joint_accelerations(robot, *state, found.acceleration[kept])
        joints, rates = found.joints[kept], found.joint_rates[kept]
        time = np.arange(len(joints)) / rate
        return Recording(
            time, joints, rates, seconds.actuated, found.forces[kept], state[0], gap=0.0
        )


def driven(robot: pteron.Manipulator, friction: Friction) -> pteron.Manipulator:
    """Return the machine with that friction in its drives' tables."""
    if friction.joints:
        raise ValueError(f"joints: {friction.joints:g} given, but drives alone have friction here")
    n = robot.joint_count
    more, speeds = (np.resize(part, n).tolist() for part in (friction.stribeck, friction.speeds))
    drives = [
        Drive(coulomb, viscous, offset, stribeck=Stribeck(force, speed) if force else None)
        for coulomb, viscous, offset, force, speed in zip(
            friction.coulomb, friction.viscous, friction.offset, more, speeds, strict=True
        )
    ]
    legs = zip(robot.legs, drives, strict=True)
    return replace(robot, legs=tuple(replace(leg, drive=drive) for leg, drive in legs))


@dataclass(frozen=True)
class _Sampled:
    """The controller as `pteron.motion.simulate` takes one: its memory counts samples."""

    controller: Controller
    start: float
    period: float

    def law(self, model: pteron.Manipulator) -> _Sampled:
        """Return itself: it was made for a machine."""
        return self

    def memory(self, pose: Array, velocity: Array) -> Array:
        """Return that no sample was."""
        return np.zeros(1)

    def __call__(
        self,
        pose: Array,
        velocity: Array,
        acceleration: Array,
        joints: Array,
        joint_rates: Array,
        memory: Array,
    ) -> tuple[Array, Array]:
        """Return the forces at this sample."""
        now = self.start + self.period * float(memory[0])
        return self.controller.forces(now, joints, joint_rates), memory + 1.0
