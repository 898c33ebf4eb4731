"""Simulated encoders of the joints: rounded coordinates, and rates from their differences."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pteron.errors import DataError
from pteron.kernels import Array, as_array
from pteron.shapes import PerJoint


@dataclass(frozen=True)
class Sensors:
    """The encoders of the actuated joints.

    Parameters
    ----------
    encoder : float or array, shape (n,)
        Step of the encoders at the joints, m or rad: a coordinate is rounded to its multiples, and
        rates are differences of two of them, so that they lag half a sample. 0: coordinates and
        rates are exact.
    cutoff : float, optional
        Cut-off of a filter of first order on the rates, Hz; without effect on exact ones.
    """

    encoder: float | tuple[float, ...] = 0.0
    cutoff: float | None = None

    def __post_init__(self) -> None:
        steps = as_array(self.encoder, "encoder", ())
        if not (np.isfinite(steps).all() and (steps >= 0.0).all()):
            raise DataError(f"encoder: {self.encoder} given, steps of 0 or more expected")
        cutoff = 1.0 if self.cutoff is None else as_array(self.cutoff, "cutoff", ())
        if np.ndim(cutoff) or not (np.isfinite(cutoff) and cutoff > 0.0):
            raise DataError(f"cutoff: {self.cutoff} given, a frequency above 0 Hz expected")


class Encoders:
    """Encoders during a simulation: they compute rates from their last readings.

    The angle of a crank that may go all the way round jumps by a turn: of such ones, `round_ones`
    (n,), readings go on by the shorter way.
    """

    def __init__(
        self,
        sensors: Sensors,
        period: float,
        joints: PerJoint,
        rates: PerJoint,
        round_ones: Array | None = None,
    ) -> None:
        steps = np.asarray(sensors.encoder, dtype=float)
        if steps.shape not in ((), joints.shape):
            raise DataError(
                f"encoder: shape {steps.shape} given, one step or {len(joints)} expected, one for "
                "each joint"
            )
        self._steps = np.broadcast_to(steps, joints.shape)
        self._period = period
        self._share = 1.0
        if sensors.cutoff is not None:
            self._share = -float(np.expm1(-2.0 * np.pi * sensors.cutoff * period))
        self._round_ones = np.zeros(joints.shape) if round_ones is None else round_ones
        self._turns, self._joints = np.zeros(joints.shape), joints
        self._last = self._rounded(joints - period * rates)
        self._rates = np.array(rates)

    def read(self, joints: PerJoint, rates: PerJoint) -> tuple[Array, Array]:
        """Return coordinates and rates (n,) as the controller is told them, of the true ones."""
        if not self._steps.any():
            return joints, rates
        jumps = np.round((joints - self._joints) / (2.0 * np.pi))
        self._turns = self._turns - self._round_ones * jumps
        self._joints, gone = joints, 2.0 * np.pi * self._turns
        told = self._rounded(joints + gone)
        self._rates = self._rates + self._share * ((told - self._last) / self._period - self._rates)
        self._last = told
        return told - gone, np.where(self._steps > 0.0, self._rates, rates)

    def _rounded(self, joints: ArrayLike) -> Array:
        steps = np.where(self._steps > 0.0, self._steps, 1.0)
        rounded: Array = np.where(self._steps > 0.0, steps * np.round(joints / steps), joints)
        return rounded
