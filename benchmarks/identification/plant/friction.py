"""Friction of the actuated joints, with sticking, and of the passive ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from plant.model import Array

__all__ = ["Friction", "Guides"]

_ALMOST = 0.9
"""The share of Coulomb's friction from which a joint that sticks is watched closely."""


@dataclass(frozen=True)
class Friction:
    """Friction in the actuated joints, F_c sign(v) + F_v v + F_0 against the motion, and in others.

    At rest a joint sticks, as long as F_c can hold it.

    Attributes
    ----------
    coulomb, viscous, offset : tuple of float
        F_c (N), F_v (N s/m) and F_0 (N) of each slider; N m, N m s and N m of a crank.
    joints : float
        Viscous coefficient of every passive joint, N m s/rad.
    """

    coulomb: tuple[float, ...]
    viscous: tuple[float, ...]
    offset: tuple[float, ...]
    joints: float = 0.0


class Guides:
    """The friction of the actuated joints in a simulation, and which of them stick.

    One that turns round is held where it is by a constraint until more than F_c is needed; it
    then slips towards where it is pulled. Between two calls of `turned` nothing changes, so that
    the integrator meets no jump inside a step.
    """

    def __init__(self, friction: Friction, model: Any, data: Any, first: int, rows: int) -> None:
        """Take the coordinate of the first joint, and how many rows of constraints go before."""
        self.coulomb, self.viscous, self.offset = (
            np.array(f) for f in (friction.coulomb, friction.viscous, friction.offset)
        )
        n = len(self.coulomb)
        # Views: MuJoCo's arrays stay where they are.
        self.data = data
        self.joints, self.rates, self.accelerations = (
            vector[first::3] for vector in (data.qpos, data.qvel, data.qacc)
        )
        self.rows = rows
        self.held = data.eq_active[-n:]
        self.places = model.eq_data[-n:, 0]  # from where the model opens
        self.homes = model.qpos0[first::3]
        self.sense = np.where(self.rates < 0.0, -1.0, 1.0)
        self.holding = np.zeros(n)

    def braking(self) -> Array:
        """Return what friction takes from the actuators' forces, but for what holds a joint."""
        force: Array = self.coulomb * self.sense + self.viscous * self.rates + self.offset
        return force

    def turning(self, length: float) -> bool:
        """Return whether a joint may turn round, or come loose, within a step of this length."""
        near = np.abs(self.rates) < 2.0 * length * np.abs(self.accelerations)
        loose = np.abs(self.holding) > _ALMOST * self.coulomb
        return bool(np.where(self.held, loose, near).any())

    def turned(self) -> None:
        """Hold what has turned round, and let go what pulls too hard; to be called after a step."""
        held = self.held.astype(bool)
        self.holding[:] = 0.0
        if held.any():
            # The rows of the constraints that were active in the step follow the loops'.
            self.holding[held] = self.data.efc_force[self.rows :]
        loose = held & (np.abs(self.holding) > self.coulomb)
        # One that was let go may still creep backwards for an instant.
        back = (self.sense * self.rates <= 0.0) & (self.sense * self.accelerations <= 0.0)
        stopped = ~held & back & (self.coulomb > 0.0)
        if loose.any():
            self.sense[loose] = -np.sign(self.holding[loose])
            self.held[loose] = 0
        if stopped.any():
            self.sense[stopped] = 0.0
            self.places[stopped] = (self.joints - self.homes)[stopped]
            self.held[stopped] = 1
