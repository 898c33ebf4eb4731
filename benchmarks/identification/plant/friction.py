"""Friction of the actuated joints, with sticking, and of the passive ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plant.model import Array

__all__ = ["Friction", "Guides"]

_ALMOST = 0.9
"""The share of what friction holds from which a joint that sticks is watched closely."""


@dataclass(frozen=True)
class Friction:
    """Friction in the actuated joints, F_c sign(v) + F_v v + F_0 against the motion, and in others.

    Dry friction falls as the joint moves faster, F_c + F_s exp(-(v / speed)^2). At rest a joint
    sticks, as long as F_c + F_s can hold it.

    Attributes
    ----------
    coulomb, viscous, offset : tuple of float
        F_c (N), F_v (N s/m) and F_0 (N) of each slider; N m, N m s and N m of a crank.
    joints : float
        Viscous coefficient of every passive joint, N m s/rad.
    stribeck, speeds : tuple of float
        F_s (N) of each slider and the speed with which it falls (m/s); N m and rad/s of a crank.
    """

    coulomb: tuple[float, ...]
    viscous: tuple[float, ...]
    offset: tuple[float, ...]
    joints: float = 0.0
    stribeck: tuple[float, ...] = (0.0,)
    speeds: tuple[float, ...] = (1.0,)

    def dry(self, rates: Array) -> Array:
        """Return dry friction (..., n) at rates (..., n), without its sign."""
        falls = np.exp(-((rates / np.array(self.speeds)) ** 2))
        return np.asarray(np.array(self.coulomb) + np.array(self.stribeck) * falls)


class Guides:
    """The friction of the actuated joints in a simulation, and which of them stick.

    One that turns round is held where it is by a constraint until more than F_c is needed; it
    then slips towards where it is pulled. Between two calls of `turned` nothing changes, so that
    the integrator meets no jump inside a step.
    """

    def __init__(
        self, friction: Friction, model: Any, data: Any, at: NDArray[np.int64], rows: int
    ) -> None:
        """Take the joints' coordinates, and how many rows of constraints go before theirs."""
        self.dry = friction.dry
        self.viscous, self.offset = np.array(friction.viscous), np.array(friction.offset)
        n = len(at)
        self.hold = self.dry(np.zeros(n))
        self.data, self.at = data, at
        self.rows = rows
        # Views: MuJoCo's arrays stay where they are.
        self.held = data.eq_active[-n:]
        self.places = model.eq_data[-n:, 0]  # from where the model opens
        self.homes = model.qpos0[at]
        self.sense = np.where(self.rates < 0.0, -1.0, 1.0)
        self.holding = np.zeros(n)

    @property
    def joints(self) -> Array:
        """Coordinates of the joints (n,)."""
        return np.asarray(self.data.qpos[self.at])

    @property
    def rates(self) -> Array:
        """Their rates (n,)."""
        return np.asarray(self.data.qvel[self.at])

    @property
    def accelerations(self) -> Array:
        """Their accelerations (n,)."""
        return np.asarray(self.data.qacc[self.at])

    def braking(self) -> Array:
        """Return what friction takes from the actuators' forces, but for what holds a joint."""
        rates = self.rates
        force: Array = self.dry(rates) * self.sense + self.viscous * rates + self.offset
        return force

    def turning(self, length: float) -> bool:
        """Return whether a joint may turn round, or come loose, within a step of this length."""
        near = np.abs(self.rates) < 2.0 * length * np.abs(self.accelerations)
        loose = np.abs(self.holding) > _ALMOST * self.hold
        return bool(np.where(self.held, loose, near).any())

    def turned(self) -> None:
        """Hold what has turned round, and let go what pulls too hard; to be called after a step."""
        held = self.held.astype(bool)
        self.holding[:] = 0.0
        if held.any():
            # The rows of the constraints that were active in the step follow the loops'.
            self.holding[held] = self.data.efc_force[self.rows :]
        loose = held & (np.abs(self.holding) > self.hold)
        # One that was let go may still creep backwards for an instant.
        back = (self.sense * self.rates <= 0.0) & (self.sense * self.accelerations <= 0.0)
        stopped = ~held & back & (self.hold > 0.0)
        if loose.any():
            self.sense[loose] = -np.sign(self.holding[loose])
            self.held[loose] = 0
        if stopped.any():
            self.sense[stopped] = 0.0
            self.places[stopped] = (self.joints - self.homes)[stopped]
            self.held[stopped] = 1
