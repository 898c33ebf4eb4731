"""Slotine and Li's adaptive control, in base parameters."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from pteron.controllers.controller import SHARE, Controller
from pteron.controllers.gain_numbers import PerJoint, per_joint
from pteron.controllers.joint_masses import joint_masses
from pteron.controllers.shown import Moves, shown, typical
from pteron.equations.control import ADAPTED
from pteron.equations.drives import drive_numbers
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.reduction import BaseParameters

_SHARE = 0.02
"""The usual rate of adaptation, of the bandwidth."""


@dataclass(frozen=True)
class Adaptive(Controller):
    """F = Y theta + K_d s, theta' = Gamma Y^T s: Slotine and Li's law; theta are base parameters.

    s = e' + bandwidth e, and Y theta is what the drives need for q'_r = q'_d + bandwidth e. Errors
    vanish though the masses are not known; the estimates need not become the true values, only what
    the motion asks of them. They stay within `uncertainty` of what they begin with.

    Parameters
    ----------
    period : float
        Time between two samples, for which forces are held, s.
    bandwidth : float or one for each joint, optional
        How quickly an error goes, rad/s; by default 0.1 / period.
    derivative : float or one for each joint, optional
        K_d, N s/m at a slider and N m s/rad at a crank; by default bandwidth times the joint's
        mass, see `joint_masses`.
    adaptation : float, optional
        How quickly the best seen combination of parameters is learnt in a motion of 1 m/s and
        10 m/s^2, rad/s; by default a fifth of the least bandwidth.
    uncertainty : float
        By which share the bodies' parameters may be off; 0.5 is a half.
    friction : bool
        Whether dry and viscous friction, offsets and motors' inertia are estimated too, or taken
        from the model.

    Raises
    ------
    DataError
        If a number is not above zero.

    Notes
    -----
    J.-J. E. Slotine, W. Li, "On the adaptive control of robot manipulators", The International
    Journal of Robotics Research 6 (1987) 49-59.

    Examples
    --------
    >>> import pteron
    >>> from pteron.controllers import Adaptive
    >>> law = Adaptive().law(pteron.load("five-bar"))
    >>> law.base.names
    """

    derivative: PerJoint | None = None
    adaptation: float | None = None
    uncertainty: float = 0.5
    friction: bool = False
    motion: Moves | None = field(default=None, compare=False, repr=False)

    positive: ClassVar[tuple[str, ...]] = ("bandwidth", "derivative", "adaptation", "uncertainty")

    @property
    def what(self) -> str:
        """The name of its law."""
        return "adaptive_drives" if self.friction else "adaptive"

    def base(self, model: Manipulator) -> BaseParameters:
        """Return the base parameters that it estimates of a machine."""
        return typical(model).base

    def gains(self, model: Manipulator) -> Array:
        """Return its gains (G,) for a machine; see `Controller.gains`."""
        bandwidth = SHARE / self.period if self.bandwidth is None else self.bandwidth
        # As Euler's method sees it, so that the error's poles are those of the bandwidth.
        slope = -np.expm1(-per_joint(model, "bandwidth", bandwidth) * self.period) / self.period
        derivative = slope * joint_masses(model)
        if self.derivative is not None:
            derivative = per_joint(model, "derivative", self.derivative)
        start = self.base(model).values(model)
        if self.friction:
            drives = drive_numbers(model)[: len(ADAPTED) * model.freedom]
            start = np.concatenate([start, drives])
        rate = _SHARE * slope.min() if self.adaptation is None else self.adaptation
        known = shown(model, self.motion)
        learning, size = known.learning(derivative, len(start), rate, float(slope.min()))
        room = [self.uncertainty * size]
        return np.concatenate([slope, derivative, [self.period], start, learning.ravel("F"), room])
